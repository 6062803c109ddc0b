#include "kernel/refine/reshape.h"

#include <algorithm>
#include <array>
#include <string>

#include "base/contract.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/split.h"
#include "kernel/spline/blossom.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {
namespace {

constexpr int kMaxOrder = KnotVector::kMaxDegree + 1;

// Difference quotients as compact rows, and the knots of the derivative.
struct Differences {
  KnotVector knots;
  CompactRows matrix;
};

Differences differences(const KnotVector& knots) {
  const int p = knots.degree();
  const int n = knots.control_point_count();
  if (p == 0) return {knots, CompactRows(n, n, 1)};

  const std::vector<double>& U = knots.knots();
  std::vector<double> kept;
  std::vector<int> rows;  // difference of control points r and r + 1
  for (int r = 0; r + 1 < n; ++r) {
    if (knots[r + p + 1] > knots[r + 1]) {
      rows.push_back(r);
      kept.push_back(knots[r + 1]);
    }
  }
  kept.insert(kept.end(), U.end() - p - 1, U.end() - 1);
  Result<KnotVector> lower = KnotVector::make(p - 1, std::move(kept));
  EXPECTS(lower.has_value());

  // Derivative of a spline: p (c_(r+1) - c_r) / (u_(r+p+1) - u_(r+1)) over knots one shorter at
  // each end (de Boor, chapter X).
  Differences result{std::move(*lower), CompactRows(static_cast<int>(rows.size()), n, 2)};
  for (int k = 0; k < result.matrix.rows(); ++k) {
    const int r = rows[static_cast<std::size_t>(k)];
    const double factor = p / (knots[r + p + 1] - knots[r + 1]);
    const std::array<double, 2> entries{-factor, factor};
    result.matrix.set_row(k, r, entries.data(), 2);
  }
  return result;
}

template <int D>
BSplineCurve<D> clamp(const BSplineCurve<D>& curve) {
  return restrict_to(curve, curve.knots().first(), curve.knots().last());
}

// What was made of a closed spline is closed too, but for rounding; unless it may jump at the seam.
template <int D>
BSplineCurve<D> closed_if(bool closed, BSplineCurve<D> curve) {
  return closed && periodic_count(curve.knots()) ? closed_up(curve) : curve;
}

template <int D>
BSplineSurface<D> closed_if(bool closed_u, bool closed_v, BSplineSurface<D> surface) {
  if (closed_u && periodic_count(surface.u())) surface = closed_up_u(surface);
  if (closed_v && periodic_count(surface.v())) surface = closed_up_v(surface);
  return surface;
}

}  // namespace

template <int D>
BSplineCurve<D> derivative(const BSplineCurve<D>& curve) {
  Differences d = differences(curve.knots());
  return closed_if(
      is_periodic(curve),
      BSplineCurve<D>(std::move(d.knots), d.matrix.template apply<D>(curve.control_points())));
}

template <int D>
BSplineSurface<D> derivative_u(const BSplineSurface<D>& surface) {
  const Differences d = differences(surface.u());
  return closed_if(is_periodic_u(surface), is_periodic_v(surface),
                   transform_u(surface, d.matrix, d.knots));
}

template <int D>
BSplineSurface<D> derivative_v(const BSplineSurface<D>& surface) {
  const Differences d = differences(surface.v());
  return closed_if(is_periodic_u(surface), is_periodic_v(surface),
                   transform_v(surface, d.matrix, d.knots));
}

// The blossom of the elevated piece is the mean, over the argument left out, of the old blossom.
CompactRows elevation_matrix(const KnotVector& knots) {
  const KnotVector raised = elevated_knots(knots, 1);
  const int p = knots.degree();
  CompactRows E(raised.control_point_count(), knots.control_point_count(), p + 1);
  std::array<double, kMaxOrder> args;
  std::array<double, kMaxOrder> row;
  for (int i = 0; i < E.rows(); ++i) {
    const int span = span_inside_support(knots, raised, i);

    std::array<double, kMaxOrder> sum{};
    // The blossom of degree p + 1 is the mean of the blossoms of degree p without one argument each
    // (Ramshaw 1989).
    for (int left_out = 0; left_out <= p; ++left_out) {
      for (int k = 0, at = 0; k <= p; ++k) {
        if (k != left_out) args[static_cast<std::size_t>(at++)] = raised[i + 1 + k];
      }
      blossom_row(knots, span, args.data(), row.data());
      for (int j = 0; j <= p; ++j)
        sum[static_cast<std::size_t>(j)] += row[static_cast<std::size_t>(j)];
    }
    for (double& s : sum) s /= p + 1;
    E.set_row(i, span - p, sum.data(), p + 1);
  }
  return E;
}

