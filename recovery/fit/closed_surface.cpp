#include "recovery/fit/closed_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Eigenvalues>
#include <fmt/format.h>

#include "base/contract.h"
#include "base/index.h"
#include "recovery/fit/patches.h"
#include "recovery/fit/rings.h"
#include "recovery/fit/rules.h"
#include "recovery/imaging/mask/morphology.h"

namespace angiospline {
namespace {

using namespace fit_rules;

constexpr int kDegree = kPatchSize - 1;

// Points of the cube's surface on a lattice of 5 n steps along each edge.
using Lattice = std::array<int, 3>;

// A face of the cube: u and v run along these axes, so that u x v points out. No two faces next to
// each other close into a strip along v.
struct CubeFace {
  int out, u, v;
  bool far;
};
constexpr std::array<CubeFace, 6> kFaces{{{0, 1, 2, true},
                                          {1, 2, 0, true},
                                          {2, 0, 1, true},
                                          {0, 2, 1, false},
                                          {1, 0, 2, false},
                                          {2, 1, 0, false}}};

Lattice lattice(const CubeFace& face, int i, int j, int steps) {
  Lattice p{};
  p[index(face.out)] = face.far ? steps : 0;
  p[index(face.u)] = i;
  p[index(face.v)] = j;
  return p;
}

// The direction of a place on a face, by equal angles: u and v in [0, 1].
Vec3 direction(const CubeFace& face, double u, double v) {
  const auto side = [](double t) { return std::tan((2 * t - 1) * std::numbers::pi / 4); };
  Vec3 d;
  d(face.out) = face.far ? 1 : -1;
  d(face.u) = side(u);
  d(face.v) = side(v);
  return d.normalized();
}

// Sides whose ends are the same two lattice points are one curve.
void join_sides(const std::vector<std::array<Lattice, 4>>& corners, SurfaceNetwork& network) {
  struct End {
    Side side;
    Lattice from;
  };
  std::map<std::pair<Lattice, Lattice>, End> waiting;
  for (std::size_t p = 0; p < corners.size(); ++p) {
    const auto& [c00, c10, c01, c11] = corners[p];

    const std::array<std::pair<Lattice, Lattice>, 4> sides{
        {{c00, c01}, {c10, c11}, {c00, c10}, {c01, c11}}};  // in the order of PatchSide

    // The second patch that comes to a curve joins the first.
    for (std::size_t s = 0; s < 4; ++s) {
      const auto& [from, to] = sides[s];
      const Side side{static_cast<int>(p), static_cast<PatchSide>(s), 0.0, 1.0};
      const auto key = std::minmax(from, to);
      const auto [found, added] =
          waiting.try_emplace(std::pair<Lattice, Lattice>(key), End{side, from});
      if (!added) network.joins.push_back({found->second.side, side, found->second.from != from});
    }
  }
}

// Numbers for lattice points in the order in which they come, and the sphere's points there.
struct SpherePoints {
  std::map<Lattice, int> number;
  std::vector<Vec3> points;
};

// One patch of a face: part (a, b) of its `divisions` along u and v.
struct FacePart {
  const CubeFace& face;
  int a, b, divisions;
  int steps() const { return kDegree * divisions; }
};

Patch patch_of(const FacePart& part, SpherePoints& sphere) {
  Patch patch{KnotVector::bezier(kDegree), KnotVector::bezier(kDegree), {}, 0};
  const int steps = part.steps();

  for (int i = 0; i <= kDegree; ++i) {
    for (int j = 0; j <= kDegree; ++j) {
      const int k = kDegree * part.a + i, l = kDegree * part.b + j;
      const auto [found, added] = sphere.number.try_emplace(lattice(part.face, k, l, steps),
                                                            static_cast<int>(sphere.points.size()));
      if (added) {
        sphere.points.push_back(
            direction(part.face, static_cast<double>(k) / steps, static_cast<double>(l) / steps));
      }
      patch.control.push_back(found->second);
    }
  }
  return patch;
}

// Places of the sphere that the patch should run through.
void add_samples(const FacePart& part, int patch, std::vector<PatchSample>& samples) {
  for (int i = 0; i <= kSphereSteps; ++i) {
    for (int j = 0; j <= kSphereSteps; ++j) {
      PatchSample s;
      s.patch = patch;
      s.uv = Vec2(i, j) / kSphereSteps;
      s.point_mm = s.normal = s.moved_normal = direction(
          part.face, (part.a + s.uv.x()) / part.divisions, (part.b + s.uv.y()) / part.divisions);
      s.weight = 1.0 / ((kSphereSteps + 1) * (kSphereSteps + 1));
      samples.push_back(s);
    }
  }
}

// The unit sphere's patches and joins, control points at the lattice's directions; samples of the
// sphere for them.
SurfaceNetwork cube_of_patches(int divisions, std::vector<PatchSample>& samples) {
  SurfaceNetwork network;
  SpherePoints sphere;
  std::vector<std::array<Lattice, 4>> corners;
  for (const CubeFace& face : kFaces) {
    for (int a = 0; a < divisions; ++a) {
      for (int b = 0; b < divisions; ++b) {
        const FacePart part{face, a, b, divisions};

        const auto corner = [&](int i, int j) {
          return lattice(face, kDegree * (a + i), kDegree * (b + j), part.steps());
        };
        corners.push_back({corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)});
        add_samples(part, static_cast<int>(network.patches.size()), samples);
        network.patches.push_back(patch_of(part, sphere));
      }
    }
  }

