// What a polydata file of VTK says of points and lines; for vtk_centerline.
#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/result.h"

namespace angiospline {

struct VtkPolylines {
  std::vector<double> points;      // x, y, z of each
  std::vector<long long> offsets;  // of each line: one past its last index
  std::vector<long long> indices;  // of points
  std::vector<std::pair<std::string, std::vector<double>>>
      scalars;         // of the points, one component each
  std::string header;  // title and comments
};

// XML polydata (.vtp) and legacy polydata (.vtk). Memory is bounded by a multiple of the file's
// size (zlib's largest ratio, where data are compressed). Errors name file, line or array, value
// and rule.
//
// VTK's own readers are not used here: they ask for memory by what a file claims (82 bytes that
// claim four billion points make vtkPolyDataReader of VTK 9.1 ask for 48 GB, and its error code
// then says that all is well), they write what is wrong to the error stream, and they name neither
// line nor value.
Result<VtkPolylines> parse_vtp(std::string_view bytes, std::string_view name);
Result<VtkPolylines> parse_legacy_vtk(std::string_view bytes, std::string_view name);

}  // namespace angiospline
