// The thesis's experiments on segmentation (7.1.1).
#include <algorithm>

#include <fmt/format.h>

#include "recovery/imaging/segment/region_growing.h"
#include "recovery/phantoms/rings.h"
#include "recovery/thesis/experiments/tables.h"

namespace angiospline::experiments {

Result<ReproducedTable> region_growing(const ReproduceOptions& options, const Progress& progress) {
  PhantomOptions image;
  image.snr = 20;
  image.loss_deg = 12;
  image.seed = options.seed;
  const auto phantom = make_phantom(PhantomKind::kRings, image);
  if (!phantom) return fail(phantom.error());
  struct Case {
    int N;
    double M, thesis;
  };
  std::vector<Case> cases = {{5, 2, 1101}, {5, 3, 1120},  {5, 4, 5916},  {7, 2, 1081},
                             {7, 3, 2050}, {7, 4, 10172}, {9, 2, 1084},  {9, 3, 1115},
                             {9, 4, 1129}, {11, 2, 965},  {11, 3, 1114}, {11, 4, 1131}};
  if (options.quick) cases.resize(3);
  ReproducedTable t;
  t.columns = {"segmented points"};
  const Vec3 seed = phantom_rings()[0].at(0.39);  // midway between two losses
  int more_with_m = 0, pairs_m = 0, fewer_with_n = 0, pairs_n = 0;
  for (std::size_t k = 0; k < cases.size(); ++k) {
    GrowOptions grow;
    grow.neighbourhood_vox = cases[k].N;
    grow.deviations = cases[k].M;
    grow.max_examined = 200000;
    const auto grown = grow_region(phantom->image, {seed}, grow, progress);
    if (!grown) return fail(grown.error());
    const auto points = static_cast<double>(grown->report.voxels);
    t.rows.push_back(
        {fmt::format("N {:2} M {}", cases[k].N, cases[k].M), {{cases[k].thesis, points}}});
    const auto ours = [&](std::size_t i) { return *t.rows[i].figures[0].ours; };
    if (k % 3 != 0) ++pairs_m, more_with_m += points >= ours(k - 1);
    if (k >= 3) ++pairs_n, fewer_with_n += points <= 1.02 * ours(k - 3);
    progress.at("table 7.1", static_cast<double>(k + 1) / static_cast<double>(cases.size()));
  }
  t.trends.push_back({"more deviations M segment more points", more_with_m == pairs_m,
                      fmt::format("{} of {} pairs", more_with_m, pairs_m)});
  if (pairs_n > 0)
    t.trends.push_back({"larger neighbourhoods N segment no more points, with one exception",
                        fewer_with_n + 1 >= pairs_n,
                        fmt::format("{} of {} pairs", fewer_with_n, pairs_n)});
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
  struct Row {
    const char* label;
    RingsImages images;
    std::vector<Vec3> seeds;
    std::optional<double> examined;  // as the thesis has it
  };
  const Row rows[] = {{"MR volume alone", RingsImages::kVolume, seeds, {}},
                      {"X-ray views alone, one seed", RingsImages::kViews, {seeds[0]}, {}},
                      {"both", RingsImages::kBoth, seeds, 200000}};
  std::vector<RingsMeasure> measured;
  for (const Row& row : rows) {
    const auto grown = grow_rings(*rings, row.images, row.seeds, progress);
    if (!grown) return fail(grown.error());
    measured.push_back(measure_rings(*rings, grown->mask));
    const RingsMeasure& m = measured.back();
    t.rows.push_back({row.label,
                      {{row.examined, static_cast<double>(grown->report.examined)},
                       {{}, static_cast<double>(m.voxels)},
                       {{}, 100 * m.found},
                       {{}, 100 * m.artefact},
                       {{}, 100 * m.arc[0]},
                       {{}, 100 * m.arc[1]},
                       {{}, 100 * m.arc[2]}}});
    progress.at("rings", static_cast<double>(measured.size()) / 3);
  }
  const auto longest = [](const RingsMeasure& m) {
    return *std::max_element(m.arc.begin(), m.arc.end());
  };
  const auto shortest = [](const RingsMeasure& m) {
    return *std::min_element(m.arc.begin(), m.arc.end());
  };
  t.trends.push_back({"the volume alone does not span the gaps", longest(measured[0]) < 0.25,
                      fmt::format("at most {:.0f} % of a ring", 100 * longest(measured[0]))});
  t.trends.push_back({"the views alone fill a plane that is no ring", measured[1].artefact > 0.5,
                      fmt::format("{:.0f} % of it lies outside the rings, up to {:.0f} mm",
                                  100 * measured[1].artefact, measured[1].farthest_mm)});
  t.trends.push_back(
      {"both together complete all three rings without artefact",
       shortest(measured[2]) > 0.97 && measured[2].farthest_mm < 4,
       fmt::format("at least {:.1f} % of each ring, nothing farther than {:.1f} mm from a tube",
                   100 * shortest(measured[2]), measured[2].farthest_mm)});
  t.notes.push_back(
      "three rings linked but not touching: one seed each (thesis: one seed), except for the views "
      "alone; 12 degrees of the signal lost by 65 % every 45, 22.5 apart in the volume and the "
      "views; SNR 20");
  return t;
}

}  // namespace angiospline::experiments
