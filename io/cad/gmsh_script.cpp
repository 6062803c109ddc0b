#include "io/cad/gmsh_script.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "base/atomic_file.h"
#include "io/cad/rules.h"

namespace angiospline {
namespace {

// A string in Gmsh's language: quotes and backslashes would end it.
std::string quoted(std::string text) {
  for (char& c : text) {
    if (c == '"' || c == '\\' || static_cast<unsigned char>(c) < ' ') c = '_';
  }
  return '"' + text + '"';
}

}  // namespace

Result<void> write_gmsh_script(const Solid& solid, const std::filesystem::path& cad_file,
                               const std::filesystem::path& script) {
  std::vector<std::string> names;  // in the order in which they first appear
  std::map<std::string, std::vector<std::size_t>> tags;
  double smallest = 0.0;
  for (std::size_t k = 0; k < solid.faces.size(); ++k) {
    const SolidFace& face = solid.faces[k];
    if (!tags.contains(face.name)) names.push_back(face.name);
    tags[face.name].push_back(k + 1);
    if (face.radius_mm > 0 && (smallest == 0.0 || face.radius_mm < smallest)) {
      smallest = face.radius_mm;
    }
  }

  // The script finds the model from its own folder, wherever both are moved together.
  const std::filesystem::path model =
      cad_file.lexically_proximate(script.parent_path().empty() ? "." : script.parent_path());
  std::string text = fmt::format(
      "// Physical groups of {0}, by face name. Lengths are millimetres.\n"
      "// Mesh it: gmsh -3 {1}\n"
      "SetFactory(\"OpenCASCADE\");\n"
      "Merge {2};\n\n",
      model.filename().string(), script.filename().string(), quoted(model.generic_string()));

  for (std::size_t n = 0; n < names.size(); ++n) {
    text += fmt::format("Physical Surface({}, {}) = {{{}}};\n", quoted(names[n]), n + 1,
                        fmt::join(tags[names[n]], ", "));
  }
  text += fmt::format("Physical Volume(\"lumen\", {}) = Volume{{:}};\n\n", names.size() + 1);

  text += fmt::format(
      "// Twelve elements around a vessel; raise this number for a finer mesh.\n"
      "Mesh.MeshSizeFromCurvature = {};\n",
      kGmshElementsAround);
  if (smallest > 0) {
    text += fmt::format("Mesh.MeshSizeMin = {:.6g};\n",
                        2 * std::numbers::pi * smallest / kGmshMostElementsAround);
  }
  return write_file(script, text);
}

}  // namespace angiospline