  const std::vector<Vec3>& points = sphere.points;
  network.control_points_mm =
      Eigen::Map<const Points3>(points.data()->data(), 3, static_cast<Eigen::Index>(points.size()));
  join_sides(corners, network);
  return network;
}

SurfaceNetwork unit_sphere(int divisions) {
  std::vector<PatchSample> samples;
  SurfaceNetwork network = cube_of_patches(divisions, samples);
  std::vector<int> patches(network.patches.size());
  for (std::size_t p = 0; p < patches.size(); ++p) patches[p] = static_cast<int>(p);

  PatchGroup group = patch_group(network, patches);
  std::fill(group.net.scale.begin(), group.net.scale.end(), 1.0);
  number_unknowns(group);
  for (const Join& join : network.joins) add_edge(group, join, 1);

  // Samples lie on the sphere: the group is moved onto it and made smooth.
  const MovedGroup moved = move_group(group, samples, Points3::Zero(3, group.net.points.cols()),
                                      PatchWeights{}, std::array{0.0}, 0.0);
  EXPECTS(moved.failure.empty());

  for (std::size_t k = 0; k < group.columns.size(); ++k) {
    network.control_points_mm.col(group.columns[k]) =
        group.net.points.col(static_cast<Eigen::Index>(k));
  }
  return network;
}

}  // namespace

SurfaceNetwork closed_surface(const Vec3& center, const Mat3& half_axes, const std::string& name,
                              int divisions) {
  EXPECTS(divisions >= 1 && divisions <= 4);
  SurfaceNetwork network = unit_sphere(divisions);
  Mat3 axes = half_axes;
  if (axes.determinant() < 0) axes.col(2) *= -1;
  network.control_points_mm = (axes * network.control_points_mm).colwise() + center;
  network.regions = {{"wall_" + name, RegionKind::kBody, axes.colwise().norm().minCoeff()}};
  return network;
}

std::vector<std::vector<int>> closed_patches(const SurfaceNetwork& network) {
  std::vector<std::vector<int>> closed(network.regions.size());
  std::vector<char> other(network.regions.size(), 0);
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const Patch& patch = network.patches[p];
    closed[index(patch.region)].push_back(static_cast<int>(p));
    const KnotVector bezier = KnotVector::bezier(kDegree);
    if (!(patch.u == bezier && patch.v == bezier)) other[index(patch.region)] = 1;
  }

  // What meets another region, or a part of a side, or an open end is no closed surface.
  for (const Join& join : network.joins) {
    const int a = network.patches[index(join.a.patch)].region;
    const int b = network.patches[index(join.b.patch)].region;
    const auto part = [](const Side& side) { return side.from != 0 || side.to != 1; };
    if (a != b || part(join.a) || part(join.b)) other[index(a)] = other[index(b)] = 1;
  }
  for (const Rim& rim : network.rims) {
    for (const Side& side : rim.sides) other[index(network.patches[index(side.patch)].region)] = 1;
  }

  for (std::size_t r = 0; r < closed.size(); ++r) {
    if (other[r]) closed[r].clear();
  }
  return closed;
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
