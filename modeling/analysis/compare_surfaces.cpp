#include "modeling/analysis/compare_surfaces.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>

#include <Eigen/Geometry>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "base/contract.h"
#include "base/disjoint_sets.h"
#include "base/index.h"
#include "kernel/geometry/triangle_tree.h"

namespace angiospline {
namespace {

// What one triangle adds to a directed distance.
struct Share {
  double area = 0.0;
  double sum = 0.0;          // of distance times area
  double sum_squared = 0.0;  // of squared distance times area
  double squared_max = -1.0;
  Vec3 worst = Vec3::Zero();
  int near = -1;  // the other surface's triangle nearest to the sample before

  void look(const TriangleTree& tree, const Vec3& p, double weight) {
    const NearestTrianglePoint found = tree.nearest(p, near);
    near = found.triangle;
    const double squared = found.squared_distance_mm2;
    sum += weight * std::sqrt(squared);
    sum_squared += weight * squared;
    if (squared > squared_max) {
      squared_max = squared;
      worst = p;
    }
  }
};

Share share_of(const TriangleMesh& mesh, Eigen::Index t, const TriangleTree& tree, double spacing) {
  const Vec3 a = mesh.points_mm.col(mesh.triangles(0, t));
  const Vec3 b = mesh.points_mm.col(mesh.triangles(1, t));
  const Vec3 c = mesh.points_mm.col(mesh.triangles(2, t));
  const double longest = std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
  const int n = std::max(1, static_cast<int>(std::ceil(longest / spacing)));
  Share share;
  share.area = 0.5 * (b - a).cross(c - a).norm();
  const double weight = share.area / (static_cast<double>(n) * n);
  const Vec3 u = (b - a) / n;
  const Vec3 v = (c - a) / n;
  for (int i = 0; i < n; ++i) {
    for (int j = 0; i + j < n; ++j) {
      const Vec3 corner = a + i * u + j * v;
      share.look(tree, corner + (u + v) / 3, weight);
      if (i + j + 1 < n) share.look(tree, corner + 2 * (u + v) / 3, weight);
    }
  }
  return share;
}

// Corners count for the maximum only, each once.
std::vector<char> corners_in_use(const TriangleMesh& mesh) {
  std::vector<char> used(static_cast<std::size_t>(mesh.points_mm.cols()), 0);
  for (const int p : mesh.triangles.reshaped()) used[static_cast<std::size_t>(p)] = 1;
  return used;
}

Result<DirectedDistance> directed(const TriangleMesh& from, const TriangleTree& to, double spacing,
                                  const Progress& progress) {
  std::vector<Share> shares(static_cast<std::size_t>(from.triangles.cols()));
  std::atomic<bool> stopped = false;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, shares.size(), 256), [&](const auto& range) {
    if (stopped || progress.should_stop()) {
      stopped = true;
      return;
    }
    for (std::size_t t = range.begin(); t < range.end(); ++t) {
      shares[t] = share_of(from, static_cast<Eigen::Index>(t), to, spacing);
    }
  });

  // Corners as well: there the distance is often the largest, and samples lie inside triangles.
  const std::vector<char> used = corners_in_use(from);
  std::vector<double> corner(used.size(), 0.0);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, used.size(), 256), [&](const auto& range) {
    if (stopped || progress.should_stop()) {
      stopped = true;
      return;
    }
    for (std::size_t k = range.begin(); k < range.end(); ++k) {
      if (used[k] == 0) continue;
      const Vec3 p = from.points_mm.col(static_cast<Eigen::Index>(k));
      corner[k] = to.nearest(p).squared_distance_mm2;
    }
  });

  if (stopped) return fail(cancelled("compare"));
  Share all;  // summed in the order of triangles: the same on any number of threads
  for (const Share& share : shares) {
    all.area += share.area;
    all.sum += share.sum;
    all.sum_squared += share.sum_squared;
    if (share.squared_max > all.squared_max) {
      all.squared_max = share.squared_max;
      all.worst = share.worst;
    }
  }

  for (std::size_t k = 0; k < corner.size(); ++k) {
    if (corner[k] <= all.squared_max) continue;
    all.squared_max = corner[k];
    all.worst = from.points_mm.col(static_cast<Eigen::Index>(k));
  }

  DirectedDistance distance{std::sqrt(all.squared_max), 0.0, 0.0, all.worst};
  if (all.area > 0) {
    distance.mean_mm = all.sum / all.area;
    distance.rms_mm = std::sqrt(all.sum_squared / all.area);
  }
  return distance;
}

