// From an image to a CAD model in one call.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/export/export_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/model.h"
#include "pipeline/segment_file.h"
#include "pipeline/stopwatch.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/fit/fit_model.h"

namespace angiospline {

struct RecoverOptions {
  SegmentFileOptions image;
  VesselsOptions vessels;
  bool fit = true;        // the model to the image; otherwise its walls are the mask's
  FitOptions fitting;     // dark vessels are those of the segmentation's polarity
  ExportOptions writing;  // of recover_file
};

struct RecoveredModel {
  Model model;
  SegmentReport segment;
  Vessels vessels;
};

// The model of an image, nothing written. The mask is grown from the seeds; its skeleton becomes a
// tree; pieces of the mask without branches become closed surfaces (recovery/fit/closed_pieces.h).
// Where the model cannot be fitted to the image its walls are as the mask's radii have them, and a
// warning says why. `name` is the model's; errors name `source`, as does the tree. Errors: those of
// segment, vessels_from_mask and build_model; a mask that floods the image; stopped on request.
Result<RecoveredModel> recover_model(const AnyImage& image, const std::string& name,
                                     const std::string& source, const RecoverOptions& options = {},
                                     const Progress& progress = {});

struct RecoveredFile {
  Model model;
  SegmentReport segment;
  Vessels vessels;
  Certificate certificate;
  std::vector<std::string> files;  // as written
  StageSeconds seconds;
};

// The same from a file, which is read once, into a folder, which is made if its parent exists:
// mask.nrrd, skeleton.nrrd, centerlines.swc and .vtp, kept even where no model comes of them; then
// model.json .step .iges .glb .stl and report.html with its facts. A folder that this call made and
// left empty goes away again. Errors: also those of reading and writing.
Result<RecoveredFile> recover_file(const std::filesystem::path& image,
                                   const std::filesystem::path& folder,
                                   const RecoverOptions& options = {},
                                   const Progress& progress = {});

// What is wrong with a mask that floods its image, as a seed in noise or tissue makes one: it fills
// more than a fifth of it and has more than 100 loops, or fills nine tenths. Nothing for vessels,
// which fill a small part, and for capillaries, which have many loops but fill little. The error
// names `source`.
std::optional<Error> flooded(const Mask& mask, const std::string& source);

}  // namespace angiospline
