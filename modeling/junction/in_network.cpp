#include "modeling/junction/in_network.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/junction/patch_basis.h"
#include "modeling/layout/rules.h"

namespace angiospline {
namespace {

bool is_unit_bezier(const KnotVector& knots) {
  return knots.degree() == kPatchSize - 1 && knots.control_point_count() == kPatchSize &&
         knots.first() == 0 && knots.last() == 1;
}

// What is not as in a junction's template, for the error's text.
using Defect = std::string;

class Finder {
 public:
  Finder(const SurfaceNetwork& network, int region) : network_(network) {
    result_.name = network.regions[index(region)].name;
    result_.radius_mm = network.regions[index(region)].radius_mm;
    number_.assign(network.patches.size(), -1);
    for (std::size_t p = 0; p < network.patches.size(); ++p) {
      if (network.patches[p].region != region) continue;
      number_[p] = static_cast<int>(result_.patches.size());
      result_.patches.push_back(static_cast<int>(p));
    }
    result_.topology.patches.resize(result_.patches.size());
  }

  Result<JunctionInNetwork> run() {
    Defect defect = result_.patches.empty() ? "it has no patches" : check_patches();
    if (defect.empty()) defect = join_patches();
    if (defect.empty()) defect = order_branches();
    if (defect.empty()) defect = find_columns();
    if (!defect.empty()) {
      return fail({ErrorKind::kBadInput, "not a junction of the template's shape", result_.name,
                   defect, "bi-quintic patches between openings and saddles are wanted"});
    }
    place();
    return std::move(result_);
  }

 private:
  JunctionPatch& patch(int p) { return result_.topology.patches[index(p)]; }

  Defect check_patches() const {
    if (!(result_.radius_mm > 0)) return "its radius is not known";
    for (const int p : result_.patches) {
      const Patch& surface = network_.patches[index(p)];
      if (!is_unit_bezier(surface.u) || !is_unit_bezier(surface.v)) {
        return fmt::format("patch {} is not a bi-quintic Bezier patch", p);
      }
    }
    return {};
  }

  // Poles by the pool column of the patches' corners.
  Defect join_patches() {
    std::map<int, int> poles;

    // Each patch's corners at u = 1.
    for (int p = 0; p < static_cast<int>(result_.patches.size()); ++p) {
      const std::vector<int>& control = network_.patches[index(result_.patches[index(p)])].control;
      const auto pole = [&](int column) {
        return poles.try_emplace(column, static_cast<int>(poles.size())).first->second;
      };
      patch(p).from = pole(control[kPatchSize * (kPatchSize - 1)]);
      patch(p).to = pole(control[kPatchSize * kPatchSize - 1]);
    }

    result_.topology.poles.resize(poles.size());

    // Sides v = 0 and v = 1 meet around a branch, sides u = 1 across a saddle; no others meet.
    for (const Join& join : network_.joins) {
      const int a = number_[index(join.a.patch)];
      const int b = number_[index(join.b.patch)];
      if (a < 0 || b < 0) continue;
      const bool forward = join.a.side == PatchSide::kV1 && join.b.side == PatchSide::kV0;
      const bool backward = join.a.side == PatchSide::kV0 && join.b.side == PatchSide::kV1;
      if ((forward || backward) && !join.reversed) {
        patch(forward ? a : b).next = forward ? b : a;
        patch(forward ? b : a).previous = forward ? a : b;
      } else if (join.a.side == PatchSide::kU1 && join.b.side == PatchSide::kU1 && join.reversed) {
        patch(a).saddle = patch(b).saddle = static_cast<int>(result_.topology.saddles.size());
        result_.topology.saddles.push_back({-1, -1, patch(a).from, patch(a).to, a, b});
      } else {
        return fmt::format("patches {} and {} meet on other sides", join.a.patch, join.b.patch);
      }
    }
    for (int p = 0; p < static_cast<int>(result_.patches.size()); ++p) {
      if (patch(p).next < 0 || patch(p).previous < 0 || patch(p).saddle < 0) {
        return fmt::format("patch {} has an open side", result_.patches[index(p)]);
      }
    }
    return {};
  }

  Defect order_branches() {
    JunctionTopology& t = result_.topology;
    for (int p = 0; p < static_cast<int>(t.patches.size()); ++p) {
      if (patch(p).branch >= 0) continue;
      const int branch = static_cast<int>(t.sectors.size());
      t.sectors.emplace_back();
      for (int q = p; patch(q).branch < 0; q = patch(q).next) {
        patch(q).branch = branch;
        t.sectors.back().push_back(q);
      }
    }

    // Saddles and poles know the branches beside them by their patches.
    for (JunctionSaddle& saddle : t.saddles) {
      saddle.branch_a = patch(saddle.patch_a).branch;
      saddle.branch_b = patch(saddle.patch_b).branch;
    }
    for (const JunctionPatch& p : t.patches) t.poles[index(p.from)].branches.push_back(p.branch);

    return t.sectors.size() < 3 ? fmt::format("it has {} openings", t.sectors.size()) : Defect{};
  }

  Defect find_columns() {
    const SharedGrid grid(result_.topology, kPatchSize);
    result_.columns.assign(index(grid.count()), -1);
    for (int p = 0; p < static_cast<int>(result_.patches.size()); ++p) {
      const std::vector<int>& control = network_.patches[index(result_.patches[index(p)])].control;
      for (int k = 0; k < kPatchSize * kPatchSize; ++k) {
        int& column = result_.columns[index(grid.at(p, k / kPatchSize, k % kPatchSize))];
        if (column >= 0 && column != control[index(k)]) {
          return fmt::format("patch {} does not share its control points",
                             result_.patches[index(p)]);
        }
        column = control[index(k)];
      }
    }
    return {};
  }

