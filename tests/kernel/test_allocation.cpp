// Evaluation of one point allocates nothing: malloc itself is counted, which operator new and Eigen
// both go through (glibc; not under the address sanitizer, which has a malloc of its own).
#include <cstddef>

#include <gtest/gtest.h>

#include "kernel/spline/evaluator.h"
#include "tests/shapes/random_splines.h"

#if defined(__SANITIZE_ADDRESS__)
#define ANGIOSPLINE_OWN_MALLOC 0
#elif defined(__has_feature)
#if __has_feature(address_sanitizer)
#define ANGIOSPLINE_OWN_MALLOC 0
#endif
#endif
#if !defined(ANGIOSPLINE_OWN_MALLOC) && defined(__GLIBC__)
#define ANGIOSPLINE_OWN_MALLOC 1
#endif

namespace {

thread_local long allocations = 0;

}  // namespace

#if ANGIOSPLINE_OWN_MALLOC
extern "C" void* __libc_malloc(std::size_t size);
extern "C" void* malloc(std::size_t size) {
  ++allocations;
  return __libc_malloc(size);
}
#endif

namespace angiospline {
namespace {

template <typename Work>
long allocations_of(const Work& work) {
  const long before = allocations;
  work();
  return allocations - before;
}

TEST(Allocation, OfOnePointIsNone) {
#if !ANGIOSPLINE_OWN_MALLOC
  GTEST_SKIP() << "allocations are not counted with this C library or sanitizer";
#endif
  double sum = 0;
  EXPECT_GE(allocations_of([&] { sum += Eigen::MatrixXd::Zero(9, 9).eval().sum(); }), 1);
  EXPECT_GE(allocations_of([&] { sum += std::vector<double>(9).back(); }), 1);
  Random random(1);
  int evaluated = 0;
  for (int round = 0; round < 40; ++round) {
    const KnotVector u = random_knots(random, 1 + round % 7);
    const KnotVector v = random_knots(random, 1 + random.below(7));
    const BSplineCurve<3> curve = random_curve<3>(random, u);
    const BSplineSurface<3> surface = random_surface<3>(random, u, v);
    const BSplineSurface<4> rational = random_surface<4>(random, u, v);
    const SurfaceEvaluator<3> evaluator(surface);
    SpanHint hint;
    for (int k = 0; k < 10; ++k) {
      const double s = random_parameter(random, u);
      const double t = random_parameter(random, v);
      const long made = allocations_of([&] {
        sum += curve.at(s)(0) + curve.at(s, 3)(1);
        sum += surface.at(s, t, hint)(0) + surface.at(s, t, hint, 2, 1)(1);
        sum += rational.at(s, t)(3);
        sum += evaluator.point(s, t)(0) + evaluator.partials(s, t).u(2);
      });
      EXPECT_EQ(made, 0) << "degrees " << u.degree() << ", " << v.degree();
      ++evaluated;
    }
  }
  EXPECT_EQ(evaluated, 400);
  EXPECT_FALSE(std::isnan(sum));
}

}  // namespace
}  // namespace angiospline
