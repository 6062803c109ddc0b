// What is said of a model at the end of a command, and the exit code.
#pragma once

#include <string>
#include <vector>

#include "cli/console.h"
#include "modeling/check/certificate.h"
#include "modeling/network/model.h"

namespace angiospline::cli {

// Notes, warnings, failed parts and one line of summary on stderr. Exit code 0 only if nothing
// failed and the solid is closed, valid and free of self-intersection. `targets` ends the summary:
// where the results are.
int tell_outcome(const Model& model, const Certificate& certificate,
                 const std::vector<std::string>& targets, const Console& console);

}  // namespace angiospline::cli
