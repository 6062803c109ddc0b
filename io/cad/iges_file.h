// IGES files (5.3) of solids with named and coloured faces.
#pragma once

#include <filesystem>
#include <string>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/solid/solid.h"

namespace angiospline {

struct IgesOptions {
  std::string product = "vessel";
};

// Writes the solid in millimetres as manifold solids (entity 186), reads the file back, and only
// when the same faces, names, kinds and closed solids came out of it moves it to `path`. The same
// solid gives the same bytes. A solid that is moved in is let go before that. Errors: kCannotWrite;
// stopped on request.
Result<void> write_iges(Solid solid, const std::filesystem::path& path,
                        const IgesOptions& options = {}, const Progress& progress = {});

// Any IGES file, by any program, in millimetres whatever its unit; loose faces stay loose. Faces
// without a name are called "face_<k>". Errors: kBadInput naming the file.
Result<Solid> read_iges(const std::filesystem::path& path, const Progress& progress = {});

}  // namespace angiospline
