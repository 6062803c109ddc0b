// Surfaces by two passes of a solver of curves: first along u, then along v.
#pragma once

#include <functional>
#include <string>
#include <utility>

#include <Eigen/Core>

#include "base/result.h"

namespace angiospline {

// From samples of curves (one row a parameter, one column a coordinate of a curve) to their control
// points, one a row.
using CurveSolve = std::function<Result<Eigen::MatrixXd>(const Eigen::MatrixXd&)>;

// The control net of the tensor product, v fastest, from points on a grid of `u_samples` parameters
// along u, v fastest. An error is the first that a solver gives, with its direction. Requires
// points.cols() to be a multiple of u_samples.
// Reference: de Boor, A Practical Guide to Splines, chapter XVII.
template <int D>
Result<Eigen::Matrix<double, D, Eigen::Dynamic>> tensor_fit(
    const Eigen::Matrix<double, D, Eigen::Dynamic>& points, Eigen::Index u_samples,
    const CurveSolve& solve_u, const CurveSolve& solve_v) {
  const auto in_direction = [](const char* name, Error error) {
    error.where = std::string(name) + " direction, " + error.where;
    return fail(std::move(error));
  };

  // Along u the curves are the grid's columns: rows of n points for each parameter.
  const Eigen::Index m = u_samples;
  const Eigen::Index n = m == 0 ? 0 : points.cols() / m;
  const Result<Eigen::MatrixXd> along_u =
      solve_u(Eigen::Map<const Eigen::MatrixXd>(points.data(), D * n, m).transpose());
  if (!along_u) return in_direction("u", along_u.error());

  // Along v they are the rows of control points that came out.
  const Eigen::Index rows = along_u->rows();
  Eigen::MatrixXd values(n, D * rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      values.block(j, D * i, 1, D) = along_u->block(i, D * j, 1, D);
    }
  }
  const Result<Eigen::MatrixXd> along_v = solve_v(values);
  if (!along_v) return in_direction("v", along_v.error());

  const Eigen::Index columns = along_v->rows();
  Eigen::Matrix<double, D, Eigen::Dynamic> net(D, rows * columns);
  for (Eigen::Index i = 0; i < rows; ++i) {
    net.middleCols(i * columns, columns) = along_v->middleCols(D * i, D).transpose();
  }
  return net;
}

}  // namespace angiospline
