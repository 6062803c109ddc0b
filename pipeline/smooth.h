// A native model file made tangent-plane continuous again, in one call.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/export/export_model.h"
#include "modeling/check/certificate.h"
#include "modeling/continuity/smooth_network.h"
#include "modeling/network/model.h"
#include "pipeline/stopwatch.h"

namespace angiospline {

struct SmoothFileOptions {
  SmoothNetworkOptions smooth;
  ExportOptions writing;
};

struct SmoothedFile {
  Model model;  // parts that were refused are named in its warnings
  Certificate certificate;
  std::vector<SmoothedPart> parts;
  double before_deg = 0.0;  // largest angle between normals at any join
  double after_deg = 0.0;
  std::vector<std::string> files;
  StageSeconds seconds;
};

// Smooths the network of a native model (modeling/continuity/smooth_network.h), writes the model to
// every output by its suffix, and measures it. Outputs are checked first. Errors: a file that is
// not a native model; those of reading, smoothing, writing and measuring.
Result<SmoothedFile> smooth_file(const std::filesystem::path& model,
                                 const std::vector<std::filesystem::path>& outputs,
                                 const SmoothFileOptions& options = {},
                                 const Progress& progress = {});

}  // namespace angiospline
