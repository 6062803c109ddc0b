// A Gmsh script beside a STEP file: what Gmsh drops when it reads STEP.
#pragma once

#include <filesystem>

#include "base/result.h"
#include "modeling/solid/solid.h"

namespace angiospline {

// Writes a .geo script that merges `cad_file` (named relative to the script), gives each face name
// a physical surface and all solids together the physical volume "lumen", and asks for elements
// that follow the curvature of the vessels. Gmsh 4 numbers faces in the order of the CLOSED_SHELL
// list, which is the order of Solid::faces. `gmsh -3 model.geo` meshes the model, and its MSH file
// carries the names. Errors: kCannotWrite.
Result<void> write_gmsh_script(const Solid& solid, const std::filesystem::path& cad_file,
                               const std::filesystem::path& script);

}  // namespace angiospline
