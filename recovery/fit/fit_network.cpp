#include "recovery/fit/fit_network.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <map>

#include <Eigen/Dense>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/fit/penalised_spline.h"
#include "kernel/spline/basis.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/fit_body.h"
#include "recovery/fit/fit_junction.h"
#include "recovery/fit/rings.h"

namespace angiospline {
namespace {

// A value at a place along a ring: patch number + v.
struct RingSample {
  double place = 0.0;
  Vec3 move = Vec3::Zero();
  double weight = 1.0;
};

// The moves of a ring's points nearest to the samples.
Points3 fit_ring(const StripRing& ring, const std::vector<RingSample>& samples) {
  const Eigen::MatrixXd basis = ring.basis();
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(basis.cols(), basis.cols());
  Eigen::MatrixXd b = Eigen::MatrixXd::Zero(basis.cols(), 3);
  for (const RingSample& s : samples) {
    const Eigen::VectorXd row = ring_row(ring, basis, s.place);
    A += s.weight * row * row.transpose();
    b += s.weight * row * s.move.transpose();
  }
  A.diagonal().array() += std::max(1e-300, 1e-5 * A.trace() / static_cast<double>(A.rows()));
  return (basis * A.ldlt().solve(b)).transpose();
}

class Mover {
 public:
  Mover(const SurfaceNetwork& network, const FitMesh& mesh, const Eigen::VectorXd& displacement)
      : old_(network),
        mesh_(mesh),
        displacement_(displacement),
        normals_(moved_normals(mesh, displacement)),
        wall_{mesh, displacement, MeshSmoother(mesh).mass_mm2(), {}},
        rings_(strip_rings(network)),
        ring_of_(network.patches.size(), -1) {
    wall_.nodes_of.resize(network.patches.size());

    for (std::size_t r = 0; r < rings_.size(); ++r) {
      for (std::size_t k = 0; k < rings_[r].patches.size(); ++k) {
        ring_of_[index(rings_[r].patches[k])] = static_cast<int>(r);
      }
    }
    for (int k = 0; k < mesh.size(); ++k)
      wall_.nodes_of[index(mesh.origins[index(k)].patch)].push_back(k);
  }

  Result<MovedNetwork> run(const Progress& progress) {
    MovedNetwork result;
    result.network = old_;
    Points3& pool = result.network.control_points_mm;
    const std::map<int, Vec3> openings = moved_openings();
    move_junctions(openings, result, progress);
    if (progress.should_stop()) return fail(cancelled("junctions"));
    move_closed_regions(result, progress);
    move_end_rows(pool);
    apply_dependencies(result.network);
    move_bodies(result, progress);
    if (progress.should_stop()) return fail(cancelled("bodies"));
    move_rims(result.network);
    return result;
  }

 private:
  bool is_body(const StripRing& ring) const {
    return old_.regions[index(ring.region)].kind == RegionKind::kBody;
  }
  int position_in_ring(int patch) const {
    const std::vector<int>& patches = rings_[index(ring_of_[index(patch)])].patches;
    return static_cast<int>(std::find(patches.begin(), patches.end(), patch) - patches.begin());
  }

  // ---- openings

  // Nodes on the openings' circles are nodes of the bodies; joins tell where they lie on the
  // junctions' rows.
  std::map<int, Vec3> moved_openings() const {
    std::map<int, std::vector<RingSample>> samples;
    for (const Join& join : old_.joins) {
      for (const bool swap : {false, true}) {
        const Side& body = swap ? join.b : join.a;
        const Side& opening = swap ? join.a : join.b;
        if (opening.side != PatchSide::kU0 || !is_junction_patch(opening.patch) ||
            is_junction_patch(body.patch)) {
          continue;
        }
        collect(body, opening, join.reversed, samples[ring_of_[index(opening.patch)]]);
      }
    }

    // A junction without a body: its own rows are the open end.
    for (const Rim& rim : old_.rims) {
      for (const Side& side : rim.sides) {
        if (side.side == PatchSide::kU0 && is_junction_patch(side.patch)) {
          collect(side, side, false, samples[ring_of_[index(side.patch)]]);
        }
      }
    }

    // The ring nearest to the samples, kept in the opening's plane.
    std::map<int, Vec3> moved;
    for (auto& [r, of_ring] : samples) {
      const StripRing& ring = rings_[index(r)];
      const Vec3 axis = (old_.control_points_mm.col(ring.columns(0, 0)) -
                         old_.control_points_mm.col(ring.columns(1, 0)))
                            .normalized();
      const Points3 moves = fit_ring(ring, of_ring);
      for (int c = 0; c < ring.points(); ++c) {
        const Vec3 move = moves.col(c);
        moved[ring.columns(0, c)] =
            old_.control_points_mm.col(ring.columns(0, c)) + move - axis.dot(move) * axis;
      }
    }
    return moved;
  }

