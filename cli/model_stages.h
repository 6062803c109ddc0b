// From a model to its files, its certificate and its exit code: the end of seed and recover.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/stages.h"
#include "io/centerlines/centerline_file.h"
#include "io/export/export_model.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"

namespace angiospline::cli {

Result<CenterlineFileOptions> centerline_options(const CenterlineArguments& arguments);

StepSchema step_schema(const std::string& name);

// Writes the files and measures the model as a solid. `meanwhile` is called, once the other files
// are written, while a STEP file may still be under way in a process of its own.
struct FinishedModel {
  Certificate certificate;
  ExportReport report;
};
Result<FinishedModel> finish_model(const Model& model,
                                   const std::vector<std::filesystem::path>& paths,
                                   const std::string& schema, const Console& console,
                                   Stopwatch& watch, const std::function<void()>& meanwhile = {});

// What is said of the files stands with what is said of the model.
void append_warnings(Model& model, const ExportReport& report);

// Warnings, failed parts and one line of summary on stderr. Exit code 0 only if nothing failed and
// the solid is closed, valid and free of self-intersection.
int tell_outcome(const Model& model, const Certificate& certificate,
                 const std::vector<std::string>& files, const Console& console);

}  // namespace angiospline::cli
