// L D L' of a sparse symmetric matrix by dense fronts, its pattern analysed once.
#pragma once

#include <cstddef>
#include <vector>

#include <Eigen/Core>
#include <Eigen/SparseCore>

namespace angiospline {

// For matrices that have L D L' in every order, such as definite and quasi-definite ones
// (Vanderbei, "Symmetric quasidefinite matrices", SIAM J. Optim. 5, 1995): there is no pivoting.
// Columns of nearly equal pattern are eliminated together in dense fronts (Duff & Reid, "The
// multifrontal solution of indefinite sparse symmetric linear equations", ACM TOMS 9, 1983), in
// approximate minimum degree order.
//
// Why not a library: Eigen's SimplicialLDLT works column by column and takes several times as long
// (docs/kernel.md has the figures); the supernodal part of CHOLMOD is under the GPL and has L L'
// only, so no indefinite matrices.
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
    std::size_t entries_end = 0;      // where its entries of the matrix end
    std::vector<int> rows_in_parent;  // of the rows after the pivots
    std::vector<int> children;
    std::size_t panel = 0;  // where its columns of L begin, each as long as the front
    std::size_t first = 0;  // of its diagonal

    int size() const { return static_cast<int>(rows.size()); }
    int below() const { return size() - pivots; }
  };
  using Panel = Eigen::Map<const Eigen::MatrixXd>;

  Panel panel_of(const Front& front) const {
    return {panels_.data() + front.panel, front.size(), front.pivots};
  }

  struct Gathered;
  struct Columns;
  template <typename Group, typename Other>
  Gathered gather(const Eigen::SparseMatrix<double>& lower, Group&& group, Other&& other) const;
  Columns find_order(const Eigen::SparseMatrix<double>& lower);
  void find_fronts(const Columns& columns);
  void find_rows(const Columns& columns, const Gathered& by_column);
  void place_entries(const Gathered& by_column);

  std::vector<int> place_;      // of each row in the order of elimination
  std::vector<Front> fronts_;   // children before parents
  std::vector<Entry> entries_;  // front after front
  std::vector<double> panels_, diagonal_;
  // While factoring: the front at work, the updates that wait for their parents (the last front's
  // on top), and L D of a block.
  std::vector<double> work_, waiting_, scaled_;
};

}  // namespace angiospline
