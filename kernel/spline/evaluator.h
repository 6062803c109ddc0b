// Evaluation prepared once and then fast at any number of points: pointwise, in batches, on
// threads.
#pragma once

#include <array>
#include <vector>

#include <Eigen/Core>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The basis functions of every span of positive length as polynomials about its middle, and a table
// that finds the span of a parameter in constant time. Up to a few ulps the values are those of
// basis_at; degree at most kMaxDegree (above it the power form would lose digits).
class PreparedBasis {
 public:
  static constexpr int kMaxDegree = 7;
  static constexpr int kWidth = kMaxDegree + 1;

  // Requires degree <= kMaxDegree.
  explicit PreparedBasis(const KnotVector& knots);

  int degree() const { return degree_; }

  // Index into the spans of positive length; outside the domain the first or last.
  EIGEN_ALWAYS_INLINE int find(double t) const {
    const double place = (t - first_) * buckets_per_unit_;
    const double clamped = place > 0 ? (place < last_bucket_ ? place : last_bucket_) : 0;
    int s = bucket_[static_cast<std::size_t>(clamped)];
    s += t >= start_[static_cast<std::size_t>(s) + 1];
    while (t >= start_[static_cast<std::size_t>(s) + 1]) ++s;
    return s;
  }
  // The first basis function on span s.
  int first_function(int s) const { return function_[static_cast<std::size_t>(s)]; }

  // Values, and with kDerivative also first derivatives, of the P + 1 functions on span s.
  template <int P, bool kDerivative>
  EIGEN_ALWAYS_INLINE void evaluate(int s, double t, double* values, double* slopes) const {
    const double scale = scale_[static_cast<std::size_t>(s)];
    const double x = (t - middle_[static_cast<std::size_t>(s)]) * scale;
    using Row = Eigen::Matrix<double, P + 1, 1>;
    const double* c = coefficients_.data() + static_cast<std::ptrdiff_t>(s) * (P + 1) * (P + 1);
    Row value = Eigen::Map<const Row>(c + P * (P + 1));
    [[maybe_unused]] Row slope = value;
    for (int k = P - 1; k >= 0; --k) {
      value = value * x + Eigen::Map<const Row>(c + k * (P + 1));
      if constexpr (kDerivative) {
        if (k > 0) slope = slope * x + value;
      }
    }
    Eigen::Map<Row>{values} = value;
    if constexpr (kDerivative) Eigen::Map<Row>{slopes} = slope * scale;
  }

 private:
  int degree_;
  double first_;
  double buckets_per_unit_;
  double last_bucket_;
  std::vector<int> bucket_;    // the span at the start of each bucket
  std::vector<double> start_;  // of each span; then infinity
  std::vector<double> middle_;
  std::vector<double> scale_;  // 2 / length: the local variable runs over [-1, 1]
  std::vector<int> function_;
  std::vector<double> coefficients_;  // by span, power, function
};

template <int D>
struct SurfacePartials {
  Eigen::Matrix<double, D, 1> point, u, v;
};

// A surface prepared for evaluation at many parameters. Immutable and self-contained: threads may
// share one. Requires degrees 1 to PreparedBasis::kMaxDegree; bi-quadratic, bi-cubic and bi-quintic
// ones have code of their own. D is 2 to 4.
// No call allocates, apart from the results of evaluate_all.
template <int D>
class SurfaceEvaluator {
 public:
  using Point = Eigen::Matrix<double, D, 1>;

  explicit SurfaceEvaluator(const BSplineSurface<D>& surface);

  Point point(double u, double v) const { return partials_(*this, u, v).point; }
  // Point and first partials.
  SurfacePartials<D> partials(double u, double v) const { return partials_(*this, u, v); }

  // partials at (parameters(0, k), parameters(1, k)), written to out[k], over `threads` threads.
  // The result does not depend on their number. Requires threads >= 1 and room for all.
  void evaluate_all(const Eigen::Matrix2Xd& parameters, SurfacePartials<D>* out,
                    int threads = 1) const;

 private:
  // The code for the surface's two degrees.
  struct Code;

  PreparedBasis u_;
  PreparedBasis v_;
  Eigen::Index row_;  // doubles in one row of the net
  std::vector<double> net_;
  SurfacePartials<D> (*partials_)(const SurfaceEvaluator&, double, double);
  void (*run_)(const SurfaceEvaluator&, const double* uv, Eigen::Index count,
               SurfacePartials<D>* out);
};

}  // namespace angiospline