template <int D>
BSplineCurve<D> elevate(const BSplineCurve<D>& curve, int by) {
  EXPECTS(by >= 0);
  BSplineCurve<D> result = curve;
  const bool was_closed = is_periodic(curve);
  for (; by > 0; --by) {
    result = BSplineCurve<D>(
        elevated_knots(result.knots(), 1),
        elevation_matrix(result.knots()).template apply<D>(result.control_points()));
  }
  return closed_if(was_closed, std::move(result));
}

template <int D>
BSplineSurface<D> elevate(const BSplineSurface<D>& surface, int by_u, int by_v) {
  EXPECTS(by_u >= 0 && by_v >= 0);
  BSplineSurface<D> result = surface;
  for (; by_u > 0; --by_u) {
    result = transform_u(result, elevation_matrix(result.u()), elevated_knots(result.u(), 1));
  }
  for (; by_v > 0; --by_v) {
    result = transform_v(result, elevation_matrix(result.v()), elevated_knots(result.v(), 1));
  }
  return closed_if(is_periodic_u(surface), is_periodic_v(surface), std::move(result));
}

template <int D>
BSplineCurve<D> reverse(const BSplineCurve<D>& curve) {
  return BSplineCurve<D>(reversed(curve.knots()), curve.control_points().rowwise().reverse());
}

template <int D>
BSplineSurface<D> reverse_u(const BSplineSurface<D>& surface) {
  typename BSplineSurface<D>::ControlPoints net(D, surface.control_points().cols());
  for (int i = 0; i < surface.u_count(); ++i) {
    net.middleCols(surface.index(surface.u_count() - 1 - i, 0), surface.v_count()) =
        surface.control_points().middleCols(surface.index(i, 0), surface.v_count());
  }
  return BSplineSurface<D>(reversed(surface.u()), surface.v(), std::move(net));
}

template <int D>
BSplineSurface<D> reverse_v(const BSplineSurface<D>& surface) {
  typename BSplineSurface<D>::ControlPoints net(D, surface.control_points().cols());
  for (int i = 0; i < surface.u_count(); ++i) {
    net.middleCols(surface.index(i, 0), surface.v_count()) =
        surface.control_points()
            .middleCols(surface.index(i, 0), surface.v_count())
            .rowwise()
            .reverse();
  }
  return BSplineSurface<D>(surface.u(), reversed(surface.v()), std::move(net));
}

template <int D>
BSplineSurface<D> swap_uv(const BSplineSurface<D>& surface) {
  typename BSplineSurface<D>::ControlPoints net(D, surface.control_points().cols());
  for (int i = 0; i < surface.u_count(); ++i) {
    for (int j = 0; j < surface.v_count(); ++j) {
      net.col(static_cast<Eigen::Index>(j) * surface.u_count() + i) = surface.control_point(i, j);
    }
  }
  return BSplineSurface<D>(surface.v(), surface.u(), std::move(net));
}

template <int D>
BSplineCurve<D> over(const BSplineCurve<D>& curve, double first, double last) {
  return BSplineCurve<D>(with_domain(curve.knots(), first, last), curve.control_points());
}

template <int D>
BSplineSurface<D> over(const BSplineSurface<D>& surface, double u_first, double u_last,
                       double v_first, double v_last) {
  return BSplineSurface<D>(with_domain(surface.u(), u_first, u_last),
                           with_domain(surface.v(), v_first, v_last), surface.control_points());
}

