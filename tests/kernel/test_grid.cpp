#include <algorithm>

#include <gtest/gtest.h>

#include "kernel/grid.h"
#include "tests/kernel/random_splines.h"

namespace angiospline {
namespace {

std::vector<double> random_parameters(Random& random, const KnotVector& knots, int count) {
  std::vector<double> parameters;
  for (int k = 0; k < count; ++k) parameters.push_back(random_parameter(random, knots));
  return parameters;
}

template <int D>
void expect_pointwise(Random& random, int rows, int columns) {
  const BSplineSurface<D> surface = random_surface<D>(random, random_knots(random, random.below(9)),
                                                      random_knots(random, random.below(9)));
  const auto us = random_parameters(random, surface.u(), rows);  // in no order
  const auto vs = random_parameters(random, surface.v(), columns);
  const SurfaceGrid<D> grid = evaluate_grid(surface, us, vs, 3);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      for (int a = 0; a <= 3; ++a) {
        for (int b = 0; a + b <= 3; ++b) {
          const Eigen::Matrix<double, D, 1> wanted =
              surface.at(us[static_cast<std::size_t>(i)], vs[static_cast<std::size_t>(j)], a, b);
          EXPECT_LE((grid.partial(a, b).col(i * columns + j) - wanted).norm(),
                    1e-11 * (1 + wanted.norm()));
        }
      }
    }
  }
}

TEST(EvaluateGrid, AgreesWithPointwiseEvaluationForAllDegreesAndSizes) {
  Random random(6);
  const int columns[] = {1, 5, 31, 32, 33, 70};  // around the width of a strip
  for (int round = 0; round < 24; ++round) {
    expect_pointwise<1>(random, 1 + random.below(5), columns[round % 6]);
    expect_pointwise<2>(random, 1 + random.below(5), columns[round % 6]);
    expect_pointwise<3>(random, 1 + random.below(5), columns[round % 6]);
    expect_pointwise<4>(random, 1 + random.below(5), columns[round % 6]);
  }
}

TEST(EvaluateGrid, OfNoParametersIsEmptyAndReusesAnEarlierGrid) {
  Random random(7);
  const BSplineSurface<3> surface =
      random_surface<3>(random, KnotVector::bezier(3), KnotVector::bezier(2));
  SurfaceGrid<3> grid = evaluate_grid(surface, {0.2, 0.4, 0.6}, {0.1, 0.9}, 2);
  const double* memory = grid.points().data();
  grid = evaluate_grid(surface, {0.9, 0.5}, {0.3, 0.2, 0.1}, 1, std::move(grid));
  EXPECT_EQ(grid.points().data(), memory);
  EXPECT_EQ(grid.partials.size(), 3u);
  EXPECT_LT((grid.partial(0, 1).col(3) - surface.at(0.5, 0.3, 0, 1)).norm(), 1e-14);
  EXPECT_EQ(evaluate_grid(surface, {}, {0.5}, 1).points().cols(), 0);
  EXPECT_EQ(evaluate_grid(surface, {0.5}, {}, 1).points().cols(), 0);
}

}  // namespace
}  // namespace angiospline
