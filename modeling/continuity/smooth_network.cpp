#include "modeling/continuity/smooth_network.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "modeling/continuity/mend_bodies.h"
#include "modeling/continuity/rules.h"
#include "modeling/junction/in_network.h"
#include "modeling/junction/quality.h"
#include "modeling/junction/smooth_junction.h"

namespace angiospline {
namespace {

using namespace continuity_rules;

constexpr double kDegrees = 180 / std::numbers::pi;

using Outcome = SmoothedPart::Outcome;

double angle_deg(const Vec3& a, const Vec3& b) {
  return kDegrees * std::atan2(a.cross(b).norm(), a.dot(b));
}

// Between the normals of both sides, at points evenly spread with both ends.
double join_angle_deg(const SurfaceNetwork& network, const Join& join) {
  const Patch& a = network.patches[index(join.a.patch)];
  const Patch& b = network.patches[index(join.b.patch)];
  const BSplineSurface<3> surface_a = patch_surface(network, join.a.patch);
  const BSplineSurface<3> surface_b = patch_surface(network, join.b.patch);
  const bool along_v = join.a.side == PatchSide::kU0 || join.a.side == PatchSide::kU1;
  const KnotVector& knots = along_v ? a.v : a.u;
  const int count = kAngleSamplesPerSpan * (knots.control_point_count() - knots.degree());

  double worst = 0;
  for (int k = 0; k <= count; ++k) {
    const double s = static_cast<double>(k) / count;
    const Vec2 ua = side_parameters(a, join.a.side, join_parameter_a(join, s));
    const Vec2 ub = side_parameters(b, join.b.side, join_parameter_b(join, s));
    worst = std::max(worst, angle_deg(normal_vector(surface_a, ua.x(), ua.y()),
                                      normal_vector(surface_b, ub.x(), ub.y())));
  }
  return worst;
}

// The largest angle over the joins inside a region. A join between two regions counts for the body:
// junctions hold their openings.
class RegionAngles {
 public:
  explicit RegionAngles(const SurfaceNetwork& network)
      : network_(network), region_(network.joins.size()), angle_(network.joins.size(), 0.0) {
    for (std::size_t j = 0; j < network.joins.size(); ++j) {
      const int a = network.patches[index(network.joins[j].a.patch)].region;
      const int b = network.patches[index(network.joins[j].b.patch)].region;
      region_[j] = network.regions[index(a)].kind == RegionKind::kBody ? a : b;
    }
  }

  // One value for each region.
  std::vector<double> measure() {
    tbb::parallel_for(std::size_t{0}, angle_.size(), [&](std::size_t j) {
      angle_[j] = join_angle_deg(network_, network_.joins[j]);
    });
    std::vector<double> worst(network_.regions.size(), 0.0);
    for (std::size_t j = 0; j < angle_.size(); ++j) {
      worst[index(region_[j])] = std::max(worst[index(region_[j])], angle_[j]);
    }
    return worst;
  }

 private:
  const SurfaceNetwork& network_;
  std::vector<int> region_;
  std::vector<double> angle_;
};

// New places of a junction's control points, or why there are none.
struct JunctionMove {
  std::vector<int> columns;
  Points3 points_mm;
  std::string refused;
};

JunctionMove smooth_one(const SurfaceNetwork& network, int region, double clean_deg) {
  JunctionMove move;
  const auto junction = junction_in_network(network, region);
  if (!junction) {
    move.refused = junction.error().message();
    return move;
  }

  const JunctionLayout layout = present_layout(*junction, network);
  JunctionNet start = present_net(*junction, layout, network);
  const Points3 before = junction_normals(junction->topology, start);
  const SmoothedNet smooth = smooth_in_place(junction->topology, layout, std::move(start));
  if (!smooth.solved) {
    move.refused = "the equations of its edges cannot be solved";
    return move;
  }

  // How far the surface turned stands in for the distance from a target, of which there is none.
  JunctionQuality quality = junction_quality(junction->topology, smooth.net);
  const Points3 after = junction_normals(junction->topology, smooth.net);
  for (Eigen::Index k = 0; k < before.cols(); ++k) {
    quality.normal_off_target_deg =
        std::max(quality.normal_off_target_deg, angle_deg(before.col(k), after.col(k)));
  }

  if (quality.normal_off_target_deg > kMostTurnDeg) {
    move.refused = fmt::format("its surface would turn by {:.3g} degrees, at most {} is allowed",
                               quality.normal_off_target_deg, kMostTurnDeg);
  } else if (!is_sound(quality)) {
    move.refused = failed_gate(quality);
  } else if (quality.worst_angle_deg > clean_deg) {
    move.refused =
        fmt::format("{:.3g} degrees remain between its patches", quality.worst_angle_deg);
  }
  if (!move.refused.empty()) return move;

  // Back from the junction's own unit and place.
  move.columns = junction->columns;
  move.points_mm = (junction->radius_mm * smooth.net.points).colwise() + junction->center_mm;
  return move;
}

class Smoother {
 public:
  Smoother(SurfaceNetwork network, const SmoothNetworkOptions& options, const Progress& progress)
      : options_(options), progress_(progress) {
    result_.network = std::move(network);
  }

