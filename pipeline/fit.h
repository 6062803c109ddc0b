// From a model or a mask, and an image, to the files of a fitted model in one call.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/export/export_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/model.h"
#include "pipeline/stopwatch.h"
#include "recovery/analysis/compare_masks.h"
#include "recovery/fit/figures.h"
#include "recovery/fit/fit_model.h"
#include "recovery/thesis/deform/deform_model.h"

namespace angiospline {

struct FitFileOptions {
  FitOptions fit;
  // Set: the thesis's way instead, by edges that pull a mesh; `fit` is not looked at.
  std::optional<DeformModelOptions> deform;
  std::filesystem::path truth;     // a mask on the image's grid to measure the result by; or empty
  std::filesystem::path residual;  // .glb or .vtp of what is left as colours; or empty
  ExportOptions writing;
};

// What the default fit has to say.
struct WallFit {
  FitReport report;
  double mean_residual_mm = 0.0;  // that the image still asks for
};

// What the thesis's way has to say.
struct EdgeFit {
  DeformModelOptions options;
  DeformReport report;
  int nodes = 0;
  int edges = 0;
  Eigen::Index control_points = 0;
  double coarsening_mm = 0.0;
  double angle_before_deg = 0.0;
  double angle_after_deg = 0.0;
};

struct FittedFile {
  Model model;
  Certificate certificate;
  std::optional<WallFit> wall;     // one of the two
  std::optional<EdgeFit> edges;    // is set
  std::vector<PartFigures> parts;  // the last one: all. Residuals in mm, or for edges in the
                                   // potential's unit
  bool converged = false;
  int iterations = 0;
  std::vector<std::string> unconverged;  // parts that were held, or near which there is no wall
  std::optional<MaskComparison> truth;
  std::vector<std::string> files;
  StageSeconds seconds;
};

// Whether the part of this name came to rest.
bool converged_part(const FittedFile& fitted, const std::string& name);

// Fits what `start` holds to the image: a native model (.json), or a mask, of which each piece
// becomes a closed surface (recovery/fit/closed_surface.h). Writes the result to every output, and
// measures it. Targets, and the grid of the truth, are checked before anything long begins. It
// converged if the image asks for less than a tenth of a voxel in the mean and no part was held or
// without a wall; by edges: if it came to rest. Errors: those of reading, fitting, writing and
// measuring; a truth on another grid.
Result<FittedFile> fit_file(const std::filesystem::path& start, const std::filesystem::path& image,
                            const std::vector<std::filesystem::path>& outputs,
                            const FitFileOptions& options = {}, const Progress& progress = {});

}  // namespace angiospline
