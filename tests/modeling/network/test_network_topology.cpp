#include <map>

#include <gtest/gtest.h>

#include "modeling/network/network_topology.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

struct Sample {
  const char* name;
  SurfaceNetwork network;
  int characteristic;  // of all closed surfaces: 2 for each without a handle
  int components;
};

std::vector<Sample> all_samples() {
  SurfaceNetwork two = samples::tube();
  append(two, samples::torus());
  return {{"tube", samples::tube(), 2, 1},
          {"T-vertex", samples::tube_with_t_vertex(), 2, 1},
          {"quarters", crafted::tube_of_quarters(1, 6), 2, 1},
          {"one patch", crafted::one_patch_tube(1, 5), 2, 1},
          {"torus", samples::torus(), 0, 1},
          {"two", two, 2, 2}};
}

int from(const NetworkTopology& t, const LoopEdge& step) {
  const NetworkEdge& edge = t.edges[static_cast<std::size_t>(step.edge)];
  return step.forward ? edge.first_vertex : edge.last_vertex;
}
int to(const NetworkTopology& t, const LoopEdge& step) {
  return from(t, {step.edge, step.use, !step.forward});
}

TEST(NetworkTopology, HasEulersCharacteristicOnceRimsAreClosed) {
  for (const Sample& s : all_samples()) {
    SCOPED_TRACE(s.name);
    const auto t = network_topology(s.network);
    ASSERT_TRUE(t) << t.error().message();
    const auto faces = static_cast<int>(s.network.patches.size() + s.network.rims.size());
    EXPECT_EQ(t->vertices_mm.cols() - std::ssize(t->edges) + faces, s.characteristic);
    EXPECT_EQ(t->component_count, s.components);
  }
}

TEST(NetworkTopology, RunsEveryLoopHeadToTailAndEveryEdgeOnceEachWay) {
  int loops = 0;
  for (const Sample& s : all_samples()) {
    SCOPED_TRACE(s.name);
    const auto t = network_topology(s.network);
    ASSERT_TRUE(t);
    std::map<int, std::pair<int, int>> uses;  // forward, backward
    const auto follow = [&](const std::vector<LoopEdge>& loop) {
      ++loops;
      for (std::size_t k = 0; k < loop.size(); ++k) {
        EXPECT_EQ(to(*t, loop[k]), from(*t, loop[(k + 1) % loop.size()]));
        auto& [forward, backward] = uses[loop[k].edge];
        ++(loop[k].forward ? forward : backward);
      }
    };
    for (const auto& loop : t->patch_loops) follow(loop);
    for (const auto& loop : t->rim_loops) follow(loop);
    ASSERT_EQ(uses.size(), t->edges.size());
    for (const auto& [edge, count] : uses) EXPECT_EQ(count, std::pair(1, 1)) << edge;
  }
  EXPECT_GE(loops, 30);
}

TEST(NetworkTopology, PutsVerticesWhereTheirCornersAre) {
  for (const Sample& s : all_samples()) {
    SCOPED_TRACE(s.name);
    const auto t = network_topology(s.network);
    ASSERT_TRUE(t);
    for (const NetworkEdge& edge : t->edges) {
      const Side& side = edge.sides[0];
      const auto surface = patch_surface(s.network, side.patch);
      const Patch& patch = s.network.patches[static_cast<std::size_t>(side.patch)];
      for (const bool last : {false, true}) {
        const Vec2 uv = side_parameters(patch, side.side, last ? side.to : side.from);
        const int v = last ? edge.last_vertex : edge.first_vertex;
        EXPECT_LT((surface.at(uv.x(), uv.y()) - t->vertices_mm.col(v)).norm(), 1e-12);
      }
    }
    for (const double gap : t->vertex_gaps_mm) EXPECT_LT(gap, 1e-12);
  }
}

TEST(NetworkTopology, MapsParametersOfBothSidesOntoTheSamePoint) {
  for (const Sample& s : all_samples()) {
    SCOPED_TRACE(s.name);
    const auto t = network_topology(s.network);
    ASSERT_TRUE(t);
    for (const NetworkEdge& edge : t->edges) {
      if (!edge.is_join()) continue;
      const auto point = [&](int k, double at) {
        const Side& side = edge.sides[static_cast<std::size_t>(k)];
        const Vec2 uv =
            side_parameters(s.network.patches[static_cast<std::size_t>(side.patch)], side.side, at);
        return patch_surface(s.network, side.patch).at(uv.x(), uv.y());
      };
      const Side& a = edge.sides[0];
      for (const double share : {0.0, 0.37, 1.0}) {
        const double at = a.from + share * (a.to - a.from);
        EXPECT_LT((point(0, at) - point(1, second_parameter(edge, at))).norm(), 1e-12);
      }
    }
  }
}

TEST(NetworkTopology, NamesNormalsThatDisagree) {
  // The torus's last patch turned over: its rows against its columns.
  SurfaceNetwork torus = samples::torus();
  for (Join& join : torus.joins) {
    if (join.a.patch == 3 || join.b.patch == 3) join.reversed = !join.reversed;
  }
  const auto t = network_topology(torus);
  ASSERT_FALSE(t);
  EXPECT_NE(t.error().message().find("patch 3"), std::string::npos) << t.error().message();
}

}  // namespace
}  // namespace angiospline
