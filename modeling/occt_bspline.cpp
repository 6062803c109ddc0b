#include "modeling/occt_bspline.h"

#include <algorithm>

#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_Array2OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TColgp_Array2OfPnt.hxx>

#include "base/contract.h"
#include "base/vector.h"
#include "kernel/periodic.h"

namespace angiospline {
namespace {

struct DistinctKnots {
  TColStd_Array1OfReal values;
  TColStd_Array1OfInteger multiplicities;
};

DistinctKnots distinct(const KnotVector& knots) {
  EXPECTS(knots.knots().front() == knots.first() && knots.knots().back() == knots.last());
  const std::vector<double> breaks = knots.breakpoints();
  const int count = static_cast<int>(breaks.size());
  DistinctKnots result{TColStd_Array1OfReal(1, count), TColStd_Array1OfInteger(1, count)};
  std::size_t at = 0;
  for (int i = 1; i <= count; ++i) {
    const double value = breaks[static_cast<std::size_t>(i) - 1];
    int multiplicity = 0;
    while (at < knots.knots().size() && knots.knots()[at] == value) ++at, ++multiplicity;
    result.values.SetValue(i, value);
    result.multiplicities.SetValue(i, multiplicity);
  }
  return result;
}

std::optional<KnotVector> knot_vector(int degree, const TColStd_Array1OfReal& flat) {
  Result<KnotVector> made = KnotVector::make(degree, std::vector<double>(flat.begin(), flat.end()));
  if (!made) return std::nullopt;
  return *std::move(made);
}

gp_Pnt point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

}  // namespace

Handle(Geom_BSplineCurve) to_occt(const BSplineCurve<3>& curve) {
  TColgp_Array1OfPnt poles(1, static_cast<int>(curve.control_points().cols()));
  for (int i = 1; i <= poles.Length(); ++i) {
    poles.SetValue(i, point(curve.control_points().col(i - 1)));
  }
  const DistinctKnots knots = distinct(curve.knots());
  return new Geom_BSplineCurve(poles, knots.values, knots.multiplicities, curve.knots().degree());
}

Handle(Geom_BSplineSurface) to_occt(const BSplineSurface<3>& surface) {
  TColgp_Array2OfPnt poles(1, surface.u_count(), 1, surface.v_count());
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = 0; j < surface.v_count(); ++j) {
      poles.SetValue(i + 1, j + 1, point(surface.control_point(i, j)));
    }
  }
  const DistinctKnots u = distinct(surface.u());
  const DistinctKnots v = distinct(surface.v());
  return new Geom_BSplineSurface(poles, u.values, v.values, u.multiplicities, v.multiplicities,
                                 surface.u().degree(), surface.v().degree());
}

std::optional<BSplineCurve<3>> from_occt(const Geom_BSplineCurve& curve) {
  if (curve.IsRational() || curve.IsPeriodic()) return std::nullopt;
  std::optional<KnotVector> knots = knot_vector(curve.Degree(), curve.KnotSequence());
  if (!knots) return std::nullopt;
  Points3 points(3, curve.NbPoles());
  for (int i = 1; i <= curve.NbPoles(); ++i) {
    const gp_Pnt p = curve.Pole(i);
    points.col(i - 1) << p.X(), p.Y(), p.Z();
  }
  return BSplineCurve<3>(*std::move(knots), std::move(points));
}

std::optional<BSplineSurface<3>> from_occt(const Geom_BSplineSurface& surface) {
  if (surface.IsURational() || surface.IsVRational() || surface.IsUPeriodic() ||
      surface.IsVPeriodic()) {
    return std::nullopt;
  }
  std::optional<KnotVector> u = knot_vector(surface.UDegree(), surface.UKnotSequence());
  std::optional<KnotVector> v = knot_vector(surface.VDegree(), surface.VKnotSequence());
  if (!u || !v) return std::nullopt;
  Points3 points(3, static_cast<Eigen::Index>(surface.NbUPoles()) * surface.NbVPoles());
  Eigen::Index column = 0;
  for (int i = 1; i <= surface.NbUPoles(); ++i) {
    for (int j = 1; j <= surface.NbVPoles(); ++j) {
      const gp_Pnt p = surface.Pole(i, j);
      points.col(column++) << p.X(), p.Y(), p.Z();
    }
  }
  return BSplineSurface<3>(*std::move(u), *std::move(v), std::move(points));
}

