// From centerline files to the files of a CAD model in one call.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/centerlines/centerline_file.h"
#include "io/export/export_model.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/check/fidelity.h"
#include "modeling/network/model.h"
#include "pipeline/stopwatch.h"

namespace angiospline {

struct BuildFileOptions {
  CenterlineFileOptions reading;
  BuildOptions build;
  ExportOptions writing;
  std::string name;  // of the product; empty: the stem of the first file
  int threads = 0;   // processors used at a time; 0: all
};

struct BuiltFile {
  Model model;
  Certificate certificate;
  Fidelity fidelity;  // to the smoothed tree that the model was made of
  std::vector<std::string> files;
  StageSeconds seconds;
};

// Reads one tree from one file or several (SimVascular's vessels), smooths it, builds its model,
// writes that to every output by its suffix and measures it. Outputs are checked before anything is
// read. Errors: those of reading, building, writing and measuring. Requires a tree.
Result<BuiltFile> build_file(const std::vector<std::filesystem::path>& tree,
                             const std::vector<std::filesystem::path>& outputs,
                             const BuildFileOptions& options = {}, const Progress& progress = {});

}  // namespace angiospline
