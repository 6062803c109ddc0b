#include "recovery/thesis/smoothing/thesis_smoothing.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "base/contract.h"
#include "base/index.h"
#include "base/random.h"
#include "kernel/refine/split.h"
#include "modeling/body/body.h"
#include "modeling/build/assembly.h"
#include "modeling/continuity/smooth_network.h"
#include "modeling/junction/junction.h"
#include "recovery/thesis/smoothing/corner_tangents.h"
#include "recovery/thesis/smoothing/rules.h"

namespace angiospline {
namespace {

using namespace thesis_smoothing_rules;

JunctionSpec bifurcation_spec() {
  const auto direction = [](double deg, double tilt_deg) {
    const double a = deg * 3.141592653589793 / 180;
    const double t = tilt_deg * 3.141592653589793 / 180;
    return Vec3(std::cos(t) * std::cos(a), std::cos(t) * std::sin(a), std::sin(t));
  };
  JunctionSpec spec;
  spec.name = "bifurcation";
  spec.branches = {{"parent", direction(180, 0), 1.0, 0.0},
                   {"left", direction(50, 8), 0.8, 0.0},
                   {"right", direction(-40, -5), 0.7, 0.0}};
  return spec;
}

// A tube straight on from an opening of the junction.
BodyPiece straight_body(const Junction& junction, int opening, const std::string& name) {
  const JunctionOpening& from = junction.openings[index(opening)];
  BodyPiece piece;
  piece.start = opening_end(junction, opening, true);

  const Vec3 tip = from.center_mm + kBodyLength * from.radius_mm * from.axis;
  Eigen::Matrix4Xd target(4, 2);
  target.col(0) << from.center_mm, from.radius_mm;
  target.col(1) << tip, from.radius_mm;
  const BodyPath path = fit_body_path(target, {from.center_mm, from.radius_mm, from.axis},
                                      {tip, from.radius_mm, Vec3::Zero()});
  piece.end = free_end(path.curve, 1.0);
  piece.path = path.curve;
  piece.body = make_body(path, piece.start, piece.end, {0.5});

  piece.name = "wall_" + name;
  piece.radius_mm = from.radius_mm;
  piece.start_link.kind = BodyLink::Kind::kOpening;
  piece.start_link.junction = 0;
  piece.start_link.opening = opening;
  piece.end_link.rim_name = "cap_" + name;
  return piece;
}

// Whether a join lies between two sectors of the junction: one of the six that are rough (7.2.4).
bool is_leg(const SurfaceNetwork& network, const Join& join) {
  const auto kind = [&](const Side& side) {
    return network.regions[index(network.patches[index(side.patch)].region)].kind;
  };
  return kind(join.a) == RegionKind::kJunction && kind(join.b) == RegionKind::kJunction &&
         join.a.side == PatchSide::kV1;
}

double worst_of_all(const SurfaceNetwork& network) {
  double worst = 0;
  for (int j = 0; j < static_cast<int>(network.joins.size()); ++j) {
    worst = std::max(worst, join_angle_deg(network, j));
  }
  return worst;
}

// The four quarters of each junction patch, on shared points: equal points of the quarters' sides
// become one pool column.
class Quartering {
 public:
  explicit Quartering(const ThesisBifurcation& whole) : whole_(whole) {
    result_.network.regions = whole.network.regions;
    result_.network.rims = whole.network.rims;
  }

  ThesisTessellation run() {
    const SurfaceNetwork& old = whole_.network;
    for (int p = 0; p < static_cast<int>(old.patches.size()); ++p) add(p);
    for (int j = 0; j < static_cast<int>(old.joins.size()); ++j) add_join(j);
    for (Rim& rim : result_.network.rims) cut_rim(rim);
    result_.network.control_points_mm =
        Eigen::Map<const Points3>(pool_.front().data(), 3, static_cast<Eigen::Index>(pool_.size()));
    return std::move(result_);
  }

 private:
  bool is_cut(int p) const {
    const SurfaceNetwork& old = whole_.network;
    return old.regions[index(old.patches[index(p)].region)].kind == RegionKind::kJunction;
  }

