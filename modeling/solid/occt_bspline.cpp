#include "modeling/solid/occt_bspline.h"

#include <algorithm>
#include <vector>

#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColStd_Array2OfReal.hxx>
#include <TColgp_Array1OfPnt.hxx>
#include <TColgp_Array2OfPnt.hxx>

#include "base/contract.h"
#include "base/vector.h"
#include "kernel/refine/periodic.h"

namespace angiospline {
namespace {

gp_Pnt point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }
Vec3 vector(const gp_Pnt& p) { return {p.X(), p.Y(), p.Z()}; }

// One direction as OpenCASCADE holds it: the distinct knots, and of a periodic one those of the
// period and the distinct poles. Its flat knots, and so the numbers of its poles, are those of
// periodic_knots: degree + 1 - multiplicity knots before the first copy of the start.
struct Axis {
  TColStd_Array1OfReal values;
  TColStd_Array1OfInteger multiplicities;
  int poles;
  bool periodic;
};

Axis axis(const KnotVector& knots, bool closed) {
  std::vector<Knot> distinct = distinct_knots(knots);
  if (closed) {
    std::erase_if(distinct,
                  [&](const Knot& k) { return k.value < knots.first() || k.value > knots.last(); });
    // Floating knots show all copies of the seam at one end at least.
    distinct.front().multiplicity = distinct.back().multiplicity =
        std::max(distinct.front().multiplicity, distinct.back().multiplicity);
  }
  const int count = static_cast<int>(distinct.size());
  Axis result{TColStd_Array1OfReal(1, count), TColStd_Array1OfInteger(1, count),
              closed ? *periodic_count(knots) : knots.control_point_count(), closed};
  for (int i = 1; i <= count; ++i) {
    result.values.SetValue(i, distinct[static_cast<std::size_t>(i) - 1].value);
    result.multiplicities.SetValue(i, distinct[static_cast<std::size_t>(i) - 1].multiplicity);
  }
  return result;
}

// OpenCASCADE looks for the knots before the start within one period and reads beyond its arrays
// where that has fewer than degree + 1 poles: the knots to add, at even cuts of every span. None
// for most.
std::vector<double> missing_knots(const KnotVector& knots) {
  std::vector<double> missing;
  const Axis along = axis(knots, true);
  const int lacking = knots.degree() + 1 - along.poles;
  if (lacking <= 0) return missing;
  const int spans = along.values.Length() - 1;
  const int cuts = (lacking + spans - 1) / spans;
  for (int i = 1; i <= spans; ++i) {
    const double from = along.values.Value(i);
    const double step = (along.values.Value(i + 1) - from) / (cuts + 1);
    for (int k = 1; k <= cuts; ++k) missing.push_back(from + k * step);
  }
  return missing;
}

template <int D>
BSplineCurve<D> with_enough_knots(const BSplineCurve<D>& curve) {
  if (!is_periodic(curve)) return curve;
  const std::vector<double> missing = missing_knots(curve.knots());
  return missing.empty() ? curve : *insert_knots_periodic(curve, missing);
}

template <int D>
BSplineSurface<D> with_enough_knots(BSplineSurface<D> surface) {
  if (is_periodic_u(surface)) {
    const std::vector<double> missing = missing_knots(surface.u());
    if (!missing.empty()) surface = *insert_knots_periodic_u(surface, missing);
  }
  if (is_periodic_v(surface)) {
    const std::vector<double> missing = missing_knots(surface.v());
    if (!missing.empty()) surface = *insert_knots_periodic_v(surface, missing);
  }
  return surface;
}

// And back; nothing where OpenCASCADE's knots break an invariant of ours.
std::optional<KnotVector> knot_vector(int degree, const TColStd_Array1OfReal& values,
                                      const TColStd_Array1OfInteger& multiplicities,
                                      bool periodic) {
  std::vector<Knot> distinct;
  for (int i = values.Lower(); i <= values.Upper(); ++i) {
    distinct.push_back({values.Value(i), multiplicities.Value(i)});
  }
  Result<KnotVector> made = [&] {
    if (!periodic) return from_distinct(degree, distinct);
    distinct.pop_back();
    return periodic_knots(degree, distinct, values.Last());
  }();
  if (!made) return std::nullopt;
  return *std::move(made);
}

std::optional<KnotVector> knots_of(const Geom_BSplineCurve& curve) {
  return knot_vector(curve.Degree(), curve.Knots(), curve.Multiplicities(), curve.IsPeriodic());
}
std::optional<KnotVector> u_knots_of(const Geom_BSplineSurface& surface) {
  return knot_vector(surface.UDegree(), surface.UKnots(), surface.UMultiplicities(),
                     surface.IsUPeriodic());
}
std::optional<KnotVector> v_knots_of(const Geom_BSplineSurface& surface) {
  return knot_vector(surface.VDegree(), surface.VKnots(), surface.VMultiplicities(),
                     surface.IsVPeriodic());
}

// The curve whose pole number i (from 1) is pole(i).
template <int D, typename Pole>
BSplineCurve<D> curve_of(const Geom_BSplineCurve& curve, const KnotVector& knots,
                         const Pole& pole) {
  Eigen::Matrix<double, D, Eigen::Dynamic> poles(D, curve.NbPoles());
  for (int i = 1; i <= curve.NbPoles(); ++i) poles.col(i - 1) = pole(i);
  return curve.IsPeriodic() ? periodic_curve<D>(knots, poles)
                            : BSplineCurve<D>(knots, std::move(poles));
}

template <int D, typename Pole>
BSplineSurface<D> surface_of(const Geom_BSplineSurface& surface, const KnotVector& u,
                             const KnotVector& v, const Pole& pole) {
  const int m = surface.IsUPeriodic() ? u.control_point_count() : surface.NbUPoles();
  const int n = surface.IsVPeriodic() ? v.control_point_count() : surface.NbVPoles();
  Eigen::Matrix<double, D, Eigen::Dynamic> net(D, static_cast<Eigen::Index>(m) * n);
  Eigen::Index column = 0;
  for (int i = 0; i < m; ++i) {
    for (int j = 0; j < n; ++j) {
      net.col(column++) = pole(i % surface.NbUPoles() + 1, j % surface.NbVPoles() + 1);
    }
  }
  return BSplineSurface<D>(u, v, std::move(net));
}

Eigen::Vector4d homogeneous_point(const gp_Pnt& p, double weight) {
  return {weight * p.X(), weight * p.Y(), weight * p.Z(), weight};
}

}  // namespace

