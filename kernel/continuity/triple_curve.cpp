#include "kernel/continuity/triple_curve.h"

#include <algorithm>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/continuity/product.h"
#include "kernel/refine/reshape.h"
#include "kernel/spline/binomial.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {
namespace {

double triple(const Vec3& f, const Vec3& g, const Vec3& h) { return f.dot(g.cross(h)); }

bool is_bezier(const KnotVector& knots) {
  return knots.control_point_count() == knots.order() && knots.knots().front() == knots.first() &&
         knots.knots().back() == knots.last();
}

// One surface seen from one of its sides: where its two control rows along the side are, and the
// factor by which their difference is the cross derivative (in the growing parameter).
struct Rim {
  const BSplineSurface<3>& surface;
  SurfaceSide side;

  bool along_v() const { return side == SurfaceSide::kU0 || side == SurfaceSide::kU1; }
  bool at_first() const { return side == SurfaceSide::kU0 || side == SurfaceSide::kV0; }
  const KnotVector& across() const { return along_v() ? surface.u() : surface.v(); }

  // Control point j of the boundary row (depth 0) or of the row behind it (depth 1).
  Eigen::Index point(int j, int depth) const {
    const int row = at_first() ? depth : across().control_point_count() - 1 - depth;
    return along_v() ? surface.index(row, j) : surface.index(j, row);
  }
  // cross derivative = factor * (behind - boundary)
  double factor() const {
    const KnotVector& U = across();
    const int p = U.degree();
    const int n = U.control_point_count();
    return at_first() ? p / (U[p + 1] - U[1]) : -p / (U[n + p - 1] - U[n - 1]);
  }
};

struct RimPoint {
  BasisValues basis;
  Vec3 tangent = Vec3::Zero();
  Vec3 cross = Vec3::Zero();
};

RimPoint evaluate_rim(const Rim& rim, const KnotVector& along, double t) {
  RimPoint at{basis_at(along, t, 1)};
  const double factor = rim.factor();
  for (int k = 0; k < along.order(); ++k) {
    const int j = at.basis.first + k;
    const Vec3 boundary = rim.surface.control_points().col(rim.point(j, 0));
    const Vec3 behind = rim.surface.control_points().col(rim.point(j, 1));
    at.tangent += at.basis.values(1, k) * boundary;
    at.cross += at.basis.values(0, k) * factor * (behind - boundary);
  }
  return at;
}

void require_clamped(const Rim& rim) {
  const KnotVector& U = rim.across();
  EXPECTS(U.degree() >= 1);
  EXPECTS(rim.at_first() ? U.knots().front() == U.first() : U.knots().back() == U.last());
}

KnotVector derivative_knots(const KnotVector& knots) {
  return derivative(BSplineCurve<1>(knots, Eigen::RowVectorXd::Zero(knots.control_point_count())))
      .knots();
}

}  // namespace

KnotVector triple_knots(const KnotVector& f, const KnotVector& g, const KnotVector& h) {
  return product_knots(f, product_knots(g, h));
}

double triple_value(const BSplineCurve<3>& f, const BSplineCurve<3>& g, const BSplineCurve<3>& h,
                    double t) {
  return triple(f.at(t), g.at(t), h.at(t));
}

BSplineCurve<1> triple_product(const BSplineCurve<3>& f, const BSplineCurve<3>& g,
                               const BSplineCurve<3>& h) {
  return dot_product(f, cross_product(g, h));
}

