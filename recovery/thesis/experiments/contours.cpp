// Tables 7.2 to 7.5: contours in a slice through two arteries.
#include <algorithm>
#include <cmath>
#include <numeric>

#include <fmt/format.h>

#include "recovery/analysis/compare_masks.h"
#include "recovery/imaging/rasterize/mask_inside.h"
#include "recovery/thesis/experiments/slice.h"
#include "recovery/thesis/experiments/tables.h"

namespace angiospline::experiments {
namespace {

constexpr double kSnr = 8;
constexpr double kReach = 4;

struct Outcome {
  double iterations = 0, missed = 0;
};

// The slice, its edges near each artery, and runs on them.
class Slice {
 public:
  static Result<Slice> make(const ReproduceOptions& options) {
    Slice s{artery_slice(kSnr, options.seed)};
    auto field = find_edges(s.slice_.image, {EdgePercentile{85}});
    if (!field) return fail(field.error());
    const EdgePoints all = edge_points(*field, s.slice_.image.grid);
    for (const bool right : {true, false}) {
      const SliceArtery& artery = s.artery(right);
      EdgePoints near = all;
      Eigen::Index count = 0;
      for (Eigen::Index e = 0; e < all.count(); ++e) {
        if ((all.at_mm.col(e) - artery.centre_mm).norm() > artery.radius_mm + 6) continue;
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

  Result<Outcome> run(bool right, const DeformMesh& start, DeformOptions options,
                      const ReproduceOptions& how, const Progress& progress) const {
    if (how.quick) options.most_iterations = 60;
    const auto fit = deform(start, right ? right_ : left_, 1.0, options, progress);
    if (!fit) return fail(fit.error());
    const Mask& truth = artery(right).truth;
    const Mask mask = mask_inside(fit->mesh.nodes_mm, truth.grid);
    double missed = 0;
    for (std::size_t i = 0; i < mask.voxels.size(); ++i)
      missed += (mask.voxels[i] != 0) != (truth.voxels[i] != 0);
    return Outcome{static_cast<double>(fit->report.iterations), missed};
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
        points(slice_.right.truth), points(slice_.left.truth), kSnr);
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
  std::vector<Outcome> thesis;  // by method, the sparse one missing
};

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
      const DeformMesh start = slice->circle(s.right, Vec3(0.8, -0.5, 0), 6, 12);
      const auto out = slice->run(
          s.right, start, steady_options(kMethods[m].method, start, s.kind, s.strength, kReach),
          how, progress);
      if (!out) return fail(out.error());
      std::optional<Outcome> thesis;
      if (m < s.thesis.size()) thesis = s.thesis[m];
      row.figures.push_back(
          {thesis ? std::optional(thesis->iterations) : std::nullopt, out->iterations});
      row.figures.push_back({thesis ? std::optional(thesis->missed) : std::nullopt, out->missed});
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

}  // namespace

Result<ReproducedTable> methods_and_strengths(const ReproduceOptions& how,
                                              const Progress& progress) {
  const auto g = PotentialKind::kGravity;
  auto t =
      by_method({{"right 10x", true, g, 10, {{49, 18}, {37, 20}, {588, 21}, {984, 19}, {573, 20}}},
                 {"left 10x", false, g, 10, {{58, 29}, {36, 36}, {506, 49}, {867, 36}, {527, 35}}},
                 {"right 1x", true, g, 1, {{92, 27}, {71, 27}, {600, 32}, {775, 23}, {598, 32}}},
                 {"left 5x", false, g, 5, {{84, 34}, {54, 34}, {635, 35}, {646, 32}, {640, 36}}}},
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
  auto t = by_method(
      {{"gravity 10x", true, g, 10, {{49, 18}, {37, 20}, {588, 21}, {984, 19}, {573, 20}}},
       {"spring 20x", true, s, 20, {{93, 26}, {95, 26}, {777, 19}, {773, 19}, {774, 19}}},
       {"gravity 1x", true, g, 1, {{92, 27}, {71, 27}, {600, 32}, {775, 23}, {598, 32}}},
       {"spring 10x", true, s, 10, {{105, 42}, {69, 38}, {448, 49}, {449, 50}, {447, 49}}}},
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
  struct Start {
    double x, y, radius;
    double iterations, missed;
  };
  std::vector<Start> all = {{0, 0, 6, 37, 20},   {1, 0, 6, 55, 18},  {0, 1, 6, 65, 21},
                            {1, 1, 6, 60, 23},   {-1, 0, 6, 35, 15}, {0, -1, 6, 95, 17},
                            {-1, -1, 6, 60, 21}, {0, 2, 6, 96, 27},  {2, 0, 6, 35, 24},
                            {1, 2, 6, 120, 37},  {2, 1, 6, 161, 31}, {2, 2, 6, 78, 42},
                            {0, -2, 6, 30, 23},  {-2, 0, 6, 53, 20}, {-1, -2, 6, 48, 21},
                            {-2, -1, 6, 90, 23}, {-2, -2, 6, 94, 32}};
  const std::size_t positions = all.size();
  const double by_size[][2] = {{33, 18}, {33, 18}, {31, 18}, {37, 20},
                               {55, 18}, {25, 23}, {29, 17}, {25, 17}};
  for (int k = 0; k < 8; ++k) all.push_back({0, 0, 3.0 + k, by_size[k][0], by_size[k][1]});
  if (how.quick) all.resize(3);
  ReproducedTable t;
  t.columns = {"DFT iterations",       "DFT missed",        "DFT with drag iterations",
               "DFT with drag missed", "sparse iterations", "sparse missed"};
  std::vector<double> plain, drag, sizes;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Start& s = all[k];
    const DeformMesh start = slice->circle(true, Vec3(s.x, s.y, 0), s.radius, 12);
    ReproducedRow row;
    row.label = k < positions ? fmt::format("position {:+}/{:+}", s.x, s.y)
                              : fmt::format("size {}", s.radius);
    const DeformOptions dft =
        steady_options(DeformMethod::kEulerDft, start, PotentialKind::kGravity, 10, kReach);
    DeformOptions dragged = dft;
    dragged.elements.drag = 0.5;
    const DeformOptions sparse =
        steady_options(DeformMethod::kSparse, start, PotentialKind::kGravity, 10, kReach);
    for (const DeformOptions* o :
         std::initializer_list<const DeformOptions*>{&dft, &dragged, &sparse}) {
      const auto out = slice->run(true, start, *o, how, progress);
      if (!out) return fail(out.error());
      const bool first = o == &dft;
      row.figures.push_back({first ? std::optional(s.iterations) : std::nullopt, out->iterations});
      row.figures.push_back({first ? std::optional(s.missed) : std::nullopt, out->missed});
    }
    (k < positions ? plain : sizes).push_back(*row.figures[1].ours);
    if (k < positions) drag.push_back(*row.figures[3].ours);
    t.rows.push_back(std::move(row));
  }
  const auto spread = [](const std::vector<double>& v) {
    const double mean = std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
    double sum = 0;
    for (const double x : v) sum += (x - mean) * (x - mean);
    return std::pair(mean, std::sqrt(sum / static_cast<double>(v.size())));
  };
  if (!how.quick) {
    const auto [pm, ps] = spread(plain);
    const auto [dm, ds] = spread(drag);
    const auto [sm, ss] = spread(sizes);
    t.trends.push_back({"precise over the start position (thesis 20.8, deviation 3.2)", ps <= 3.2,
                        fmt::format("mean {:.1f}, deviation {:.1f}", pm, ps)});
    t.trends.push_back({"the same with drag 0.5 against the ground", ds <= 3.2,
                        fmt::format("mean {:.1f}, deviation {:.1f}", dm, ds)});
    t.trends.push_back({"precise over the start size (thesis 18.6, deviation 2.0)", ss <= 5,
                        fmt::format("mean {:.1f}, deviation {:.1f}", sm, ss)});
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
  const double thesis[][3] = {{6, 64, 51},  {9, 50, 31},  {12, 71, 27}, {15, 39, 19},
                              {18, 45, 17}, {21, 46, 16}, {24, 40, 15}, {27, 50, 14},
                              {30, 37, 12}, {33, 37, 14}, {36, 55, 11}};
  ReproducedTable t;
  t.columns = {"DFT 1x iterations", "DFT 1x missed", "sparse 10x iterations", "sparse 10x missed"};
  for (const auto& row : thesis) {
    const int sides = static_cast<int>(row[0]);
    if (how.quick && sides > 12) break;
    const DeformMesh start = slice->circle(true, Vec3(0.8, -0.5, 0), 6, sides);
    DeformOptions dft =
        steady_options(DeformMethod::kEulerDft, start, PotentialKind::kGravity, 1, kReach);
    dft.rest_speed = 0.03;  // 1x: everything is slower
    const auto a = slice->run(true, start, dft, how, progress);
    if (!a) return fail(a.error());
    const auto b = slice->run(
        true, start,
        steady_options(DeformMethod::kSparse, start, PotentialKind::kGravity, 10, kReach), how,
        progress);
    if (!b) return fail(b.error());
    t.rows.push_back(
        {fmt::format("{} sides", sides),
         {{row[1], a->iterations}, {row[2], a->missed}, {{}, b->iterations}, {{}, b->missed}}});
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
