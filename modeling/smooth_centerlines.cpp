#include "modeling/smooth_centerlines.h"

#include <algorithm>
#include <atomic>
#include <optional>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "modeling/branch_smoother.h"
#include "modeling/clean_tree.h"

namespace angiospline {
namespace {

std::size_t index(int i) { return static_cast<std::size_t>(i); }

// The mean of where its branches would put a node, thick ones weighing more (by cross-section), no
// farther than `largest_move` times the thinnest one's radius from where it was.
struct NodePlace {
  Vec3 sum = Vec3::Zero();
  double weight = 0.0;
  double thinnest = std::numeric_limits<double>::infinity();

  void add(const Vec3& p, double radius) {
    sum += radius * radius * p;
    weight += radius * radius;
    thinnest = std::min(thinnest, radius);
  }

  Vec3 place(const Vec3& before, double largest_move) const {
    const Vec3 move = sum / weight - before;
    const double most = largest_move * thinnest;
    const double length = move.norm();
    return length > most ? Vec3(before + most / length * move) : Vec3(before + move);
  }
};

}  // namespace

Result<SmoothedTree> smooth_centerlines(const CenterlineTree& tree, const SmoothingOptions& options,
                                        const Progress& progress) {
  constexpr const char* kStage = "smooth centerlines";
  CleanedTree cleaned = clean_tree(tree);
  SmoothedTree result{std::move(cleaned.tree), {}, 0.0, std::move(cleaned.warnings)};
  std::vector<CenterlineBranch>& branches = result.tree.branches;
  if (branches.empty()) {
    return fail({ErrorKind::kBadInput,
                 "no branch has a positive length",
                 tree.source,
                 {},
                 "two points at different positions must be connected"});
  }
  const auto at = branches_at_nodes(result.tree);
  BranchSmootherOptions smoothing;
  smoothing.largest_move = options.largest_move;
  std::vector<std::optional<BranchSmoother>> smoothers(branches.size());
  std::atomic<std::size_t> done{0};
  const auto for_each_branch = [&](double from, const auto& work) {
    done = 0;
    tbb::parallel_for(std::size_t{0}, branches.size(), [&](std::size_t b) {
      if (progress.should_stop()) return;
      work(b);
      progress.at(kStage, from + 0.5 * static_cast<double>(++done) / double(branches.size()));
    });
    return !progress.should_stop();
  };
  if (!for_each_branch(0.0, [&](std::size_t b) {
        const CenterlineBranch& branch = branches[b];
        smoothers[b].emplace(branch, at[index(branch.from)].size() == 1,
                             at[index(branch.to)].size() == 1, smoothing);
      })) {
    return fail(cancelled(kStage));
  }
  std::vector<NodePlace> places(result.tree.nodes.size());
  for (std::size_t b = 0; b < branches.size(); ++b) {
    const auto [start, end] = smoothers[b]->free_ends();
    const auto [start_radius, end_radius] = smoothers[b]->end_radii_mm();
    places[index(branches[b].from)].add(start, start_radius);
    places[index(branches[b].to)].add(end, end_radius);
  }
  for (std::size_t n = 0; n < places.size(); ++n) {
    CenterlineNode& node = result.tree.nodes[n];
    node.position_mm = places[n].place(node.position_mm, 0.5 * options.largest_move);
  }
  std::vector<std::optional<SmoothPath>> paths(branches.size());
  if (!for_each_branch(0.5, [&](std::size_t b) {
        paths[b] = smoothers[b]->smooth(result.tree.nodes[index(branches[b].from)].position_mm,
                                        result.tree.nodes[index(branches[b].to)].position_mm);
      })) {
    return fail(cancelled(kStage));
  }
  result.paths.reserve(paths.size());
  for (std::size_t b = 0; b < paths.size(); ++b) {
    branches[b].points_mm.col(0) = result.tree.nodes[index(branches[b].from)].position_mm;
    branches[b].points_mm.rightCols(1) = result.tree.nodes[index(branches[b].to)].position_mm;
    result.largest_move_mm = std::max(result.largest_move_mm, paths[b]->largest_move_mm);
    if (paths[b]->sharpest_bend > 1.0) {
      result.warnings.push_back(
          fmt::format("branch {} bends more sharply than its radius allows (curvature times radius "
                      "{:.2g}); its "
                      "wall may fold there",
                      branches[b].name, paths[b]->sharpest_bend));
    }
    result.paths.push_back(std::move(paths[b]->path));
  }
  return result;
}

}  // namespace angiospline
