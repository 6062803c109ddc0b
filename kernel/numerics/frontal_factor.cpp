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

// The place of each node in an order in which children come right before their parents.
std::vector<int> postorder(const std::vector<int>& parent) {
  const int n = static_cast<int>(parent.size());
  std::vector<int> child(parent.size(), -1), sibling(parent.size(), -1);  // the highest first
  for (int k = 0; k < n; ++k) {
    if (parent[index(k)] < 0) continue;
    sibling[index(k)] = std::exchange(child[index(parent[index(k)])], k);
  }
  std::vector<int> stack;
  for (int k = n - 1; k >= 0; --k) {
    if (parent[index(k)] < 0) stack.push_back(k);
  }

  // Parents are met first: places are given from the end.
  std::vector<int> place(parent.size());
  int next = n;
  while (!stack.empty()) {
    const int node = stack.back();
    stack.pop_back();
    place[index(node)] = --next;
    for (int c = child[index(node)]; c >= 0; c = sibling[index(c)]) stack.push_back(c);
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

    // The rest of the front at once: F -= L D L' of the block.
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

// Entries of the lower triangle in the order of elimination, gathered by row or by column.
struct FrontalFactor::Gathered {
  std::vector<int> begin;  // of each group, and the end
  std::vector<int> other;  // the column of an entry gathered by row, the row of one by column
  std::vector<int> value;  // its place among the values of the matrix
};

// What elimination leaves: the first row below the diagonal of each column of L, or -1, and how
// many there are.
struct FrontalFactor::Columns {
  std::vector<int> parent;
  std::vector<int> below;
};

// `group` and `other` choose from (column, row).
template <typename Group, typename Other>
FrontalFactor::Gathered FrontalFactor::gather(const Eigen::SparseMatrix<double>& lower,
                                              Group&& group, Other&& other) const {
  const auto for_each = [&](auto&& f) {
    for (int c = 0; c < lower.outerSize(); ++c) {
      for (int k = lower.outerIndexPtr()[c]; k < lower.outerIndexPtr()[c + 1]; ++k) {
        const auto [column, row] =
            std::minmax(place_[index(lower.innerIndexPtr()[k])], place_[index(c)]);
        f(k, column, row);
      }
    }
  };
  Gathered all;
  all.begin.assign(place_.size() + 1, 0);
  for_each([&](int, int column, int row) { ++all.begin[index(group(column, row)) + 1]; });
  std::partial_sum(all.begin.begin(), all.begin.end(), all.begin.begin());

  std::vector<int> next(all.begin.begin(), all.begin.end() - 1);
  all.other.resize(index(lower.nonZeros()));
  all.value.resize(index(lower.nonZeros()));
  for_each([&](int k, int column, int row) {
    const std::size_t at = index(next[index(group(column, row))]++);
    all.other[at] = other(column, row);
    all.value[at] = k;
  });
  return all;
}

FrontalFactor::FrontalFactor(const Eigen::SparseMatrix<double>& lower) {
  EXPECTS(lower.rows() == lower.cols() && lower.isCompressed());
  const Columns columns = find_order(lower);
  find_fronts(columns);
  const Gathered by_column = gather(
      lower, [](int column, int) { return column; }, [](int, int row) { return row; });
  find_rows(columns, by_column);
  place_entries(by_column);
}

FrontalFactor::Columns FrontalFactor::find_order(const Eigen::SparseMatrix<double>& lower) {
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(lower.selfadjointView<Eigen::Lower>(), order);
  // order.indices()(k) is the row that is eliminated k-th.
  const int n = static_cast<int>(lower.rows());
  place_.resize(index(n));
  for (int k = 0; k < n; ++k) place_[index(order.indices()(k))] = k;

  // Row r of L holds the columns on the ways from the entries of row r up the elimination tree,
  // which grows on the way (Liu, "The role of elimination trees in sparse factorization", SIAM J.
  // Matrix Anal. Appl. 11, 1990).
  const Gathered by_row = gather(
      lower, [](int, int row) { return row; }, [](int column, int) { return column; });
  std::vector<int> parent(index(n), -1), below(index(n), 0), met_by(index(n), -1);
  for (int r = 0; r < n; ++r) {
    met_by[index(r)] = r;
    for (int e = by_row.begin[index(r)]; e < by_row.begin[index(r) + 1]; ++e) {
      for (int c = by_row.other[index(e)]; met_by[index(c)] != r; c = parent[index(c)]) {
        if (parent[index(c)] < 0) parent[index(c)] = r;
        ++below[index(c)];
        met_by[index(c)] = r;
      }
    }
  }

  // Renumbering in postorder changes neither the tree nor the counts.
  const std::vector<int> after = postorder(parent);
  for (int& p : place_) p = after[index(p)];
  Columns columns{std::vector<int>(index(n), -1), std::vector<int>(index(n))};
  for (int c = 0; c < n; ++c) {
    const int p = parent[index(c)];
    if (p >= 0) columns.parent[index(after[index(c)])] = after[index(p)];
    columns.below[index(after[index(c)])] = below[index(c)];
  }
  return columns;
}

// Fronts from the left; a front joins the one before it if that hands on to it and little is
// padded. Of the rows of a front only their number counts here: below its pivots they are those of
// its last column.
void FrontalFactor::find_fronts(const Columns& columns) {
  struct Merged {
    int pivots;
    int size;
    double zeros;  // entries that are padding
  };
  std::vector<Merged> merged;
  for (int c = 0; c < static_cast<int>(columns.below.size()); ++c) {
    Merged front{1, 1 + columns.below[index(c)], 0.0};
    while (!merged.empty()) {
      const Merged& before = merged.back();
      const int first = c + 1 - front.pivots;
      if (columns.parent[index(first - 1)] != first) break;
      const int pivots = before.pivots + front.pivots;
      const double added =
          static_cast<double>(before.pivots) * (front.size + before.pivots - before.size);
      const double all = front.zeros + before.zeros + added;
      const double area = static_cast<double>(pivots) * (before.pivots + front.size);
      const double most = pivots <= kTinyFront ? kMostZerosOfTiny : kMoreZeros;
      if (all > most * area && added > 0) break;
      front = {pivots, before.pivots + front.size, all};
      merged.pop_back();
    }
    merged.push_back(front);
  }

  fronts_.resize(merged.size());
  int first = 0;
  for (std::size_t f = 0; f < merged.size(); ++f) {
    fronts_[f].pivots = merged[f].pivots;
    fronts_[f].rows.reserve(index(merged[f].size));
    for (int k = 0; k < merged[f].pivots; ++k) fronts_[f].rows.push_back(first++);
  }
}

// A front's rows below its pivots: those of its columns and those that its children hand on.
void FrontalFactor::find_rows(const Columns& columns, const Gathered& by_column) {
  std::vector<int> front_of(place_.size());
  for (std::size_t f = 0; f < fronts_.size(); ++f) {
    for (const int row : fronts_[f].rows) front_of[index(row)] = static_cast<int>(f);
  }

  std::vector<int> met_by(place_.size(), -1);
  for (int f = 0; f < static_cast<int>(fronts_.size()); ++f) {
    Front& front = fronts_[index(f)];
    const int first = front.rows.front(), last = front.rows.back();
    const auto meet = [&](int row) {
      if (row > last && std::exchange(met_by[index(row)], f) != f) front.rows.push_back(row);
    };
    for (int e = by_column.begin[index(first)]; e < by_column.begin[index(last) + 1]; ++e) {
      meet(by_column.other[index(e)]);
    }
    for (const int c : front.children) {
      const Front& child = fronts_[index(c)];
      std::for_each(child.rows.begin() + child.pivots, child.rows.end(), meet);
    }
    std::sort(front.rows.begin() + front.pivots, front.rows.end());

    const int parent = columns.parent[index(last)];
    if (parent >= 0) fronts_[index(front_of[index(parent)])].children.push_back(f);
  }
}

void FrontalFactor::place_entries(const Gathered& by_column) {
  std::vector<int> row_in_front(place_.size());
  std::size_t panels = 0, pivots = 0;
  for (Front& front : fronts_) {
    front.panel = std::exchange(panels, panels + index(front.size()) * index(front.pivots));
    front.first = std::exchange(pivots, pivots + index(front.pivots));
    for (int i = 0; i < front.size(); ++i) row_in_front[index(front.rows[index(i)])] = i;

    for (int k = 0; k < front.pivots; ++k) {
      const std::size_t column = index(front.rows[index(k)]);
      for (int e = by_column.begin[column]; e < by_column.begin[column + 1]; ++e) {
        const std::ptrdiff_t row = row_in_front[index(by_column.other[index(e)])];
        entries_.push_back({by_column.value[index(e)], k * std::ptrdiff_t{front.size()} + row});
      }
    }
    front.entries_end = entries_.size();

    for (const int c : front.children) {
      Front& child = fronts_[index(c)];
      for (int k = child.pivots; k < child.size(); ++k) {
        child.rows_in_parent.push_back(row_in_front[index(child.rows[index(k)])]);
      }
    }
  }
  panels_.resize(panels);
  diagonal_.resize(pivots);
}

bool FrontalFactor::factor(const Eigen::SparseMatrix<double>& lower) {
  const double* values = lower.valuePtr();
  waiting_.clear();
  std::size_t entry = 0;
  for (const Front& front : fronts_) {
    const int size = front.size();
    work_.assign(index(size) * index(size), 0.0);
    Eigen::Map<Eigen::MatrixXd> F(work_.data(), size, size);
    for (; entry < front.entries_end; ++entry)
      work_[index(entries_[entry].place)] = values[entries_[entry].value];

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

  // L y = b, front by front,
  Eigen::VectorXd part(right.size());
  for (const Front& front : fronts_) {
    const Panel L = panel_of(front);
    auto own = x.segment(front.rows.front(), front.pivots);
    L.topRows(front.pivots).triangularView<Eigen::UnitLower>().solveInPlace(own);
    const int count = front.below();
    part.head(count).noalias() = L.bottomRows(count) * own;
    for (int i = 0; i < count; ++i) x(front.rows[index(front.pivots + i)]) -= part(i);
  }

  // then D L' x = y from the last front to the first.
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
