#include <algorithm>

#include <gtest/gtest.h>

#include "kernel/evaluate/grid.h"
#include "kernel/fit/fit.h"
#include "tests/shapes/random_splines.h"

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

// The sums as written down, one term after the other: whatever instructions are used, every bit is
// that of these.
TEST(EvaluateGrid, GivesTheBitsOfPlainSums) {
  Random random(8);
  for (int degree = 1; degree <= 8; ++degree) {
    const BSplineSurface<3> surface =
        random_surface<3>(random, random_knots(random, degree), random_knots(random, degree));
    const auto us = random_parameters(random, surface.u(), 9);
    const auto vs = random_parameters(random, surface.v(), 43);
    const SurfaceGrid<3> grid = evaluate_grid(surface, us, vs, 2);
    const auto Nu = collocation_matrices(surface.u(), us, 2);
    const auto Nv = collocation_matrices(surface.v(), vs, 2);
    for (int a = 0; a <= 2; ++a) {
      for (int b = 0; a + b <= 2; ++b) {
        const CompactRows& U = Nu[static_cast<std::size_t>(a)];
        const CompactRows& V = Nv[static_cast<std::size_t>(b)];
        for (int i = 0; i < U.rows(); ++i) {
          for (int j = 0; j < V.rows(); ++j) {
            Eigen::Vector3d sum = Eigen::Vector3d::Zero();
            for (int k = 0; k <= degree; ++k) {
              Eigen::Vector3d along_v = Eigen::Vector3d::Zero();
              for (int l = 0; l <= degree; ++l) {
                along_v += V.row(j)[l] * surface.control_point(U.first(i) + k, V.first(j) + l);
              }
              sum += U.row(i)[k] * along_v;
            }
            ASSERT_EQ(grid.partial(a, b).col(i * V.rows() + j), sum) << "degree " << degree;
          }
        }
      }
    }
  }
}

TEST(UnitNormals, AreThoseOfThePartials) {
  Random random(9);
  const BSplineSurface<3> surface =
      random_surface<3>(random, KnotVector::clamped(3, {0, 1, 2}), KnotVector::bezier(5));
  const auto us = spaced(0, 2, 7);
  const auto vs = spaced(0, 1, 5);
  const auto normals = unit_normals(evaluate_grid(surface, us, vs, 1));
  for (int i = 0; i < 7; ++i) {
    for (int j = 0; j < 5; ++j) {
      const Eigen::Vector3d wanted =
          normal_vector(surface, us[static_cast<std::size_t>(i)], vs[static_cast<std::size_t>(j)])
              .normalized();
      EXPECT_LT((normals.col(i * 5 + j) - wanted).norm(), 1e-13);
    }
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
