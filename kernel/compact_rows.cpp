#include "kernel/compact_rows.h"

#include <algorithm>

#include "base/contract.h"

namespace angiospline {

CompactRows::CompactRows(int rows, int columns, int width)
    : columns_(columns),
      width_(width),
      first_(static_cast<std::size_t>(rows), 0),
      values_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(width), 0.0) {
  EXPECTS(width >= 1 && width <= columns);
}

void CompactRows::set_row(int row, int column, const double* entries, int count) {
  const int from = std::max(column, 0);
  const int to = std::min(column + count, columns_);
  EXPECTS(to - from <= width_);
  const int start = std::clamp(from, 0, columns_ - width_);
  double* target = values_.data() + static_cast<std::ptrdiff_t>(row) * width_;
  first_[static_cast<std::size_t>(row)] = start;
  std::fill_n(target, width_, 0.0);
  for (int c = from; c < to; ++c) target[c - start] = entries[c - column];
}

void CompactRows::apply_blocks(const double* blocks, std::ptrdiff_t stride, double* out) const {
  for (int r = 0; r < rows(); ++r) {
    const double* a = row(r);
    const double* in = blocks + first(r) * stride;
    double* sum = out + r * stride;
    std::fill_n(sum, stride, 0.0);
    for (int j = 0; j < width_; ++j, in += stride) {
      const double factor = a[j];
      if (factor == 0) continue;
      for (std::ptrdiff_t k = 0; k < stride; ++k) sum[k] += factor * in[k];
    }
  }
}

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> CompactRows::apply(
    const Eigen::Matrix<double, D, Eigen::Dynamic>& points) const {
  EXPECTS(points.cols() == columns_);
  Eigen::Matrix<double, D, Eigen::Dynamic> result(D, rows());
  for (int r = 0; r < rows(); ++r) {
    const double* a = row(r);
    Eigen::Matrix<double, D, 1> sum = a[0] * points.col(first(r));
    for (int j = 1; j < width_; ++j) sum += a[j] * points.col(first(r) + j);
    result.col(r) = sum;
  }
  return result;
}

template Eigen::Matrix<double, 1, Eigen::Dynamic> CompactRows::apply<1>(
    const Eigen::Matrix<double, 1, Eigen::Dynamic>&) const;
template Eigen::Matrix<double, 2, Eigen::Dynamic> CompactRows::apply<2>(
    const Eigen::Matrix<double, 2, Eigen::Dynamic>&) const;
template Eigen::Matrix<double, 3, Eigen::Dynamic> CompactRows::apply<3>(
    const Eigen::Matrix<double, 3, Eigen::Dynamic>&) const;
template Eigen::Matrix<double, 4, Eigen::Dynamic> CompactRows::apply<4>(
    const Eigen::Matrix<double, 4, Eigen::Dynamic>&) const;

Eigen::SparseMatrix<double> CompactRows::to_sparse() const {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(values_.size());
  for (int r = 0; r < rows(); ++r) {
    for (int j = 0; j < width_; ++j) entries.emplace_back(r, first(r) + j, row(r)[j]);
  }
  Eigen::SparseMatrix<double> matrix(rows(), columns_);
  matrix.setFromTriplets(entries.begin(), entries.end());
  return matrix;
}

Eigen::MatrixXd CompactRows::to_dense() const {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(rows(), columns_);
  for (int r = 0; r < rows(); ++r) {
    for (int j = 0; j < width_; ++j) matrix(r, first(r) + j) = row(r)[j];
  }
  return matrix;
}

}  // namespace angiospline
