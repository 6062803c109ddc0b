#include "recovery/fit/closed_surface.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "base/contract.h"
#include "base/index.h"
#include "recovery/fit/patches.h"
#include "recovery/fit/rings.h"
#include "recovery/fit/rules.h"

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

constexpr int kHalves = 2 * kDegree;  // the last of the control points of a side in two halves

// Rows: control points of the two halves of a Bezier curve, the middle one once.
Eigen::Matrix<double, kHalves + 1, kPatchSize> halving_matrix() {
  Eigen::Matrix<double, kHalves + 1, kPatchSize> H;
  const Eigen::Matrix<double, kPatchSize, kPatchSize> all =
      Eigen::Matrix<double, kPatchSize, kPatchSize>::Identity();
  Eigen::Matrix<double, kPatchSize, kPatchSize> level = all;  // de Casteljau at 1/2
  for (int k = 0; k <= kDegree; ++k) {
    H.row(k) = level.row(0);
    H.row(kHalves - k) = level.row(kDegree - k);
    for (int i = 0; i < kDegree - k; ++i) {
      level.row(i) = ((level.row(i) + level.row(i + 1)) / 2).eval();
    }
  }
  return H;
}

// Pool columns of the points on the patches' sides: one for each place of a shared curve.
class SideColumns {
 public:
  explicit SideColumns(std::vector<Vec3>& pool) : pool_(pool) {}

  // `curve` has the six old columns of the side, `k` is the place along it.
  int at_place(std::array<int, kPatchSize> curve, int k, const Vec3& point) {
    if (k == 0) return curve.front();
    if (k == kHalves) return curve.back();
    std::array<int, kPatchSize> other = curve;
    std::reverse(other.begin(), other.end());
    if (other < curve) {
      curve = other;
      k = kHalves - k;
    }
    const auto [found, added] = known_.try_emplace({curve, k}, static_cast<int>(pool_.size()));
    if (added) pool_.push_back(point);
    return found->second;
  }

 private:
  std::vector<Vec3>& pool_;
  std::map<std::pair<std::array<int, kPatchSize>, int>, int> known_;
};

// Columns of the finer net of a patch, row by row along u.
std::vector<int> halved_columns(const SurfaceNetwork& network, const Patch& patch,
                                std::vector<Vec3>& pool, SideColumns& sides) {
  static const auto H = halving_matrix();
  Eigen::Matrix<double, kPatchSize, 3 * kPatchSize> net;  // row i along u, triples along v
  for (int i = 0; i < kPatchSize; ++i) {
    for (int j = 0; j < kPatchSize; ++j) {
      net.block<1, 3>(i, 3 * j) =
          network.control_points_mm.col(patch.control[index(i * kPatchSize + j)]).transpose();
    }
  }

  const auto old = [&](int i, int j) { return patch.control[index(i * kPatchSize + j)]; };

  // The tensor product of both halvings. Points on sides are shared with the neighbour.
  std::vector<int> columns;
  for (int i = 0; i <= kHalves; ++i) {
    const Eigen::RowVectorXd along = H.row(i) * net;
    for (int j = 0; j <= kHalves; ++j) {
      Vec3 point = Vec3::Zero();
      for (int b = 0; b < kPatchSize; ++b) point += H(j, b) * along.segment<3>(3 * b).transpose();

      std::array<int, kPatchSize> curve;
      if (i == 0 || i == kHalves) {
        for (int b = 0; b < kPatchSize; ++b) curve[index(b)] = old(i == 0 ? 0 : kDegree, b);
        columns.push_back(sides.at_place(curve, j, point));
      } else if (j == 0 || j == kHalves) {
        for (int b = 0; b < kPatchSize; ++b) curve[index(b)] = old(b, j == 0 ? 0 : kDegree);
        columns.push_back(sides.at_place(curve, i, point));
      } else {
        columns.push_back(static_cast<int>(pool.size()));
        pool.push_back(point);
      }
    }
  }
  return columns;
}

// quarters[p][2 a + b]: the part of patch p in half a along u and half b along v.
using Quarters = std::map<int, std::array<int, 4>>;

// Cuts the patches in four; the pool's new columns, in the order of their use.
Quarters quarter_patches(const SurfaceNetwork& network, const std::vector<int>& patches,
                         SurfaceNetwork& finer) {
  std::vector<Vec3> pool;
  for (Eigen::Index c = 0; c < network.control_points_mm.cols(); ++c) {
    pool.push_back(network.control_points_mm.col(c));
  }
  SideColumns sides(pool);

  Quarters quarters;
  for (const int p : patches) {
    const Patch& old = network.patches[index(p)];
    const std::vector<int> columns = halved_columns(network, old, pool, sides);
    for (int q = 0; q < 4; ++q) {
      Patch part{old.u, old.v, {}, old.region};
      for (int i = 0; i <= kDegree; ++i) {
        for (int j = 0; j <= kDegree; ++j) {
          const int row = kDegree * (q / 2) + i, column = kDegree * (q % 2) + j;
          part.control.push_back(columns[index(row * (kHalves + 1) + column)]);
        }
      }

      // The first quarter keeps the patch's number.
      quarters[p][index(q)] = q == 0 ? p : static_cast<int>(finer.patches.size());
      if (q == 0) {
        finer.patches[index(p)] = std::move(part);
      } else {
        finer.patches.push_back(std::move(part));
      }
    }
  }
  finer.control_points_mm =
      Eigen::Map<const Points3>(pool.data()->data(), 3, static_cast<Eigen::Index>(pool.size()));
  return quarters;
}

// A half of a side that was cut, as a whole side of a quarter.
Side half_of(const Side& side, const Quarters& quarters, int half) {
  const std::array<int, 4>& q = quarters.at(side.patch);
  const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
  const int far = side.side == PatchSide::kU1 || side.side == PatchSide::kV1 ? 1 : 0;
  return Side{q[index(along_v ? 2 * far + half : 2 * half + far)], side.side, 0.0, 1.0};
}

// The joins of the finer network: halves of the old ones, then those within each old patch.
std::vector<Join> join_quarters(const std::vector<Join>& old, const Quarters& quarters) {
  std::vector<Join> joins;
  for (const Join& join : old) {
    if (!quarters.contains(join.a.patch)) {
      joins.push_back(join);
      continue;
    }
    for (int half = 0; half < 2; ++half) {
      const int other = join.reversed ? 1 - half : half;
      joins.push_back(
          {half_of(join.a, quarters, half), half_of(join.b, quarters, other), join.reversed});
    }
  }

  for (const auto& [p, q] : quarters) {
    for (int k = 0; k < 2; ++k) {
      joins.push_back({{q[index(k)], PatchSide::kU1}, {q[index(2 + k)], PatchSide::kU0}, false});
      joins.push_back(
          {{q[index(2 * k)], PatchSide::kV1}, {q[index(2 * k + 1)], PatchSide::kV0}, false});
    }
  }
  return joins;
}

}  // namespace

SurfaceNetwork with_quartered(const SurfaceNetwork& network, const std::vector<int>& patches) {
  SurfaceNetwork finer = network;
  const Quarters quarters = quarter_patches(network, patches, finer);
  finer.joins = join_quarters(network.joins, quarters);
  return compacted(std::move(finer));
}

}  // namespace angiospline
