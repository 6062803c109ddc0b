// L D L' of a sparse symmetric matrix by dense fronts, its pattern analysed once.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace angiospline {

// For matrices that have L D L' in every order, such as definite and quasi-definite ones: there is
// no pivoting. Columns of nearly equal pattern are eliminated together in dense fronts (Duff &
// Reid, "The multifrontal solution of indefinite sparse symmetric linear equations", ACM TOMS 9,
// 1983), in approximate minimum degree order.
class FrontalFactor {
 public:
  // Of the lower triangle in compressed form; every diagonal entry must be in the pattern.
  explicit FrontalFactor(const Eigen::SparseMatrix<double>& lower);

  // Of the values of `lower`, which has the pattern that was analysed. False when a pivot vanishes
  // or is not finite.
  bool factor(const Eigen::SparseMatrix<double>& lower);

  Eigen::VectorXd solve(const Eigen::VectorXd& right) const;

 private:
  // An entry of the matrix and its place in a front.
  struct Entry {
    std::ptrdiff_t value;
    std::ptrdiff_t place;
  };
  // Columns first .. first + pivots - 1 of the permuted matrix; `rows` starts with them.
  struct Front {
    int pivots = 0;
    std::vector<int> rows;
    std::vector<Entry> entries;
    int parent = -1;
    std::vector<int> rows_in_parent;  // of the rows after the pivots
    std::vector<int> children;
    Eigen::MatrixXd matrix;  // lower triangle; L below the pivots once factored
    Eigen::VectorXd diagonal;

    int size() const { return static_cast<int>(rows.size()); }
  };

  void find_order(const Eigen::SparseMatrix<double>& lower);
  void find_fronts(const Eigen::SparseMatrix<double>& lower);
  void place_entries(const Eigen::SparseMatrix<double>& lower);

  std::vector<int> place_;     // of each row in the order of elimination
  std::vector<Front> fronts_;  // children before parents
};

}  // namespace angiospline
