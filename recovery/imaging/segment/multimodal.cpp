#include "recovery/imaging/segment/multimodal.h"

#include <algorithm>
#include <limits>
#include <memory>

#include <fmt/format.h>

#include "recovery/imaging/segment/adaptive_threshold.h"
#include "recovery/imaging/segment/growing_front.h"

namespace angiospline {

using namespace region_growing;

namespace {

// One image with its labels. A view is an image of one slice; `at` maps the world into it.
struct Channel {
  Image<float>* image;
  const XrayGeometry* geometry;  // none: a volume
  std::unique_ptr<AdaptiveThreshold<float>> rule;

  std::optional<Voxel> at(const Vec3& point_mm) const {
    Voxel v;
    if (geometry != nullptr) {
      const auto pixel = geometry->project(point_mm);
      if (!pixel) return std::nullopt;
      v = nearest_voxel(Vec3((*pixel)[0], (*pixel)[1], 0));
    } else {
      v = nearest_voxel(image->grid.index_vox(point_mm));
    }
    if (!image->grid.contains(v)) return std::nullopt;
    return v;
  }

  bool says_vessel(const Vec3& point_mm) const {
    const auto v = at(point_mm);
    return v && (rule->is_vessel(*v) || rule->decide(*v).vessel);
  }

  // Labels the place of a voxel that is vessel; if this image saw background there, it takes the
  // parent's grey value first.
  void accept(const Vec3& point_mm, const Vec3& parent_mm, bool agreed) const {
    const auto v = at(point_mm);
    if (!v) return;
    if (!agreed && !rule->is_vessel(*v))
      if (const auto parent = at(parent_mm)) (*image)[*v] = (*image)[*parent];
    rule->label_vessel(*v);
  }

  void reject(const Vec3& point_mm) const {
    if (const auto v = at(point_mm)) rule->label_background(*v);
  }
};

// A voxel of the world and the one that queued it, by their offsets.
struct Step {
  std::size_t to, from;
};

class Grower {
 public:
  Grower(Modalities& modalities, const ImageGrid& world, const MultimodalOptions& options)
      : world_(world), options_(options), seen_(world.size), mask_(world) {
    const auto add = [&](Image<float>& image, const XrayGeometry* geometry, const GrowOptions& o) {
      channels_.push_back({&image, geometry, std::make_unique<AdaptiveThreshold<float>>(image, o)});
    };
    has_volume_ = modalities.volume.has_value();
    if (has_volume_) add(*modalities.volume, nullptr, options.volume);
    for (XrayView& view : modalities.views) add(view.image, &view.geometry, options.projection);
  }

  Result<void> start(const Vec3& seed_mm, std::size_t index);
  Result<MultimodalReport> grow(const Progress& progress);
  Mask take_mask() { return std::move(mask_); }

 private:
  double brightness(const Vec3& point_mm) const;
  void label(const Voxel& v);
  void queue_neighbours(const Voxel& v);
  void examine(const Step& step);

