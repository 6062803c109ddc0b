#include "kernel/closest_point.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "kernel/grid.h"

namespace angiospline {
namespace {

constexpr int kMaxIterations = 60;

// Squared distance from a point to the box of some control points: no point of their hull is
// nearer.
template <int D, typename Points>
double squared_distance_to_box(const Points& points, const Eigen::Matrix<double, D, 1>& target) {
  const Eigen::Matrix<double, D, 1> low = points.rowwise().minCoeff();
  const Eigen::Matrix<double, D, 1> high = points.rowwise().maxCoeff();
  return (target - target.cwiseMax(low).cwiseMin(high)).squaredNorm();
}

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

}  // namespace

template <int D>
CurvePoint<D> closest_point_from(const BSplineCurve<D>& curve,
                                 const Eigen::Matrix<double, D, 1>& target, double start) {
  using Point = Eigen::Matrix<double, D, 1>;
  const double low = curve.knots().first();
  const double high = curve.knots().last();
  double t = std::clamp(start, low, high);
  Point point = curve.at(t);
  double squared = (point - target).squaredNorm();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Point d1 = curve.at(t, 1);
    const Point offset = point - target;
    const double g = d1.dot(offset);
    const double h = d1.squaredNorm() + curve.at(t, 2).dot(offset);
    const double scale = h > 0 ? h : d1.squaredNorm();
    if (!(scale > 0)) break;
    double step = std::clamp(t - g / scale, low, high) - t;
    bool moved = false;
    for (int halving = 0; halving < 30 && step != 0; ++halving, step *= 0.5) {
      const Point next = curve.at(t + step);
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

template <int D>
CurvePoint<D> closest_point(const BSplineCurve<D>& curve,
                            const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& knots = curve.knots();
  std::vector<Candidate> candidates;
  for (const int span : spans_of(knots)) {
    const auto hull = curve.control_points().middleCols(span - knots.degree(), knots.order());
    candidates.push_back({squared_distance_to_box<D>(hull, target), span, 0});
  }
  sort_by_bound(candidates);
  const double infinity = std::numeric_limits<double>::infinity();
  CurvePoint<D> best{knots.first(), curve.at(knots.first()), infinity};
  for (const Candidate& candidate : candidates) {
    if (candidate.bound > best.distance * best.distance) break;
    const int k = candidate.u_span;
    const std::vector<double> ts = spaced(knots[k], knots[k + 1], knots.order() + 2);
    std::vector<double> distances;
    for (const double t : ts) distances.push_back((curve.at(t, 0, k) - target).squaredNorm());
    for (std::size_t i = 0; i < ts.size(); ++i) {
      const double before = i > 0 ? distances[i - 1] : infinity;
      const double after = i + 1 < ts.size() ? distances[i + 1] : infinity;
      if (distances[i] > before || distances[i] > after) continue;
      const CurvePoint<D> found = closest_point_from(curve, target, ts[i]);
      if (found.distance < best.distance || (found.distance == best.distance && found.t < best.t)) {
        best = found;
      }
    }
  }
  return best;
}

template <int D>
SurfacePoint<D> closest_point_from(const BSplineSurface<D>& surface,
                                   const Eigen::Matrix<double, D, 1>& target, double start_u,
                                   double start_v) {
  using Point = Eigen::Matrix<double, D, 1>;
  const Eigen::Vector2d low(surface.u().first(), surface.v().first());
  const Eigen::Vector2d high(surface.u().last(), surface.v().last());
  Eigen::Vector2d uv = Eigen::Vector2d(start_u, start_v).cwiseMax(low).cwiseMin(high);
  Point point = surface.at(uv(0), uv(1));
  double squared = (point - target).squaredNorm();
  for (int iteration = 0; iteration < kMaxIterations; ++iteration) {
    const Point su = surface.at(uv(0), uv(1), 1, 0);
    const Point sv = surface.at(uv(0), uv(1), 0, 1);
    const Point offset = point - target;
    const Eigen::Vector2d g(su.dot(offset), sv.dot(offset));
    Eigen::Matrix2d G;
    G << su.squaredNorm(), su.dot(sv), su.dot(sv), sv.squaredNorm();
    Eigen::Matrix2d H = G;
    H(0, 0) += surface.at(uv(0), uv(1), 2, 0).dot(offset);
    H(1, 1) += surface.at(uv(0), uv(1), 0, 2).dot(offset);
    H(0, 1) += surface.at(uv(0), uv(1), 1, 1).dot(offset);
    H(1, 0) = H(0, 1);
    const auto held = [&](int k) {
      return (uv(k) <= low(k) && g(k) > 0) || (uv(k) >= high(k) && g(k) < 0);
    };
    Eigen::Vector2d step = box_step(g, H, G, held(0), held(1));
    bool moved = false;
    for (int halving = 0; halving < 30; ++halving, step *= 0.5) {
      const Eigen::Vector2d next_uv = (uv + step).cwiseMax(low).cwiseMin(high);
      if (next_uv == uv) break;
      const Point next = surface.at(next_uv(0), next_uv(1));
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

template <int D>
SurfacePoint<D> closest_point(const BSplineSurface<D>& surface,
                              const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& U = surface.u();
  const KnotVector& V = surface.v();
  std::vector<Candidate> candidates;
  for (const int k : spans_of(U)) {
    for (const int l : spans_of(V)) {
      double bound = std::numeric_limits<double>::infinity();
      Eigen::Matrix<double, D, 1> low =
          Eigen::Matrix<double, D, 1>::Constant(std::numeric_limits<double>::infinity());
      Eigen::Matrix<double, D, 1> high = -low;
      for (int i = k - U.degree(); i <= k; ++i) {
        const auto row =
            surface.control_points().middleCols(surface.index(i, l - V.degree()), V.order());
        low = low.cwiseMin(row.rowwise().minCoeff());
        high = high.cwiseMax(row.rowwise().maxCoeff());
      }
      bound = (target - target.cwiseMax(low).cwiseMin(high)).squaredNorm();
      candidates.push_back({bound, k, l});
    }
  }
  sort_by_bound(candidates);
  const double infinity = std::numeric_limits<double>::infinity();
  SurfacePoint<D> best{U.first(), V.first(), surface.at(U.first(), V.first()), infinity};
  for (const Candidate& candidate : candidates) {
    if (candidate.bound > best.distance * best.distance) break;
    const std::vector<double> us =
        spaced(U[candidate.u_span], U[candidate.u_span + 1], U.order() + 2);
    const std::vector<double> vs =
        spaced(V[candidate.v_span], V[candidate.v_span + 1], V.order() + 2);
    const int m = static_cast<int>(us.size());
    const int n = static_cast<int>(vs.size());
    Eigen::MatrixXd distances(m, n);
    const SurfaceGrid<D> grid = evaluate_grid(surface, us, vs);
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < n; ++j) {
        distances(i, j) = (grid.points().col(i * n + j) - target).squaredNorm();
      }
    }
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < n; ++j) {
        const int i0 = std::max(i - 1, 0);
        const int j0 = std::max(j - 1, 0);
        const auto around =
            distances.block(i0, j0, std::min(i + 2, m) - i0, std::min(j + 2, n) - j0);
        if (distances(i, j) > around.minCoeff()) continue;
        const SurfacePoint<D> found = closest_point_from(
            surface, target, us[static_cast<std::size_t>(i)], vs[static_cast<std::size_t>(j)]);
        if (found.distance < best.distance) best = found;
      }
    }
  }
  return best;
}

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