  bool is_junction_patch(int patch) const {
    return ring_of_[index(patch)] >= 0 &&
           old_.regions[index(old_.patches[index(patch)].region)].kind == RegionKind::kJunction;
  }

  void collect(const Side& from, const Side& to, bool reversed,
               std::vector<RingSample>& samples) const {
    const Patch& patch = old_.patches[index(from.patch)];
    const double end = from.side == PatchSide::kU0 ? patch.u.first() : patch.u.last();
    const int position = position_in_ring(to.patch);
    for (const int node : wall_.nodes_of[index(from.patch)]) {
      const Vec2& uv = mesh_.origins[index(node)].uv;
      if (uv.x() != end || uv.y() < from.from || uv.y() > from.to) continue;
      const double s = (uv.y() - from.from) / (from.to - from.from);
      const double t = to.from + (reversed ? 1 - s : s) * (to.to - to.from);
      samples.push_back({position + t, wall_.move_of(node), 1.0});
    }
  }

  // ---- junctions

  void move_junctions(const std::map<int, Vec3>& openings, MovedNetwork& result,
                      const Progress& progress) const {
    std::map<int, std::vector<StripRing>> junctions;  // by region
    for (const StripRing& ring : rings_) {
      if (!is_body(ring)) junctions[ring.region].push_back(ring);
    }

    std::vector<int> regions;
    for (const auto& [region, of_junction] : junctions) regions.push_back(region);

    std::vector<MovedPatches> moved(regions.size());
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, regions.size(), [&](std::size_t k) {
      if (progress.should_stop()) return;
      const std::vector<StripRing>& of_junction = junctions.at(regions[k]);
      std::vector<int> patches;
      for (const StripRing& ring : of_junction) {
        patches.insert(patches.end(), ring.patches.begin(), ring.patches.end());
      }
      if (any_moves(of_junction, patches, openings)) {
        moved[k] = move_junction(old_, of_junction, openings, samples_on(patches));
      }
      progress.at("junctions", static_cast<double>(++done) / static_cast<double>(regions.size()));
    });

    for (std::size_t k = 0; k < regions.size(); ++k) take(moved[k], regions[k], result);
  }

  // Whether anything of a junction is to move: its openings, or nodes on its patches.
  bool any_moves(const std::vector<StripRing>& rings, const std::vector<int>& patches,
                 const std::map<int, Vec3>& openings) const {
    for (const StripRing& ring : rings) {
      for (int c = 0; c < ring.points(); ++c) {
        const auto found = openings.find(ring.columns(0, c));
        if (found == openings.end()) continue;
        if (found->second != old_.control_points_mm.col(found->first)) return true;
      }
    }
    return std::any_of(patches.begin(), patches.end(), [&](int p) {
      const std::vector<int>& nodes = wall_.nodes_of[index(p)];
      return std::any_of(nodes.begin(), nodes.end(), [&](int k) { return displacement_(k) != 0; });
    });
  }

  void move_closed_regions(MovedNetwork& result, const Progress& progress) const {
    const std::vector<std::vector<int>> closed = closed_patches(old_);
    std::vector<MovedPatches> moved(closed.size());
    tbb::parallel_for(std::size_t{0}, closed.size(), [&](std::size_t r) {
      if (closed[r].empty() || progress.should_stop()) return;
      moved[r] = move_closed(old_, closed[r], old_.regions[r].radius_mm, samples_on(closed[r]));
    });
    for (std::size_t r = 0; r < closed.size(); ++r) {
      if (!closed[r].empty()) take(moved[r], static_cast<int>(r), result);
    }
  }

  void take(const MovedPatches& moved, int region, MovedNetwork& result) const {
    if (moved.share > 0) {
      for (const auto& [column, point] : moved.points) {
        result.network.control_points_mm.col(column) = point;
      }
    }
    if (moved.failure.empty()) return;
    const std::string& name = old_.regions[index(region)].name;
    if (moved.share > 0) {
      result.held.push_back(
          {name, fmt::format("beyond {:.0f} % of the way: {}", 100 * moved.share, moved.failure)});
    } else {
      result.held.push_back({name, moved.failure});
    }
  }

  std::vector<PatchSample> samples_on(const std::vector<int>& patches) const {
    std::vector<PatchSample> samples;
    for (const int patch : patches) {
      const std::vector<int>& nodes = wall_.nodes_of[index(patch)];
      double area = 0;
      for (const int node : nodes) area += wall_.mass_mm2(node);

      // Patches count alike, whatever their size; within each, nodes by their area.
      for (const int node : nodes) {
        PatchSample s;
        s.patch = patch;
        s.uv = mesh_.origins[index(node)].uv;
        s.point_mm = mesh_.nodes[index(node)].point_mm;
        s.normal = mesh_.nodes[index(node)].normal;
        s.move_mm = wall_.move_of(node);
        s.moved_normal = normals_.col(node);
        s.weight = wall_.mass_mm2(node) / area;
        samples.push_back(s);
      }
    }
    return samples;
  }

