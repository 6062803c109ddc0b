#include "recovery/fit/closed_pieces.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "base/index.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/rules.h"
#include "recovery/imaging/mask/morphology.h"

namespace angiospline {

namespace {

using namespace fit_rules;

struct Piece {
  int voxels = 0;
  int axis = 0;  // voxels of the skeleton
  bool at_border = false;
  std::vector<int> branches;
};

bool is_blob(const Piece& piece, const CenterlineTree& tree) {
  if (piece.voxels < kFewestClosedVoxels) return false;
  if (piece.axis <= 1) return piece.branches.empty();
  if (piece.branches.size() != 1 || piece.at_border) return false;
  const CenterlineBranch& branch = tree.branches[index(piece.branches.front())];
  return branch.from != branch.to && length_mm(branch) <= kLongestBlob * branch.radii_mm.mean();
}

// The pieces of a labelled mask; a branch belongs to the piece at the middle of its line.
std::vector<Piece> pieces_of(const Components& components, const Mask& skeleton,
                             const CenterlineTree& tree) {
  const ImageGrid& grid = skeleton.grid;
  std::vector<Piece> pieces(components.list.size());
  for (std::size_t i = 0; i < skeleton.voxels.size(); ++i) {
    const int label = components.labels.voxels[i];
    if (label == 0) continue;
    Piece& piece = pieces[index(label - 1)];
    ++piece.voxels;
    piece.axis += skeleton.voxels[i] != 0 ? 1 : 0;

    const Voxel v = grid.voxel(i);
    for (std::size_t k = 0; k < 3; ++k)
      piece.at_border = piece.at_border || v[k] == 0 || v[k] == grid.size[k] - 1;
  }

  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    const Points3& line = tree.branches[b].points_mm;
    const Vec3 middle = grid.index_vox(line.col(line.cols() / 2));
    Voxel v{};
    for (std::size_t k = 0; k < 3; ++k)
      v[k] = std::clamp(static_cast<int>(std::lround(middle(static_cast<Eigen::Index>(k)))), 0,
                        grid.size[k] - 1);
    const int label = components.labels.voxels[grid.offset(v)];
    if (label != 0) pieces[index(label - 1)].branches.push_back(static_cast<int>(b));
  }
  return pieces;
}

// The tree without these branches and the nodes that only they have.
CenterlineTree without(const CenterlineTree& tree, const std::vector<char>& dropped) {
  std::vector<int> renumbered(tree.nodes.size(), -1);
  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    if (dropped[b]) continue;
    renumbered[index(tree.branches[b].from)] = renumbered[index(tree.branches[b].to)] = 0;
  }

  CenterlineTree kept = tree;
  kept.nodes.clear();
  kept.branches.clear();
  kept.inlets.clear();
  for (std::size_t n = 0; n < tree.nodes.size(); ++n) {
    if (renumbered[n] < 0) continue;
    renumbered[n] = static_cast<int>(kept.nodes.size());
    kept.nodes.push_back(tree.nodes[n]);
  }
  for (std::size_t b = 0; b < tree.branches.size(); ++b) {
    if (dropped[b]) continue;
    kept.branches.push_back(tree.branches[b]);
    kept.branches.back().from = renumbered[index(tree.branches[b].from)];
    kept.branches.back().to = renumbered[index(tree.branches[b].to)];
  }
  for (const int inlet : tree.inlets)
    if (renumbered[index(inlet)] >= 0) kept.inlets.push_back(renumbered[index(inlet)]);
  return kept;
}

}  // namespace

TreeAndPieces part_closed_pieces(const Mask& mask, const Mask& skeleton,
                                 const CenterlineTree& tree) {
  EXPECTS(mask.grid.size == skeleton.grid.size);
  const Components components = connected_components(mask, Neighbours::kCorners26);
  const std::vector<Piece> pieces = pieces_of(components, skeleton, tree);

  std::vector<char> blob(pieces.size(), 0), dropped(tree.branches.size(), 0);
  for (std::size_t p = 0; p < pieces.size(); ++p) {
    if (!is_blob(pieces[p], tree)) continue;
    blob[p] = 1;
    for (const int b : pieces[p].branches) dropped[index(b)] = 1;
  }

  TreeAndPieces parted{tree, Mask(mask.grid)};
  if (std::find(dropped.begin(), dropped.end(), 0) == dropped.end()) return parted;

  parted.tree = without(tree, dropped);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const int label = components.labels.voxels[i];
    if (label != 0 && blob[index(label - 1)]) parted.pieces.voxels[i] = 1;
  }
  return parted;
}

