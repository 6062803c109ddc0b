#include "recovery/centerlines/centerlines_from_graph.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "recovery/centerlines/axis_smoothing.h"
#include "recovery/centerlines/branch_points.h"
#include "recovery/centerlines/branch_radii.h"
#include "recovery/centerlines/branch_tip.h"
#include "recovery/centerlines/lumen_section.h"
#include "recovery/centerlines/rules.h"
#include "recovery/imaging/mask/distance_transform.h"

namespace angiospline {
namespace {

using namespace centerline_rules;

class Centerlines {
 public:
  Centerlines(const VesselGraph& graph, const Mask& mask, const CenterlineOptions& options)
      : graph_(graph),
        mask_(mask),
        options_(options),
        points_(branch_points(graph, mask, options.tips)) {}

  bool run(const Progress& progress) {
    smooth(kFirstSmoothing);
    for (int k = 0; k < kRecenterings; ++k) {
      if (progress.should_stop()) return false;
      progress.at("centerlines", static_cast<double>(k + 1) / (kRecenterings + 2));
      recenter();
      smooth(1.0);
    }
    measure();
    return true;
  }

  CenterlineTree tree() const {
    CenterlineTree tree;
    std::vector<int> number(graph_.nodes.size(), -1);
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      if (graph_.nodes[n].arcs.empty()) continue;
      number[n] = static_cast<int>(tree.nodes.size());
      tree.nodes.push_back(
          {node_name(static_cast<int>(n)), points_.at_mm.col(static_cast<int>(n))});
      const bool is_root = n == 0 || graph_.nodes[n - 1].component != graph_.nodes[n].component;
      if (is_root && graph_.nodes[n].is_end()) tree.inlets.push_back(number[n]);
    }

    // Several branches may lead to one node: they share its name and are counted.
    std::map<std::string, int> used;
    for (std::size_t a = 0; a < graph_.arcs.size(); ++a) {
      CenterlineBranch branch = branch_of(static_cast<int>(a));
      branch.name = node_name(graph_.arcs[a].to);
      const int times = ++used[branch.name];
      if (times > 1) branch.name += fmt::format("_{}", times);
      branch.from = number[index(graph_.arcs[a].from)];
      branch.to = number[index(graph_.arcs[a].to)];
      set_node(tree, branch.from, branch.points_mm.leftCols<1>());
      set_node(tree, branch.to, branch.points_mm.rightCols<1>());
      tree.branches.push_back(std::move(branch));
    }
    return tree;
  }

 private:
  std::string node_name(int n) const {
    const Voxel& v = graph_.nodes[index(n)].voxel;
    return fmt::format("v{}_{}_{}", v[0], v[1], v[2]);
  }

  static void set_node(CenterlineTree& tree, int n, const Vec3& position) {
    tree.nodes[index(n)].position_mm = position;  // tips have moved; junctions are where they were
  }

  double voxel_mm() const { return graph_.grid.spacing_mm.maxCoeff(); }

  void smooth(double factor) {
    SmoothingData data;
    data.measured = points_.at_mm;

    const Eigen::Index n = points_.at_mm.cols();
    data.weight.resize(n);
    data.wavelength.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      data.weight[i] = points_.in_junction[index(i)] ? kOpenWeight : 1.0;
      if (measured_ && points_.radius_mm[i] == 0.0) data.weight[i] = kOpenWeight;
      data.wavelength[i] = factor * std::max(options_.smoothing_radii * points_.inscribed_mm[i],
                                             options_.smoothing_voxels * voxel_mm());
    }

