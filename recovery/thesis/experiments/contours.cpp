// Tables 7.2 to 7.5: contours in a slice through two arteries.
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include <fmt/format.h>

#include "recovery/analysis/compare_masks.h"
#include "recovery/thesis/experiments/outline.h"
#include "recovery/thesis/experiments/printed_contours.h"
#include "recovery/thesis/experiments/rules.h"
#include "recovery/thesis/experiments/slice.h"
#include "recovery/thesis/experiments/tables.h"

namespace angiospline::experiments {
namespace {

using namespace experiment_rules;

// The slice, its edges near each artery, and runs on them.
class Slice {
 public:
  static Result<Slice> make(const ReproduceOptions& options) {
    Slice s{artery_slice(kSliceSnr, options.seed)};
    auto field = find_edges(s.slice_.image, {EdgePercentile{kSlicePercentile}});
    if (!field) return fail(field.error());

    // Each artery gets the edges near its own wall; the vein's are among the left one's.
    const EdgePoints all = edge_points(*field, s.slice_.image.grid);
    for (const bool right : {true, false}) {
      const SliceArtery& artery = s.artery(right);
      EdgePoints near = all;
      Eigen::Index count = 0;
      for (Eigen::Index e = 0; e < all.count(); ++e) {
        if ((all.at_mm.col(e) - artery.centre_mm).norm() > artery.radius_mm + kSliceEdgeReach)
          continue;
        near.at_mm.col(count) = all.at_mm.col(e);
        near.normals.col(count) = all.normals.col(e);
        near.strength[count++] = all.strength[e];
      }
      near.at_mm.conservativeResize(3, count);
      near.normals.conservativeResize(3, count);
      near.strength.conservativeResize(count);
      (right ? s.right_ : s.left_) = std::move(near);
    }
    return s;
  }

  const SliceArtery& artery(bool right) const { return right ? slice_.right : slice_.left; }

  Result<ContourOutcome> run(bool right, const DeformMesh& start, DeformOptions options,
                             const ReproduceOptions& how, const Progress& progress) const {
    if (how.quick) options.most_iterations = kQuickContour;
    const auto fit = deform(start, right ? right_ : left_, 1.0, options, progress);
    if (!fit) return fail(fit.error());

    // Missed are the points of either that the other does not have (7.3.2).
    const Mask& truth = artery(right).truth;
    const Mask mask = mask_inside(fit->mesh.nodes_mm, truth.grid);
    double missed = 0;
    for (std::size_t i = 0; i < mask.voxels.size(); ++i)
      missed += (mask.voxels[i] != 0) != (truth.voxels[i] != 0);
    return ContourOutcome{static_cast<double>(fit->report.iterations), missed};
  }

  DeformMesh circle(bool right, const Vec3& shift, double radius, int sides) const {
    return circle_contour(artery(right).centre_mm + shift, radius, sides);
  }

  std::string note() const {
    const auto points = [](const Mask& m) {
      return std::accumulate(m.voxels.begin(), m.voxels.end(), 0);
    };
    return fmt::format(
        "arteries of {} and {} points (thesis 122 and 158), SNR {}, circles of 12 "
        "sides beside them unless stated; edges within 6 voxels of the artery",
        points(slice_.right.truth), points(slice_.left.truth), kSliceSnr);
  }

