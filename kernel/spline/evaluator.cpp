#include "kernel/spline/evaluator.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <limits>
#include <thread>

#include "base/contract.h"
#include "kernel/spline/basis.h"

namespace angiospline {

PreparedBasis::PreparedBasis(const KnotVector& knots) : degree_(knots.degree()) {
  EXPECTS(degree_ <= kMaxDegree);
  const int order = degree_ + 1;
  std::vector<double> derivatives(static_cast<std::size_t>(order * order));

  for (int span = degree_; span < knots.control_point_count(); ++span) {
    if (!(knots[span] < knots[span + 1])) continue;
    const double half = 0.5 * (knots[span + 1] - knots[span]);
    start_.push_back(knots[span]);
    middle_.push_back(knots[span] + half);
    scale_.push_back(1 / half);
    function_.push_back(span - degree_);

    // Taylor: the k-th coefficient is the k-th derivative in the middle, times half^k / k!.
    basis_on_span(knots, span, middle_.back(), degree_, derivatives.data());
    double factor = 1;
    for (int k = 0; k < order; ++k) {
      for (int j = 0; j < order; ++j) {
        coefficients_.push_back(factor * derivatives[static_cast<std::size_t>(k * order + j)]);
      }
      factor *= half / (k + 1);
    }
  }

  // Sixteen buckets a span on average, so that few contain a knot; no more than fit a small cache.
  constexpr int kBucketsASpan = 16;
  constexpr int kMostBuckets = 1 << 16;
  const int spans = static_cast<int>(start_.size());
  const int buckets = std::min(kBucketsASpan * spans, std::max(kMostBuckets, spans));
  first_ = knots.first();
  buckets_per_unit_ = buckets / (knots.last() - knots.first());
  last_bucket_ = buckets - 1;
  start_.push_back(std::numeric_limits<double>::infinity());

  int s = 0;
  for (int b = 0; b < buckets; ++b) {
    // A bucket starts no later than any parameter that is mapped to it, rounding included.
    const double start = first_ + (b - 1e-6) / buckets_per_unit_;
    while (start_[static_cast<std::size_t>(s) + 1] <= start) ++s;
    bucket_.push_back(s);
  }
}

namespace {

// Two doubles in one register, as GCC and Clang both write it.
using Two = double __attribute__((vector_size(16)));

inline Two load(const double* from) {
  Two two;
  std::memcpy(&two, from, sizeof two);
  return two;
}

// Points of the world with an even number of functions along v, the case that matters most: pairs
// of control points (x0 y0)(z0 x1)(y1 z1) go through both contractions without leaving the
// registers.
template <int PU, int PV>
EIGEN_ALWAYS_INLINE SurfacePartials<3> contract_pairs(const double* base, Eigen::Index row,
                                                      const double* Nu, const double* Mu,
                                                      const double* Nv, const double* Mv) {
  static_assert(PV % 2 == 1);
  std::array<Two, 9> sum{};  // point, u, v: three registers each

  for (int j = 0; j <= PV; j += 2) {
    std::array<Two, 3> value{};
    std::array<Two, 3> slope{};
    for (int i = 0; i <= PU; ++i) {
      const Two n = {Nu[i], Nu[i]};
      const Two m = {Mu[i], Mu[i]};
      const double* pair = base + i * row + 3 * j;
      for (std::size_t k = 0; k < 3; ++k) {
        const Two points = load(pair + 2 * k);
        value[k] += n * points;
        slope[k] += m * points;
      }
    }

    const std::array<Two, 3> n{Two{Nv[j], Nv[j]}, Two{Nv[j], Nv[j + 1]}, Two{Nv[j + 1], Nv[j + 1]}};
    const std::array<Two, 3> m{Two{Mv[j], Mv[j]}, Two{Mv[j], Mv[j + 1]}, Two{Mv[j + 1], Mv[j + 1]}};
    for (std::size_t k = 0; k < 3; ++k) {
      sum[k] += n[k] * value[k];
      sum[3 + k] += n[k] * slope[k];
      sum[6 + k] += m[k] * value[k];
    }
  }

  const auto point = [&](std::size_t k) {
    return Eigen::Vector3d(sum[k][0] + sum[k + 1][1], sum[k][1] + sum[k + 2][0],
                           sum[k + 1][0] + sum[k + 2][1]);
  };
  return {point(0), point(3), point(6)};
}

// From the net's rows i0 .. i0 + PU, columns j0 .. j0 + PV: u is contracted over whole rows, which
// are contiguous, then v.
template <int D, int PU, int PV>
EIGEN_ALWAYS_INLINE SurfacePartials<D> partials_at(const PreparedBasis& bu, const PreparedBasis& bv,
                                                   const double* net, Eigen::Index row, double u,
                                                   double v) {
  std::array<double, PU + 1> Nu, Mu;
  std::array<double, PV + 1> Nv, Mv;
  const int su = bu.find(u);
  const int sv = bv.find(v);
  bu.evaluate<PU, true>(su, u, Nu.data(), Mu.data());
  bv.evaluate<PV, true>(sv, v, Nv.data(), Mv.data());
  const double* base = net + bu.first_function(su) * row + bv.first_function(sv) * D;

  if constexpr (D == 3 && PV % 2 == 1) {
    return contract_pairs<PU, PV>(base, row, Nu.data(), Mu.data(), Nv.data(), Mv.data());
  }

  // Along u over whole rows of the net,
  using Row = Eigen::Matrix<double, D*(PV + 1), 1>;
  Row value = Nu[0] * Eigen::Map<const Row>(base);
  Row slope = Mu[0] * Eigen::Map<const Row>(base);
  for (int i = 1; i <= PU; ++i) {
    const Eigen::Map<const Row> points(base + i * row);
    value += Nu[static_cast<std::size_t>(i)] * points;
    slope += Mu[static_cast<std::size_t>(i)] * points;
  }

  // then along v.
  SurfacePartials<D> result;
  for (int c = 0; c < D; ++c) {
    double point = Nv[0] * value(c);
    double by_u = Nv[0] * slope(c);
    double by_v = Mv[0] * value(c);
    for (int j = 1; j <= PV; ++j) {
      point += Nv[static_cast<std::size_t>(j)] * value(D * j + c);
      by_u += Nv[static_cast<std::size_t>(j)] * slope(D * j + c);
      by_v += Mv[static_cast<std::size_t>(j)] * value(D * j + c);
    }
    result.point(c) = point;
    result.u(c) = by_u;
    result.v(c) = by_v;
  }

  return result;
}

void basis_of_any_degree(const PreparedBasis& basis, int s, double t, double* values,
                         double* slopes) {
  switch (basis.degree()) {
    case 1:
      return basis.evaluate<1, true>(s, t, values, slopes);
    case 2:
      return basis.evaluate<2, true>(s, t, values, slopes);
    case 3:
      return basis.evaluate<3, true>(s, t, values, slopes);
    case 4:
      return basis.evaluate<4, true>(s, t, values, slopes);
    case 5:
      return basis.evaluate<5, true>(s, t, values, slopes);
    case 6:
      return basis.evaluate<6, true>(s, t, values, slopes);
    default:
      return basis.evaluate<7, true>(s, t, values, slopes);
  }
}

// Surfaces whose two degrees differ: the same sums with loops the compiler cannot unroll.
template <int D>
SurfacePartials<D> partials_of_any_degree(const PreparedBasis& bu, const PreparedBasis& bv,
                                          const double* net, Eigen::Index row, double u, double v) {
  std::array<double, PreparedBasis::kWidth> Nu, Mu, Nv, Mv;
  const int su = bu.find(u);
  const int sv = bv.find(v);
  basis_of_any_degree(bu, su, u, Nu.data(), Mu.data());
  basis_of_any_degree(bv, sv, v, Nv.data(), Mv.data());
  const double* base = net + bu.first_function(su) * row + bv.first_function(sv) * D;

  using Point = Eigen::Matrix<double, D, 1>;
  SurfacePartials<D> result{Point::Zero(), Point::Zero(), Point::Zero()};
  for (std::size_t i = 0; i <= static_cast<std::size_t>(bu.degree()); ++i, base += row) {
    Point across = Point::Zero();
    Point slope = Point::Zero();
    for (std::size_t j = 0; j <= static_cast<std::size_t>(bv.degree()); ++j) {
      const Eigen::Map<const Point> point(base + D * j);
      across += Nv[j] * point;
      slope += Mv[j] * point;
    }
    result.point += Nu[i] * across;
    result.u += Mu[i] * across;
    result.v += Nu[i] * slope;
  }
  return result;
}

}  // namespace

template <int D>
struct SurfaceEvaluator<D>::Code {
  template <int P>
  static SurfacePartials<D> partials(const SurfaceEvaluator& e, double u, double v) {
    if constexpr (P == 0) {
      return partials_of_any_degree<D>(e.u_, e.v_, e.net_.data(), e.row_, u, v);
    } else {
      return partials_at<D, P, P>(e.u_, e.v_, e.net_.data(), e.row_, u, v);
    }
  }
  template <int P>
  static void run(const SurfaceEvaluator& e, const double* uv, Eigen::Index count,
                  SurfacePartials<D>* out) {
    for (Eigen::Index k = 0; k < count; ++k) out[k] = partials<P>(e, uv[2 * k], uv[2 * k + 1]);
  }
  template <int P>
  static void choose(SurfaceEvaluator& e) {
    e.partials_ = &Code::template partials<P>;
    e.run_ = &Code::template run<P>;
  }
};

template <int D>
SurfaceEvaluator<D>::SurfaceEvaluator(const BSplineSurface<D>& surface)
    : u_(surface.u()),
      v_(surface.v()),
      row_(static_cast<Eigen::Index>(D) * surface.v_count()),
      net_(surface.control_points().data(),
           surface.control_points().data() + surface.control_points().size()) {
  EXPECTS(surface.u().degree() >= 1 && surface.v().degree() >= 1);
  switch (u_.degree() == v_.degree() ? u_.degree() : 0) {
    case 2:
      Code::template choose<2>(*this);
      break;
    case 3:
      Code::template choose<3>(*this);
      break;
    case 5:
      Code::template choose<5>(*this);
      break;
    default:
      Code::template choose<0>(*this);
      break;
  }
}

template <int D>
void SurfaceEvaluator<D>::evaluate_all(const Eigen::Matrix2Xd& parameters, SurfacePartials<D>* out,
                                       int threads) const {
  EXPECTS(threads >= 1);
  const Eigen::Index count = parameters.cols();
  // Short runs, taken as threads come free: none waits for another that was started late or held
  // up. Each point has its place, so who works on it makes no difference.
  constexpr Eigen::Index kRun = 2048;
  std::atomic<Eigen::Index> next = 0;
  const auto work = [&] {
    for (;;) {
      const Eigen::Index from = next.fetch_add(kRun, std::memory_order_relaxed);
      if (from >= count) return;
      run_(*this, parameters.data() + 2 * from, std::min(kRun, count - from), out + from);
    }
  };
  std::vector<std::jthread> helpers;
  for (int k = 1; k < threads; ++k) helpers.emplace_back(work);
  work();
}

template class SurfaceEvaluator<2>;
template class SurfaceEvaluator<3>;
template class SurfaceEvaluator<4>;

}  // namespace angiospline
