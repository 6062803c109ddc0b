// Options that several subcommands share.
#pragma once

#include <filesystem>
#include <vector>

#include "cli/command_line.h"
#include "io/export/export_model.h"
#include "pipeline/segment_file.h"
#include "recovery/centerlines/vessels_from_mask.h"

namespace angiospline::cli {

// IMAGE and how it is segmented.
void add_segment_options(const Command& command, std::filesystem::path& image,
                         SegmentFileOptions& options);

// --root and --cut-contacts.
void add_vessel_options(const Command& command, VesselsOptions& options);

// --step-schema. Files are written as a program does that has no threads but ours.
void add_writing_options(const Command& command, ExportOptions& options);

Option add_refinements_option(const Command& command, int& refinements);

void add_json_flag(const Command& command, bool& json);

}  // namespace angiospline::cli