 private:
  explicit Slice(ArterySlice slice) : slice_(std::move(slice)) {}
  ArterySlice slice_;
  EdgePoints right_, left_;
};

struct Method {
  const char* name;
  DeformMethod method;
};
constexpr Method kMethods[] = {{"Euler, pseudo-inverse (SVD)", DeformMethod::kEulerSvd},
                               {"Euler, circulant (DFT)", DeformMethod::kEulerDft},
                               {"central differences", DeformMethod::kCentral},
                               {"Runge-Kutta, first order", DeformMethod::kRungeKutta1},
                               {"Runge-Kutta, fourth order", DeformMethod::kRungeKutta4},
                               {"sparse (not in the thesis)", DeformMethod::kSparse}};

// One group of two columns: iterations and missed points.
struct Setting {
  std::string name;
  bool right = true;
  PotentialKind kind = PotentialKind::kGravity;
  double strength = 10;
  PrintedByMethod thesis{};  // the sparse one is missing
};

// Two more figures of a row: what the thesis prints, where it does, beside ours.
void add_outcome(ReproducedRow& row, const ContourOutcome& ours,
                 const ContourOutcome* printed = nullptr) {
  const auto of = [&](double ContourOutcome::*figure) {
    return printed ? std::optional(printed->*figure) : std::nullopt;
  };
  row.figures.push_back({of(&ContourOutcome::iterations), ours.iterations});
  row.figures.push_back({of(&ContourOutcome::missed), ours.missed});
}

DeformOptions gravity(DeformMethod method, const DeformMesh& start, double strength) {
  return steady_options(method, start, PotentialKind::kGravity, strength, kContourReach);
}

DeformMesh start_beside(const Slice& slice, bool right, int sides) {
  return slice.circle(right, Vec3(kStartBeside[0], kStartBeside[1], 0), kStartRadius, sides);
}

Result<ReproducedTable> by_method(const std::vector<Setting>& settings, const ReproduceOptions& how,
                                  const Progress& progress) {
  const auto slice = Slice::make(how);
  if (!slice) return fail(slice.error());
  ReproducedTable t;
  for (const Setting& s : settings) {
    t.columns.push_back(s.name + " iterations");
    t.columns.push_back(s.name + " missed");
  }

  for (std::size_t m = 0; m < std::size(kMethods); ++m) {
    ReproducedRow row{kMethods[m].name, {}};
    for (const Setting& s : settings) {
      const DeformMesh start = start_beside(*slice, s.right, kStartSides);
      const auto out =
          slice->run(s.right, start,
                     steady_options(kMethods[m].method, start, s.kind, s.strength, kContourReach),
                     how, progress);
      if (!out) return fail(out.error());
      add_outcome(row, *out, m < s.thesis.size() ? &s.thesis[m] : nullptr);
    }
    t.rows.push_back(std::move(row));
  }

  t.notes.push_back(slice->note());
  t.notes.push_back(
      "mass systems need some drag (0.2), or a contour swings for ever; the SVD and the DFT of a "
      "contour are the same matrix, so that ours agree to rounding");
  return t;
}

// Spearman's correlation of values with their places; equal values share a rank. Requires two
// values or more that are not all equal.
double rank_correlation(const std::vector<double>& values) {
  const auto n = static_cast<double>(values.size());

  double product = 0, squares = 0, places = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    double rank = 0;
    for (const double other : values) rank += other < values[i] ? 1 : other == values[i] ? 0.5 : 0;
    rank -= n / 2;  // about its mean
    const double place = static_cast<double>(i) - (n - 1) / 2;
    product += rank * place;
    squares += rank * rank;
    places += place * place;
  }
  return product / std::sqrt(squares * places);
}

double ours(const ReproducedTable& t, std::size_t row, std::size_t column) {
  return *t.rows[row].figures[column].ours;
}

// Mass systems' iterations over the massless ones', over all settings.
ReproducedTrend mass_costs(const ReproducedTable& t) {
  std::vector<double> ratios;
  for (std::size_t c = 0; c < t.columns.size(); c += 2)
    for (std::size_t m = 2; m < 5; ++m) ratios.push_back(ours(t, m, c) / ours(t, 1, c));
  const auto [low, high] = std::minmax_element(ratios.begin(), ratios.end());
  return {"mass systems take 8 to 26 times the iterations of massless ones",
          *low >= 3 && *high <= 40 && *high >= 8,
          fmt::format("{:.0f} to {:.0f} times", *low, *high)};
}

// Figures of many runs as one: their mean and standard deviation.
struct Spread {
  double mean, deviation;
};
Spread spread(const std::vector<double>& v) {
  const double mean = std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
  double sum = 0;
  for (const double x : v) sum += (x - mean) * (x - mean);
  return {mean, std::sqrt(sum / static_cast<double>(v.size()))};
}

// The claim that starts hardly matter, by the missed points of all of them.
ReproducedTrend precision(std::string claim, const std::vector<double>& missed, double most) {
  const auto [mean, deviation] = spread(missed);
  return {std::move(claim), deviation <= most,
          fmt::format("mean {:.1f}, deviation {:.1f}", mean, deviation)};
}

// A row of table 7.4: the thesis's way, that with drag, and ours.
Result<ReproducedRow> row_of_start(const Slice& slice, const PrintedStart& s, std::string label,
                                   const ReproduceOptions& how, const Progress& progress) {
  const DeformMesh start = slice.circle(true, Vec3(s.x, s.y, 0), s.radius, kStartSides);
  const DeformOptions dft = gravity(DeformMethod::kEulerDft, start, 10);
  DeformOptions dragged = dft;
  dragged.elements.drag = kGroundDrag;
  const DeformOptions sparse = gravity(DeformMethod::kSparse, start, 10);

  ReproducedRow row{std::move(label), {}};
  for (const DeformOptions* o : {&dft, &std::as_const(dragged), &sparse}) {
    const auto out = slice.run(true, start, *o, how, progress);
    if (!out) return fail(out.error());
    add_outcome(row, *out, o == &dft ? &s.printed : nullptr);
  }
  return row;
}

}  // namespace