BSplineCurve<1> triple_derose(const BSplineCurve<3>& f, const BSplineCurve<3>& g,
                              const BSplineCurve<3>& h) {
  EXPECTS(is_bezier(f.knots()) && is_bezier(g.knots()) && is_bezier(h.knots()));
  EXPECTS(f.knots().first() == g.knots().first() && f.knots().first() == h.knots().first());
  EXPECTS(f.knots().last() == g.knots().last() && f.knots().last() == h.knots().last());

  const int nf = f.knots().degree();
  const int ng = g.knots().degree();
  const int nh = h.knots().degree();
  const int degree = nf + ng + nh;

  Eigen::Matrix<double, 1, Eigen::Dynamic> Q = Eigen::RowVectorXd::Zero(degree + 1);
  for (int j = 0; j <= nf; ++j) {
    for (int k = 0; k <= ng; ++k) {
      for (int l = 0; l <= nh; ++l) {
        const double weight = binomial(nf, j) * binomial(ng, k) * binomial(nh, l);
        Q(j + k + l) +=
            weight / binomial(degree, j + k + l) *
            triple(f.control_points().col(j), g.control_points().col(k), h.control_points().col(l));
      }
    }
  }

  return BSplineCurve<1>(KnotVector::bezier(degree, f.knots().first(), f.knots().last()),
                         std::move(Q));
}

TripleCurve::TripleCurve(const BSplineSurface<3>& a, SurfaceSide side_a, const BSplineSurface<3>& b,
                         SurfaceSide side_b, SideDirection direction)
    : side_a_(side_a),
      side_b_(side_b),
      direction_(direction),
      along_a_(side_knots(a, side_a)),
      along_b_(side_knots(b, side_b)),
      knots_(along_a_) {
  require_clamped({a, side_a});
  require_clamped({b, side_b});
  KnotVector g = direction == SideDirection::kReversed ? reversed(along_b_) : along_b_;
  g = with_domain(g, along_a_.first(), along_a_.last());
  // The map of one domain onto the other rounds: what should be the same knot is made so.
  constexpr double kRounding = 1e-13;
  g = snapped(g, along_a_, kRounding * (along_a_.last() - along_a_.first()));
  knots_ = triple_knots(along_a_, g, derivative_knots(along_a_));
  nodes_ = knots_.greville();
}

double TripleCurve::parameter_on_b(double t) const {
  const double length_a = along_a_.last() - along_a_.first();
  const double length_b = along_b_.last() - along_b_.first();
  const double s = (t - along_a_.first()) / length_a * length_b;
  return direction_ == SideDirection::kReversed ? along_b_.last() - s : along_b_.first() + s;
}

TripleValues TripleCurve::evaluate(const BSplineSurface<3>& a, const BSplineSurface<3>& b) const {
  EXPECTS(side_knots(a, side_a_) == along_a_ && side_knots(b, side_b_) == along_b_);
  const Rim rim_a{a, side_a_};
  const Rim rim_b{b, side_b_};
  const double factor_a = rim_a.factor();
  const double factor_b = rim_b.factor();
  TripleValues result;
  result.values.resize(static_cast<Eigen::Index>(nodes_.size()));

  for (int node = 0; node < static_cast<int>(nodes_.size()); ++node) {
    const double t = nodes_[static_cast<std::size_t>(node)];
    const RimPoint at_a = evaluate_rim(rim_a, along_a_, t);
    const RimPoint at_b = evaluate_rim(rim_b, along_b_, parameter_on_b(t));

    const Vec3 by_f = at_b.cross.cross(at_a.tangent);  // d Phi / d F'
    const Vec3 by_g = at_a.tangent.cross(at_a.cross);
    const Vec3 by_h = at_a.cross.cross(at_b.cross);
    result.values(node) = at_a.cross.dot(by_f);

    // H' goes by the boundary row alone, F' and G' by their row behind it as well.
    for (int k = 0; k < along_a_.order(); ++k) {
      const double N = factor_a * at_a.basis.values(0, k);
      const int j = at_a.basis.first + k;
      result.gradient.push_back(
          {node, 0, rim_a.point(j, 0), at_a.basis.values(1, k) * by_h - N * by_f});
      result.gradient.push_back({node, 0, rim_a.point(j, 1), N * by_f});
    }
    for (int k = 0; k < along_b_.order(); ++k) {
      const double N = factor_b * at_b.basis.values(0, k);
      const int j = at_b.basis.first + k;
      result.gradient.push_back({node, 1, rim_b.point(j, 0), -N * by_g});
      result.gradient.push_back({node, 1, rim_b.point(j, 1), N * by_g});
    }
  }
  return result;
}

}  // namespace angiospline