    points_.at_mm = smooth_on_graph(solver_chains(graph_, points_), data);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double most = std::max(options_.largest_move_radii * points_.inscribed_mm[i],
                                   graph_.grid.spacing_mm.norm());
      const Vec3 move = points_.at_mm.col(i) - points_.voxels_mm.col(i);
      if (move.norm() > most)
        points_.at_mm.col(i) = points_.voxels_mm.col(i) + most / move.norm() * move;
    }
  }

  LumenSection section_at(Eigen::Index i, const Vec3& tangent) const {
    if (points_.in_junction[index(i)] || tangent.isZero()) return {};
    return lumen_section(mask_, points_.at_mm.col(i), tangent,
                         kLongestRay * points_.inscribed_mm[i] + voxel_mm());
  }

  template <typename Use>
  void for_sections(const Points3& t, const Use& use) {
    tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, t.cols(), 16),
                      [&](const tbb::blocked_range<Eigen::Index>& range) {
                        for (Eigen::Index i = range.begin(); i < range.end(); ++i)
                          use(i, section_at(i, t.col(i)));
                      });
  }

  // The slab of voxels that are counted: long enough to level out slices. For radii it is a radius
  // long, so that counts scatter less; for centres no longer than needed, since bends shift them.
  double center_slab_mm() const { return kLeastSlabVoxels * voxel_mm(); }
  double radius_slab_mm(double radius_mm) const {
    return std::max(radius_mm, kLeastSlabVoxels * voxel_mm());
  }

  void recenter() {
    const std::vector<bool> clear = clear_of_junctions(
        points_, Eigen::VectorXd::Constant(points_.at_mm.cols(), center_slab_mm()));
    const Points3 t = branch_tangents(graph_, points_);
    for_sections(t, [&](Eigen::Index i, const LumenSection& s) {
      points_.radius_mm[i] = s.closed ? s.radius_mm : 0.0;
      if (!s.closed) return;
      points_.at_mm.col(i) = clear[index(i)] ? counted_section(mask_, s, points_.at_mm.col(i),
                                                               t.col(i), center_slab_mm())
                                                   .center_mm
                                             : s.center_mm;
    });
    measured_ = true;
  }

  void measure() {
    const Points3 t = branch_tangents(graph_, points_);
    points_.counted = Eigen::VectorXd::Zero(t.cols());
    for_sections(t, [&](Eigen::Index i, const LumenSection& s) {
      points_.radius_mm[i] = s.closed ? s.radius_mm : 0.0;
      if (!s.closed || !(s.radius_mm > 0.0)) return;
      points_.counted[i] =
          counted_section(mask_, s, points_.at_mm.col(i), t.col(i), radius_slab_mm(s.radius_mm))
              .radius_mm /
          s.radius_mm;
    });

    // Near a junction a slab holds voxels of other branches: what was counted there does not count.
    Eigen::VectorXd reach(t.cols());
    for (Eigen::Index i = 0; i < t.cols(); ++i) reach[i] = radius_slab_mm(points_.radius_mm[i]);
    const std::vector<bool> clear = clear_of_junctions(points_, reach);
    for (Eigen::Index i = 0; i < t.cols(); ++i) {
      if (!clear[index(i)]) points_.counted[i] = 0.0;
    }
  }

  CenterlineBranch branch_of(int a) const {
    const SmoothingChain& chain = points_.chains[index(a)];
    const Eigen::VectorXd radii = radii_along(graph_, points_, chain);
    BranchLine line;
    for (const int u : chain.unknowns) line.points.emplace_back(points_.at_mm.col(u));
    line.radii.assign(radii.begin(), radii.end());

    const VesselArc& arc = graph_.arcs[index(a)];
    if (options_.tips == TipRule::kFlatCap) {
      if (graph_.nodes[index(arc.to)].is_end()) line = extended_to_wall(mask_, std::move(line));
      if (graph_.nodes[index(arc.from)].is_end()) {
        line = turned(extended_to_wall(mask_, turned(std::move(line))));
      }
    }

    CenterlineBranch branch;
    branch.points_mm.resize(3, std::ssize(line.points));
    for (std::size_t i = 0; i < line.points.size(); ++i) {
      branch.points_mm.col(static_cast<Eigen::Index>(i)) = line.points[i];
    }
    branch.radii_mm = Eigen::Map<const Eigen::VectorXd>(line.radii.data(), std::ssize(line.radii));
    return branch;
  }

  static BranchLine turned(BranchLine line) {
    std::reverse(line.points.begin(), line.points.end());
    std::reverse(line.radii.begin(), line.radii.end());
    return line;
  }

  const VesselGraph& graph_;
  const Mask& mask_;
  const CenterlineOptions& options_;
  BranchPoints points_;
  bool measured_ = false;
};

}  // namespace

Result<CenterlineTree> centerlines_from_graph(const VesselGraph& graph, const Mask& mask,
                                              const CenterlineOptions& options,
                                              const Progress& progress) {
  EXPECTS(graph.grid.size == mask.grid.size);
  if (graph.arcs.empty())
    return fail({ErrorKind::kBadInput, "the axis has no branch", "mask",
                 fmt::format("{} nodes", graph.nodes.size()),
                 "a vessel must be longer than one voxel"});

  Centerlines centerlines(graph, mask, options);
  if (!centerlines.run(progress)) return fail(cancelled("centerlines"));
  CenterlineTree tree = centerlines.tree();

  const auto lonely = std::count_if(graph.nodes.begin(), graph.nodes.end(),
                                    [](const VesselNode& n) { return n.arcs.empty(); });
  if (lonely > 0)
    tree.assumptions.push_back(
        fmt::format("{} components of a single axis voxel are left out", lonely));
  tree.assumptions.push_back(
      "radii are those of circles with the area of the mask's cross-section, which keep its "
      "volume");
  if (options.tips == TipRule::kFlatCap)
    tree.assumptions.push_back("free ends lie where a flat cap keeps the volume of the mask");
  return tree;
}

std::vector<int> thickest_ends(const VesselGraph& graph, const Mask& mask) {
  std::vector<std::size_t> offsets;               // outer halves of the branches at free ends
  std::vector<std::pair<int, std::size_t>> ends;  // node, where its voxels stop
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    const VesselNode& node = graph.nodes[n];
    if (node.arcs.size() != 1) continue;
    const VesselArc& arc = graph.arcs[index(node.arcs[0])];
    const std::size_t count = arc.voxels.size();
    const bool front = arc.from == static_cast<int>(n);
    for (std::size_t i = 0; i < (count + 1) / 2; ++i)
      offsets.push_back(graph.grid.offset(arc.voxels[front ? i : count - 1 - i]));
    ends.emplace_back(static_cast<int>(n), offsets.size());
  }

  const std::vector<double> distances = boundary_distances_mm(mask, offsets);

  // The thickest of each component; the first of equally thick ones.
  std::map<int, std::pair<double, int>> best;  // by component
  std::size_t begin = 0;
  for (const auto& [n, end] : ends) {
    const double radius = median({distances.begin() + static_cast<std::ptrdiff_t>(begin),
                                  distances.begin() + static_cast<std::ptrdiff_t>(end)});
    begin = end;
    const auto [at, is_new] = best.try_emplace(graph.nodes[index(n)].component, radius, n);
    if (!is_new && radius > at->second.first) at->second = {radius, n};
  }

  std::vector<int> nodes;
  for (const auto& [component, choice] : best) nodes.push_back(choice.second);
  return nodes;
}

}  // namespace angiospline