BSplineCurve<4> homogeneous_from_occt(const Geom_BSplineCurve& original) {
  const Handle(Geom_BSplineCurve) curve = Handle(Geom_BSplineCurve)::DownCast(original.Copy());
  curve->SetNotPeriodic();
  const std::optional<KnotVector> knots = knot_vector(curve->Degree(), curve->KnotSequence());
  EXPECTS(knots.has_value());
  Eigen::Matrix4Xd points(4, curve->NbPoles());
  for (int i = 1; i <= curve->NbPoles(); ++i) {
    const gp_Pnt p = curve->Pole(i);
    const double w = curve->Weight(i);
    points.col(i - 1) << w * p.X(), w * p.Y(), w * p.Z(), w;
  }
  return BSplineCurve<4>(*knots, std::move(points));
}

BSplineSurface<4> homogeneous_from_occt(const Geom_BSplineSurface& original) {
  const Handle(Geom_BSplineSurface) surface =
      Handle(Geom_BSplineSurface)::DownCast(original.Copy());
  surface->SetUNotPeriodic();
  surface->SetVNotPeriodic();
  const std::optional<KnotVector> u = knot_vector(surface->UDegree(), surface->UKnotSequence());
  const std::optional<KnotVector> v = knot_vector(surface->VDegree(), surface->VKnotSequence());
  EXPECTS(u.has_value() && v.has_value());
  Eigen::Matrix4Xd points(4, static_cast<Eigen::Index>(surface->NbUPoles()) * surface->NbVPoles());
  Eigen::Index column = 0;
  for (int i = 1; i <= surface->NbUPoles(); ++i) {
    for (int j = 1; j <= surface->NbVPoles(); ++j) {
      const gp_Pnt p = surface->Pole(i, j);
      const double w = surface->Weight(i, j);
      points.col(column++) << w * p.X(), w * p.Y(), w * p.Z(), w;
    }
  }
  return BSplineSurface<4>(*u, *v, std::move(points));
}

Handle(Geom_BSplineCurve) rational_to_occt(const BSplineCurve<4>& curve) {
  const int count = static_cast<int>(curve.control_points().cols());
  TColgp_Array1OfPnt poles(1, count);
  TColStd_Array1OfReal weights(1, count);
  for (int i = 1; i <= count; ++i) {
    const Eigen::Vector4d h = curve.control_points().col(i - 1);
    EXPECTS(h.w() > 0);
    poles.SetValue(i, point(h.head<3>() / h.w()));
    weights.SetValue(i, h.w());
  }
  const DistinctKnots knots = distinct(curve.knots());
  return new Geom_BSplineCurve(poles, weights, knots.values, knots.multiplicities,
                               curve.knots().degree());
}

Handle(Geom_BSplineSurface) rational_to_occt(const BSplineSurface<4>& surface) {
  TColgp_Array2OfPnt poles(1, surface.u_count(), 1, surface.v_count());
  TColStd_Array2OfReal weights(1, surface.u_count(), 1, surface.v_count());
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = 0; j < surface.v_count(); ++j) {
      const Eigen::Vector4d h = surface.control_point(i, j);
      EXPECTS(h.w() > 0);
      poles.SetValue(i + 1, j + 1, point(h.head<3>() / h.w()));
      weights.SetValue(i + 1, j + 1, h.w());
    }
  }
  const DistinctKnots u = distinct(surface.u());
  const DistinctKnots v = distinct(surface.v());
  return new Geom_BSplineSurface(poles, weights, u.values, v.values, u.multiplicities,
                                 v.multiplicities, surface.u().degree(), surface.v().degree());
}

// OpenCASCADE counts poles from the knot span that starts the period: its pole 1 is the function
// whose support ends that span when the first knot has multiplicity 1, and each further copy moves
// it on.
Handle(Geom_BSplineCurve) periodic_to_occt(const BSplineCurve<3>& curve) {
  EXPECTS(is_periodic(curve));
  const int count = *periodic_count(curve.knots());
  std::vector<Knot> period;
  for (const Knot& knot : distinct_knots(curve.knots())) {
    if (knot.value >= curve.knots().first() && knot.value <= curve.knots().last()) {
      period.push_back(knot);
    }
  }
  period.front().multiplicity = period.back().multiplicity =
      std::max(period.front().multiplicity, period.back().multiplicity);
  TColStd_Array1OfReal values(1, static_cast<int>(period.size()));
  TColStd_Array1OfInteger multiplicities(1, static_cast<int>(period.size()));
  for (int i = 1; i <= values.Length(); ++i) {
    values.SetValue(i, period[static_cast<std::size_t>(i) - 1].value);
    multiplicities.SetValue(i, period[static_cast<std::size_t>(i) - 1].multiplicity);
  }
  TColgp_Array1OfPnt poles(1, count);
  for (int i = 0; i < count; ++i) poles.SetValue(i + 1, point(curve.control_points().col(i)));
  return new Geom_BSplineCurve(poles, values, multiplicities, curve.knots().degree(), true);
}

}  // namespace angiospline
