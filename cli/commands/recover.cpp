#include <cstdint>
#include <filesystem>
#include <optional>
#include <system_error>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "cli/model_stages.h"
#include "io/centerlines/centerline_export.h"
#include "io/model/certificate_json.h"
#include "io/report/report_html.h"
#include "recovery/fit/closed_pieces.h"
#include "recovery/fit/fit_model.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/mask/topology_numbers.h"

namespace angiospline::cli {
namespace {

namespace fs = std::filesystem;

// The folder for the results; one that this run made goes away again if nothing came to lie in it.
class OutputFolder {
 public:
  static Result<std::unique_ptr<OutputFolder>> make(const std::string& name) {
    std::error_code error;
    const bool made = fs::create_directory(name, error);
    if (error || !fs::is_directory(name)) {
      return fail({ErrorKind::kCannotWrite, "cannot make the folder", name, error.message(),
                   "its parent must exist and be writable"});
    }
    return std::unique_ptr<OutputFolder>(new OutputFolder(name, made));
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

struct Recovered {
  SegmentReport segment;
  Vessels vessels;
  Model model;
};

Result<void> write_stage_files(const OutputFolder& folder, const Mask& mask,
                               const Vessels& vessels) {
  auto written = write_image(mask, folder / "mask.nrrd");
  if (written) written = write_image(vessels.skeleton, folder / "skeleton.nrrd");
  if (written) written = write_centerline_file(folder / "centerlines.swc", vessels.tree);
  if (written) written = write_centerline_file(folder / "centerlines.vtp", vessels.tree);
  return written;
}

// A seed in noise or tissue floods the image. Vessels fill a small part of it and have few loops; a
// network of capillaries has many, but fills little.
std::optional<Error> flooded(const Mask& mask, const std::string& image) {
  constexpr double kShare = 0.2, kFull = 0.9;
  constexpr std::int64_t kLoops = 100;
  const double share =
      static_cast<double>(voxel_count(mask)) / static_cast<double>(mask.grid.voxel_count());
  if (share <= kShare) return std::nullopt;
  const std::int64_t loops = topology_numbers(mask).cycles;
  if (loops <= kLoops && share < kFull) return std::nullopt;
  return Error{ErrorKind::kBadInput, "there is no vessel at the seeds, or it leaks", image,
               fmt::format("what grows from them fills {:.0f} % of the image and has {} loops",
                           100 * share, loops),
               "give other seeds or a higher background threshold; `segment` writes the mask"};
}

// The model of a tree, fitted to the image; where that cannot be done the walls are as the mask's
// radii have them, with a warning. Pieces of the mask without branches become closed surfaces.
Result<Model> model_of(const CenterlineTree& tree, const Mask& closed,
                       const RecoverArguments& arguments, const Progress& progress,
                       Stopwatch& watch) {
  std::optional<Error> unfit;
  if (arguments.fit) {
    const std::string& path = arguments.segment.image;
    const auto file = read_image(path, reading_of(arguments.segment), progress);
    if (!file) return fail(file.error());
    FitOptions options;
    options.dark = arguments.segment.dark;
    options.refinements = arguments.refinements;
    const auto image = grey_image(file->image, path);
    auto fitted = image ? fit_tree(tree, *image, options, progress)
                        : Result<FittedModel>(fail(image.error()));
    if (fitted) {
      auto added = add_closed_pieces(fitted->model, closed, &*image, options, progress);
      watch.lap("fit");
      if (!added) return fail(added.error());
      return std::move(fitted->model);
    }
    watch.lap("fit");
    if (fitted.error().kind == ErrorKind::kCancelled) return fail(fitted.error());
    unfit = fitted.error();
  }
  auto model = build_model(tree, {}, progress);
  if (model && unfit) {
    model->warnings.push_back({WarningCode::kWallsNotFitted,
                               "the walls were not fitted to the image: " + unfit->message()});
  }
  if (model) {
    if (auto added = add_closed_pieces(*model, closed, nullptr); !added) return fail(added.error());
  }
  watch.lap("model");
  return model;
}

Result<Recovered> recover(const RecoverArguments& arguments, const OutputFolder& folder,
                          const Progress& progress, Stopwatch& watch) {
  auto segmented = segment_image(arguments.segment, progress, watch);
  if (!segmented) return fail(segmented.error());
  if (auto error = flooded(segmented->mask, arguments.segment.image)) return fail(*error);
  VesselsOptions options;
  if (arguments.root_mm) options.roots_mm.push_back(*arguments.root_mm);
  options.cut_contacts = arguments.cut_contacts;
  auto vessels = vessels_from_mask(segmented->mask, options, progress);
  if (!vessels) return fail(vessels.error());
  watch.lap("graph");
  TreeAndPieces parted = part_closed_pieces(segmented->mask, vessels->skeleton, vessels->tree);
  vessels->tree = std::move(parted.tree);
  vessels->tree.source = arguments.segment.image;
  if (auto written = write_stage_files(folder, segmented->mask, *vessels); !written) {
    return fail(written.error());
  }
  watch.lap("write stages");
  auto model = model_of(vessels->tree, parted.pieces, arguments, progress, watch);
  if (!model) return fail(model.error());
  model->name = fs::path(arguments.segment.image).stem().stem().string();
  const SegmentReport& report = segmented->report;
  model->assumptions.insert(model->assumptions.begin(), report.choices.begin(),
                            report.choices.end());
  model->warnings.insert(model->warnings.begin(), report.warnings.begin(), report.warnings.end());
  return Recovered{std::move(segmented->report), std::move(*vessels), std::move(*model)};
}

// The page a person looks at, with projections of the image; the image is read once more for them.
Result<void> write_recovery_report(const fs::path& path, const RecoverArguments& arguments,
                                   const Recovered& recovered, const Certificate& certificate,
                                   const std::vector<std::string>& files, const Stopwatch& watch) {
  const auto file = read_image(arguments.segment.image, reading_of(arguments.segment));
  if (!file) return fail(file.error());
  auto mesh = tessellate(recovered.model.network);
  if (!mesh) return fail(mesh.error());
  ReportExtras extras;
  extras.certificate = certificate;
  extras.images = projections(file->image, recovered.vessels.tree,
                              arguments.segment.dark ? Polarity::kDark : Polarity::kBright);
  extras.seconds = watch.laps();
  extras.files = files;
  return write_report(path, recovered.model, mesh->mesh, extras);
}

}  // namespace

int run_recover(const RecoverArguments& arguments) {
  const Console console;
  Stopwatch watch;
  const auto folder = OutputFolder::make(arguments.output_folder);
  if (!folder) return report_error(folder.error());
  auto recovered = recover(arguments, **folder, console.progress(), watch);
  if (!recovered) return report_error(recovered.error());

  std::vector<fs::path> paths;
  for (const char* name : {"model.json", "model.step", "model.iges", "model.glb", "model.stl"}) {
    paths.push_back(**folder / name);
  }
  const auto finished = finish_model(recovered->model, paths, "AP242", console, watch);
  if (!finished) return report_error(finished.error());
  const Certificate& certificate = finished->certificate;
  append_warnings(recovered->model, finished->report);

  std::vector<std::string> files;
  for (const char* name : {"mask.nrrd", "skeleton.nrrd", "centerlines.swc", "centerlines.vtp"}) {
    files.push_back((**folder / name).string());
  }
  for (const fs::path& path : paths) files.push_back(path.string());
  const fs::path report = **folder / "report.html";
  if (const auto written =
          write_recovery_report(report, arguments, *recovered, certificate, files, watch);
      !written) {
    return report_error(written.error());
  }
  files.push_back(report.string());
  watch.lap("report");
  if (arguments.json) {
    Json json = model_json(recovered->model);
    json["segment"] = segmentation_json(recovered->segment);
    json["graph"] = graph_json(recovered->vessels.tree);
    json["contacts"] = contacts_json(recovered->vessels);
    json["seconds"] = seconds_json(watch);
    json["files"] = files;
    json["check"] = to_json(certificate);
    print_json(json);
  }
  return tell_outcome(recovered->model, certificate, {arguments.output_folder}, console);
}

}  // namespace angiospline::cli