  // A body's patch keeps its end on the opening whole: it joins the two quarters there by parts, so
  // it is cut along u as well.
  void add(int p) {
    const BSplineSurface<3> surface = patch_surface(whole_.network, p);
    first_.push_back(static_cast<int>(result_.network.patches.size()));
    const auto [low, high] = split_v(surface, 0.5);
    for (const BSplineSurface<3>& half : {low, high}) {
      if (!is_cut(p)) {
        add_patch(half, p);
        continue;
      }
      const auto [near, far] = split_u(half, 0.5);
      add_patch(near, p);
      add_patch(far, p);
    }

    // Quarters: low near, low far, high near, high far; halves of bodies: low, high.
    const int f = first_.back();
    if (is_cut(p)) {
      for (const int k : {f, f + 2}) inner({k, PatchSide::kU1}, {k + 1, PatchSide::kU0});
      for (const int k : {f, f + 1}) inner({k, PatchSide::kV1}, {k + 2, PatchSide::kV0});
    } else {
      inner({f, PatchSide::kV1}, {f + 1, PatchSide::kV0});
    }
  }

  void inner(Side a, Side b) { result_.network.joins.push_back({whole(a), whole(b), false}); }

  Side whole(Side side) const {
    const Patch& patch = result_.network.patches[index(side.patch)];
    const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
    const KnotVector& knots = along_v ? patch.v : patch.u;
    side.from = knots.first();
    side.to = knots.last();
    return side;
  }

  void add_patch(const BSplineSurface<3>& surface, int old) {
    Patch patch{surface.u(), surface.v(), {}, whole_.network.patches[index(old)].region};
    // Points on sides are shared by place: the cuts of two neighbours are equal to rounding.
    for (int i = 0; i < surface.u_count(); ++i) {
      for (int j = 0; j < surface.v_count(); ++j) {
        const bool on_side =
            i == 0 || j == 0 || i + 1 == surface.u_count() || j + 1 == surface.v_count();
        patch.control.push_back(column(surface.control_point(i, j), on_side));
      }
    }
    result_.network.patches.push_back(std::move(patch));
  }

  int column(const Vec3& point, bool shared) {
    const auto key = [&](double shift) {
      std::array<long long, 3> k{};
      for (int d = 0; d < 3; ++d) k[index(d)] = std::llround(point(d) / kSamePlace + shift);
      return k;
    };
    // Cells half a cell apart: two places nearer than half a cell share one of them.
    if (shared) {
      for (const double shift : {0.0, 0.5, -0.5}) {
        const auto found = places_.find(key(shift));
        if (found != places_.end()) return found->second;
      }
    }
    pool_.push_back(point);
    const int number = static_cast<int>(pool_.size()) - 1;
    if (shared) {
      for (const double shift : {0.0, 0.5, -0.5}) places_.try_emplace(key(shift), number);
    }
    return number;
  }

  // Head to tail: a side that is run backwards has its last part first.
  void cut_rim(Rim& rim) const {
    std::vector<Side> sides;
    const std::size_t count = rim.sides.size();
    for (std::size_t k = 0; k < count; ++k) {
      std::array<Side, 2> cut = parts(rim.sides[k]);
      const Side& next = rim.sides[(k + 1) % count];
      const int here = end_column(rim.sides[k], true);
      if (here != end_column(next, false) && here != end_column(next, true)) {
        std::swap(cut[0], cut[1]);
      }
      for (const Side& side : cut) sides.push_back(whole(side));
    }
    rim.sides = std::move(sides);
  }

  // Pool column at the end (or beginning) of a body's side U0 or U1.
  int end_column(const Side& side, bool last) const {
    const Patch& patch = whole_.network.patches[index(side.patch)];
    const int row = side.side == PatchSide::kU0 ? 0 : patch.u.control_point_count() - 1;
    return patch.control[index(kPatchRows * row + (last ? kPatchRows - 1 : 0))];
  }

  // Parts of a side in the order of its parameter.
  std::array<Side, 2> parts(const Side& side) const {
    const int f = first_[index(side.patch)];
    if (!is_cut(side.patch)) {
      if (side.side == PatchSide::kV0) return {Side{f, side.side}, Side{-1, side.side}};
      if (side.side == PatchSide::kV1) return {Side{f + 1, side.side}, Side{-1, side.side}};
      return {Side{f, side.side}, Side{f + 1, side.side}};
    }
    switch (side.side) {
      case PatchSide::kU0:
        return {Side{f, side.side}, Side{f + 2, side.side}};
      case PatchSide::kU1:
        return {Side{f + 1, side.side}, Side{f + 3, side.side}};
      case PatchSide::kV0:
        return {Side{f, side.side}, Side{f + 1, side.side}};
      case PatchSide::kV1:
        break;
    }
    return {Side{f + 2, side.side}, Side{f + 3, side.side}};
  }