Result<ReproducedTable> methods_and_strengths(const ReproduceOptions& how,
                                              const Progress& progress) {
  const auto g = PotentialKind::kGravity;
  auto t = by_method({{"right 10x", true, g, 10, kRightGravity10},
                      {"left 10x", false, g, 10, kLeftGravity10},
                      {"right 1x", true, g, 1, kRightGravity1},
                      {"left 5x", false, g, 5, kLeftGravity5}},
                     how, progress);
  if (!t) return t;

  t->trends.push_back(mass_costs(*t));
  t->trends.push_back({"stronger potentials are more accurate (massless, right 10x against 1x)",
                       ours(*t, 1, 1) < ours(*t, 1, 5),
                       listed({ours(*t, 1, 1), ours(*t, 1, 5)}) + " missed"});
  t->trends.push_back({"fourth-order Runge-Kutta is no better than first",
                       std::abs(ours(*t, 4, 1) - ours(*t, 3, 1)) <= 4,
                       listed({ours(*t, 4, 1), ours(*t, 3, 1)}) + " missed, right 10x"});
  t->trends.push_back({"the DFT takes fewer iterations than the SVD",
                       ours(*t, 1, 0) < ours(*t, 0, 0),
                       listed({ours(*t, 1, 0), ours(*t, 0, 0)}) + " iterations, right 10x"});
  return t;
}

Result<ReproducedTable> gravity_and_springs(const ReproduceOptions& how, const Progress& progress) {
  const auto g = PotentialKind::kGravity, s = PotentialKind::kSpring;
  auto t = by_method({{"gravity 10x", true, g, 10, kRightGravity10},
                      {"spring 20x", true, s, 20, kRightSpring20},
                      {"gravity 1x", true, g, 1, kRightGravity1},
                      {"spring 10x", true, s, 10, kRightSpring10}},
                     how, progress);
  if (!t) return t;

  double gravity = 0, spring = 0, strong = 0;
  for (std::size_t m = 0; m < 5; ++m) {
    gravity += ours(*t, m, 1) / 5;
    strong += ours(*t, m, 3) / 5;
    spring += ours(*t, m, 7) / 5;
  }

  t->trends.push_back(
      {"springs are worse than gravity of the same strength", spring > gravity,
       fmt::format("{:.1f} against {:.1f} missed, mean of five methods", spring, gravity)});
  t->trends.push_back({"stronger springs are better", strong < spring,
                       fmt::format("{:.1f} at 20x, {:.1f} at 10x", strong, spring)});
  return t;
}

