// Classes against a brute-force twin that relabels every element at each join.
#include <algorithm>
#include <set>
#include <vector>

#include <gtest/gtest.h>

#include "base/disjoint_sets.h"
#include "base/random.h"

namespace angiospline {
namespace {

// Of each element the lowest member of its class.
class RelabelledSets {
 public:
  explicit RelabelledSets(int size) {
    for (int i = 0; i < size; ++i) lowest_.push_back(i);
  }
  void join(int a, int b) {
    const int from = std::max(lowest_[index(a)], lowest_[index(b)]);
    const int to = std::min(lowest_[index(a)], lowest_[index(b)]);
    std::replace(lowest_.begin(), lowest_.end(), from, to);
  }
  const std::vector<int>& lowest() const { return lowest_; }
  int count() const {
    return static_cast<int>(std::set<int>(lowest_.begin(), lowest_.end()).size());
  }

 private:
  std::vector<int> lowest_;
};

TEST(DisjointSets, EveryElementIsAClassOfItsOwnAtFirst) {
  DisjointSets sets(4);
  EXPECT_EQ(sets.size(), 4U);
  EXPECT_EQ(sets.count(), 4);
  EXPECT_EQ(sets.numbers(), (std::vector<int>{0, 1, 2, 3}));
}

TEST(DisjointSets, NoElementsHaveNoClass) {
  DisjointSets sets;
  EXPECT_EQ(sets.count(), 0);
  EXPECT_TRUE(sets.numbers().empty());
}

TEST(DisjointSets, TheRootIsTheLowestMemberInWhateverOrderTheyWereJoined) {
  DisjointSets down(5), up(5);
  for (int i = 4; i > 0; --i) down.join(i, i - 1);
  for (int i = 0; i < 4; ++i) up.join(i + 1, i);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(down.root(i), 0);
    EXPECT_EQ(up.root(i), 0);
  }
}

TEST(DisjointSets, JoinSaysWhetherTwoClassesBecameOne) {
  DisjointSets sets(3);
  EXPECT_TRUE(sets.join(2, 1));
  EXPECT_FALSE(sets.join(1, 2));
  EXPECT_FALSE(sets.join(0, 0));
  EXPECT_EQ(sets.count(), 2);
}

TEST(DisjointSets, NumbersFollowTheLowestMembersOfClasses) {
  DisjointSets sets(6);
  sets.join(5, 1);
  sets.join(4, 2);
  EXPECT_EQ(sets.numbers(), (std::vector<int>{0, 1, 2, 3, 2, 1}));
}

TEST(DisjointSets, AnElementAddedLaterIsAClassOfItsOwn) {
  DisjointSets sets(2);
  sets.join(0, 1);
  EXPECT_EQ(sets.add(), 2);
  EXPECT_EQ(sets.count(), 2);
  sets.join(2, 1);
  EXPECT_EQ(sets.root(2), 0);
}

TEST(DisjointSets, RandomJoinsGiveTheClassesThatRelabellingGives) {
  Random random(20);
  for (int size = 1; size <= 60; ++size) {
    DisjointSets sets(index(size));
    RelabelledSets twin(size);
    for (int k = 0; k < size; ++k) {
      const int a = random.below(size), b = random.below(size);
      const bool apart = twin.lowest()[index(a)] != twin.lowest()[index(b)];
      EXPECT_EQ(sets.join(a, b), apart);
      twin.join(a, b);
    }
    ASSERT_EQ(sets.count(), twin.count());
    for (int i = 0; i < size; ++i) ASSERT_EQ(sets.root(i), twin.lowest()[index(i)]);
  }
}

}  // namespace
}  // namespace angiospline