  Result<SmoothedNetwork> run() {
    const Points3 start = result_.network.control_points_mm;
    RegionAngles angles(result_.network);
    const std::vector<double> before = angles.measure();
    for (std::size_t r = 0; r < before.size(); ++r) {
      SmoothedPart part;
      part.name = result_.network.regions[r].name;
      part.before_deg = before[r];
      result_.parts.push_back(std::move(part));
      wanted_.push_back(options_.everything || !(before[r] <= options_.clean_deg));
    }

    // Bodies first: junctions hold their openings as bodies leave them.
    mend_bodies();
    if (!smooth_junctions()) return fail(cancelled("smooth junctions"));

    const std::vector<double> after = angles.measure();
    for (std::size_t r = 0; r < after.size(); ++r) result_.parts[r].after_deg = after[r];
    measure_moves(start);

    // What was moved and is still not smooth is refused all the same.
    for (SmoothedPart& part : result_.parts) {
      result_.before_deg = std::max(result_.before_deg, part.before_deg);
      result_.after_deg = std::max(result_.after_deg, part.after_deg);
      if (part.outcome == Outcome::kSmoothed && !(part.after_deg <= options_.clean_deg)) {
        part.outcome = Outcome::kRefused;
        part.why = fmt::format("{:.3g} degrees remain", part.after_deg);
      }
    }
    return std::move(result_);
  }

 private:
  SurfaceNetwork& network() { return result_.network; }

  void mend_bodies() {
    std::vector<char> mended(network().regions.size(), 0);
    for (const BodyRing& ring : body_rings(network())) {
      if (!wanted_[index(ring.region)]) continue;
      for (const int beyond : mend_body(network(), ring)) wanted_[index(beyond)] = 1;
      mended[index(ring.region)] = 1;
    }
    for (std::size_t r = 0; r < wanted_.size(); ++r) {
      if (!wanted_[r] || network().regions[r].kind != RegionKind::kBody) continue;
      result_.parts[r].outcome = mended[r] ? Outcome::kSmoothed : Outcome::kRefused;
      if (!mended[r]) result_.parts[r].why = "its patches are not a ring of strips";
    }
  }

  bool smooth_junctions() {
    std::vector<int> work;
    for (int r = 0; r < static_cast<int>(wanted_.size()); ++r) {
      if (wanted_[index(r)] && network().regions[index(r)].kind == RegionKind::kJunction)
        work.push_back(r);
    }

    // Junctions share no point that moves, so they are solved side by side and written in order.
    std::vector<JunctionMove> moves(work.size());
    std::atomic<std::size_t> done{0};
    tbb::parallel_for(std::size_t{0}, work.size(), [&](std::size_t k) {
      if (progress_.should_stop()) return;
      moves[k] = smooth_one(network(), work[k], options_.clean_deg);
      progress_.at("smooth junctions",
                   static_cast<double>(++done) / static_cast<double>(work.size()));
    });
    if (progress_.should_stop()) return false;

    for (std::size_t k = 0; k < work.size(); ++k) {
      SmoothedPart& part = result_.parts[index(work[k])];
      part.outcome = moves[k].refused.empty() ? Outcome::kSmoothed : Outcome::kRefused;
      part.why = moves[k].refused;
      for (std::size_t c = 0; c < moves[k].columns.size(); ++c) {
        network().control_points_mm.col(moves[k].columns[c]) =
            moves[k].points_mm.col(static_cast<Eigen::Index>(c));
      }
    }
    apply_dependencies(network());
    return true;
  }

  void measure_moves(const Points3& start) {
    const Eigen::RowVectorXd moved = (network().control_points_mm - start).colwise().norm();
    for (const Patch& patch : network().patches) {
      double& farthest = result_.parts[index(patch.region)].moved_mm;
      for (const int c : patch.control) farthest = std::max(farthest, moved(c));
    }
  }

  SmoothNetworkOptions options_;
  const Progress& progress_;
  SmoothedNetwork result_;
  std::vector<char> wanted_;  // regions
};

}  // namespace

Result<SmoothedNetwork> smooth_network(SurfaceNetwork network, const SmoothNetworkOptions& options,
                                       const Progress& progress) {
  if (auto error = find_defect(network)) return fail(*error);
  return Smoother(std::move(network), options, progress).run();
}

}  // namespace angiospline
