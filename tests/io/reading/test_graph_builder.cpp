#include <algorithm>
#include <random>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "io/reading/graph_builder.h"

namespace angiospline {
namespace {

GraphBuilder with_points(int count) {
  GraphBuilder builder("f");
  for (int k = 0; k < count; ++k) {
    std::string id("p");
    id += std::to_string(k);
    builder.add_point({std::move(id), Vec3(k, 0, 0), 1.0}, 10 + k);
  }
  return builder;
}

TEST(GraphBuilder, FindsPointsByTheirIdsOnceTheseAreRegistered) {
  GraphBuilder builder = with_points(3);
  EXPECT_FALSE(builder.find("p1"));
  for (int k = 0; k < 3; ++k) ASSERT_TRUE(builder.register_id(k, "twice"));
  EXPECT_EQ(builder.find("p1"), 1);
  EXPECT_FALSE(builder.find("p3"));
}

TEST(GraphBuilder, AnIdUsedTwiceIsAnErrorAtTheSecondLine) {
  GraphBuilder builder = with_points(1);
  ASSERT_TRUE(builder.register_id(0, "the id is used twice"));
  const int again = builder.add_point({"p0", Vec3::Zero(), 1.0}, 77);
  const auto unique = builder.register_id(again, "the id is used twice");
  ASSERT_FALSE(unique);
  EXPECT_EQ(unique.error().what, "the id is used twice");
  EXPECT_EQ(unique.error().where, "f:77");
  EXPECT_EQ(unique.error().value, "p0");
  EXPECT_EQ(builder.find("p0"), 0) << "the first keeps it";
}

TEST(GraphBuilder, AnEdgeNamesTheEndThatDoesNotExist) {
  GraphBuilder builder = with_points(2);
  for (int k = 0; k < 2; ++k) ASSERT_TRUE(builder.register_id(k, "twice"));
  ASSERT_TRUE(builder.add_edge("p1", "p0", 5, "rule"));
  EXPECT_EQ(builder.graph.edges, (std::vector<std::pair<int, int>>{{1, 0}}));
  EXPECT_EQ(builder.add_edge("p1", "q", 6, "rule").error().value, "q");
  EXPECT_EQ(builder.add_edge("q", "r", 6, "rule").error().value, "q") << "the first of two";
  builder.continue_in("g");
  EXPECT_EQ(builder.add_edge("p1", "q", 6, "rule").error().where, "g:6");
  EXPECT_EQ(builder.graph.edges.size(), 1u);
}

TEST(GraphBuilder, ParentsThatLeadToARootAreSoundAndCyclesAreNamed) {
  EXPECT_TRUE(with_points(4).check_parents({-1, 0, 1, 1}));
  const auto round = with_points(4).check_parents({-1, 3, 1, 2});
  ASSERT_FALSE(round);
  EXPECT_EQ(round.error().where, "f:11");
  EXPECT_EQ(round.error().value, "p1");
  EXPECT_FALSE(with_points(1).check_parents({0})) << "its own parent";
  EXPECT_TRUE(with_points(0).check_parents({}));
}

// Brute force: from each point, as many steps to the parent as there are points must end.
TEST(GraphBuilder, CyclesAreFoundExactlyWhereAWalkDoesNotEnd) {
  std::mt19937 random(1);
  int sound = 0, round = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const int count = 1 + static_cast<int>(random() % 8);
    std::vector<int> parent_of;
    for (int k = 0; k < count; ++k) {
      parent_of.push_back(static_cast<int>(random() % static_cast<unsigned>(count + 1)) - 1);
    }
    const bool ends = std::all_of(parent_of.begin(), parent_of.end(), [&](int p) {
      for (int step = 0; step < count && p >= 0; ++step) p = parent_of[static_cast<std::size_t>(p)];
      return p < 0;
    });
    EXPECT_EQ(with_points(count).check_parents(parent_of).has_value(), ends);
    ++(ends ? sound : round);
  }
  EXPECT_GT(sound, 50);
  EXPECT_GT(round, 50);
}

TEST(GraphBuilder, FinishesATreeThatSaysItsFile) {
  GraphBuilder builder = with_points(3);
  builder.graph.edges = {{0, 1}, {1, 2}};
  const auto tree = builder.finish({});
  ASSERT_TRUE(tree);
  EXPECT_EQ(tree->source, "f");
  EXPECT_EQ(tree->branches.size(), 1u);
}

}  // namespace
}  // namespace angiospline
