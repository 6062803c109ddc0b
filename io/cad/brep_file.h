// OpenCASCADE's own text format (.brep), in millimetres.
#pragma once

#include <filesystem>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/solid/solid.h"

namespace angiospline {

// The format knows no names: they follow the shape as lines that other readers do not look at.
// Read back and compared before it is moved to `path`; a solid that is moved in is let go before
// that. Errors: kCannotWrite.
Result<void> write_brep(Solid solid, const std::filesystem::path& path,
                        const Progress& progress = {});

// Any .brep file; faces without a name are called "face_<k>". Errors: kBadInput naming the file.
Result<Solid> read_brep(const std::filesystem::path& path, const Progress& progress = {});

}  // namespace angiospline
