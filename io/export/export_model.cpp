#include "io/export/export_model.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <system_error>
#include <thread>
#include <utility>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "base/process.h"
#include "io/cad/brep_file.h"
#include "io/cad/gmsh_script.h"
#include "io/cad/iges_file.h"
#include "io/cad/order_patches.h"
#include "io/cad/split_joins.h"
#include "io/cad/turn_patches.h"
#include "io/meshes/glb_file.h"
#include "io/meshes/stl_file.h"
#include "io/meshes/vtk_file.h"
#include "io/model/model_file.h"
#include "io/report/report_html.h"
#include "modeling/check/certificate.h"
#include "modeling/solid/tessellate_solid.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

enum class Format { kNative, kStep, kIges, kBrep, kGlb, kStl, kVtk, kReport, kGmsh };

struct Suffix {
  const char* text;
  Format format;
};

constexpr std::array<Suffix, 12> kSuffixes{{{".json", Format::kNative},
                                            {".step", Format::kStep},
                                            {".stp", Format::kStep},
                                            {".iges", Format::kIges},
                                            {".igs", Format::kIges},
                                            {".brep", Format::kBrep},
                                            {".glb", Format::kGlb},
                                            {".stl", Format::kStl},
                                            {".vtp", Format::kVtk},
                                            {".vtu", Format::kVtk},
                                            {".html", Format::kReport},
                                            {".geo", Format::kGmsh}}};

std::string lower_suffix(const fs::path& path) {
  std::string suffix = path.extension().string();
  std::transform(suffix.begin(), suffix.end(), suffix.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return suffix;
}

std::optional<Format> format_of(const fs::path& path) {
  const std::string suffix = lower_suffix(path);
  for (const Suffix& known : kSuffixes) {
    if (suffix == known.text) return known.format;
  }
  return std::nullopt;
}

bool needs_solid(Format f) {
  return f == Format::kStep || f == Format::kIges || f == Format::kBrep || f == Format::kGmsh;
}

// Gmsh reads these, and puts a fixed least number of elements on every edge.
bool wants_short_edges(Format f) { return f == Format::kStep || f == Format::kBrep; }

bool needs_triangles(Format f) {
  return f == Format::kGlb || f == Format::kStl || f == Format::kVtk;
}

Error unknown_suffix(const fs::path& path, ErrorKind kind, const std::string& known) {
  return {kind, "unknown model format", path.string(), path.extension().string(), known};
}

Result<void> write_solid(Solid solid, const std::string& name, const fs::path& path,
                         const ExportOptions& options, const Progress& progress) {
  switch (*format_of(path)) {
    case Format::kStep:
      return write_step(std::move(solid), path, {options.step_schema, name}, progress);
    case Format::kIges:
      return write_iges(std::move(solid), path, {name}, progress);
    default:
      return write_brep(std::move(solid), path, progress);
  }
}

Result<void> write_triangles(const TriangleMesh& mesh, const std::string& name,
                             const fs::path& path) {
  switch (*format_of(path)) {
    case Format::kGlb:
      return write_glb(path, mesh, {.name = name});
    case Format::kStl:
      return write_stl(path, mesh);
    default:
      return write_vtk_mesh(path, mesh);
  }
}

// The STEP file that a script for Gmsh loads.
std::optional<fs::path> step_among(const std::vector<fs::path>& paths) {
  for (const fs::path& path : paths) {
    if (format_of(path) == Format::kStep) return path;
  }
  return std::nullopt;
}

Result<void> write_measured_report(const fs::path& path, const Model& model,
                                   const TriangleMesh& mesh, const Progress& progress) {
  auto certificate = certify(model.network, {}, progress);
  if (!certificate) return fail(certificate.error());
  ReportExtras extras;
  extras.certificate = std::move(*certificate);
  return write_report(path, model, mesh, extras);
}

// Control points from which on files are written one after the other: each takes some 4 GB a
// million.
constexpr Eigen::Index kMostAside = 500'000;

// Whether a second process has a processor to run on, and both have the memory.
bool may_work_aside(const Model& model) {
  return std::thread::hardware_concurrency() > 1 &&
         tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) > 1 &&
         model.network.control_points_mm.cols() <= kMostAside;
}

std::string coarsened(const TessellationOptions& asked, const TessellationOptions& used) {
  return fmt::format(
      "triangles of .glb, .stl, .vtp, .vtu: tolerance {:.6g} of the local radius instead of "
      "{:.6g}, "
      "so that there are at most {:.0f}",
      used.chord_tolerance, asked.chord_tolerance, asked.most_triangles);
}

