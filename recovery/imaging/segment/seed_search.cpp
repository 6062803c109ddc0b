#include "recovery/imaging/segment/seed_search.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include "base/median.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/segment/rules.h"
#include "recovery/imaging/segment/vesselness.h"

namespace angiospline {
namespace {

using namespace segmentation;

bool near_border(const ImageGrid& grid, const Voxel& v, int reach, int thin) {
  for (std::size_t k = 0; k < 3; ++k)
    if (grid.size[k] > thin && (v[k] < reach || v[k] >= grid.size[k] - reach)) return true;
  return false;
}

// The distance of the voxel that is farthest from the one that is farthest from `start`.
double extent_vox(const ImageGrid& grid, const std::vector<std::size_t>& voxels,
                  std::size_t start) {
  const auto at = [&](std::size_t offset) {
    const Voxel v = grid.voxel(offset);
    return Vec3(v[0], v[1], v[2]);
  };
  double extent = 0;
  for (int sweep = 0; sweep < 2; ++sweep) {
    const Vec3 from = at(start);
    extent = 0;
    for (const std::size_t o : voxels)
      if (const double d = (at(o) - from).norm(); d > extent) extent = d, start = o;
  }
  return extent;
}

struct Structure : TubularStructure {
  std::vector<std::size_t> voxels;
  bool reaches_border = false;
};

// The structures of what answers, most in all first; faint ones left out.
std::vector<Structure> structures_of(const Vesselness& v, float strongest,
                                     const std::vector<double>& radii_vox) {
  const ImageGrid& grid = v.answer.grid;
  Mask strong(grid);
  for (std::size_t i = 0; i < strong.voxels.size(); ++i)
    strong.voxels[i] = v.answer.voxels[i] >= kStructure * strongest;

  const Components parts = connected_components(strong, Neighbours::kCorners26);
  std::vector<Structure> all(parts.list.size());
  for (std::size_t i = 0; i < strong.voxels.size(); ++i)
    if (const auto label = parts.labels.voxels[i]; label > 0) {
      Structure& s = all[static_cast<std::size_t>(label - 1)];
      s.total += static_cast<double>(v.answer.voxels[i]);
      s.voxels.push_back(i);
    }
  std::stable_sort(all.begin(), all.end(),
                   [](const Structure& a, const Structure& b) { return a.total > b.total; });

  while (all.back().total < kLeastTotal * all.front().total) all.pop_back();

  for (Structure& s : all) {
    const auto answers_less = [&](std::size_t a, std::size_t b) {
      return v.answer.voxels[a] < v.answer.voxels[b];
    };
    const std::size_t core = *std::max_element(s.voxels.begin(), s.voxels.end(), answers_less);
    s.core_mm = grid.world_mm(grid.voxel(core));
    s.strength = static_cast<double>(v.answer.voxels[core]);

    std::vector<double> tubeness;
    std::size_t at_border = 0;
    for (const std::size_t i : s.voxels) {
      at_border += near_border(grid, grid.voxel(i), kBorder, kThinImage);
      s.reaches_border =
          s.reaches_border || near_border(grid, grid.voxel(i), kUnknownBorder + 1, 0);
      if (2 * static_cast<double>(v.answer.voxels[i]) >= s.strength)
        tubeness.push_back(static_cast<double>(v.tubeness.voxels[i]));
    }

    s.tubeness = median(std::move(tubeness));
    s.border_share = static_cast<double>(at_border) / static_cast<double>(s.voxels.size());
    s.length_radii = extent_vox(grid, s.voxels, core) / radii_vox[v.scale.voxels[core]];
  }
  return all;
}

// Structures left out for one reason; the strongest of them is named.
struct Reason {
  const char* why;
  std::size_t count = 0;
  Vec3 core_mm = Vec3::Zero();
  double strength = 0;

  void add(const TubularStructure& s) {
    if (++count > 1 && s.strength <= strength) return;
    core_mm = s.core_mm;
    strength = s.strength;
  }
  std::string text(double strongest) const {
    return fmt::format("{} left out as {}; the strongest ({:.2f}) at {:.1f},{:.1f},{:.1f} mm",
                       count == 1 ? "1 structure is" : fmt::format("{} structures are", count), why,
                       strength / strongest, core_mm.x(), core_mm.y(), core_mm.z());
  }
};

struct Judgement {
  std::vector<TubularStructure> kept;
  Reason border{"lying along the image's border"}, no_tube{"no tubes"},
      weak{"far weaker than the strongest tube"}, more{"more than are looked for"};
  double strongest = 0;  // of those that are tubes

