// One model, many files: the suffix of each says its format.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "base/warning.h"
#include "io/cad/split_joins.h"
#include "io/cad/step_file.h"
#include "modeling/network/model.h"
#include "modeling/network/tessellation.h"
#include "modeling/solid/solid.h"

namespace angiospline {

struct ExportOptions {
  StepSchema step_schema = StepSchema::kAp242;
  // Of GLB, STL, VTP and VTU. The defaults are coarsened where a model is very large; a tolerance
  // that is set here is kept or refused.
  TessellationOptions tessellation{.coarsen = true};
  SplitOptions edges;  // of STEP and BREP, so that Gmsh meshes them as they are
  // Lets a copy of this process (fork) write the STEP file beside the others. For programs whose
  // only threads are ours: what another thread has locked stays locked in the copy. Very large
  // models are written one file after the other all the same, for the memory of one.
  bool step_in_side_process = false;
};

// What a reader of the files should know, beyond the model's own warnings.
struct ExportReport {
  std::vector<Warning> warnings;
};

// The suffixes that export_model writes, for messages: ".json .step ...".
std::string exported_suffixes();

// Nothing wrong with the target's suffix and folder, or the error that export_model would end with.
Result<void> check_export_target(const std::filesystem::path& path);

// The report of files written. Writes the model to every path: .json (native), .step .stp, .iges
// .igs, .brep, .glb, .stl, .vtp, .vtu, .html (the report, with its facts beside it), .geo (a Gmsh
// script that loads the .step among the paths and names its faces). Solids and triangles are made
// once, only if a path needs them, and let go after the last that does. Each file appears whole or
// not at all; targets are checked before the first is written. OpenCASCADE writes one file at a
// time in one process: where the options allow it, there is more to do than the STEP file and more
// than one thread is allowed, that is written by a copy of this process; `meanwhile` is called once
// in any case, and on this thread. Errors: those of the writers.
Result<ExportReport> export_model(const Model& model,
                                  const std::vector<std::filesystem::path>& paths,
                                  const ExportOptions& options = {}, const Progress& progress = {},
                                  const std::function<void()>& meanwhile = {});

// The same for a solid from any source, to every format but the native one.
Result<void> export_solid(const Solid& solid, const std::string& name,
                          const std::vector<std::filesystem::path>& paths,
                          const ExportOptions& options = {}, const Progress& progress = {});

// The same for triangles: .glb .stl .vtp .vtu.
Result<void> export_mesh(const TriangleMesh& mesh, const std::string& name,
                         const std::vector<std::filesystem::path>& paths);

// What a model file holds: the native file a Model; STEP, IGES and BREP a Solid; STL, VTP and VTU a
// mesh. Errors: an unknown suffix; those of the readers.
using AnyModel = std::variant<Model, Solid, TriangleMesh>;
Result<AnyModel> read_any_model(const std::filesystem::path& path, const Progress& progress = {});

// Its surface as triangles, whatever it is.
Result<TriangleMesh> triangles_of(const AnyModel& model, const Progress& progress = {});

}  // namespace angiospline