// The files of one model, in their order; solids and triangles are made when the first of them asks
// and let go with the last that needs them.
class ModelWriter {
 public:
  // `step`: the file that a script for Gmsh loads, if there is one.
  ModelWriter(const Model& model, std::vector<fs::path> paths, std::optional<fs::path> step,
              const ExportOptions& options, const Progress& progress)
      : model_(model),
        paths_(std::move(paths)),
        step_(std::move(step)),
        options_(options),
        progress_(progress) {}

  Result<ExportReport> write() {
    for (std::size_t k = 0; k < paths_.size(); ++k) {
      progress_.at("writing " + paths_[k].filename().string(),
                   static_cast<double>(k) / static_cast<double>(paths_.size()));
      if (progress_.should_stop()) return fail(cancelled("writing"));
      if (auto written = write(k); !written) return fail(written.error());
    }
    return std::move(report_);
  }

 private:
  Result<void> write(std::size_t k) {
    const fs::path& path = paths_[k];
    const Format format = *format_of(path);
    if (format == Format::kNative) return write_model(path, model_);
    if (needs_solid(format)) {
      auto solid = solid_for(k);
      if (!solid) return fail(solid.error());
      return format == Format::kGmsh
                 ? write_gmsh_script(*solid, *step_, path)
                 : write_solid(*std::move(solid), model_.name, path, options_, progress_);
    }
    if (auto made = need_mesh(); !made) return made;
    auto written = format == Format::kReport
                       ? write_measured_report(path, model_, *mesh_, progress_)
                       : write_triangles(*mesh_, model_.name, path);
    if (!is_wanted_after(k, [](Format f) { return !needs_solid(f) && f != Format::kNative; })) {
      mesh_.reset();
    }
    return written;
  }

  template <typename Wants>
  bool is_wanted_after(std::size_t k, const Wants& wants) const {
    return std::any_of(paths_.begin() + static_cast<std::ptrdiff_t>(k) + 1, paths_.end(),
                       [&](const fs::path& path) { return wants(*format_of(path)); });
  }

  // Made, kept or handed out for good.
  Result<Solid> solid_for(std::size_t k) {
    const bool short_edges = wants_short_edges(*format_of(paths_[k]));
    std::optional<Solid>& solid = solids_[short_edges ? 1 : 0];
    if (!solid) {
      SurfaceNetwork network = order_by_neighbours(turn_long_patches(model_.network));
      auto made = make_solid(short_edges ? split_joins(std::move(network), options_.edges)
                                         : std::move(network));
      if (!made) return fail(made.error());
      solid = std::move(*made);
    }
    const bool again = is_wanted_after(
        k, [&](Format f) { return needs_solid(f) && wants_short_edges(f) == short_edges; });
    return again ? *solid : *std::exchange(solid, std::nullopt);
  }

  Result<void> need_mesh() {
    if (mesh_) return {};
    auto made = tessellate(model_.network, options_.tessellation, progress_);
    if (!made) return fail(made.error());
    if (made->used.chord_tolerance > options_.tessellation.chord_tolerance) {
      report_.warnings.push_back(
          {WarningCode::kMeshCoarsened, coarsened(options_.tessellation, made->used)});
    }
    mesh_ = std::move(made->mesh);
    return {};
  }

  const Model& model_;
  const std::vector<fs::path> paths_;
  const std::optional<fs::path> step_;
  const ExportOptions& options_;
  const Progress& progress_;
  std::array<std::optional<Solid>, 2> solids_;  // with the network's own edges; with short ones
  std::optional<TriangleMesh> mesh_;
  ExportReport report_;
};

}  // namespace

std::string exported_suffixes() {
  std::string text;
  for (const Suffix& known : kSuffixes) {
    if (!text.empty()) text += ' ';
    text += known.text;
  }
  return text;
}

Result<void> check_export_target(const fs::path& path) {
  if (!format_of(path)) {
    return fail(unknown_suffix(path, ErrorKind::kBadInput, "one of " + exported_suffixes()));
  }
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) {
    return fail({ErrorKind::kCannotWrite, "folder does not exist", path.string(), folder.string(),
                 "make it first"});
  }
  if (fs::is_directory(path, ignored)) {
    return fail({ErrorKind::kCannotWrite, "target is a folder", path.string(), {}, {}});
  }
  return {};
}