  void add_join(int j) {
    const Join& join = whole_.network.joins[index(j)];
    const std::array<Side, 2> a = parts(join.a);
    std::array<Side, 2> b = parts(join.b);
    if (join.reversed) std::swap(b[0], b[1]);
    const bool rough = std::find(whole_.rough.begin(), whole_.rough.end(), j) != whole_.rough.end();
    for (const std::size_t k : {0U, 1U}) {
      if (a[k].patch < 0 || b[k].patch < 0) continue;
      const int number = static_cast<int>(result_.network.joins.size());
      result_.network.joins.push_back({whole(a[k]), whole(b[k]), join.reversed});
      if (!rough || k == 0) continue;
      const Patch& patch = whole_.network.patches[index(join.a.patch)];
      const auto [at_pole, added] =
          poles_.try_emplace(patch.control.back(), static_cast<int>(poles_.size()));
      if (added) result_.systems.emplace_back();
      result_.systems[index(at_pole->second)].push_back(number);
    }
  }

  const ThesisBifurcation& whole_;
  ThesisTessellation result_;
  std::vector<int> first_;  // new patch of each old one
  std::vector<Vec3> pool_;
  std::map<std::array<long long, 3>, int> places_;
  std::map<int, int> poles_;  // system of each pole's column
};

// Moves every control point that a system may move when its boundaries float.
void move_like_a_fit(ThesisTessellation& model) {
  Random random(kFitSeed);
  std::vector<char> moved(static_cast<std::size_t>(model.network.control_points_mm.cols()), 0);
  for (const std::vector<int>& joins : model.systems) {
    for (const int j : joins) {
      const Join& join = model.network.joins[index(j)];
      const std::vector<int>& control = model.network.patches[index(join.a.patch)].control;
      // The boundary's inner points, on side V1.
      for (int i = 1; i + 1 < kPatchRows; ++i) {
        const int c = control[index(kPatchRows * i + kPatchRows - 1)];
        if (std::exchange(moved[index(c)], 1)) continue;
        for (int d = 0; d < 3; ++d) {
          model.network.control_points_mm(d, c) += kFitMove * random.gaussian();
        }
      }
    }
  }
}

// One experiment of 7.2.4.
struct Case {
  ThesisCase which;
  const char* name;
  const char* thesis;
  const SurfaceNetwork& network;
  std::vector<std::vector<int>> systems;
  bool floating;
};

// All experiments but the sparse one. `level`: with flat corners; `fitted`: moved as a fit would.
std::vector<Case> cases_of(const ThesisBifurcation& model, const ThesisTessellation& cut,
                           const ThesisTessellation& level, const ThesisTessellation& fitted,
                           const ThesisTessellation& fitted_level) {
  std::vector<int> all(model.network.joins.size());
  std::iota(all.begin(), all.end(), 0);
  return {{ThesisCase::kAll,
           "all 21 boundaries",
           "436 constraints, 726 unknowns: impractical",
           model.network,
           {all},
           true},
          {ThesisCase::kRough,
           "the 6 rough boundaries",
           "134 constraints, 156 unknowns, 10,000 iterations, over 4 days",
           model.network,
           {model.rough},
           true},
          {ThesisCase::kHeld, "tessellated, boundaries held",
           "28 patches, 2 systems of 45 constraints, 66 unknowns, 10,000 iterations, 45 min",
           cut.network, cut.systems, false},
          {ThesisCase::kHeldLevel, "tessellated, corners level, boundaries held", "", level.network,
           cut.systems, false},
          {ThesisCase::kFloating, "tessellated, boundaries floating", "", cut.network, cut.systems,
           true},
          {ThesisCase::kFittedHeld, "after a fit, boundaries held",
           "45 constraints, 66 unknowns: unacceptable", fitted.network, cut.systems, false},
          {ThesisCase::kFittedHeldLevel, "after a fit, corners level, boundaries held", "",
           fitted_level.network, cut.systems, false},
          {ThesisCase::kFittedFloating, "after a fit, boundaries floating",
           "45 constraints, 102 unknowns: continuous", fitted.network, cut.systems, true}};
}

Result<ThesisSmoothingRow> run_case(const Case& one, double most_seconds,
                                    const Progress& progress) {
  ThesisSmoothingRow row{one.which, one.name, one.thesis, "SLSQP on triple curves", 0, 0, {}, 0, 0};
  SurfaceNetwork network = one.network;
  TripleSmoothingOptions options;
  options.floating = one.floating;
  options.most_seconds = most_seconds;
  row.patches = static_cast<int>(network.patches.size());
  row.systems = static_cast<int>(one.systems.size());
  row.before_deg = worst_of_all(network);

  auto reports = smooth_by_triple_curves(network, one.systems, options, progress);
  if (!reports) return fail(reports.error());
  row.reports = std::move(*reports);
  row.after_deg = worst_of_all(network);
  return row;
}

ThesisSmoothingRow sparse_row(const ThesisBifurcation& model) {
  ThesisSmoothingRow row{
      ThesisCase::kSparse, "all 21 boundaries", "", "sparse cofactor form", 12, 1, {}, 0, 0};
  const auto begin = std::chrono::steady_clock::now();
  const auto smoothed = smooth_network(model.network);
  TripleSystemReport report;
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  report.boundaries = static_cast<int>(model.network.joins.size());
  if (smoothed) {
    report.ending = TripleEnding::kSmooth;
    row.before_deg = report.before_deg = smoothed->before_deg;
    row.after_deg = report.after_deg = smoothed->after_deg;
    for (const SmoothedPart& part : smoothed->parts) {
      report.moved_mm = std::max(report.moved_mm, part.moved_mm);
    }
  }
  row.reports.push_back(report);
  return row;
}

}  // namespace

Result<ThesisBifurcation> thesis_bifurcation() {
  const JunctionSpec spec = bifurcation_spec();
  const Result<Junction> junction = make_rough_junction(spec);
  if (!junction) return fail(junction.error());
  std::vector<BodyPiece> bodies;
  for (int b = 0; b < 3; ++b) {
    bodies.push_back(straight_body(*junction, b, spec.branches[index(b)].name));
  }
  ThesisBifurcation result;
  result.network = assemble({*junction}, bodies);
  for (int j = 0; j < static_cast<int>(result.network.joins.size()); ++j) {
    if (is_leg(result.network, result.network.joins[index(j)])) result.rough.push_back(j);
  }
  EXPECTS(result.rough.size() == 6);
  return result;
}

ThesisTessellation tessellated(const ThesisBifurcation& bifurcation) {
  return Quartering(bifurcation).run();
}

double flatten_corners(ThesisTessellation& tessellation) {
  std::set<int> corners;
  for (const std::vector<int>& joins : tessellation.systems) {
    for (const int j : joins) {
      const Join& join = tessellation.network.joins[index(j)];
      const std::vector<int>& control = tessellation.network.patches[index(join.a.patch)].control;
      corners.insert({control[kPatchRows - 1], control.back()});  // the ends of side V1
    }
  }
  double farthest = 0;
  for (const int c : corners)
    farthest = std::max(farthest, flatten_corner(tessellation.network, c));
  return farthest;
}

Result<std::vector<ThesisSmoothingRow>> run_thesis_smoothing(double most_seconds,
                                                             const Progress& progress) {
  const Result<ThesisBifurcation> model = thesis_bifurcation();
  if (!model) return fail(model.error());

  const ThesisTessellation cut = tessellated(*model);
  ThesisTessellation level = cut;
  flatten_corners(level);
  ThesisTessellation fitted = cut;
  move_like_a_fit(fitted);
  ThesisTessellation fitted_level = fitted;
  flatten_corners(fitted_level);
  const std::vector<Case> cases = cases_of(*model, cut, level, fitted, fitted_level);

  std::vector<ThesisSmoothingRow> rows;
  for (const Case& one : cases) {
    progress.at(one.name, static_cast<double>(rows.size()) / static_cast<double>(cases.size()));
    auto row = run_case(one, most_seconds, progress);
    if (!row) return fail(row.error());
    rows.push_back(std::move(*row));
  }
  rows.push_back(sparse_row(*model));
  return rows;
}

}  // namespace angiospline
