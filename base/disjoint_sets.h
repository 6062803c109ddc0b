// Classes of 0 .. n - 1 that only ever grow together.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <numeric>
#include <vector>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {

// A forest in which the root of a class is its lowest member, so that neither roots nor numbers
// depend on the order in which classes were joined. Cost: O(log n) amortised for root and join
// (path halving without ranks: Tarjan & van Leeuwen 1984), and on meshes and images close to O(1).
class DisjointSets {
 public:
  // `size` elements, each a class of its own.
  explicit DisjointSets(std::size_t size = 0) : parent_(size), count_(static_cast<int>(size)) {
    EXPECTS(size <= static_cast<std::size_t>(std::numeric_limits<int>::max()));
    std::iota(parent_.begin(), parent_.end(), 0);
  }

  // How many elements there are.
  std::size_t size() const { return parent_.size(); }

  // How many classes there are.
  int count() const { return count_; }

  // The new element, a class of its own: the number that size() was before.
  int add() {
    parent_.push_back(static_cast<int>(parent_.size()));
    ++count_;
    return parent_.back();
  }

  // The lowest member of i's class. Requires 0 <= i < size().
  int root(int i) {
    while (parent_[index(i)] != i) i = parent_[index(i)] = parent_[index(parent_[index(i)])];
    return i;
  }

  // Whether a and b were in two classes, which are one now. Requires 0 <= a, b < size().
  bool join(int a, int b) {
    a = root(a);
    b = root(b);
    if (a == b) return false;
    parent_[index(std::max(a, b))] = std::min(a, b);
    --count_;
    return true;
  }

  // Of each element the number of its class, 0 .. count() - 1 in the order of their lowest members.
  std::vector<int> numbers() {
    std::vector<int> number(parent_.size());
    int next = 0;
    for (int i = 0; i < static_cast<int>(parent_.size()); ++i) {
      const int r = root(i);
      number[index(i)] = r == i ? next++ : number[index(r)];
    }
    return number;
  }

 private:
  std::vector<int> parent_;  // of a root itself; else a lower member of the class
  int count_;
};

}  // namespace angiospline
