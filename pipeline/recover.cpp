#include "pipeline/recover.h"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "io/centerlines/centerline_export.h"
#include "io/report/report_html.h"
#include "modeling/build/build_model.h"
#include "modeling/network/tessellation.h"
#include "pipeline/finish_model.h"
#include "recovery/fit/closed_pieces.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

// Of a mask that floods its image; see recover.h.
constexpr double kFloodedShare = 0.2;
constexpr double kFullShare = 0.9;
constexpr std::int64_t kFloodedLoops = 100;

constexpr const char* kStageFiles[] = {"mask.nrrd", "skeleton.nrrd", "centerlines.swc",
                                       "centerlines.vtp"};
constexpr const char* kModelFiles[] = {"model.json", "model.step", "model.iges", "model.glb",
                                       "model.stl"};

// The folder for the results; one that this run made goes away again if nothing came to lie in it.
class OutputFolder {
 public:
  static Result<std::unique_ptr<OutputFolder>> make(const fs::path& path) {
    std::error_code error;
    const bool made = fs::create_directory(path, error);
    if (error || !fs::is_directory(path)) {
      return fail({ErrorKind::kCannotWrite, "cannot make the folder", path.string(),
                   error.message(), "its parent must exist and be writable"});
    }
    return std::unique_ptr<OutputFolder>(new OutputFolder(path, made));
  }
  ~OutputFolder() {
    std::error_code ignored;
    if (made_ && fs::is_empty(path_, ignored)) fs::remove(path_, ignored);
  }
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;

  fs::path operator/(const char* name) const { return path_ / name; }

 private:
  OutputFolder(fs::path path, bool made) : path_(std::move(path)), made_(made) {}
  fs::path path_;
  bool made_;
};

Result<void> write_stage_files(const OutputFolder& folder, const Mask& mask,
                               const Vessels& vessels) {
  auto written = write_image(mask, folder / "mask.nrrd");
  if (written) written = write_image(vessels.skeleton, folder / "skeleton.nrrd");
  if (written) written = write_centerline_file(folder / "centerlines.swc", vessels.tree);
  if (written) written = write_centerline_file(folder / "centerlines.vtp", vessels.tree);
  return written;
}

// What the model of a tree is made of besides it.
struct Evidence {
  const AnyImage& image;
  const std::string& source;
  const Mask& pieces;  // that become closed surfaces
};

// The model and its closed pieces, all fitted to the image. Errors of fit_tree mean that the walls
// cannot be fitted; `add_closed_pieces` only fails when it is stopped.
Result<Model> fitted_model(const CenterlineTree& tree, const Evidence& evidence,
                           const FitOptions& options, const Progress& progress) {
  const auto grey = grey_image(evidence.image, evidence.source);
  if (!grey) return fail(grey.error());
  auto fitted = fit_tree(tree, *grey, options, progress);
  if (!fitted) return fail(fitted.error());
  auto added = add_closed_pieces(fitted->model, evidence.pieces, &*grey, options, progress);
  if (!added) return fail(added.error());
  return std::move(fitted->model);
}

// The model of a tree, fitted to the image; where that cannot be done the walls are as the mask's
// radii have them, with a warning.
Result<Model> model_of(const CenterlineTree& tree, const Evidence& evidence,
                       const RecoverOptions& options, const Progress& progress, Stopwatch& watch) {
  std::optional<Error> unfit;
  if (options.fit) {
    FitOptions fitting = options.fitting;
    fitting.dark = options.image.segment.polarity == Polarity::kDark;
    auto fitted = fitted_model(tree, evidence, fitting, progress);
    watch.lap("fit");
    if (fitted || fitted.error().kind == ErrorKind::kCancelled) return fitted;
    unfit = fitted.error();
  }

  auto model = build_model(tree, options.fitting.build, progress);
  if (!model) return model;
  if (unfit) {
    model->warnings.push_back({WarningCode::kWallsNotFitted,
                               "the walls were not fitted to the image: " + unfit->message()});
  }
  if (auto added = add_closed_pieces(*model, evidence.pieces, nullptr); !added) {
    return fail(added.error());
  }
  watch.lap("model");
  return model;
}

// Called with the mask and the vessels before the model is made, to keep them.
using KeepStages = std::function<Result<void>(const Mask&, const Vessels&)>;

