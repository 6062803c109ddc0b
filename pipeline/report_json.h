// The reports of the pipeline's verbs as JSON text: the figures that scripts rely on.
#pragma once

#include <optional>
#include <string>

#include "modeling/check/certificate.h"
#include "modeling/check/fidelity.h"
#include "pipeline/batch.h"
#include "pipeline/build.h"
#include "pipeline/fit.h"
#include "pipeline/graph.h"
#include "pipeline/recover.h"
#include "pipeline/segment_file.h"
#include "pipeline/smooth.h"

namespace angiospline {

// One object over several lines, without a line feed at the end. Numbers have as many digits as it
// takes to read the same ones back; those that are no numbers are null. Keys keep their order.
std::string json_text(const RecoveredFile& recovered);
std::string json_text(const BuiltFile& built);
std::string json_text(const BatchReport& batch);
std::string json_text(const FittedFile& fitted);
std::string json_text(const SmoothedFile& smoothed);
std::string json_text(const WrittenMask& written);
std::string json_text(const WrittenMultimodalMask& written);
std::string json_text(const ThinnedFile& thinned);
std::string json_text(const GraphedFile& graphed);
std::string json_text(const Certificate& certificate, const std::optional<Fidelity>& fidelity);

}  // namespace angiospline