  // ---- bodies

  // Rims' rows take the ring nearest to their nodes, in their plane.
  void move_end_rows(Points3& pool) const {
    for (const Rim& rim : old_.rims) {
      std::vector<RingSample> samples;
      int r = -1;
      PatchSide end = PatchSide::kU0;
      for (const Side& side : rim.sides) {
        r = ring_of_[index(side.patch)];
        end = side.side;
        if (r < 0 || !is_body(rings_[index(r)])) break;
        collect(side, side, false, samples);
      }

      if (samples.empty() || !is_body(rings_[index(r)])) continue;

      const StripRing& ring = rings_[index(r)];
      const int row = end == PatchSide::kU0 ? 0 : ring.rows() - 1;
      const Points3 moves = fit_ring(ring, samples);
      for (int c = 0; c < ring.points(); ++c) {
        const Vec3 move = moves.col(c);
        pool.col(ring.columns(row, c)) += move - rim.normal.dot(move) * rim.normal;
      }
    }
  }

  // Whether a body's end is a rim: then the next row is free.
  std::vector<char> free_next_rows(bool at_end) const {
    std::vector<char> is_free(rings_.size(), 0);
    for (const Rim& rim : old_.rims) {
      for (const Side& side : rim.sides) {
        const bool same = side.side == (at_end ? PatchSide::kU1 : PatchSide::kU0);
        if (same && ring_of_[index(side.patch)] >= 0)
          is_free[index(ring_of_[index(side.patch)])] = 1;
      }
    }
    return is_free;
  }

  void move_bodies(MovedNetwork& result, const Progress& progress) const {
    const std::vector<char> free_start = free_next_rows(false);
    const std::vector<char> free_end = free_next_rows(true);

    std::vector<BodyFit> fits(rings_.size());
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, rings_.size(), [&](std::size_t r) {
      if (!is_body(rings_[r]) || progress.should_stop()) return;
      fits[r] = fit_body(old_, wall_, rings_[r], result.network.control_points_mm,
                         free_start[r] != 0, free_end[r] != 0);
      progress.at("bodies", static_cast<double>(++done) / static_cast<double>(rings_.size()));
    });

    // In the order of the rings, whatever thread was first.
    for (std::size_t r = 0; r < rings_.size(); ++r) {
      const StripRing& ring = rings_[r];
      if (!is_body(ring) || fits[r].points.cols() == 0) continue;
      for (int i = 1; i + 1 < ring.rows(); ++i) {
        for (int c = 0; c < ring.points(); ++c) {
          result.network.control_points_mm.col(ring.columns(i, c)) =
              fits[r].points.col(i * ring.points() + c);
        }
      }

      if (fits[r].share >= 1) continue;
      const std::string why =
          fits[r].share > 0
              ? fmt::format("beyond {:.3g} % of the way: its wall would fold", 100 * fits[r].share)
              : "its wall would fold";
      result.held.push_back({old_.regions[index(ring.region)].name, why});
    }
  }

  // ---- rims

  void move_rims(SurfaceNetwork& network) const {
    for (Rim& rim : network.rims) {
      Vec3 center = Vec3::Zero();
      double count = 0;
      std::vector<Vec3> points;
      for (const Side& side : rim.sides) {
        const BSplineSurface<3> surface = patch_surface(network, side.patch);
        for (int k = 0; k < 8; ++k) {
          const Vec2 uv = side_parameters(network.patches[index(side.patch)], side.side,
                                          side.from + (side.to - side.from) * k / 8);
          points.push_back(surface.at(uv.x(), uv.y()));
          center += points.back();
          count += 1;
        }
      }

      // In the rim's plane, which stays.
      center /= count;
      rim.center_mm = center - rim.normal.dot(center - rim.center_mm) * rim.normal;

      double radius = 0;
      for (const Vec3& p : points) radius += (p - rim.center_mm).norm() / count;
      rim.radius_mm = radius;
    }
  }

  const SurfaceNetwork& old_;
  const FitMesh& mesh_;
  const Eigen::VectorXd& displacement_;
  Points3 normals_;
  WallMoves wall_;
  std::vector<StripRing> rings_;
  std::vector<int> ring_of_;  // of each patch, or -1
};

}  // namespace

Result<MovedNetwork> move_network(const SurfaceNetwork& network, const FitMesh& mesh,
                                  const Eigen::VectorXd& displacement, const Progress& progress) {
  return Mover(network, mesh, displacement).run(progress);
}

}  // namespace angiospline
