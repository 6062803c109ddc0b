// The thesis's experiments on segmentation (7.1.1).
#include <algorithm>

#include <fmt/format.h>

#include "recovery/imaging/segment/region_growing.h"
#include "recovery/phantoms/rings.h"
#include "recovery/thesis/experiments/rules.h"
#include "recovery/thesis/experiments/tables.h"

namespace angiospline::experiments {
namespace {

using namespace experiment_rules;

// A row of table 7.1: neighbourhood, deviations, and the points that the thesis segmented.
struct GrowingCase {
  int N;
  double M, thesis;
};
constexpr GrowingCase kGrowingCases[] = {{5, 2, 1101}, {5, 3, 1120},  {5, 4, 5916},  {7, 2, 1081},
                                         {7, 3, 2050}, {7, 4, 10172}, {9, 2, 1084},  {9, 3, 1115},
                                         {9, 4, 1129}, {11, 2, 965},  {11, 3, 1114}, {11, 4, 1131}};

// How many of the pairs of neighbouring rows a claim holds for.
struct PairCount {
  int holding = 0, all = 0;

  void add(bool holds) { ++all, holding += holds; }
  std::string text() const { return fmt::format("{} of {} pairs", holding, all); }
};

// What is grown from where, for one row of the rings' table.
struct RingsRun {
  const char* label;
  RingsImages images;
  std::vector<Vec3> seeds;
  std::optional<double> examined;  // points, as the thesis has it
};

ReproducedRow row_of(const RingsRun& run, std::size_t examined, const RingsMeasure& m) {
  return {run.label,
          {{run.examined, static_cast<double>(examined)},
           {{}, static_cast<double>(m.voxels)},
           {{}, 100 * m.found},
           {{}, 100 * m.artefact},
           {{}, 100 * m.arc[0]},
           {{}, 100 * m.arc[1]},
           {{}, 100 * m.arc[2]}}};
}

// The thesis's claims: neither modality alone finds the rings, both together do (7.1.1).
std::vector<ReproducedTrend> compare(const RingsMeasure& volume, const RingsMeasure& views,
                                     const RingsMeasure& both) {
  const double longest = *std::max_element(volume.arc.begin(), volume.arc.end());
  const double shortest = *std::min_element(both.arc.begin(), both.arc.end());
  return {{"the volume alone does not span the gaps", longest < 0.25,
           fmt::format("at most {:.0f} % of a ring", 100 * longest)},
          {"the views alone fill a plane that is no ring", views.artefact > 0.5,
           fmt::format("{:.0f} % of it lies outside the rings, up to {:.0f} mm",
                       100 * views.artefact, views.farthest_mm)},
          {"both together complete all three rings without artefact",
           shortest > 0.97 && both.farthest_mm < 4,
           fmt::format("at least {:.1f} % of each ring, nothing farther than {:.1f} mm from a tube",
                       100 * shortest, both.farthest_mm)}};
}

}  // namespace

Result<ReproducedTable> region_growing(const ReproduceOptions& options, const Progress& progress) {
  PhantomOptions image;
  image.snr = kRingsSnr;
  image.loss_deg = kRingsLossDeg;
  image.seed = options.seed;
  const auto phantom = make_phantom(PhantomKind::kRings, image);
  if (!phantom) return fail(phantom.error());
  ReproducedTable t;
  t.columns = {"segmented points"};

  // Rows stand in blocks of three M for each N: neighbours differ in one of the two.
  const std::size_t count = options.quick ? 3 : std::size(kGrowingCases);
  const Vec3 seed = phantom_rings()[0].at(kRingsSeedTurn);
  PairCount more_with_m, fewer_with_n;
  for (std::size_t k = 0; k < count; ++k) {
    const auto [N, M, thesis] = kGrowingCases[k];
    GrowOptions grow;
    grow.neighbourhood_vox = N;
    grow.deviations = M;
    grow.max_examined = kMostExamined;
    const auto grown = grow_region(phantom->image, {seed}, grow, progress);
    if (!grown) return fail(grown.error());

    const auto points = static_cast<double>(grown->report.voxels);
    t.rows.push_back({fmt::format("N {:2} M {}", N, M), {{thesis, points}}});
    const auto ours = [&](std::size_t i) { return *t.rows[i].figures[0].ours; };
    if (k % 3 != 0) more_with_m.add(points >= ours(k - 1));
    if (k >= 3) fewer_with_n.add(points <= kNoMorePoints * ours(k - 3));
    progress.at("table 7.1", static_cast<double>(k + 1) / static_cast<double>(count));
  }

  t.trends.push_back({"more deviations M segment more points",
                      more_with_m.holding == more_with_m.all, more_with_m.text()});
  if (fewer_with_n.all > 0)
    t.trends.push_back({"larger neighbourhoods N segment no more points, with one exception",
                        fewer_with_n.holding + 1 >= fewer_with_n.all, fewer_with_n.text()});
  t.notes.push_back(
      "rings of tube radius 4 mm with 12 degrees of lost signal every 45, SNR 20; one seed");
  return t;
}

Result<ReproducedTable> two_modalities(const ReproduceOptions& options, const Progress& progress) {
  RingsExperimentOptions phantom;
  phantom.seed = options.seed;
  const auto rings = make_rings_experiment(phantom);
  if (!rings) return fail(rings.error());
  ReproducedTable t;
  t.columns = {"examined",        "vessel voxels",    "% of rings found",
               "% of it outside", "% of arc, ring 1", "ring 2",
               "ring 3"};

  const std::vector<Vec3> seeds = rings_seeds_mm();
  const RingsRun runs[] = {{"MR volume alone", RingsImages::kVolume, seeds, {}},
                           {"X-ray views alone, one seed", RingsImages::kViews, {seeds[0]}, {}},
                           {"both", RingsImages::kBoth, seeds, 200000}};
  std::vector<RingsMeasure> measured;
  for (const RingsRun& run : runs) {
    const auto grown = grow_rings(*rings, run.images, run.seeds, progress);
    if (!grown) return fail(grown.error());
    measured.push_back(measure_rings(*rings, grown->mask));
    t.rows.push_back(row_of(run, grown->report.examined, measured.back()));
    progress.at("rings", static_cast<double>(measured.size()) / 3);
  }

  t.trends = compare(measured[0], measured[1], measured[2]);
  t.notes.push_back(
      "three rings linked but not touching: one seed each (thesis: one seed), except for the views "
      "alone; 12 degrees of the signal lost by 65 % every 45, 22.5 apart in the volume and the "
      "views; SNR 20");
  return t;
}

}  // namespace angiospline::experiments
