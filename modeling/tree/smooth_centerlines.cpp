#include "modeling/tree/smooth_centerlines.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/SparseCholesky>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "modeling/tree/branch_smoother.h"
#include "modeling/tree/clean_tree.h"
#include "modeling/tree/overlaps.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

constexpr const char* kStage = "smooth centerlines";

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

  // Each branch, with all its inner coefficients eliminated, is a quadratic in its two end places:
  // their sum is assembled as finite elements are.
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

  // A node that cannot be told (its branches say nothing of it) stays.
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    Vec3& position = tree.nodes[n].position_mm;
    const Vec3 move = places.row(static_cast<Eigen::Index>(n)).transpose() - position;
    const double most = SmoothingRules::kInsideLimit * largest_move * radii[n].thinnest;
    if (!move.allFinite()) continue;
    position += move.norm() > most ? Vec3(most / move.norm() * move) : move;
  }
}

std::vector<Warning> overlap_warnings(const SmoothedTree& tree) {
  const std::vector<Overlap> overlaps = find_overlaps(tree);
  const std::size_t named = std::min(overlaps.size(), SmoothingRules::kNamedOverlaps);
  std::vector<Warning> warnings;
  for (std::size_t k = 0; k < named; ++k)
    warnings.push_back({WarningCode::kVesselsOverlap, overlap_text(tree, overlaps[k])});
  if (overlaps.size() > named) {
    warnings.push_back({WarningCode::kVesselsOverlap,
                        fmt::format("{} more pairs of branches overlap", overlaps.size() - named)});
  }
  return warnings;
}

// Why a tree has no branch left after cleaning.
Error without_branches(const CenterlineTree& tree, const std::vector<Warning>& warnings) {
  const bool lacks_radius =
      std::any_of(tree.branches.begin(), tree.branches.end(), [](const CenterlineBranch& b) {
        return !(b.radii_mm.allFinite() && b.radii_mm.minCoeff() > 0);
      });
  if (lacks_radius) {
    return {ErrorKind::kBadInput, "no branch is left", tree.source, warnings.front().text,
            "branches have positive radii and a length"};
  }
  return {ErrorKind::kBadInput,
          "no branch has a positive length",
          tree.source,
          {},
          "two points at different positions must be connected"};
}

using Smoothers = std::vector<std::optional<BranchSmoother>>;

// Calls work(b) for each branch, in parallel, as one half of the whole; false if stopped.
template <typename Work>
bool for_each_branch(std::size_t count, double from, const Progress& progress, const Work& work) {
  std::atomic<std::size_t> done{0};
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t b) {
    if (progress.should_stop()) return;
    work(b);
    progress.at(kStage, from + 0.5 * static_cast<double>(++done) / static_cast<double>(count));
  });
  return !progress.should_stop();
}

// A smoother for each branch, with its verdict on all strengths; nothing if stopped.
std::optional<Smoothers> make_smoothers(const CenterlineTree& tree,
                                        const std::vector<NodeRadii>& radii, double largest_move,
                                        const Progress& progress) {
  // Noise is measured against the typical branch: it comes from voxels, which all branches share.
  std::vector<double> mean_radii;
  for (const CenterlineBranch& branch : tree.branches) {
    mean_radii.push_back(branch.radii_mm.mean());
  }
  const double tree_radius = median(mean_radii);

  const auto at = branches_at_nodes(tree);
  const auto end_at = [&](int node) {
    const bool is_junction = at[index(node)].size() > 2;
    const double hidden = SmoothingRules::kHidden * radii[index(node)].thickest;
    return SmootherEnd{is_junction, is_junction ? hidden : 0.0};
  };
  BranchSmootherOptions options;
  options.largest_move = largest_move;
  Smoothers smoothers(tree.branches.size());
  const bool finished = for_each_branch(smoothers.size(), 0.0, progress, [&](std::size_t b) {
    const CenterlineBranch& branch = tree.branches[b];
    smoothers[b].emplace(branch, end_at(branch.from), end_at(branch.to), tree_radius, options);
  });
  return finished ? std::optional(std::move(smoothers)) : std::nullopt;
}

