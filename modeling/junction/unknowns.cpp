#include "modeling/junction/unknowns.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/index.h"
#include "modeling/junction/patch_basis.h"
#include "modeling/junction/rules.h"
#include "modeling/layout/opening_arcs.h"

namespace angiospline {
namespace {

using namespace junction_rules;

// The layout's node at fraction (i, j) / 5, bilinear between nodes.
Vec3 layout_point(const JunctionLayout& layout, int patch, int i, int j) {
  const int last = layout.grid.size() - 1;
  const auto split = [&](int k) {
    const double t = static_cast<double>(k) * last / (kPatchSize - 1);
    const int low = std::min(static_cast<int>(t), last - 1);
    return std::pair<int, double>(low, t - low);
  };
  const auto [i0, s] = split(i);
  const auto [j0, t] = split(j);
  const auto node = [&](int a, int b) -> Vec3 {
    return layout.nodes.col(layout.grid.at(patch, a, b));
  };
  return (1 - s) * ((1 - t) * node(i0, j0) + t * node(i0, j0 + 1)) +
         s * ((1 - t) * node(i0 + 1, j0) + t * node(i0 + 1, j0 + 1));
}

}  // namespace

void JunctionNet::apply(const Eigen::VectorXd& move) {
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    const ControlSlot& slot = slots[static_cast<std::size_t>(k)];
    if (slot.count == 3) points.col(k) += move.segment<3>(slot.first);
    if (slot.count == 1) points.col(k) += move(slot.first) * slot.along;
  }
}

JunctionNet start_net(const JunctionTopology& topology, const JunctionLayout& layout) {
  JunctionNet net{SharedGrid(topology, kPatchSize), {}, {}, {}, 0};
  const int count = net.grid.count();
  net.points.resize(3, count);
  net.slots.resize(index(count));
  net.scale.assign(index(count), std::numeric_limits<double>::infinity());

  for (std::size_t b = 0; b < topology.sectors.size(); ++b) {
    const OpeningFrame& frame = layout.openings[b];
    const std::vector<QuinticArc> arcs = opening_arcs(frame.seams_rad);
    for (std::size_t k = 0; k < arcs.size(); ++k) {
      const int patch = topology.sectors[b][k];
      for (int i = 0; i < kPatchSize; ++i) {
        for (int j = 0; j < kPatchSize; ++j) {
          const int id = net.grid.at(patch, i, j);
          net.scale[index(id)] = std::min(net.scale[index(id)], frame.radius);
          net.points.col(id) = layout_point(layout, patch, i, j);
          net.slots[index(id)].count = i == 0 ? 0 : i == 1 ? 1 : 3;
          net.slots[index(id)].along = -frame.axis;
        }
      }
      for (int j = 0; j < kPatchSize; ++j) {
        const Vec3 rim =
            frame.center + frame.radius * (arcs[k](0, j) * frame.x + arcs[k](1, j) * frame.y);
        net.points.col(net.grid.at(patch, 0, j)) = rim;
        // Start the first row a fifth of the way to the saddle down the axis.
        const Vec3 below = layout_point(layout, patch, 1, j) - layout_point(layout, patch, 0, j);
        const double depth = std::max(kLeastDepth * frame.radius, -frame.axis.dot(below));
        net.points.col(net.grid.at(patch, 1, j)) = rim - depth * frame.axis;
      }
    }
  }

  for (ControlSlot& slot : net.slots) {
    slot.first = net.unknowns;
    net.unknowns += slot.count;
  }
  return net;
}

}  // namespace angiospline
