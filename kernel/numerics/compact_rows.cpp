#include "kernel/numerics/compact_rows.h"

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

void CompactRows::reshape(int rows, int columns, int width) {
  EXPECTS(width >= 1 && width <= columns);
  columns_ = columns;
  width_ = width;
  first_.resize(static_cast<std::size_t>(rows));
  values_.resize(static_cast<std::size_t>(rows) * static_cast<std::size_t>(width));
}

void CompactRows::set_row(int row, int column, const double* entries, int count) {
  double* target = values_.data() + static_cast<std::ptrdiff_t>(row) * width_;
  if (count == width_ && column >= 0 && column + count <= columns_) {
    first_[static_cast<std::size_t>(row)] = column;
    std::copy_n(entries, count, target);
    return;
  }
  const int from = std::max(column, 0);
  const int to = std::min(column + count, columns_);
  EXPECTS(to - from <= width_);
  const int start = std::clamp(from, 0, columns_ - width_);
  first_[static_cast<std::size_t>(row)] = start;
  std::fill_n(target, width_, 0.0);
  for (int c = from; c < to; ++c) target[c - start] = entries[c - column];
}

namespace {

// kStride > 0 is a block size known at compile time, and so is kWidth > 0, the length of the runs.
template <int kStride, int kWidth = 0>
void apply_rows(const CompactRows& A, int from, int to, const double* blocks,
                std::ptrdiff_t runtime, double* out) {
  const std::ptrdiff_t stride = kStride > 0 ? kStride : runtime;
  const int width = kWidth > 0 ? kWidth : A.width();
  double* result = out;
  for (int r = from; r < to; ++r, result += stride) {
    const double* a = A.row(r);
    const double* in = blocks + A.first(r) * stride;
    if constexpr (kStride > 0) {
      double sum[kStride] = {};
      for (int j = 0; j < width; ++j, in += stride) {
        for (int k = 0; k < kStride; ++k) sum[k] += a[j] * in[k];
      }
      for (int k = 0; k < kStride; ++k) result[k] = sum[k];
    } else {
      int low = 0;  // rows of refinement matrices are often shorter than they may be
      int high = width;
      while (low < high && a[low] == 0) ++low;
      while (low < high && a[high - 1] == 0) --high;

      constexpr std::ptrdiff_t kChunk = 8;  // as much as stays in registers
      std::ptrdiff_t c = 0;
      for (; c + kChunk <= stride; c += kChunk) {
        double sum[kChunk] = {};
        for (int j = low; j < high; ++j) {
          for (int k = 0; k < kChunk; ++k) sum[k] += a[j] * in[j * stride + c + k];
        }
        std::copy_n(sum, kChunk, result + c);
      }
      for (; c < stride; ++c) {
        double sum = 0;
        for (int j = low; j < high; ++j) sum += a[j] * in[j * stride + c];
        result[c] = sum;
      }
    }
  }
}

void apply_any(const CompactRows& A, int from, int to, const double* blocks, std::ptrdiff_t stride,
               double* out) {
  switch (stride) {
    case 1:
      return apply_rows<1>(A, from, to, blocks, stride, out);
    case 2:
      return apply_rows<2>(A, from, to, blocks, stride, out);
    case 3:  // points of the world; cubics and quintics matter most
      if (A.width() == 6) return apply_rows<3, 6>(A, from, to, blocks, stride, out);
      if (A.width() == 4) return apply_rows<3, 4>(A, from, to, blocks, stride, out);
      return apply_rows<3>(A, from, to, blocks, stride, out);
    case 4:
      return apply_rows<4>(A, from, to, blocks, stride, out);
    default:
      return apply_rows<0>(A, from, to, blocks, stride, out);
  }
}

}  // namespace

void CompactRows::apply_blocks(const double* blocks, std::ptrdiff_t stride, double* out) const {
  apply_any(*this, 0, rows(), blocks, stride, out);
}

void CompactRows::apply_row(int row, const double* blocks, std::ptrdiff_t stride,
                            double* out) const {
  EXPECTS(row >= 0 && row < rows());
  apply_any(*this, row, row + 1, blocks, stride, out);
}

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> CompactRows::apply(
    const Eigen::Matrix<double, D, Eigen::Dynamic>& points) const {
  EXPECTS(points.cols() == columns_);
  Eigen::Matrix<double, D, Eigen::Dynamic> result(D, rows());
  apply_blocks(points.data(), D, result.data());
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
