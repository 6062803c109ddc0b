#include "kernel/numerics/frontal_factor.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <Eigen/OrderingMethods>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {
namespace {

constexpr int kBlock = 32;       // pivots that are eliminated before the rest of a front is updated
constexpr int kSmallFront = 24;  // rows below which plain loops are faster than blocks
constexpr double kMoreZeros = 0.3;  // share of a merged front's columns that may be padding
constexpr int kTinyFront = 8;       // pivots below which a front is merged more readily
constexpr double kMostZerosOfTiny = 0.6;

// Row patterns of the strict lower triangle of the permuted matrix, column by column.
std::vector<std::vector<int>> permuted_columns(const Eigen::SparseMatrix<double>& lower,
                                               const std::vector<int>& place) {
  std::vector<std::vector<int>> columns(place.size());
  for (int c = 0; c < lower.outerSize(); ++c) {
    for (Eigen::SparseMatrix<double>::InnerIterator it(lower, c); it; ++it) {
      const int a = place[index(static_cast<int>(it.row()))];
      const int b = place[index(c)];
      if (a != b) columns[index(std::min(a, b))].push_back(std::max(a, b));
    }
  }
  for (auto& rows : columns) std::sort(rows.begin(), rows.end());
  return columns;
}

// Liu's algorithm with path compression on the rows of the lower triangle.
std::vector<int> elimination_tree(const std::vector<std::vector<int>>& columns) {
  const int n = static_cast<int>(columns.size());
  std::vector<std::vector<int>> by_row(columns.size());
  for (int c = 0; c < n; ++c) {
    for (const int r : columns[index(c)]) by_row[index(r)].push_back(c);
  }
  std::vector<int> parent(columns.size(), -1);
  std::vector<int> ancestor(columns.size(), -1);
  for (int r = 0; r < n; ++r) {
    for (int c : by_row[index(r)]) {
      while (c != -1 && c < r) {
        const int next = std::exchange(ancestor[index(c)], r);
        if (next == -1) parent[index(c)] = r;
        c = next;
      }
    }
  }
  return parent;
}

// The place of each node in an order in which children come right before their parents.
std::vector<int> postorder(const std::vector<int>& parent) {
  const int n = static_cast<int>(parent.size());
  std::vector<std::vector<int>> children(parent.size());
  std::vector<int> stack;
  for (int k = n - 1; k >= 0; --k) {
    if (parent[index(k)] < 0) {
      stack.push_back(k);
    } else {
      children[index(parent[index(k)])].push_back(k);
    }
  }
  std::vector<int> place(parent.size());
  int next = n;
  // Parents are met first: places are given from the end.
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    place[index(node)] = --next;
    for (const int child : children[index(node)]) stack.push_back(child);
  }
  return place;
}

// Eliminates the first columns of a front's lower triangle, as many as `diagonal` has. `room`
// is overwritten.
bool eliminate(Eigen::Map<Eigen::MatrixXd> F, Eigen::Map<Eigen::VectorXd> diagonal,
               std::vector<double>& room) {
  const int size = static_cast<int>(F.rows());
  const int pivots = static_cast<int>(diagonal.size());
  for (int first = 0; first < pivots; first += kBlock) {
    const int count = std::min(kBlock, pivots - first);
    const int end = first + count;
    for (int k = first; k < end; ++k) {
      const double pivot = F(k, k);
      if (!std::isfinite(pivot) || pivot == 0) return false;
      diagonal(k) = pivot;
      const int below = size - k - 1;
      F.col(k).tail(below) /= pivot;
      // The other columns of the block only.
      for (int j = k + 1; j < end; ++j) {
        F.col(j).tail(size - j) -= (F(j, k) * pivot) * F.col(k).tail(size - j);
      }
    }
    const int rest = size - end;
    if (rest == 0) continue;
    const auto L = F.block(end, first, rest, count);
    room.resize(std::max(room.size(), index(rest) * index(count)));
    Eigen::Map<Eigen::MatrixXd> scaled(room.data(), rest, count);
    scaled.noalias() = L * diagonal.segment(first, count).asDiagonal();
    if (rest < kSmallFront) {
      for (int j = 0; j < rest; ++j) {
        F.col(end + j).tail(rest - j).noalias() -=
            L.bottomRows(rest - j) * scaled.row(j).transpose();
      }
    } else {
      F.bottomRightCorner(rest, rest).triangularView<Eigen::Lower>() -= L * scaled.transpose();
    }
  }
  return true;
}

}  // namespace

