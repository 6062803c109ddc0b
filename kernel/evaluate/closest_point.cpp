#include "kernel/evaluate/closest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernel/evaluate/bernstein_box.h"
#include "kernel/evaluate/rational.h"

namespace angiospline {
namespace {

constexpr int kMaxIterations = 60;
constexpr int kMostBoxes = 100000;
constexpr double kClose = 1e-12;  // of the largest squared distance: what is not worth halving for

struct Candidate {
  double bound;
  int u_span;
  int v_span;
};

void sort_by_bound(std::vector<Candidate>& candidates) {
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.bound < b.bound; });
}

// Spans of positive length.
std::vector<int> spans_of(const KnotVector& knots) {
  std::vector<int> spans;
  for (int k = knots.degree(); k < knots.control_point_count(); ++k) {
    if (knots[k] < knots[k + 1]) spans.push_back(k);
  }
  return spans;
}

// The Newton step for the squared distance in a box: gradient g, Hessian H, falling back to the
// Gauss-Newton matrix G where H is not positive definite. A coordinate at its bound whose gradient
// points outwards stays there.
Eigen::Vector2d box_step(const Eigen::Vector2d& g, const Eigen::Matrix2d& H,
                         const Eigen::Matrix2d& G, bool hold_u, bool hold_v) {
  const auto solve = [&](const Eigen::Matrix2d& M) -> Eigen::Vector2d {
    if (hold_u && hold_v) return Eigen::Vector2d::Zero();
    if (hold_u) return {0, M(1, 1) > 0 ? -g(1) / M(1, 1) : 0};
    if (hold_v) return {M(0, 0) > 0 ? -g(0) / M(0, 0) : 0, 0};
    const double determinant = M(0, 0) * M(1, 1) - M(0, 1) * M(1, 0);
    if (!(determinant > 1e-14 * M(0, 0) * M(1, 1)) || !(M(0, 0) > 0)) {
      return {M(0, 0) > 0 ? -g(0) / M(0, 0) : 0, M(1, 1) > 0 ? -g(1) / M(1, 1) : 0};
    }
    return {(-g(0) * M(1, 1) + g(1) * M(0, 1)) / determinant,
            (-g(1) * M(0, 0) + g(0) * M(1, 0)) / determinant};
  };
  const bool definite = H(0, 0) > 0 && H(0, 0) * H(1, 1) > H(0, 1) * H(1, 0);
  const Eigen::Vector2d step = solve(definite ? H : G);
  return step.dot(g) < 0 ? step : solve(G);
}

// Point, first and second derivative of a curve, polynomial or rational, as columns.
template <int D>
Eigen::Matrix<double, D, 3> jet(const BSplineCurve<D>& curve, double t) {
  Eigen::Matrix<double, D, 3> columns;
  const BasisValues b = basis_at(curve.knots(), t, 2);
  columns =
      curve.control_points().middleCols(b.first, curve.knots().order()) * b.values.transpose();
  return columns;
}
template <int D>
Eigen::Matrix<double, D, 3> jet(const BSplineCurve<D + 1>& curve, double t) {
  return rational_derivatives<D>(curve, t, 2);
}

// S, Su, Sv, Suu, Suv, Svv of a surface.
template <int D>
Eigen::Matrix<double, D, 6> jet(const BSplineSurface<D>& surface, double u, double v) {
  const BasisValues bu = basis_at(surface.u(), u, 2);
  const BasisValues bv = basis_at(surface.v(), v, 2);
  Eigen::Matrix<double, D, 6> columns = Eigen::Matrix<double, D, 6>::Zero();
  for (int i = 0; i < surface.u().order(); ++i) {
    const Eigen::Matrix<double, D, 3> row =
        surface.control_points().middleCols(surface.index(bu.first + i, bv.first),
                                            surface.v().order()) *
        bv.values.transpose();
    columns.col(0) += bu.values(0, i) * row.col(0);
    columns.col(1) += bu.values(1, i) * row.col(0);
    columns.col(2) += bu.values(0, i) * row.col(1);
    columns.col(3) += bu.values(2, i) * row.col(0);
    columns.col(4) += bu.values(1, i) * row.col(1);
    columns.col(5) += bu.values(0, i) * row.col(2);
  }
  return columns;
}
template <int D>
Eigen::Matrix<double, D, 6> jet(const BSplineSurface<D + 1>& surface, double u, double v) {
  return rational_derivatives<D>(surface, u, v, 2);
}