// Closed loops of open edges: ends of the surface that no cap closes.
int open_loops(const TriangleMesh& mesh) {
  std::map<std::pair<int, int>, int> uses;
  for (const auto& t : mesh.triangles.colwise()) {
    for (int k = 0; k < 3; ++k) ++uses[std::minmax(t[k], t[(k + 1) % 3])];
  }

  DisjointSets loops(index(mesh.points_mm.cols()));
  std::vector<char> on_loop(loops.size(), 0);
  for (const auto& [edge, count] : uses) {
    if (count != 1) continue;
    loops.join(edge.first, edge.second);
    on_loop[index(edge.first)] = on_loop[index(edge.second)] = 1;
  }
  const auto inside = std::count(on_loop.begin(), on_loop.end(), char{0});
  return loops.count() - static_cast<int>(inside);
}

std::array<int, 3> caps(const TriangleMesh& mesh) {
  std::array<int, 3> count{};
  for (const MeshPart& part : mesh.parts) {
    if (!is_wall(part.kind)) {
      ++count[static_cast<std::size_t>(part.kind) - static_cast<std::size_t>(PartKind::kInlet)];
    }
  }
  return count;
}

bool same_topology(const TriangleMesh& a, const MeshMeasure& ma, const TriangleMesh& b,
                   const MeshMeasure& mb) {
  if (ma.components != mb.components || ma.genus != mb.genus || ma.closed() != mb.closed()) {
    return false;
  }
  if (!ma.closed() && open_loops(a) != open_loops(b)) return false;
  constexpr std::array<int, 3> kNone{};
  const auto caps_a = caps(a);
  const auto caps_b = caps(b);
  return caps_a == kNone || caps_b == kNone || caps_a == caps_b;
}

}  // namespace

Result<Comparison> compare(const TriangleMesh& a, const TriangleMesh& b,
                           const CompareOptions& options, const Progress& progress) {
  EXPECTS(options.spacing_mm >= 0);
  for (const TriangleMesh* mesh : {&a, &b}) {
    if (mesh->triangles.cols() == 0) {
      return fail({ErrorKind::kBadInput,
                   "surface has no triangles",
                   mesh == &a ? "first" : "second",
                   {},
                   "there is something to compare"});
    }
  }

  const MeshMeasure ma = measure(a);
  const MeshMeasure mb = measure(b);
  Comparison result;
  result.spacing_mm = options.spacing_mm;
  if (result.spacing_mm == 0) {
    result.spacing_mm =
        (ma.highest_mm.cwiseMax(mb.highest_mm) - ma.lowest_mm.cwiseMin(mb.lowest_mm)).norm() / 300;
  }

  const TriangleTree tree_a(a);
  const TriangleTree tree_b(b);
  progress.at("compare", 0.0);
  Result<DirectedDistance> there = directed(a, tree_b, result.spacing_mm, progress);
  if (!there) return fail(there.error());
  progress.at("compare", 0.5);
  Result<DirectedDistance> back = directed(b, tree_a, result.spacing_mm, progress);
  if (!back) return fail(back.error());
  progress.at("compare", 1.0);

  result.a_to_b = *there;
  result.b_to_a = *back;
  result.max_distance_mm = std::max(there->max_mm, back->max_mm);
  result.mean_distance_mm = 0.5 * (there->mean_mm + back->mean_mm);
  result.rms_distance_mm =
      std::sqrt(0.5 * (there->rms_mm * there->rms_mm + back->rms_mm * back->rms_mm));
  result.volume_ratio =
      ma.volume_mm3 != 0 ? mb.volume_mm3 / ma.volume_mm3 : std::numeric_limits<double>::quiet_NaN();
  result.area_ratio =
      ma.area_mm2 > 0 ? mb.area_mm2 / ma.area_mm2 : std::numeric_limits<double>::quiet_NaN();
  result.same_topology = same_topology(a, ma, b, mb);
  return result;
}

MeshField distance_field(const TriangleMesh& mesh, const TriangleMesh& reference) {
  const TriangleTree tree(reference);
  MeshField field{"distance_mm", Eigen::VectorXd(mesh.points_mm.cols())};
  tbb::parallel_for(Eigen::Index{0}, mesh.points_mm.cols(), [&](Eigen::Index k) {
    const Vec3 p = mesh.points_mm.col(k);
    const NearestTrianglePoint near = tree.nearest(p);
    const auto corner = reference.triangles.col(near.triangle);
    const Vec3 a = reference.points_mm.col(corner[0]);
    const Vec3 n = (Vec3(reference.points_mm.col(corner[1])) - a)
                       .cross(Vec3(reference.points_mm.col(corner[2])) - a);
    const double distance = std::sqrt(near.squared_distance_mm2);
    field.values[k] = n.dot(p - near.point_mm) < 0 ? -distance : distance;
  });
  return field;
}

}  // namespace angiospline