FrontalFactor::FrontalFactor(const Eigen::SparseMatrix<double>& lower) {
  EXPECTS(lower.rows() == lower.cols() && lower.isCompressed());
  find_order(lower);
  find_fronts(lower);
  place_entries(lower);
}

void FrontalFactor::find_order(const Eigen::SparseMatrix<double>& lower) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  // order.indices()(k) is the row that is eliminated k-th.
  place_.resize(index(static_cast<int>(lower.rows())));
  for (int k = 0; k < static_cast<int>(lower.rows()); ++k) place_[index(order.indices()(k))] = k;
  const std::vector<int> after = postorder(elimination_tree(permuted_columns(lower, place_)));
  for (int& p : place_) p = after[index(p)];
}

void FrontalFactor::find_fronts(const Eigen::SparseMatrix<double>& lower) {
  std::vector<std::vector<int>> below = permuted_columns(lower, place_);
  const int n = static_cast<int>(below.size());
  // Patterns of L: a column hands its pattern to its parent, the first row below it.
  for (int c = 0; c < n; ++c) {
    auto& rows = below[index(c)];
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    if (rows.empty()) continue;
    auto& of_parent = below[index(rows.front())];
    std::vector<int> both;
    both.reserve(of_parent.size() + rows.size());
    // The parent's own list may still hold repeats: they go when its turn comes.
    std::merge(rows.begin() + 1, rows.end(), of_parent.begin(), of_parent.end(),
               std::back_inserter(both));
    both.erase(std::unique(both.begin(), both.end()), both.end());
    of_parent = std::move(both);
  }
  // Fronts from the left; a front joins the one before it if that hands on to it and little is
  // padded. zeros: entries of the front that are padding.
  std::vector<double> zeros;
  for (int c = 0; c < n; ++c) {
    Front front;
    front.pivots = 1;
    front.rows = {c};
    front.rows.insert(front.rows.end(), below[index(c)].begin(), below[index(c)].end());
    double padding = 0;
    while (!fronts_.empty()) {
      const Front& before = fronts_.back();
      const int last = before.rows[index(before.pivots - 1)];
      const bool hands_on = before.size() > before.pivots &&
                            before.rows[index(before.pivots)] == front.rows.front() &&
                            last + 1 == front.rows.front();
      if (!hands_on) break;
      const int pivots = before.pivots + front.pivots;
      const double added =
          static_cast<double>(before.pivots) * (front.size() + before.pivots - before.size());
      const double all = padding + zeros.back() + added;
      const double area = static_cast<double>(pivots) * (before.pivots + front.size());
      const double most = pivots <= kTinyFront ? kMostZerosOfTiny : kMoreZeros;
      if (all > most * area && added > 0) break;
      std::vector<int> rows(before.rows.begin(), before.rows.begin() + before.pivots);
      rows.insert(rows.end(), front.rows.begin(), front.rows.end());
      front.rows = std::move(rows);
      front.pivots = pivots;
      padding = all;
      fronts_.pop_back();
      zeros.pop_back();
    }
    fronts_.push_back(std::move(front));
    zeros.push_back(padding);
  }
}

void FrontalFactor::place_entries(const Eigen::SparseMatrix<double>& lower) {
  std::vector<int> front_of(place_.size());
  for (int f = 0; f < static_cast<int>(fronts_.size()); ++f) {
    for (int k = 0; k < fronts_[index(f)].pivots; ++k) front_of[index(fronts_[index(f)].rows[index(k)])] = f;
  }
  const auto row_in = [](const Front& front, int row) {
    const auto found = std::lower_bound(front.rows.begin(), front.rows.end(), row);
    return static_cast<int>(found - front.rows.begin());
  };
  for (int c = 0; c < lower.outerSize(); ++c) {
    for (int k = lower.outerIndexPtr()[c]; k < lower.outerIndexPtr()[c + 1]; ++k) {
      const int a = place_[index(lower.innerIndexPtr()[k])];
      const int b = place_[index(c)];
      Front& front = fronts_[index(front_of[index(std::min(a, b))])];
      const std::ptrdiff_t column = row_in(front, std::min(a, b));
      front.entries.push_back({k, column * front.size() + row_in(front, std::max(a, b))});
    }
  }
  std::size_t panels = 0, pivots = 0;
  for (int f = 0; f < static_cast<int>(fronts_.size()); ++f) {
    Front& front = fronts_[index(f)];
    front.panel = std::exchange(panels, panels + index(front.size()) * index(front.pivots));
    front.first = std::exchange(pivots, pivots + index(front.pivots));
    if (front.below() == 0) continue;
    front.parent = front_of[index(front.rows[index(front.pivots)])];
    fronts_[index(front.parent)].children.push_back(f);
    for (int k = front.pivots; k < front.size(); ++k) {
      front.rows_in_parent.push_back(row_in(fronts_[index(front.parent)], front.rows[index(k)]));
    }
  }
  panels_.resize(panels);
  diagonal_.resize(pivots);
}