// The point alone.
template <int D, int H>
Eigen::Matrix<double, D, 1> projected_point(const Eigen::Matrix<double, H, 1>& p) {
  if constexpr (H > D) {
    return p.template head<D>() / p(D);
  } else {
    return p;
  }
}

// Newton on a curve, each step halved until it comes nearer.
template <int D, int H>
CurvePoint<D> descend(const BSplineCurve<H>& curve, const Eigen::Matrix<double, D, 1>& target,
                      double start) {
  using Point = Eigen::Matrix<double, D, 1>;
  const double low = curve.knots().first();
  const double high = curve.knots().last();
  double t = std::clamp(start, low, high);
  Point point = projected_point<D, H>(curve.at(t));
  double squared = (point - target).squaredNorm();

  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // Newton on half the squared distance: g its derivative, h its second; where that is not
    // positive, the Gauss-Newton part takes its place.
    const Eigen::Matrix<double, D, 3> c = jet<D>(curve, t);
    const Point offset = point - target;
    const double g = c.col(1).dot(offset);
    const double h = c.col(1).squaredNorm() + c.col(2).dot(offset);
    const double scale = h > 0 ? h : c.col(1).squaredNorm();
    if (!(scale > 0)) break;
    double step = std::clamp(t - g / scale, low, high) - t;

    // The step is halved until it comes nearer.
    bool moved = false;
    for (int halving = 0; halving < 30 && step != 0; ++halving, step *= 0.5) {
      const Point next = projected_point<D, H>(curve.at(t + step));
      const double value = (next - target).squaredNorm();
      if (value < squared) {
        t += step;
        point = next;
        squared = value;
        moved = true;
        break;
      }
    }
    if (!moved) break;
  }
  return {t, point, std::sqrt(squared)};
}

// The same on a surface.
template <int D, int H>
SurfacePoint<D> descend(const BSplineSurface<H>& surface, const Eigen::Matrix<double, D, 1>& target,
                        double start_u, double start_v) {
  using Point = Eigen::Matrix<double, D, 1>;
  const Eigen::Vector2d low(surface.u().first(), surface.v().first());
  const Eigen::Vector2d high(surface.u().last(), surface.v().last());
  Eigen::Vector2d uv = Eigen::Vector2d(start_u, start_v).cwiseMax(low).cwiseMin(high);
  Point point = projected_point<D, H>(surface.at(uv(0), uv(1)));
  double squared = (point - target).squaredNorm();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    // Gradient and Hessian of half the squared distance; G is its Gauss-Newton part, without the
    // second derivatives.
    const Eigen::Matrix<double, D, 6> s = jet<D>(surface, uv(0), uv(1));
    const Point offset = point - target;
    const Eigen::Vector2d g(s.col(1).dot(offset), s.col(2).dot(offset));
    Eigen::Matrix2d G;
    G << s.col(1).squaredNorm(), s.col(1).dot(s.col(2)), s.col(1).dot(s.col(2)),
        s.col(2).squaredNorm();
    Eigen::Matrix2d H2 = G;
    H2(0, 0) += s.col(3).dot(offset);
    H2(1, 1) += s.col(5).dot(offset);
    H2(0, 1) += s.col(4).dot(offset);
    H2(1, 0) = H2(0, 1);

    // A parameter on the border that would leave the box does not move.
    const auto held = [&](int k) {
      return (uv(k) <= low(k) && g(k) > 0) || (uv(k) >= high(k) && g(k) < 0);
    };
    Eigen::Vector2d step = box_step(g, H2, G, held(0), held(1));

    // The step is halved until it comes nearer.
    bool moved = false;
    for (int halving = 0; halving < 30; ++halving, step *= 0.5) {
      const Eigen::Vector2d next_uv = (uv + step).cwiseMax(low).cwiseMin(high);
      if (next_uv == uv) break;
      const Point next = projected_point<D, H>(surface.at(next_uv(0), next_uv(1)));
      const double value = (next - target).squaredNorm();
      if (value < squared) {
        uv = next_uv;
        point = next;
        squared = value;
        moved = true;
        break;
      }
    }
    if (!moved) break;
  }
  return {uv(0), uv(1), point, std::sqrt(squared)};
}