Result<ReproducedTable> starts(const ReproduceOptions& how, const Progress& progress) {
  const auto slice = Slice::make(how);
  if (!slice) return fail(slice.error());
  ReproducedTable t;
  t.columns = {"DFT iterations",       "DFT missed",        "DFT with drag iterations",
               "DFT with drag missed", "sparse iterations", "sparse missed"};

  std::vector<double> plain, drag, sizes;
  for (const PrintedStart& s : kStartPositions) {
    if (how.quick && t.rows.size() == 3) break;
    auto row = row_of_start(*slice, s, fmt::format("position {:+}/{:+}", s.x, s.y), how, progress);
    if (!row) return fail(row.error());
    plain.push_back(*row->figures[1].ours);
    drag.push_back(*row->figures[3].ours);
    t.rows.push_back(std::move(*row));
  }
  for (const PrintedStart& s : kStartSizes) {
    if (how.quick) break;
    auto row = row_of_start(*slice, s, fmt::format("size {}", s.radius), how, progress);
    if (!row) return fail(row.error());
    sizes.push_back(*row->figures[1].ours);
    t.rows.push_back(std::move(*row));
  }

  if (!how.quick) {
    t.trends.push_back(
        precision("precise over the start position (thesis 20.8, deviation 3.2)", plain, 3.2));
    t.trends.push_back(precision("the same with drag 0.5 against the ground", drag, 3.2));
    t.trends.push_back(
        precision("precise over the start size (thesis 18.6, deviation 2.0)", sizes, 5));
  }
  t.notes.push_back(slice->note());
  t.notes.push_back(
      "without drag the transform drops the mean of all forces, and a contour cannot "
      "move as a whole: that is what the first columns show");
  return t;
}

Result<ReproducedTable> fineness(const ReproduceOptions& how, const Progress& progress) {
  const auto slice = Slice::make(how);
  if (!slice) return fail(slice.error());
  ReproducedTable t;
  t.columns = {"DFT 1x iterations", "DFT 1x missed", "sparse 10x iterations", "sparse 10x missed"};
  for (const auto& [sides, printed] : kFineness) {
    if (how.quick && sides > 12) break;
    const DeformMesh start = start_beside(*slice, true, sides);
    DeformOptions dft = gravity(DeformMethod::kEulerDft, start, 1);
    dft.rest_speed = kSlowRest;
    const auto a = slice->run(true, start, dft, how, progress);
    if (!a) return fail(a.error());
    const auto b =
        slice->run(true, start, gravity(DeformMethod::kSparse, start, 10), how, progress);
    if (!b) return fail(b.error());

    ReproducedRow row{fmt::format("{} sides", sides), {}};
    add_outcome(row, *a, &printed);
    add_outcome(row, *b);
    t.rows.push_back(std::move(row));
  }

  std::vector<double> missed, printed;
  for (const ReproducedRow& r : t.rows) {
    missed.push_back(*r.figures[1].ours);
    printed.push_back(*r.figures[1].thesis);
  }
  const double correlation = rank_correlation(missed);
  t.trends.push_back({fmt::format("accuracy rises with fineness (rank correlation, thesis {:.2f})",
                                  rank_correlation(printed)),
                      correlation < -0.8,
                      fmt::format("{:.2f}: {} missed", correlation, listed(missed))});
  t.notes.push_back(slice->note());
  t.notes.push_back(
      "12 sides have the iterations and missed points of table 7.2 at 1x: that is the "
      "thesis's strength here");
  return t;
}

}  // namespace angiospline::experiments