Result<void> add_closed_pieces(Model& model, const Mask& pieces, const Image<float>* image,
                               const FitOptions& options, const Progress& progress) {
  const bool none =
      std::none_of(pieces.voxels.begin(), pieces.voxels.end(), [](auto v) { return v != 0; });
  if (none) return {};

  auto closed = closed_model(pieces);
  if (!closed) return fail(closed.error());

  // A piece that cannot be fitted is still better shown than left out.
  if (image != nullptr) {
    auto fitted = fit_model(*closed, *image, options, progress);
    if (!fitted && fitted.error().kind == ErrorKind::kCancelled) return fail(fitted.error());
    if (fitted) {
      *closed = std::move(fitted->model);
    } else {
      closed->warnings.push_back(
          {WarningCode::kClosedPiecesNotFitted,
           "closed pieces were not fitted to the image: " + fitted.error().message()});
    }
  }

  append(model.network, closed->network);
  model.assumptions.push_back(
      fmt::format("{} of the mask without branches made closed surfaces",
                  closed->network.regions.size() == 1
                      ? "1 piece"
                      : fmt::format("{} pieces", closed->network.regions.size())));
  model.warnings.insert(model.warnings.end(), closed->warnings.begin(), closed->warnings.end());
  return {};
}

namespace {

// Sums over the voxels of a connected piece; places are relative to the grid's origin.
struct PieceSums {
  double count = 0;
  Vec3 sum = Vec3::Zero();
  Mat3 squares = Mat3::Zero();
};

// The largest first.
std::vector<PieceSums> sums_of_pieces(const Mask& mask) {
  const Components components = connected_components(mask, Neighbours::kCorners26);
  std::vector<PieceSums> pieces(components.list.size());
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const int label = components.labels.voxels[i];
    if (label == 0) continue;
    const Voxel v = mask.grid.voxel(i);
    const Vec3 p = mask.grid.world_mm(Vec3(v[0], v[1], v[2])) - mask.grid.origin_mm;
    PieceSums& piece = pieces[index(label - 1)];
    piece.count += 1;
    piece.sum += p;
    piece.squares += p * p.transpose();
  }

  std::stable_sort(pieces.begin(), pieces.end(),
                   [](const PieceSums& a, const PieceSums& b) { return a.count > b.count; });
  return pieces;
}

// The ellipsoid of the piece's second moments: those of a solid one are a fifth of its squared half
// axes.
SurfaceNetwork ellipsoid_of(const PieceSums& piece, const ImageGrid& grid,
                            const std::string& name) {
  const Vec3 center = piece.sum / piece.count;
  const Mat3 spread = piece.squares / piece.count - center * center.transpose();
  const Eigen::SelfAdjointEigenSolver<Mat3> axes(spread);
  const double least = kThinnestVox * std::cbrt(grid.spacing_mm.prod());
  const Vec3 half = (5 * axes.eigenvalues()).cwiseMax(least * least).cwiseSqrt();
  return closed_surface(grid.origin_mm + center, axes.eigenvectors() * half.asDiagonal(), name);
}

}  // namespace

Result<Model> closed_model(const Mask& mask) {
  const std::vector<PieceSums> pieces = sums_of_pieces(mask);
  Model model;
  model.name = "closed";
  int small = 0;
  for (const PieceSums& piece : pieces) {
    if (piece.count < kFewestClosedVoxels) {
      ++small;
      continue;
    }
    append(model.network, ellipsoid_of(piece, mask.grid,
                                       fmt::format("closed_{}", model.network.regions.size() + 1)));
  }

  if (model.network.patches.empty()) {
    return fail({ErrorKind::kBadInput,
                 "the mask has no piece large enough for a surface",
                 {},
                 fmt::format("{} pieces", pieces.size()),
                 fmt::format("a piece has at least {} voxels", kFewestClosedVoxels)});
  }
  if (small > 0) {
    model.warnings.push_back({WarningCode::kPiecesLeftOut,
                              fmt::format("{} pieces of the mask below {} voxels were left out",
                                          small, kFewestClosedVoxels)});
  }
  return model;
}

}  // namespace angiospline