bool FrontalFactor::factor(const Eigen::SparseMatrix<double>& lower) {
  const double* values = lower.valuePtr();
  waiting_.clear();
  for (const Front& front : fronts_) {
    const int size = front.size();
    work_.assign(index(size) * index(size), 0.0);
    Eigen::Map<Eigen::MatrixXd> F(work_.data(), size, size);
    for (const Entry& e : front.entries) work_[static_cast<std::size_t>(e.place)] = values[e.value];
    // Children were met right before, each with all of its own: theirs lie on top.
    std::size_t all = 0;
    for (const int c : front.children)
      all += index(fronts_[index(c)].below()) * index(fronts_[index(c)].below());
    const double* update = waiting_.data() + (waiting_.size() - all);
    for (const int c : front.children) {
      const Front& child = fronts_[index(c)];
      const int count = child.below();
      for (int j = 0; j < count; ++j) {
        const double* from = update + j * count;
        double* to = F.col(child.rows_in_parent[index(j)]).data();
        for (int i = j; i < count; ++i) to[child.rows_in_parent[index(i)]] += from[i];
      }
      update += count * count;
    }
    waiting_.resize(waiting_.size() - all);
    if (!eliminate(F, {diagonal_.data() + front.first, front.pivots}, scaled_)) return false;
    const auto end = work_.begin() + static_cast<std::ptrdiff_t>(size) * front.pivots;
    std::copy(work_.begin(), end, panels_.begin() + static_cast<std::ptrdiff_t>(front.panel));
    for (int j = front.pivots; j < size; ++j) {
      waiting_.insert(waiting_.end(), &F(front.pivots, j), F.col(j).data() + size);
    }
  }
  return true;
}

Eigen::VectorXd FrontalFactor::solve(const Eigen::VectorXd& right) const {
  Eigen::VectorXd x(right.size());
  for (Eigen::Index k = 0; k < right.size(); ++k) x(place_[static_cast<std::size_t>(k)]) = right(k);
  Eigen::VectorXd part(right.size());
  for (const Front& front : fronts_) {
    const Panel L = panel_of(front);
    auto own = x.segment(front.rows.front(), front.pivots);
    L.topRows(front.pivots).triangularView<Eigen::UnitLower>().solveInPlace(own);
    const int count = front.below();
    part.head(count).noalias() = L.bottomRows(count) * own;
    for (int i = 0; i < count; ++i) x(front.rows[index(front.pivots + i)]) -= part(i);
  }
  for (auto front = fronts_.rbegin(); front != fronts_.rend(); ++front) {
    const Panel L = panel_of(*front);
    auto own = x.segment(front->rows.front(), front->pivots);
    own.array() /= Eigen::Map<const Eigen::ArrayXd>(diagonal_.data() + front->first, front->pivots);
    const int count = front->below();
    for (int i = 0; i < count; ++i) part(i) = x(front->rows[index(front->pivots + i)]);
    own.noalias() -= L.bottomRows(count).transpose() * part.head(count);
    L.topRows(front->pivots).triangularView<Eigen::UnitLower>().transpose().solveInPlace(own);
  }
  Eigen::VectorXd result(right.size());
  for (Eigen::Index k = 0; k < right.size(); ++k) {
    result(k) = x(place_[static_cast<std::size_t>(k)]);
  }
  return result;
}

}  // namespace angiospline
