// STEP files (ISO 10303-21) of solids with named and coloured faces.
#pragma once

#include <filesystem>
#include <string>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/solid/solid.h"

namespace angiospline {

enum class StepSchema { kAp214, kAp242 };

struct StepOptions {
  StepSchema schema = StepSchema::kAp242;
  std::string product = "vessel";  // name of the product in the file
};

// Writes the solid in millimetres, reads the file back, and only when the same faces, names, kinds
// and closed solids came out of it moves it to `path`. The same solid gives the same bytes: the
// time stamp is fixed. A solid that is moved in is let go as soon as its entities are made. Errors:
// kCannotWrite, naming what could not be written or what did not survive; stopped on request.
Result<void> write_step(Solid solid, const std::filesystem::path& path,
                        const StepOptions& options = {}, const Progress& progress = {});

// Any STEP file, by any program, in millimetres whatever its unit. Face names and colours are kept;
// faces without a name are called "face_<k>". Errors: kBadInput naming the file.
Result<Solid> read_step(const std::filesystem::path& path, const Progress& progress = {});

}  // namespace angiospline
