#include "io/model_export.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <system_error>
#include <thread>

#include <tbb/global_control.h>

#include "io/brep_file.h"
#include "io/glb_file.h"
#include "io/gmsh_script.h"
#include "io/iges_file.h"
#include "io/model_file.h"
#include "io/report_html.h"
#include "io/side_process.h"
#include "io/stl_file.h"
#include "io/vtk_file.h"
#include "modeling/certificate.h"
#include "modeling/split_joins.h"
#include "modeling/tessellate_solid.h"
#include "modeling/turn_patches.h"

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

Result<void> write_solid(const Solid& solid, const std::string& name, const fs::path& path,
                         const ExportOptions& options, const Progress& progress) {
  switch (*format_of(path)) {
    case Format::kStep:
      return write_step(solid, path, {options.step_schema, name}, progress);
    case Format::kIges:
      return write_iges(solid, path, {name}, progress);
    default:
      return write_brep(solid, path, progress);
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

// Whether a second process has a processor to run on.
bool may_work_aside() {
  return std::thread::hardware_concurrency() > 1 &&
         tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism) > 1;
}

// The files of one model; solids and triangles are made when the first of them asks.
class ModelWriter {
 public:
  ModelWriter(const Model& model, const std::vector<fs::path>& paths, const ExportOptions& options,
              const Progress& progress)
      : model_(model), paths_(paths), options_(options), progress_(progress) {}

  Result<void> write(const fs::path& path) {
    const Format format = *format_of(path);
    if (needs_solid(format)) {
      const auto solid = solid_for(format);
      if (!solid) return fail(solid.error());
      return format == Format::kGmsh ? write_gmsh_script(**solid, *step_among(paths_), path)
                                     : write_solid(**solid, model_.name, path, options_, progress_);
    }
    if (format == Format::kNative) return write_model(path, model_);
    if (!mesh_) {
      auto made = tessellate(model_.network, options_.tessellation, progress_);
      if (!made) return fail(made.error());
      mesh_ = std::move(made->mesh);
    }
    return format == Format::kReport ? write_measured_report(path, model_, *mesh_, progress_)
                                     : write_triangles(*mesh_, model_.name, path);
  }

 private:
  Result<const Solid*> solid_for(Format format) {
    const bool short_edges = wants_short_edges(format);
    std::optional<Solid>& solid = solids_[short_edges ? 1 : 0];
    if (!solid) {
      SurfaceNetwork turned = turn_long_patches(model_.network);
      auto made = make_solid(short_edges ? split_joins(std::move(turned), options_.edges)
                                         : std::move(turned));
      if (!made) return fail(made.error());
      solid = std::move(*made);
    }
    return &*solid;
  }

  const Model& model_;
  const std::vector<fs::path> paths_;
  const ExportOptions& options_;
  const Progress& progress_;
  std::array<std::optional<Solid>, 2> solids_;  // with the network's own edges; with short ones
  std::optional<TriangleMesh> mesh_;
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

Result<void> export_model(const Model& model, const std::vector<fs::path>& paths,
                          const ExportOptions& options, const Progress& progress,
                          const std::function<void()>& meanwhile) {
  for (const fs::path& path : paths) {
    if (auto target = check_export_target(path); !target) return target;
    if (*format_of(path) == Format::kGmsh && !step_among(paths)) {
      return fail({ErrorKind::kBadInput,
                   "no STEP file for the script",
                   path.string(),
                   {},
                   "a .geo script loads a .step that is written with it"});
    }
  }
  const std::optional<fs::path> step = step_among(paths);
  const bool aside =
      options.step_in_side_process && step && (paths.size() > 1 || meanwhile) && may_work_aside();
  const SideProcess::Work write_step_file = [&](const Progress& its_own) {
    return ModelWriter(model, {*step}, options, its_own).write(*step);
  };
  std::optional<SideProcess> copy = aside ? SideProcess::start(write_step_file) : std::nullopt;
  ModelWriter writer(model, paths, options, progress);
  for (std::size_t i = 0; i < paths.size(); ++i) {
    progress.at("writing " + paths[i].filename().string(),
                static_cast<double>(i) / static_cast<double>(paths.size()));
    if (progress.should_stop()) return fail(cancelled("writing"));
    if (copy && paths[i] == *step) continue;
    if (auto written = writer.write(paths[i]); !written) return written;
  }
  if (meanwhile) meanwhile();
  return copy ? copy->wait(progress) : Result<void>();
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
