#include <algorithm>
#include <array>
#include <set>

#include <gtest/gtest.h>

#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/thinning.h"
#include "recovery/imaging/skeleton/vessel_graph.h"
#include "tests/shapes/printed_junctions.h"
#include "tests/shapes/small_masks.h"

namespace angiospline {
namespace {

using test::mask_of;

// A digital straight line, 26-connected without shortcuts.
void add_line(Mask& mask, const Voxel& a, const Voxel& b) {
  int steps = 0;
  for (std::size_t k = 0; k < 3; ++k) steps = std::max(steps, std::abs(b[k] - a[k]));
  for (int i = 0; i <= steps; ++i) {
    Voxel v{};
    for (std::size_t k = 0; k < 3; ++k)
      v[k] = a[k] + static_cast<int>(std::lround(double(i) * (b[k] - a[k]) / steps));
    mask[v] = 1;
  }
}

// The axis of the linked rings: the six printed junctions of figure 7.21 voxel by voxel, and from
// exit to exit twelve quarters, whose voxels the thesis does not print, as straight lines. Each
// exit is left along its own direction for three voxels so that lines do not touch near the
// junction.
Mask linked_rings_axis() {
  Mask mask = test::empty_mask({256, 256, 256});
  struct Exit {
    Voxel voxel, out;
    std::size_t junction, axis;
    int sign;
  };
  std::vector<Exit> exits;
  const std::vector<test::PrintedJunction> junctions = test::figure_7_21();
  for (std::size_t j = 0; j < junctions.size(); ++j) {
    for (const auto& [voxel, weight] : junctions[j].points) mask[voxel] = 1;
    for (const Voxel& e : junctions[j].exits) {
      std::size_t axis =
          0;  // the direction in which an exit leaves: the farthest from the main point
      for (std::size_t k = 1; k < 3; ++k)
        if (std::abs(e[k] - junctions[j].main[k]) > std::abs(e[axis] - junctions[j].main[axis]))
          axis = k;
      const int sign = e[axis] > junctions[j].main[axis] ? 1 : -1;
      Voxel out = e;
      out[axis] += 3 * sign;
      add_line(mask, e, out);
      exits.push_back({e, out, j, axis, sign});
    }
  }
  // An exit that leaves along +x meets the junction on the +x side, at the exit that comes from
  // here.
  const auto side = [&](std::size_t j) {
    const Voxel& m = junctions[j].main;
    for (std::size_t k = 0; k < 3; ++k)
      if (std::abs(m[k] - 128) > 50) return std::pair{k, m[k] > 128 ? 1 : -1};
    return std::pair{std::size_t{9}, 0};
  };
  for (const Exit& a : exits)
    for (const Exit& b : exits)
      if (a.junction < b.junction && side(b.junction) == std::pair{a.axis, a.sign} &&
          side(a.junction) == std::pair{b.axis, b.sign})
        add_line(mask, a.out, b.out);
  return mask;
}

TEST(VesselGraph, is_the_graph_of_figure_7_22_with_its_levels_parents_and_children) {
  const SkeletonLabels labels = label_skeleton(linked_rings_axis());
  ASSERT_EQ(labels.clusters.size(), 6U);
  const VesselGraph graph = vessel_graph(labels, {{129, 128, 33}});
  struct Row {
    Voxel voxel;
    int level;
    std::vector<int> parents, children;
  };
  const std::vector<Row> printed{
      {{129, 128, 33}, 0, {}, {1, 2, 3, 4}}, {{223, 129, 129}, 1, {0}, {2, 4, 5}},
      {{129, 33, 128}, 1, {0, 1}, {3, 5}},   {{33, 129, 128}, 1, {0, 2}, {4, 5}},
      {{129, 223, 128}, 1, {0, 1, 3}, {5}},  {{129, 129, 223}, 2, {1, 2, 3, 4}, {}},
  };
  ASSERT_EQ(graph.nodes.size(), printed.size());
  EXPECT_EQ(graph.arcs.size(), 12U);
  for (std::size_t n = 0; n < printed.size(); ++n) {
    EXPECT_EQ(graph.nodes[n].voxel, printed[n].voxel);
    EXPECT_EQ(graph.nodes[n].level, printed[n].level);
    EXPECT_EQ(graph.nodes[n].parents, printed[n].parents);
    EXPECT_EQ(graph.nodes[n].children, printed[n].children);
  }
}

// "There were seven multiple parents, but eight cycles were present": seven is the number of
// independent cycles, 12 arcs - 6 nodes + 1. The eight are the triangles that the quarters bound on
// the sphere (an octahedron's faces); one of them is the sum of the other seven.
TEST(VesselGraph, of_the_linked_rings_has_seven_multiple_parents_and_eight_triangles) {
  const VesselGraph graph = vessel_graph(label_skeleton(linked_rings_axis()), {{129, 128, 33}});
  EXPECT_EQ(graph.multiple_parent_count(), 7);
  EXPECT_EQ(graph.cycle_count(), 7);
  std::set<std::pair<int, int>> joined;
  for (const VesselArc& a : graph.arcs)
    joined.insert({std::min(a.from, a.to), std::max(a.from, a.to)});
  int triangles = 0;
  for (int a = 0; a < 6; ++a)
    for (int b = a + 1; b < 6; ++b)
      for (int c = b + 1; c < 6; ++c)
        triangles +=
            static_cast<int>(joined.count({a, b}) * joined.count({b, c}) * joined.count({a, c}));
  EXPECT_EQ(triangles, 8);
}

// The nodes and arcs of figure 7.18, in an order unlike the printed one.
VesselGraph figure_7_18() {
  const std::vector<Voxel> nodes{{153, 126, 147}, {129, 123, 121}, {149, 103, 103}, {135, 131, 145},
                                 {151, 99, 98},   {164, 101, 110}, {109, 115, 147}, {151, 132, 152},
                                 {158, 121, 151}, {118, 99, 96}};
  const std::vector<std::pair<int, int>> arcs{{9, 1}, {1, 2}, {3, 1}, {2, 4}, {2, 5},
                                              {6, 3}, {3, 7}, {7, 8}, {0, 7}};
  VesselGraph graph;
  graph.grid.size = {200, 200, 200};
  for (const Voxel& v : nodes) {
    graph.nodes.emplace_back();
    graph.nodes.back().voxel = v;
  }
  for (const auto& [a, b] : arcs) {
    const auto number = static_cast<int>(graph.arcs.size());
    graph.nodes[static_cast<std::size_t>(a)].arcs.push_back(number);
    graph.nodes[static_cast<std::size_t>(b)].arcs.push_back(number);
    graph.arcs.push_back(
        {a, b, {nodes[static_cast<std::size_t>(a)], nodes[static_cast<std::size_t>(b)]}});
  }
  return graph;
}

// The printed table but for one slip: it calls node 2 "0" where the node is listed itself.
TEST(VesselGraph, prints_the_table_of_figure_7_18) {
  EXPECT_EQ(level_order_table(rooted_at(figure_7_18(), {9})),
            "Type       X    Y    Z  Level  Node\n"
            "\n"
            "Node     118   99   96      0     0\n"
            "Child    129  123  121      1     1\n"
            "\n"
            "Node     129  123  121      1     1\n"
            "Parent   118   99   96      0     0\n"
            "Child    149  103  103      2     2\n"
            "Child    135  131  145      2     3\n"
            "\n"
            "Node     149  103  103      2     2\n"
            "Parent   129  123  121      1     1\n"
            "Child    151   99   98      3     4\n"
            "Child    164  101  110      3     5\n"
            "\n"
            "Node     135  131  145      2     3\n"
            "Parent   129  123  121      1     1\n"
            "Child    109  115  147      3     6\n"
            "Child    151  132  152      3     7\n"
            "\n"
            "Node     151   99   98      3     4\n"
            "Parent   149  103  103      2     2\n"
            "\n"
            "Node     164  101  110      3     5\n"
            "Parent   149  103  103      2     2\n"
            "\n"
            "Node     109  115  147      3     6\n"
            "Parent   135  131  145      2     3\n"
            "\n"
            "Node     151  132  152      3     7\n"
            "Parent   135  131  145      2     3\n"
            "Child    158  121  151      4     8\n"
            "Child    153  126  147      4     9\n"
            "\n"
            "Node     158  121  151      4     8\n"
            "Parent   151  132  152      3     7\n"
            "\n"
            "Node     153  126  147      4     9\n"
            "Parent   151  132  152      3     7\n");
}

void expect_sound(const VesselGraph& graph, const Mask& axis) {
  const TopologyNumbers t = topology_numbers(axis);
  EXPECT_EQ(graph.component_count(), t.components);
  EXPECT_EQ(graph.multiple_parent_count(), graph.cycle_count());
  std::set<Voxel> covered;
  for (const VesselNode& n : graph.nodes) covered.insert(n.cluster.begin(), n.cluster.end());
  for (const VesselArc& a : graph.arcs) {
    EXPECT_EQ(a.voxels.front(), graph.nodes[static_cast<std::size_t>(a.from)].voxel);
    EXPECT_EQ(a.voxels.back(), graph.nodes[static_cast<std::size_t>(a.to)].voxel);
    covered.insert(a.voxels.begin(), a.voxels.end());
    for (std::size_t i = 1; i < a.voxels.size(); ++i) {
      int most = 0;
      for (std::size_t k = 0; k < 3; ++k)
        most = std::max(most, std::abs(a.voxels[i][k] - a.voxels[i - 1][k]));
      EXPECT_EQ(most, 1) << "an arc is a chain of neighbours";
    }
    EXPECT_LE(graph.nodes[static_cast<std::size_t>(a.to)].level,
              graph.nodes[static_cast<std::size_t>(a.from)].level + 1);
  }
  EXPECT_EQ(covered.size(), foreground_offsets(axis).size())
      << "every voxel is in a node or an arc";
}

TEST(VesselGraph, of_random_axes_has_their_components_cycles_and_voxels) {
  Random random(7);
  int cycles = 0;
  for (int i = 0; i < 300; ++i) {
    const Mask mask = test::noise_mask({12, 12, 12}, random.uniform(0.02, 0.25), random);
    const Mask axis = thin(mask).value();
    const TopologyNumbers t = topology_numbers(axis);
    const VesselGraph graph = vessel_graph(label_skeleton(axis));
    expect_sound(graph, axis);
    int hidden = 0;
    int cavities = 0;
    for (const VesselNode& n : graph.nodes) {
      hidden += n.cluster_cycles;
      cavities += n.cluster_cavities;
    }
    EXPECT_EQ(graph.cycle_count() + hidden, t.cycles);
    EXPECT_EQ(cavities, t.cavities);
    cycles += graph.cycle_count();
  }
  EXPECT_GT(cycles, 300);
}

TEST(VesselGraph, handles_nothing_a_voxel_a_pair_a_ring_and_a_lollipop) {
  EXPECT_TRUE(vessel_graph(label_skeleton(test::empty_mask({3, 3, 3}))).nodes.empty());
  const VesselGraph one = vessel_graph(label_skeleton(mask_of({3, 3, 3}, {{1, 1, 1}})));
  EXPECT_EQ(one.nodes.size(), 1U);
  EXPECT_TRUE(one.arcs.empty());
  const VesselGraph pair = vessel_graph(label_skeleton(mask_of({3, 3, 3}, {{1, 1, 1}, {2, 2, 2}})));
  EXPECT_EQ(pair.nodes.size(), 2U);
  ASSERT_EQ(pair.arcs.size(), 1U);
  EXPECT_EQ(pair.arcs[0].voxels.size(), 2U);
  const std::vector<Voxel> diamond{{4, 2, 1}, {3, 3, 1}, {5, 3, 1}, {4, 4, 1}};
  const VesselGraph ring = vessel_graph(label_skeleton(mask_of({9, 9, 3}, diamond)));
  EXPECT_EQ(ring.nodes.size(), 1U);
  EXPECT_EQ(ring.arcs.size(), 1U);
  EXPECT_EQ(ring.cycle_count(), 1);
  EXPECT_EQ(ring.multiple_parent_count(), 1);
  std::vector<Voxel> lollipop = diamond;
  for (const Voxel& v : {Voxel{4, 5, 1}, Voxel{4, 6, 1}, Voxel{4, 7, 1}}) lollipop.push_back(v);
  const Mask mask = mask_of({9, 9, 3}, lollipop);
  expect_sound(vessel_graph(label_skeleton(mask)), mask);
  EXPECT_EQ(vessel_graph(label_skeleton(mask)).cycle_count(), 1);
}

TEST(VesselGraph, can_be_searched_again_from_another_root) {
  const VesselGraph graph = vessel_graph(label_skeleton(linked_rings_axis()));
  for (int n = 0; n < 6; ++n) {
    const VesselGraph other = rooted_at(graph, {n});
    EXPECT_EQ(other.nodes[0].voxel, graph.nodes[static_cast<std::size_t>(n)].voxel);
    EXPECT_EQ(other.cycle_count(), 7);
    EXPECT_EQ(other.multiple_parent_count(), 7);
    EXPECT_EQ(other.nodes[5].level, 2);
  }
}

// The same axis turned or mirrored has a graph of the same shape: only the numbering, and the
// choice among equally heavy and equally central voxels, follow the order of the image.
TEST(VesselGraph, has_the_same_shape_in_all_48_orientations) {
  Random random(8);
  const Mask axis = thin(test::noise_mask({10, 11, 12}, 0.08, random)).value();
  const auto shape = [](const Mask& m) {
    const VesselGraph g = vessel_graph(label_skeleton(m));
    std::multiset<std::vector<std::size_t>> arcs;
    for (const VesselArc& a : g.arcs) {
      const std::size_t from = g.nodes[static_cast<std::size_t>(a.from)].arcs.size();
      const std::size_t to = g.nodes[static_cast<std::size_t>(a.to)].arcs.size();
      arcs.insert({std::min(from, to), std::max(from, to)});
    }
    return arcs;
  };
  const auto expected = shape(axis);
  EXPECT_GT(expected.size(), 20U);
  std::array<int, 3> axes{0, 1, 2};
  do
    for (unsigned m = 0; m < 8; ++m)
      EXPECT_EQ(shape(test::turned(axis, axes, {(m & 1U) != 0, (m & 2U) != 0, (m & 4U) != 0})),
                expected);
  while (std::next_permutation(axes.begin(), axes.end()));
}

}  // namespace
}  // namespace angiospline