Result<RecoveredModel> model_of_segmented(const AnyImage& image, Segmented segmented,
                                          const std::string& name, const std::string& source,
                                          const RecoverOptions& options, const KeepStages& keep,
                                          const Progress& progress, Stopwatch& watch) {
  if (auto error = flooded(segmented.mask, source)) return fail(*std::move(error));
  auto vessels = vessels_from_mask(segmented.mask, options.vessels, progress);
  if (!vessels) return fail(vessels.error());
  watch.lap("graph");

  // A sac or a blob has no branch: it leaves the tree and comes back as a closed surface.
  TreeAndPieces parted = part_closed_pieces(segmented.mask, vessels->skeleton, vessels->tree);
  vessels->tree = std::move(parted.tree);
  vessels->tree.source = source;
  if (keep) {
    if (auto kept = keep(segmented.mask, *vessels); !kept) return fail(kept.error());
    watch.lap("write stages");
  }

  auto model = model_of(vessels->tree, {image, source, parted.pieces}, options, progress, watch);
  if (!model) return fail(model.error());
  model->name = name;

  // What was chosen in the image comes before what was chosen in the model.
  const SegmentReport& report = segmented.report;
  model->assumptions.insert(model->assumptions.begin(), report.choices.begin(),
                            report.choices.end());
  model->warnings.insert(model->warnings.begin(), report.warnings.begin(), report.warnings.end());
  return RecoveredModel{*std::move(model), std::move(segmented.report), *std::move(vessels)};
}

// The page a person looks at, with projections of the image.
Result<void> write_recovery_report(const fs::path& path, const RecoveredFile& recovered,
                                   std::vector<ReportImage> images) {
  auto mesh = tessellate(recovered.model.network);
  if (!mesh) return fail(mesh.error());
  ReportExtras extras;
  extras.certificate = recovered.certificate;
  extras.images = std::move(images);
  extras.seconds = recovered.seconds;
  extras.files = recovered.files;
  return write_report(path, recovered.model, mesh->mesh, extras);
}

}  // namespace

std::optional<Error> flooded(const Mask& mask, const std::string& source) {
  const double share =
      static_cast<double>(voxel_count(mask)) / static_cast<double>(mask.grid.voxel_count());
  if (share <= kFloodedShare) return std::nullopt;
  const std::int64_t loops = topology_numbers(mask).cycles;
  if (loops <= kFloodedLoops && share < kFullShare) return std::nullopt;
  return Error{ErrorKind::kBadInput, "there is no vessel at the seeds, or it leaks", source,
               fmt::format("what grows from them fills {:.0f} % of the image and has {} loops",
                           100 * share, loops),
               "give other seeds or a higher background threshold; `segment` writes the mask"};
}

Result<RecoveredModel> recover_model(const AnyImage& image, const std::string& name,
                                     const std::string& source, const RecoverOptions& options,
                                     const Progress& progress) {
  Stopwatch watch;
  auto segmented = segment_image(image, source, options.image, progress);
  if (!segmented) return fail(segmented.error());
  return model_of_segmented(image, *std::move(segmented), name, source, options, {}, progress,
                            watch);
}

Result<RecoveredFile> recover_file(const fs::path& image, const fs::path& folder,
                                   const RecoverOptions& options, const Progress& progress) {
  Stopwatch watch;
  const auto out = OutputFolder::make(folder);
  if (!out) return fail(out.error());
  auto file = segment_file(image, options.image, progress, watch);
  if (!file) return fail(file.error());
  const auto keep = [&](const Mask& mask, const Vessels& vessels) {
    return write_stage_files(**out, mask, vessels);
  };
  auto recovered =
      model_of_segmented(file->image, std::move(file->segmented), image.stem().stem().string(),
                         image.string(), options, keep, progress, watch);
  if (!recovered) return fail(recovered.error());

  // The last that is wanted of the image: it goes before solids are made, which need the memory.
  std::vector<ReportImage> images =
      projections(file->image, recovered->vessels.tree, options.image.segment.polarity);
  file->image = AnyImage();

  std::vector<fs::path> paths;
  for (const char* name : kModelFiles) paths.push_back(**out / name);
  auto finished =
      finish_model(std::move(recovered->model), paths, options.writing, progress, watch);
  if (!finished) return fail(finished.error());

  RecoveredFile result{std::move(finished->model),
                       std::move(recovered->segment),
                       std::move(recovered->vessels),
                       std::move(finished->certificate),
                       {},
                       watch.laps()};
  for (const char* name : kStageFiles) result.files.push_back((**out / name).string());
  for (const fs::path& path : paths) result.files.push_back(path.string());
  const fs::path report = **out / "report.html";
  if (auto written = write_recovery_report(report, result, std::move(images)); !written) {
    return fail(written.error());
  }
  result.files.push_back(report.string());
  watch.lap("report");
  result.seconds = watch.laps();
  return result;
}

}  // namespace angiospline
