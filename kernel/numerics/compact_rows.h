// A sparse matrix whose rows are short runs of consecutive entries: refinement and collocation.
#pragma once

#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace angiospline {

// Row i holds `width` entries for columns first[i] .. first[i] + width - 1; everything else is
// zero. Entries that would fall outside 0 .. columns - 1 are not stored: first[i] is moved so that
// the run fits. Memory and all operations are linear in rows * width.
class CompactRows {
 public:
  // All entries zero, all runs at column 0. Requires 1 <= width <= columns.
  CompactRows(int rows, int columns, int width);

  // Another matrix in the memory of this one; rows that are not set then have no meaning.
  void reshape(int rows, int columns, int width);

  int rows() const { return static_cast<int>(first_.size()); }
  int columns() const { return columns_; }
  int width() const { return width_; }
  int first(int row) const { return first_[static_cast<std::size_t>(row)]; }
  const double* row(int i) const {
    return values_.data() + static_cast<std::ptrdiff_t>(i) * width_;
  }

  // Stores a run of `count` entries that starts at `column`; columns outside the matrix are
  // dropped. Requires that what is left fits into `width` entries.
  void set_row(int row, int column, const double* entries, int count);

  // A X for X given by columns: column r of the result is sum_j A(r, j) * points.col(j).
  template <int D>
  Eigen::Matrix<double, D, Eigen::Dynamic> apply(
      const Eigen::Matrix<double, D, Eigen::Dynamic>& points) const;

  // The same with each "point" a block of `stride` consecutive doubles; `out` has rows() blocks.
  void apply_blocks(const double* blocks, std::ptrdiff_t stride, double* out) const;

  // One row of that: `out` is one block.
  void apply_row(int row, const double* blocks, std::ptrdiff_t stride, double* out) const;

  Eigen::SparseMatrix<double> to_sparse() const;  // explicit zeros are kept
  Eigen::MatrixXd to_dense() const;

 private:
  int columns_;
  int width_;
  std::vector<int> first_;
  std::vector<double> values_;
};

}  // namespace angiospline