  void place() {
    for (const int c : result_.columns) {
      result_.center_mm +=
          network_.control_points_mm.col(c) / static_cast<double>(result_.columns.size());
    }
    for (std::size_t k = 0; k < result_.topology.poles.size(); ++k) {
      const Vec3 away = network_.control_points_mm.col(result_.columns[k]) - result_.center_mm;
      result_.topology.poles[k].direction = away.normalized();
    }
  }

  const SurfaceNetwork& network_;
  JunctionInNetwork result_;
  std::vector<int> number_;  // in the junction, of each patch of the network; -1 outside
};

Vec3 local(const JunctionInNetwork& junction, const SurfaceNetwork& network, int column) {
  return (network.control_points_mm.col(column) - junction.center_mm) / junction.radius_mm;
}

OpeningFrame present_opening(const JunctionInNetwork& junction, const SurfaceNetwork& network,
                             const std::vector<int>& sectors) {
  OpeningFrame frame;
  Points3 rim(3, static_cast<Eigen::Index>(sectors.size()) * (kPatchSize - 1));
  Eigen::Index k = 0;

  // The axis is the mean way out, from the second row to the rim.
  for (const int p : sectors) {
    const std::vector<int>& control = network.patches[index(junction.patches[index(p)])].control;
    for (int j = 0; j + 1 < kPatchSize; ++j, ++k) {
      rim.col(k) = local(junction, network, control[index(j)]);
      frame.axis += rim.col(k) - local(junction, network, control[index(kPatchSize + j)]);
    }
  }

  frame.center = rim.rowwise().mean();
  frame.axis.normalize();
  frame.radius = std::sqrt((rim.colwise() - frame.center).colwise().squaredNorm().mean());
  frame.x = frame.axis.unitOrthogonal();
  frame.y = frame.axis.cross(frame.x);
  for (const int p : sectors) {
    const int corner = network.patches[index(junction.patches[index(p)])].control[0];
    const Vec3 out = local(junction, network, corner) - frame.center;
    frame.seams_rad.push_back(std::atan2(frame.y.dot(out), frame.x.dot(out)));
  }
  return frame;
}

}  // namespace

Result<JunctionInNetwork> junction_in_network(const SurfaceNetwork& network, int region) {
  return Finder(network, region).run();
}

JunctionLayout present_layout(const JunctionInNetwork& junction, const SurfaceNetwork& network) {
  JunctionLayout layout{SharedGrid(junction.topology, layout_rules::kFine), {}, {}, {}};
  const int count = layout.grid.count();
  layout.nodes.resize(3, count);
  layout.normals = Points3::Zero(3, count);
  const std::vector<double> steps = spaced(0, 1, layout_rules::kFine);

  // Nodes on an edge get the mean of both patches' normals.
  for (int p = 0; p < static_cast<int>(junction.patches.size()); ++p) {
    const auto grid =
        evaluate_grid(patch_surface(network, junction.patches[index(p)]), steps, steps, 1);
    for (int k = 0; k < layout_rules::kFine * layout_rules::kFine; ++k) {
      const int node = layout.grid.at(p, k / layout_rules::kFine, k % layout_rules::kFine);
      layout.nodes.col(node) = (grid.points().col(k) - junction.center_mm) / junction.radius_mm;
      const Vec3 normal = Vec3(grid.partial(1, 0).col(k)).cross(Vec3(grid.partial(0, 1).col(k)));
      layout.normals.col(node) += normal.normalized();
    }
  }

  layout.normals.colwise().normalize();
  for (const std::vector<int>& sectors : junction.topology.sectors) {
    layout.openings.push_back(present_opening(junction, network, sectors));
  }
  return layout;
}

JunctionNet present_net(const JunctionInNetwork& junction, const JunctionLayout& layout,
                        const SurfaceNetwork& network) {
  JunctionNet net{SharedGrid(junction.topology, kPatchSize), {}, {}, {}, 0};
  const int count = net.grid.count();
  net.points.resize(3, count);
  net.slots.resize(index(count));
  net.scale.assign(index(count), std::numeric_limits<double>::infinity());
  for (int k = 0; k < count; ++k) {
    net.points.col(k) = local(junction, network, junction.columns[index(k)]);
  }

  for (int p = 0; p < static_cast<int>(junction.patches.size()); ++p) {
    const OpeningFrame& frame = layout.openings[index(junction.topology.patches[index(p)].branch)];
    for (int i = 0; i < kPatchSize; ++i) {
      for (int j = 0; j < kPatchSize; ++j) {
        const int id = net.grid.at(p, i, j);
        net.scale[index(id)] = std::min(net.scale[index(id)], frame.radius);
        net.slots[index(id)].count = i == 0 ? 0 : i == 1 ? 1 : 3;
        net.slots[index(id)].along = -frame.axis;

        // The second row slides along the axis: what is off it is put back.
        if (i != 1) continue;
        const Vec3 rim = net.points.col(net.grid.at(p, 0, j));
        const double depth = frame.axis.dot(rim - Vec3(net.points.col(id)));
        net.points.col(id) = rim - depth * frame.axis;
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
