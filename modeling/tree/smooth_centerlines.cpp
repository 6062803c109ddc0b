#include "modeling/tree/smooth_centerlines.h"

#include <algorithm>
#include <atomic>
#include <optional>

#include <Eigen/SparseCholesky>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "modeling/tree/branch_smoother.h"
#include "modeling/tree/clean_tree.h"
#include "modeling/tree/overlaps.h"

namespace angiospline {
namespace {

constexpr const char* kStage = "smooth centerlines";

// A junction's openings lie farther out than this, in radii of its thickest branch: bends inside do
// not reach any wall.
constexpr double kHidden = 1.0;

constexpr double kInsideLimit = 0.99;  // of the largest move, for nodes: below it in any rounding

constexpr std::size_t kNamedOverlaps = 50;  // pairs that are warned of by name
constexpr double kWorthNaming = 0.95;       // of its radius that a branch keeps in its bends

// The radius of the thickest and of the thinnest branch at each node, just beside it.
struct NodeRadii {
  double thickest = 0.0;
  double thinnest = std::numeric_limits<double>::infinity();
};

std::vector<NodeRadii> radii_at_nodes(const CenterlineTree& tree) {
  std::vector<NodeRadii> radii(tree.nodes.size());
  for (const CenterlineBranch& branch : tree.branches) {
    const auto count = branch.radii_mm.size();
    const auto add = [&](int node, double r) {
      radii[index(node)].thickest = std::max(radii[index(node)].thickest, r);
      radii[index(node)].thinnest = std::min(radii[index(node)].thinnest, r);
    };
    add(branch.from, branch.radii_mm(std::min<Eigen::Index>(1, count - 1)));
    add(branch.to, branch.radii_mm(std::max<Eigen::Index>(0, count - 2)));
  }
  return radii;
}

// Where all branches together put the nodes: the minimum of their condensed problems, one sparse
// system with a row for each node. No node moves farther than `largest_move` of its thinnest
// branch.
void place_nodes(CenterlineTree& tree, const std::vector<std::optional<BranchSmoother>>& smoothers,
                 const std::vector<NodeRadii>& radii, double largest_move) {
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::MatrixXd right = Eigen::MatrixXd::Zero(static_cast<Eigen::Index>(tree.nodes.size()), 3);
  for (std::size_t b = 0; b < smoothers.size(); ++b) {
    const CondensedEnds ends = smoothers[b]->condensed_ends();
    const int nodes[2] = {tree.branches[b].from, tree.branches[b].to};
    for (int i = 0; i < 2; ++i) {
      right.row(nodes[i]) += ends.right.row(i);
      for (int j = 0; j < 2; ++j) entries.emplace_back(nodes[i], nodes[j], ends.matrix(i, j));
    }
  }
  Eigen::SparseMatrix<double> A(right.rows(), right.rows());
  A.setFromTriplets(entries.begin(), entries.end());
  const Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> solver(A);
  const Eigen::MatrixXd places = solver.solve(right);
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    Vec3& position = tree.nodes[n].position_mm;
    const Vec3 move = places.row(static_cast<Eigen::Index>(n)).transpose() - position;
    const double most = kInsideLimit * largest_move * radii[n].thinnest;
    if (!move.allFinite()) continue;
    position += move.norm() > most ? Vec3(most / move.norm() * move) : move;
  }
}

void warn_of_overlaps(SmoothedTree& tree) {
  const std::vector<Overlap> overlaps = find_overlaps(tree);
  const std::size_t named = std::min(overlaps.size(), kNamedOverlaps);
  for (std::size_t k = 0; k < named; ++k) {
    tree.warnings.push_back({WarningCode::kVesselsOverlap, overlap_text(tree, overlaps[k])});
  }
  if (overlaps.size() > named) {
    tree.warnings.push_back(
        {WarningCode::kVesselsOverlap,
         fmt::format("{} more pairs of branches overlap", overlaps.size() - named)});
  }
}

}  // namespace

Result<SmoothedTree> smooth_centerlines(const CenterlineTree& tree, const SmoothingOptions& options,
                                        const Progress& progress) {
  CleanedTree cleaned = clean_tree(tree);
  SmoothedTree result;
  result.tree = std::move(cleaned.tree);
  result.warnings = std::move(cleaned.warnings);
  std::vector<CenterlineBranch>& branches = result.tree.branches;
  for (const CenterlineBranch& branch : branches) {
    result.given.emplace_back(4, branch.points_mm.cols());
    result.given.back() << branch.points_mm, branch.radii_mm.transpose();
  }
  if (branches.empty()) {
    const auto without_radius =
        std::find_if(tree.branches.begin(), tree.branches.end(), [](const CenterlineBranch& b) {
          return !(b.radii_mm.allFinite() && b.radii_mm.minCoeff() > 0);
        });
    if (without_radius != tree.branches.end()) {
      return fail({ErrorKind::kBadInput, "no branch is left", tree.source,
                   result.warnings.front().text, "branches have positive radii and a length"});
    }
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
  const std::vector<NodeRadii> radii = radii_at_nodes(result.tree);
  std::vector<double> mean_radii;
  for (const CenterlineBranch& branch : branches) mean_radii.push_back(branch.radii_mm.mean());
  const double tree_radius = median(mean_radii);
  if (!for_each_branch(0.0, [&](std::size_t b) {
        const auto end_at = [&](int node) {
          const bool is_junction = at[index(node)].size() > 2;
          return SmootherEnd{is_junction,
                             is_junction ? kHidden * radii[index(node)].thickest : 0.0};
        };
        smoothers[b].emplace(branches[b], end_at(branches[b].from), end_at(branches[b].to),
                             tree_radius, smoothing);
      })) {
    return fail(cancelled(kStage));
  }
  Eigen::VectorXd position_criteria = Eigen::VectorXd::Zero(kStrengthCount);
  Eigen::VectorXd radius_criteria = Eigen::VectorXd::Zero(kStrengthCount);
  for (const auto& smoother : smoothers) {
    position_criteria += smoother->position_criteria();
    radius_criteria += smoother->radius_criteria();
  }
  const double position_of_tree = best_grid_position(position_criteria);
  const double radius_of_tree = best_grid_position(radius_criteria);
  for (auto& smoother : smoothers) smoother->choose_strengths(position_of_tree, radius_of_tree);
  place_nodes(result.tree, smoothers, radii, options.largest_move);
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
    if (paths[b]->radius_reduced_to < kWorthNaming) {
      result.warnings.push_back({WarningCode::kRadiusReducedInBend,
                                 fmt::format("branch {} bends more sharply than its radius allows: "
                                             "radius reduced to {:.0f} % there",
                                             branches[b].name, 100 * paths[b]->radius_reduced_to)});
    }
    if (paths[b]->sharpest_bend > 1.0) {
      result.warnings.push_back(
          {WarningCode::kBendTooSharp,
           fmt::format(
               "branch {} bends more sharply than its radius allows (curvature times radius "
               "{:.2g}): its wall may fold there",
               branches[b].name, paths[b]->sharpest_bend)});
    }
    if (!paths[b]->path.control_points().allFinite()) {
      return fail({ErrorKind::kBadInput,
                   "the branch cannot be smoothed",
                   branches[b].name,
                   {},
                   "its coordinates and radii are too far apart in size for its numbers"});
    }
    result.paths.push_back(std::move(paths[b]->path));
  }
  warn_of_overlaps(result);
  return result;
}

}  // namespace angiospline
