#include "kernel/continuity/product.h"

#include <algorithm>
#include <array>
#include <vector>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "kernel/spline/binomial.h"
#include "kernel/spline/blossom.h"
#include "kernel/spline/knot_algebra.h"

namespace angiospline {
namespace {

constexpr int kMaxOrder = KnotVector::kMaxDegree + 1;

// Walks over all ways to deal a window of knots out to two factors, p to the first.
class Dealer {
 public:
  Dealer(const double* window, int p, int q) : p_(p), q_(q), total_(binomial(p + q, p)) {
    for (int k = 0; k < p + q; ++k) {
      if (groups_.empty() || groups_.back().value != window[k]) groups_.push_back({window[k], 0});
      ++groups_.back().multiplicity;
    }
  }

  // visit(args of the first, args of the second, share of all deals)
  template <typename Visit>
  void deal(const Visit& visit) {
    step(0, 0, 0, 1.0, visit);
  }

 private:
  template <typename Visit>
  void step(std::size_t group, int used_a, int used_b, double ways, const Visit& visit) {
    if (group == groups_.size()) {
      visit(args_a_.data(), args_b_.data(), ways / total_);
      return;
    }
    const Knot& knot = groups_[group];
    const int least = std::max(0, knot.multiplicity - (q_ - used_b));
    const int most = std::min(knot.multiplicity, p_ - used_a);
    for (int k = least; k <= most; ++k) {
      std::fill_n(args_a_.begin() + used_a, k, knot.value);
      std::fill_n(args_b_.begin() + used_b, knot.multiplicity - k, knot.value);
      step(group + 1, used_a + k, used_b + knot.multiplicity - k,
           ways * binomial(knot.multiplicity, k), visit);
    }
  }

  int p_;
  int q_;
  double total_;
  std::vector<Knot> groups_;
  std::array<double, kMaxOrder> args_a_{};
  std::array<double, kMaxOrder> args_b_{};
};

template <int D>
Eigen::Matrix<double, D, 1> blossom(const BSplineCurve<D>& curve, int span, const double* args) {
  std::array<double, kMaxOrder> row;
  blossom_row(curve.knots(), span, args, row.data());
  Eigen::Matrix<double, D, 1> sum = Eigen::Matrix<double, D, 1>::Zero();
  for (int j = 0; j < curve.knots().order(); ++j) {
    sum += row[static_cast<std::size_t>(j)] *
           curve.control_points().col(span - curve.knots().degree() + j);
  }
  return sum;
}

// `multiply` is bilinear in the two values.
template <int R, int A, int B, typename Multiply>
BSplineCurve<R> multiplied(const BSplineCurve<A>& a, const BSplineCurve<B>& b,
                           const Multiply& multiply) {
  KnotVector knots = product_knots(a.knots(), b.knots());
  const int p = a.knots().degree();
  const int q = b.knots().degree();
  typename BSplineCurve<R>::ControlPoints points(R, knots.control_point_count());
  for (int i = 0; i < knots.control_point_count(); ++i) {
    const int span_a = span_inside_support(a.knots(), knots, i);
    const int span_b = span_inside_support(b.knots(), knots, i);
    Eigen::Matrix<double, R, 1> sum = Eigen::Matrix<double, R, 1>::Zero();
    Dealer(knots.knots().data() + i + 1, p, q)
        .deal([&](const double* to_a, const double* to_b, double share) {
          sum += share * multiply(blossom(a, span_a, to_a), blossom(b, span_b, to_b));
        });
    points.col(i) = sum;
  }
  return BSplineCurve<R>(std::move(knots), std::move(points));
}

}  // namespace

BSplineCurve<1> product(const BSplineCurve<1>& a, const BSplineCurve<1>& b) {
  return multiplied<1>(
      a, b, [](const auto& x, const auto& y) { return Eigen::Matrix<double, 1, 1>(x(0) * y(0)); });
}

template <int D>
BSplineCurve<D> product(const BSplineCurve<1>& a, const BSplineCurve<D>& b) {
  return multiplied<D>(
      a, b, [](const auto& x, const auto& y) { return Eigen::Matrix<double, D, 1>(x(0) * y); });
}

template <int D>
BSplineCurve<1> dot_product(const BSplineCurve<D>& a, const BSplineCurve<D>& b) {
  return multiplied<1>(
      a, b, [](const auto& x, const auto& y) { return Eigen::Matrix<double, 1, 1>(x.dot(y)); });
}

BSplineCurve<3> cross_product(const BSplineCurve<3>& a, const BSplineCurve<3>& b) {
  return multiplied<3>(a, b,
                       [](const auto& x, const auto& y) { return Eigen::Vector3d(x.cross(y)); });
}

template BSplineCurve<2> product(const BSplineCurve<1>&, const BSplineCurve<2>&);
template BSplineCurve<3> product(const BSplineCurve<1>&, const BSplineCurve<3>&);
template BSplineCurve<4> product(const BSplineCurve<1>&, const BSplineCurve<4>&);
template BSplineCurve<1> dot_product(const BSplineCurve<1>&, const BSplineCurve<1>&);
template BSplineCurve<1> dot_product(const BSplineCurve<2>&, const BSplineCurve<2>&);
template BSplineCurve<1> dot_product(const BSplineCurve<3>&, const BSplineCurve<3>&);
template BSplineCurve<1> dot_product(const BSplineCurve<4>&, const BSplineCurve<4>&);

}  // namespace angiospline