Handle(Geom_BSplineCurve) to_occt(const BSplineCurve<3>& given) {
  const BSplineCurve<3> curve = with_enough_knots(given);
  const Axis along = axis(curve.knots(), is_periodic(curve));
  TColgp_Array1OfPnt poles(1, along.poles);
  for (int i = 0; i < along.poles; ++i) poles.SetValue(i + 1, point(curve.control_points().col(i)));
  return new Geom_BSplineCurve(poles, along.values, along.multiplicities, curve.knots().degree(),
                               along.periodic);
}

Handle(Geom_BSplineSurface) to_occt(const BSplineSurface<3>& given) {
  const BSplineSurface<3> surface = with_enough_knots(given);
  const Axis u = axis(surface.u(), is_periodic_u(surface));
  const Axis v = axis(surface.v(), is_periodic_v(surface));
  TColgp_Array2OfPnt poles(1, u.poles, 1, v.poles);
  for (int i = 0; i < u.poles; ++i) {
    for (int j = 0; j < v.poles; ++j) {
      poles.SetValue(i + 1, j + 1, point(surface.control_point(i, j)));
    }
  }
  return new Geom_BSplineSurface(poles, u.values, v.values, u.multiplicities, v.multiplicities,
                                 surface.u().degree(), surface.v().degree(), u.periodic,
                                 v.periodic);
}

Handle(Geom_BSplineCurve) rational_to_occt(const BSplineCurve<4>& given) {
  const BSplineCurve<4> curve = with_enough_knots(given);
  const Axis along = axis(curve.knots(), is_periodic(curve));
  TColgp_Array1OfPnt poles(1, along.poles);
  TColStd_Array1OfReal weights(1, along.poles);
  for (int i = 0; i < along.poles; ++i) {
    const Eigen::Vector4d h = curve.control_points().col(i);
    EXPECTS(h.w() > 0);
    poles.SetValue(i + 1, point(h.head<3>() / h.w()));
    weights.SetValue(i + 1, h.w());
  }
  return new Geom_BSplineCurve(poles, weights, along.values, along.multiplicities,
                               curve.knots().degree(), along.periodic);
}

Handle(Geom_BSplineSurface) rational_to_occt(const BSplineSurface<4>& given) {
  const BSplineSurface<4> surface = with_enough_knots(given);
  const Axis u = axis(surface.u(), is_periodic_u(surface));
  const Axis v = axis(surface.v(), is_periodic_v(surface));
  TColgp_Array2OfPnt poles(1, u.poles, 1, v.poles);
  TColStd_Array2OfReal weights(1, u.poles, 1, v.poles);
  for (int i = 0; i < u.poles; ++i) {
    for (int j = 0; j < v.poles; ++j) {
      const Eigen::Vector4d h = surface.control_point(i, j);
      EXPECTS(h.w() > 0);
      poles.SetValue(i + 1, j + 1, point(h.head<3>() / h.w()));
      weights.SetValue(i + 1, j + 1, h.w());
    }
  }
  return new Geom_BSplineSurface(poles, weights, u.values, v.values, u.multiplicities,
                                 v.multiplicities, surface.u().degree(), surface.v().degree(),
                                 u.periodic, v.periodic);
}

std::optional<BSplineCurve<3>> from_occt(const Geom_BSplineCurve& curve) {
  const std::optional<KnotVector> knots = knots_of(curve);
  if (!knots || curve.IsRational()) return std::nullopt;
  return curve_of<3>(curve, *knots, [&](int i) { return vector(curve.Pole(i)); });
}

std::optional<BSplineSurface<3>> from_occt(const Geom_BSplineSurface& surface) {
  const std::optional<KnotVector> u = u_knots_of(surface);
  const std::optional<KnotVector> v = v_knots_of(surface);
  if (!u || !v || surface.IsURational() || surface.IsVRational()) return std::nullopt;
  return surface_of<3>(surface, *u, *v, [&](int i, int j) { return vector(surface.Pole(i, j)); });
}

BSplineCurve<4> homogeneous_from_occt(const Geom_BSplineCurve& curve) {
  const std::optional<KnotVector> knots = knots_of(curve);
  EXPECTS(knots.has_value());
  return curve_of<4>(curve, *knots,
                     [&](int i) { return homogeneous_point(curve.Pole(i), curve.Weight(i)); });
}

BSplineSurface<4> homogeneous_from_occt(const Geom_BSplineSurface& surface) {
  const std::optional<KnotVector> u = u_knots_of(surface);
  const std::optional<KnotVector> v = v_knots_of(surface);
  EXPECTS(u.has_value() && v.has_value());
  return surface_of<4>(surface, *u, *v, [&](int i, int j) {
    return homogeneous_point(surface.Pole(i, j), surface.Weight(i, j));
  });
}

}  // namespace angiospline
