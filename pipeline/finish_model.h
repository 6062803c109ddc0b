// From a model to its files and its certificate: how building, recovering, fitting and smoothing
// end.
#pragma once

#include <filesystem>
#include <functional>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "io/export/export_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/model.h"
#include "pipeline/stopwatch.h"

namespace angiospline {

struct FinishedModel {
  Model model;  // its warnings and those about the files
  Certificate certificate;
};

// Nothing wrong with any of the targets, or the error of the first that has something. For verbs to
// ask before work that may take long.
Result<void> check_targets(const std::vector<std::filesystem::path>& paths);

// Writes the model to all paths (io/export/export_model.h) and measures it as a solid. `meanwhile`
// is called with it on this thread, once the other files are written, while a STEP file may still
// be under way in a process of its own. Adds to the watch: "write", "check", what `meanwhile` adds,
// and "wait for files". Errors: those of writing, of make_solid and of certify. A file that was
// written before the error stays.
Result<FinishedModel> finish_model(Model model, const std::vector<std::filesystem::path>& paths,
                                   const ExportOptions& options, const Progress& progress,
                                   Stopwatch& watch,
                                   const std::function<void(const Model&)>& meanwhile = {});

// Closed, valid and free of self-intersection.
bool is_sound(const Certificate& certificate);

}  // namespace angiospline