// What the search needs of a curve and of a surface.
template <int D, int H>
struct CurveSearch {
  const BSplineCurve<H>& shape;
  const Eigen::Matrix<double, D, 1>& target;
  using Best = CurvePoint<D>;

  Best from(double u, double) const { return descend<D, H>(shape, target, u); }
  double squared(double u, double) const {
    return (projected_point<D, H>(shape.at(u)) - target).squaredNorm();
  }
  static bool holds(const BernsteinBox& box, const Best& best) { return box.holds(best.t, 0); }
  BernsteinBox box(const Candidate& span) const {
    return bernstein_box<D, H>(shape, span.u_span, target);
  }
};

template <int D, int H>
struct SurfaceSearch {
  const BSplineSurface<H>& shape;
  const Eigen::Matrix<double, D, 1>& target;
  using Best = SurfacePoint<D>;

  Best from(double u, double v) const { return descend<D, H>(shape, target, u, v); }
  double squared(double u, double v) const {
    return (projected_point<D, H>(shape.at(u, v)) - target).squaredNorm();
  }
  static bool holds(const BernsteinBox& box, const Best& best) { return box.holds(best.u, best.v); }
  BernsteinBox box(const Candidate& span) const {
    return bernstein_box<D, H>(shape, span.u_span, span.v_span, target);
  }
};

// Candidates sorted by their bounds; `best` is a first guess at infinite distance.
template <typename Search>
typename Search::Best search(const Search& in, const std::vector<Candidate>& candidates,
                             typename Search::Best best) {
  double proven = std::numeric_limits<double>::infinity();  // squared: the least bound left
  int boxes = 0;
  for (const Candidate& candidate : candidates) {
    if (candidate.bound >= best.distance * best.distance) break;
    std::vector<BernsteinBox> stack{in.box(candidate)};
    const BernsteinBox& whole = stack.back();
    const double farthest =
        whole.W.size() == 0 ? whole.F.maxCoeff() : whole.F.cwiseQuotient(whole.W).maxCoeff();

    // Depth first: the half with the lower parameters is looked at before the other.
    while (!stack.empty()) {
      const BernsteinBox box = std::move(stack.back());
      stack.pop_back();
      const double bound = box.lower_bound();
      const auto lowest = box.lowest();
      if (bound < best.distance * best.distance &&
          in.squared(lowest[0], lowest[1]) < best.distance * best.distance) {
        const auto found = in.from(lowest[0], lowest[1]);
        if (found.distance < best.distance) best = found;
      }

      // A box needs no more halving where nothing in it can be nearer by more than rounding, or
      // where the distance is convex around the best point.
      const double squared = best.distance * best.distance;
      if (bound >= squared - kClose * farthest || ++boxes > kMostBoxes) {
        proven = std::min(proven, bound);
        continue;
      }
      if (in.holds(box, best) && box.is_convex(squared)) continue;

      auto [first, second] = box.halves();
      stack.push_back(std::move(second));
      stack.push_back(std::move(first));
    }
  }
  best.lower_bound = std::sqrt(std::clamp(proven, 0.0, best.distance * best.distance));
  return best;
}

// The box of projected control points.
template <int D, int H, typename Points>
double squared_distance_to_hull(const Points& points, const Eigen::Matrix<double, D, 1>& target) {
  using Point = Eigen::Matrix<double, D, 1>;
  Point low = Point::Constant(std::numeric_limits<double>::infinity());
  Point high = -low;
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    const Point p = projected_point<D, H>(points.col(i));
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return (target - target.cwiseMax(low).cwiseMin(high)).squaredNorm();
}