  // Returns the voxels of what is to be taken away before the rest is judged anew: none if the
  // strongest structure is sound.
  std::vector<std::size_t> judge(const std::vector<Structure>& all,
                                 const SeedSearchOptions& options) {
    const auto fault = [&](const Structure& s) -> Reason* {
      if (s.border_share > kMostBorder) return &border;
      // What the border cuts off may be longer.
      const bool short_one = s.length_radii < kLeastLength && !s.reaches_border;
      return s.tubeness < kLeastTubeness || short_one ? &no_tube : nullptr;
    };
    const auto weaker = [](const Structure& a, const Structure& b) {
      return a.strength < b.strength;
    };

    // Where the strongest structure of all is none, what answers elsewhere is judged against
    // nothing.
    const bool sound = fault(*std::max_element(all.begin(), all.end(), weaker)) == nullptr;
    std::vector<std::size_t> away;

    for (const Structure& s : all) {
      Reason* reason = fault(s);
      if (reason == nullptr) {
        strongest = std::max(strongest, s.strength);
        continue;
      }
      reason->add(s);
      if (!sound) away.insert(away.end(), s.voxels.begin(), s.voxels.end());
    }

    for (const Structure& s : all) {
      if (!sound || fault(s) != nullptr) continue;
      if (s.strength < options.least_strength * strongest)
        weak.add(s);
      else if (std::ssize(kept) < options.most)
        kept.push_back(s);
      else
        more.add(s);
    }

    return away;
  }

  std::vector<std::string> reasons() const {
    std::vector<std::string> texts;
    for (const Reason* r : {&border, &no_tube, &weak, &more})
      if (r->count > 0) texts.push_back(r->text(strongest));
    return texts;
  }
};

}  // namespace

Image<float> seed_grid_image(const AnyImage& image, Polarity polarity) {
  const ImageGrid& grid = grid_of(image);
  Vec3 extent;
  for (int i = 0; i < 3; ++i)
    extent[i] = grid.size[static_cast<std::size_t>(i)] * grid.spacing_mm[i];
  const double cell = std::max(extent.maxCoeff() / kSeedGrid, grid.spacing_mm.minCoeff());

  std::array<int, 3> block;
  ImageGrid coarse = grid;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    block[i] = std::max(1, static_cast<int>(std::lround(cell / grid.spacing_mm[k])));
    coarse.size[i] = std::max(1, grid.size[i] / block[i]);
    coarse.spacing_mm[k] = grid.spacing_mm[k] * block[i];
  }
  coarse.origin_mm =
      grid.world_mm(Vec3((block[0] - 1) / 2.0, (block[1] - 1) / 2.0, (block[2] - 1) / 2.0));

  // Means over blocks; voxels that are not finite do not count.
  Image<float> out(coarse);
  const double sign = polarity == Polarity::kBright ? 1 : -1;
  std::visit(
      [&](const auto& in) {
        tbb::parallel_for(0, coarse.size[2], [&](int z) {
          for (int y = 0; y < coarse.size[1]; ++y)
            for (int x = 0; x < coarse.size[0]; ++x) {
              double sum = 0;
              int count = 0;
              for (int c = 0; c < block[2]; ++c)
                for (int b = 0; b < block[1]; ++b)
                  for (int a = 0; a < block[0]; ++a) {
                    const double v = static_cast<double>(
                        in[{x * block[0] + a, y * block[1] + b, z * block[2] + c}]);
                    if (std::isfinite(v)) sum += v, ++count;
                  }
              out[{x, y, z}] = count > 0 ? static_cast<float>(sign * sum / count)
                                         : std::numeric_limits<float>::quiet_NaN();
            }
        });
      },
      image);

  // A block without any takes the darkest grey: nothing answers there.
  float lowest = 0;
  bool any = false;
  for (const float v : out.voxels)
    if (std::isfinite(v)) lowest = any ? std::min(lowest, v) : v, any = true;
  for (float& v : out.voxels)
    if (!std::isfinite(v)) v = lowest;
  return out;
}

Result<SeedSearch> find_seeds(const AnyImage& image, const SeedSearchOptions& options,
                              const Progress& progress) {
  const Image<float> small = seed_grid_image(image, options.polarity);
  const VesselnessOptions scales;
  Result<Vesselness> v = vesselness(small, scales, progress);
  if (!v) return fail(v.error());
  for (std::size_t i = 0; i < v->answer.voxels.size(); ++i)
    if (near_border(small.grid, small.grid.voxel(i), kUnknownBorder, 0)) v->answer.voxels[i] = 0;
  Judgement judgement;
  for (int round = 0; round < kRounds && judgement.kept.empty(); ++round) {
    const float strongest = *std::max_element(v->answer.voxels.begin(), v->answer.voxels.end());
    if (!(strongest > 0)) break;
    for (const std::size_t i :
         judgement.judge(structures_of(*v, strongest, scales.radii_vox), options))
      v->answer.voxels[i] = 0;
  }
  return SeedSearch{std::move(judgement.kept), judgement.reasons()};
}

}  // namespace angiospline