// The strength that suits the tree as a whole, by the sum of all branches' restricted
// log-likelihoods, which is that of all together if they are independent; then each branch's own
// near it.
void choose_strengths(Smoothers& smoothers) {
  Eigen::VectorXd position_criteria = Eigen::VectorXd::Zero(kStrengthCount);
  Eigen::VectorXd radius_criteria = Eigen::VectorXd::Zero(kStrengthCount);
  for (const auto& smoother : smoothers) {
    position_criteria += smoother->position_criteria();
    radius_criteria += smoother->radius_criteria();
  }
  const double position_of_tree = best_grid_position(position_criteria);
  const double radius_of_tree = best_grid_position(radius_criteria);
  for (auto& smoother : smoothers) smoother->choose_strengths(position_of_tree, radius_of_tree);
}

// What a branch had to give up.
std::vector<Warning> warnings_of(const CenterlineBranch& branch, const SmoothPath& path) {
  std::vector<Warning> warnings;
  if (path.radius_reduced_to < SmoothingRules::kWorthNaming) {
    warnings.push_back({WarningCode::kRadiusReducedInBend,
                        fmt::format("branch {} bends more sharply than its radius allows: radius "
                                    "reduced to {:.0f} % there",
                                    branch.name, 100 * path.radius_reduced_to)});
  }

  if (path.sharpest_bend > SmoothingRules::kFoldingBend) {
    warnings.push_back(
        {WarningCode::kBendTooSharp,
         fmt::format("branch {} bends more sharply than its radius allows (curvature times radius "
                     "{:.2g}): its wall may fold there",
                     branch.name, path.sharpest_bend)});
  }
  return warnings;
}

// Puts the paths into the tree, with their ends and warnings.
std::optional<Error> take_paths(std::vector<std::optional<SmoothPath>> paths, SmoothedTree& tree) {
  tree.paths.reserve(paths.size());
  for (std::size_t b = 0; b < paths.size(); ++b) {
    CenterlineBranch& branch = tree.tree.branches[b];
    branch.points_mm.col(0) = tree.tree.nodes[index(branch.from)].position_mm;
    branch.points_mm.rightCols(1) = tree.tree.nodes[index(branch.to)].position_mm;

    tree.largest_move_mm = std::max(tree.largest_move_mm, paths[b]->largest_move_mm);
    for (Warning& warning : warnings_of(branch, *paths[b])) {
      tree.warnings.push_back(std::move(warning));
    }

    // Numbers that differ too much in size overflow somewhere on the way.
    if (!paths[b]->path.control_points().allFinite()) {
      return Error{ErrorKind::kBadInput,
                   "the branch cannot be smoothed",
                   branch.name,
                   {},
                   "its coordinates and radii are too far apart in size for its numbers"};
    }
    tree.paths.push_back(std::move(paths[b]->path));
  }
  return std::nullopt;
}

}  // namespace

Result<SmoothedTree> smooth_centerlines(const CenterlineTree& tree, const SmoothingOptions& options,
                                        const Progress& progress) {
  CleanedTree cleaned = clean_tree(tree);
  SmoothedTree result;
  result.tree = std::move(cleaned.tree);
  result.warnings = std::move(cleaned.warnings);
  if (result.tree.branches.empty()) return fail(without_branches(tree, result.warnings));
  for (const CenterlineBranch& branch : result.tree.branches) {
    result.given.emplace_back(4, branch.points_mm.cols());
    result.given.back() << branch.points_mm, branch.radii_mm.transpose();
  }

  // Strengths and nodes are chosen by all branches together...
  const std::vector<NodeRadii> radii = radii_at_nodes(result.tree);
  auto smoothers = make_smoothers(result.tree, radii, options.largest_move, progress);
  if (!smoothers) return fail(cancelled(kStage));
  choose_strengths(*smoothers);
  place_nodes(result.tree, *smoothers, radii, options.largest_move);

  // ... with which each path is a matter of its own branch.
  std::vector<std::optional<SmoothPath>> paths(smoothers->size());
  const auto smooth = [&](std::size_t b) {
    const CenterlineBranch& branch = result.tree.branches[b];
    paths[b] = (*smoothers)[b]->smooth(result.tree.nodes[index(branch.from)].position_mm,
                                       result.tree.nodes[index(branch.to)].position_mm);
  };
  if (!for_each_branch(paths.size(), 0.5, progress, smooth)) return fail(cancelled(kStage));
  if (const auto error = take_paths(std::move(paths), result)) return fail(*error);

  const std::vector<Warning> overlaps = overlap_warnings(result);
  result.warnings.insert(result.warnings.end(), overlaps.begin(), overlaps.end());
  return result;
}

}  // namespace angiospline