template <int D>
Result<BSplineCurve<D>> join(const BSplineCurve<D>& first, const BSplineCurve<D>& second,
                             double gap) {
  const int degree = std::max({first.knots().degree(), second.knots().degree(), 1});
  const BSplineCurve<D> a = elevate(clamp(first), degree - first.knots().degree());
  const BSplineCurve<D> raised = elevate(clamp(second), degree - second.knots().degree());
  const double start = a.knots().last();
  const double length = raised.knots().last() - raised.knots().first();
  const BSplineCurve<D> b = over(raised, start, start + length);

  const auto end_point = a.control_points().col(a.control_points().cols() - 1);
  const auto start_point = b.control_points().col(0);
  const double distance = (end_point - start_point).norm();
  if (!(distance <= gap)) {
    return fail({ErrorKind::kBadInput, "curves do not meet", "join", std::to_string(distance),
                 "the gap must be at most " + std::to_string(gap)});
  }
  std::vector<double> knots(a.knots().knots().begin(), a.knots().knots().end() - 1);
  knots.insert(knots.end(), b.knots().knots().begin() + degree + 1, b.knots().knots().end());
  const Eigen::Index head = a.control_points().cols();
  const Eigen::Index tail = b.control_points().cols() - 1;
  typename BSplineCurve<D>::ControlPoints points(D, head + tail);
  points.leftCols(head) = a.control_points();
  points.rightCols(tail) = b.control_points().rightCols(tail);
  points.col(head - 1) = 0.5 * (end_point + start_point);
  Result<KnotVector> joined = KnotVector::make(degree, std::move(knots));
  if (!joined) return fail(joined.error());
  return BSplineCurve<D>(std::move(*joined), std::move(points));
}

namespace {

// The same for closed curves, which stay closed: all have the union of the knots of a period.
template <int D>
std::vector<BSplineCurve<D>> make_closed_compatible(std::vector<BSplineCurve<D>> curves) {
  std::vector<double> all;
  const auto add_missing = [](const KnotVector& knots, const KnotVector& from,
                              std::vector<double>& missing) {
    for (const Knot& knot : distinct_knots(from)) {
      if (knot.value < knots.first() || knot.value >= knots.last()) continue;
      const int count = knot.multiplicity - knots.multiplicity(knot.value);
      missing.insert(missing.end(), static_cast<std::size_t>(std::max(count, 0)), knot.value);
    }
  };

  // The union of all knots of a period, each with the highest multiplicity.
  KnotVector common = curves.front().knots();
  for (const BSplineCurve<D>& curve : curves) {
    std::vector<double> missing;
    add_missing(common, curve.knots(), missing);
    const Result<KnotVector> both = with_knots_periodic(common, std::move(missing));
    EXPECTS(both.has_value());
    common = *both;
  }

  for (BSplineCurve<D>& curve : curves) {
    std::vector<double> missing;
    add_missing(curve.knots(), common, missing);
    const Result<BSplineCurve<D>> fine = insert_knots_periodic(curve, std::move(missing));
    EXPECTS(fine.has_value());
    curve = *fine;
  }
  return curves;
}

}  // namespace

template <int D>
std::vector<BSplineCurve<D>> make_compatible(std::vector<BSplineCurve<D>> curves) {
  EXPECTS(!curves.empty());
  int degree = 0;
  bool closed = true;
  for (const BSplineCurve<D>& curve : curves) {
    degree = std::max(degree, curve.knots().degree());
    closed = closed && is_periodic(curve);
  }

  const double first = curves.front().knots().first();
  const double last = curves.front().knots().last();
  for (BSplineCurve<D>& curve : curves) {
    const int by = degree - curve.knots().degree();
    curve = over(elevate(closed ? curve : clamp(curve), by), first, last);
  }

  if (closed) return make_closed_compatible(std::move(curves));
  KnotVector common = curves.front().knots();
  for (const BSplineCurve<D>& curve : curves) common = merged_knots(common, curve.knots());
  for (BSplineCurve<D>& curve : curves) curve = refine(curve, common);
  return curves;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                               \
  template BSplineCurve<D> derivative(const BSplineCurve<D>&);                                   \
  template BSplineSurface<D> derivative_u(const BSplineSurface<D>&);                             \
  template BSplineSurface<D> derivative_v(const BSplineSurface<D>&);                             \
  template BSplineCurve<D> elevate(const BSplineCurve<D>&, int);                                 \
  template BSplineSurface<D> elevate(const BSplineSurface<D>&, int, int);                        \
  template BSplineCurve<D> reverse(const BSplineCurve<D>&);                                      \
  template BSplineSurface<D> reverse_u(const BSplineSurface<D>&);                                \
  template BSplineSurface<D> reverse_v(const BSplineSurface<D>&);                                \
  template BSplineSurface<D> swap_uv(const BSplineSurface<D>&);                                  \
  template BSplineCurve<D> over(const BSplineCurve<D>&, double, double);                         \
  template BSplineSurface<D> over(const BSplineSurface<D>&, double, double, double, double);     \
  template Result<BSplineCurve<D>> join(const BSplineCurve<D>&, const BSplineCurve<D>&, double); \
  template std::vector<BSplineCurve<D>> make_compatible(std::vector<BSplineCurve<D>>);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