  const ImageGrid& world_;
  const MultimodalOptions& options_;
  std::vector<Channel> channels_;  // the volume first, if there is one
  bool has_volume_ = false;
  VoxelFlags seen_;
  Mask mask_;
  GrowingFront<Step> front_;
  MultimodalReport report_;
};

// What orders the queue; minus infinity where a voxel must not be looked at.
double Grower::brightness(const Vec3& point_mm) const {
  constexpr double kNever = -std::numeric_limits<double>::infinity();
  double least = std::numeric_limits<double>::infinity();
  for (const Channel& c : channels_) {
    const auto v = c.at(point_mm);
    const double g = v ? c.rule->grey(*v) : kNever;
    if (!has_volume_ || &c == &channels_.front()) {
      if (!v || !c.rule->admissible(g)) return kNever;
      least = std::min(least, g);
    }
    if (has_volume_) break;
  }
  return least;
}

void Grower::label(const Voxel& v) {
  if (mask_[v] == 0) ++report_.voxels;
  mask_[v] = 1;
  seen_.set(v, VoxelFlags::kSeen);
}

void Grower::queue_neighbours(const Voxel& v) {
  const std::size_t parent = world_.offset(v);
  for_each(box_around(v, 1, world_.size), [&](const Voxel& n) {
    if (seen_.any(n, VoxelFlags::kSeen)) return;
    const double g = brightness(world_.world_mm(n));
    if (!std::isfinite(g)) return;
    seen_.set(n, VoxelFlags::kSeen);
    front_.push(g, {world_.offset(n), parent});
  });
}

Result<void> Grower::start(const Vec3& seed_mm, std::size_t index) {
  const Voxel seed = nearest_voxel(world_.index_vox(seed_mm));
  if (!seed_mm.allFinite() || !world_.contains(seed))
    return fail({ErrorKind::kBadInput,
                 "seed is outside the world grid",
                 fmt::format("seed {}", index + 1),
                 fmt::format("({:.6g}, {:.6g}, {:.6g}) mm", seed_mm[0], seed_mm[1], seed_mm[2]),
                 {}});

  for (Channel& c : channels_) {
    Vec3 place = seed_mm;  // in the channel's own world
    if (c.geometry != nullptr) {
      const auto pixel = c.geometry->project(seed_mm);
      const Vec3 off_detector = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
      place = pixel ? c.image->grid.world_mm(Vec3((*pixel)[0], (*pixel)[1], 0)) : off_detector;
    }

    auto start = c.rule->start(place, index);
    if (!start) {
      start.error().where += c.geometry == nullptr ? " in the volume" : " in a projection";
      return fail(start.error());
    }
    for (const Voxel& v : start->voxels) c.rule->label_vessel(v);
  }

  label(seed);
  queue_neighbours(seed);
  return {};
}

void Grower::examine(const Step& step) {
  const Vec3 point = world_.world_mm(world_.voxel(step.to));
  const Vec3 parent = world_.world_mm(world_.voxel(step.from));
  const std::size_t first_view = has_volume_ ? 1 : 0;
  const bool volume = has_volume_ && channels_.front().says_vessel(point);

  std::vector<char> said(channels_.size(), 0);
  if (has_volume_) said[0] = volume;
  bool views = channels_.size() > first_view;
  for (std::size_t k = first_view; k < channels_.size(); ++k) {
    said[k] = channels_[k].says_vessel(point);
    views = views && said[k];
  }

  ++report_.examined;
  if (!volume && !views) {
    for (std::size_t k = 0; k < channels_.size(); ++k)
      if (!said[k]) channels_[k].reject(point);
    return;
  }

  (volume && views ? report_.by_both : volume ? report_.by_volume : report_.by_views) += 1;
  for (std::size_t k = 0; k < channels_.size(); ++k) channels_[k].accept(point, parent, said[k]);
  label(world_.voxel(step.to));
  queue_neighbours(world_.voxel(step.to));
}

Result<MultimodalReport> Grower::grow(const Progress& progress) {
  constexpr std::size_t kReportEvery = std::size_t{1} << 14;
  const Result<bool> limit_reached =
      front_.grow(report_.examined, options_.max_examined, kReportEvery, progress,
                  [&](const auto& candidate) { examine(candidate.at); });
  if (!limit_reached) return fail(limit_reached.error());
  report_.limit_reached = *limit_reached;
  return report_;
}

}  // namespace

ImageGrid finer_grid(const ImageGrid& grid, double spacing_mm) {
  EXPECTS(spacing_mm > 0);
  ImageGrid fine = grid;
  fine.spacing_mm = Vec3::Constant(spacing_mm);
  for (std::size_t k = 0; k < 3; ++k)
    fine.size[k] = std::max(
        1, static_cast<int>(std::lround(
               grid.size[k] * grid.spacing_mm[static_cast<Eigen::Index>(k)] / spacing_mm)));
  fine.origin_mm = grid.world_mm(
      Vec3(-0.5 * Vec3::Ones() + 0.5 * fine.spacing_mm.cwiseQuotient(grid.spacing_mm)));
  return fine;
}

Result<MultimodalSegmentation> grow_region(Modalities modalities, const ImageGrid& world,
                                           const std::vector<Vec3>& seeds_mm,
                                           const MultimodalOptions& options,
                                           const Progress& progress) {
  for (const GrowOptions* o : {&options.volume, &options.projection})
    if (const auto ok = check(*o); !ok) return fail(ok.error());
  EXPECTS(options.volume.smoothing_mm == 0 && options.projection.smoothing_mm == 0);
  if (!modalities.volume && modalities.views.empty())
    return fail({ErrorKind::kBadInput, "no image", {}, {}, "a volume or a projection is needed"});
  if (seeds_mm.empty())
    return fail(
        {ErrorKind::kBadInput, "no seed", {}, {}, "region growing starts from at least one point"});
  for (const XrayView& v : modalities.views)
    EXPECTS(v.image.grid.size == (Voxel{v.geometry.size[0], v.geometry.size[1], 1}));
  Grower grower(modalities, world, options);
  for (std::size_t i = 0; i < seeds_mm.size(); ++i)
    if (const auto ok = grower.start(seeds_mm[i], i); !ok) return fail(ok.error());
  const Result<MultimodalReport> report = grower.grow(progress);
  if (!report) return fail(report.error());
  Mask mask = grower.take_mask();
  return MultimodalSegmentation{std::move(mask), std::move(modalities), *report};
}

}  // namespace angiospline