template <int D, int H>
CurvePoint<D> nearest(const BSplineCurve<H>& curve, const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& knots = curve.knots();
  std::vector<Candidate> candidates;
  for (const int span : spans_of(knots)) {
    const auto hull = curve.control_points().middleCols(span - knots.degree(), knots.order());
    candidates.push_back({squared_distance_to_hull<D, H>(hull, target), span, 0});
  }
  sort_by_bound(candidates);
  return search(CurveSearch<D, H>{curve, target}, candidates,
                {knots.first(), projected_point<D, H>(curve.at(knots.first())),
                 std::numeric_limits<double>::infinity()});
}

template <int D, int H>
SurfacePoint<D> nearest(const BSplineSurface<H>& surface,
                        const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& U = surface.u();
  const KnotVector& V = surface.v();
  Eigen::Matrix<double, H, Eigen::Dynamic> hull(H, U.order() * V.order());
  std::vector<Candidate> candidates;
  for (const int k : spans_of(U)) {
    for (const int l : spans_of(V)) {
      for (int i = 0; i < U.order(); ++i) {
        hull.middleCols(i * V.order(), V.order()) = surface.control_points().middleCols(
            surface.index(k - U.degree() + i, l - V.degree()), V.order());
      }
      candidates.push_back({squared_distance_to_hull<D, H>(hull, target), k, l});
    }
  }

  sort_by_bound(candidates);
  return search(SurfaceSearch<D, H>{surface, target}, candidates,
                {U.first(), V.first(), projected_point<D, H>(surface.at(U.first(), V.first())),
                 std::numeric_limits<double>::infinity()});
}

}  // namespace

template <int D>
CurvePoint<D> closest_point_from(const BSplineCurve<D>& curve,
                                 const Eigen::Matrix<double, D, 1>& target, double start) {
  return descend<D, D>(curve, target, start);
}
template <int D>
SurfacePoint<D> closest_point_from(const BSplineSurface<D>& surface,
                                   const Eigen::Matrix<double, D, 1>& target, double start_u,
                                   double start_v) {
  return descend<D, D>(surface, target, start_u, start_v);
}

template <int D>
CurvePoint<D> closest_point(const BSplineCurve<D>& curve,
                            const Eigen::Matrix<double, D, 1>& target) {
  return nearest<D, D>(curve, target);
}
template <int D>
SurfacePoint<D> closest_point(const BSplineSurface<D>& surface,
                              const Eigen::Matrix<double, D, 1>& target) {
  return nearest<D, D>(surface, target);
}
template <int D>
CurvePoint<D> closest_point_rational(const BSplineCurve<D + 1>& curve,
                                     const Eigen::Matrix<double, D, 1>& target) {
  return nearest<D, D + 1>(curve, target);
}
template <int D>
SurfacePoint<D> closest_point_rational(const BSplineSurface<D + 1>& surface,
                                       const Eigen::Matrix<double, D, 1>& target) {
  return nearest<D, D + 1>(surface, target);
}

template CurvePoint<1> closest_point_rational<1>(const BSplineCurve<2>&,
                                                 const Eigen::Matrix<double, 1, 1>&);
template CurvePoint<2> closest_point_rational<2>(const BSplineCurve<3>&, const Eigen::Vector2d&);
template CurvePoint<3> closest_point_rational<3>(const BSplineCurve<4>&, const Eigen::Vector3d&);
template SurfacePoint<2> closest_point_rational<2>(const BSplineSurface<3>&,
                                                   const Eigen::Vector2d&);
template SurfacePoint<3> closest_point_rational<3>(const BSplineSurface<4>&,
                                                   const Eigen::Vector3d&);
#define ANGIOSPLINE_INSTANTIATE(D)                                                                 \
  template SurfacePoint<D> closest_point_from(const BSplineSurface<D>&,                            \
                                              const Eigen::Matrix<double, D, 1>&, double, double); \
  template SurfacePoint<D> closest_point(const BSplineSurface<D>&,                                 \
                                         const Eigen::Matrix<double, D, 1>&);
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE
#define ANGIOSPLINE_INSTANTIATE(D)                                                       \
  template CurvePoint<D> closest_point_from(const BSplineCurve<D>&,                      \
                                            const Eigen::Matrix<double, D, 1>&, double); \
  template CurvePoint<D> closest_point(const BSplineCurve<D>&, const Eigen::Matrix<double, D, 1>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