Result<ExportReport> export_model(const Model& model, const std::vector<fs::path>& paths,
                                  const ExportOptions& options, const Progress& progress,
                                  const std::function<void()>& meanwhile) {
  const std::optional<fs::path> step = step_among(paths);
  for (const fs::path& path : paths) {
    if (auto target = check_export_target(path); !target) return fail(target.error());
    if (*format_of(path) == Format::kGmsh && !step) {
      return fail({ErrorKind::kBadInput,
                   "no STEP file for the script",
                   path.string(),
                   {},
                   "a .geo script loads a .step that is written with it"});
    }
  }
  const bool aside = options.step_in_side_process && step && (paths.size() > 1 || meanwhile) &&
                     may_work_aside(model);
  const SideProcess::Work write_step_file = [&](const Progress& its_own) -> Result<void> {
    const auto written = ModelWriter(model, {*step}, step, options, its_own).write();
    return written ? Result<void>() : fail(written.error());
  };
  std::optional<SideProcess> copy = aside ? SideProcess::start(write_step_file) : std::nullopt;
  std::vector<fs::path> here = paths;
  if (copy) std::erase(here, *step);
  auto report = ModelWriter(model, std::move(here), step, options, progress).write();
  if (!report) return report;
  if (meanwhile) meanwhile();
  if (copy) {
    if (auto written = copy->wait(progress); !written) {
      Error error = written.error();
      if (error.where.empty()) error.where = step->string();  // the copy crashed
      return fail(std::move(error));
    }
  }
  return report;
}

Result<void> export_solid(const Solid& solid, const std::string& name,
                          const std::vector<fs::path>& paths, const ExportOptions& options,
                          const Progress& progress) {
  for (const fs::path& path : paths) {
    if (auto target = check_export_target(path); !target) return target;
    if (*format_of(path) == Format::kNative) {
      return fail(
          unknown_suffix(path, ErrorKind::kBadInput,
                         "a native model keeps the tree it came from, which a solid lacks"));
    }
  }
  std::optional<TriangleMesh> mesh;
  for (const fs::path& path : paths) {
    if (needs_triangles(*format_of(path)) && !mesh) {
      auto made = tessellate(solid, {}, progress);
      if (!made) return fail(made.error());
      mesh = std::move(*made);
    }
    auto written = needs_triangles(*format_of(path))
                       ? write_triangles(*mesh, name, path)
                       : write_solid(solid, name, path, options, progress);
    if (!written) return written;
  }
  return {};
}

Result<void> export_mesh(const TriangleMesh& mesh, const std::string& name,
                         const std::vector<fs::path>& paths) {
  for (const fs::path& path : paths) {
    if (auto target = check_export_target(path); !target) return target;
    if (!needs_triangles(*format_of(path))) {
      return fail(unknown_suffix(path, ErrorKind::kBadInput,
                                 "triangles go to .glb .stl .vtp or .vtu: they are no surfaces"));
    }
  }
  for (const fs::path& path : paths) {
    if (auto written = write_triangles(mesh, name, path); !written) return written;
  }
  return {};
}

Result<AnyModel> read_any_model(const fs::path& path, const Progress& progress) {
  const std::optional<Format> format = format_of(path);
  const auto as_any = [](auto result) -> Result<AnyModel> {
    if (!result) return fail(result.error());
    return AnyModel(std::move(*result));
  };
  if (!format || *format == Format::kGlb || *format == Format::kReport ||
      *format == Format::kGmsh) {
    return fail(unknown_suffix(path, ErrorKind::kBadInput,
                               "one of .json .step .stp .iges .igs .brep .stl .vtp .vtu"));
  }
  switch (*format) {
    case Format::kNative:
      return as_any(read_model(path));
    case Format::kStep:
      return as_any(read_step(path, progress));
    case Format::kIges:
      return as_any(read_iges(path, progress));
    case Format::kBrep:
      return as_any(read_brep(path, progress));
    case Format::kStl:
      return as_any(read_stl(path));
    default:
      return as_any(read_vtk_mesh(path));
  }
}

Result<TriangleMesh> triangles_of(const AnyModel& model, const Progress& progress) {
  if (const auto* mesh = std::get_if<TriangleMesh>(&model)) return *mesh;
  if (const auto* solid = std::get_if<Solid>(&model)) return tessellate(*solid, {}, progress);
  auto made = tessellate(std::get<Model>(model).network, {}, progress);
  if (!made) return fail(made.error());
  return std::move(made->mesh);
}

}  // namespace angiospline
