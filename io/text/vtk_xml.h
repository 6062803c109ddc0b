// The one way in which we write VTK's XML files.
#pragma once

#include <filesystem>

#include "base/result.h"

class vtkXMLWriter;

namespace angiospline {

// Writes what the writer's input is: appended raw data with 64-bit headers, compressed by zlib. The
// file appears whole or not at all. Errors: VTK could not write the data; those of writing.
Result<void> write_vtk_xml(const std::filesystem::path& path, vtkXMLWriter& writer);

}  // namespace angiospline
