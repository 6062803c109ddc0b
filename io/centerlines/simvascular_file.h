// SimVascular's paths (.pth) and contour groups (.ctgr): XML with two root elements, in
// centimetres.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// One cross-section: its place on the path, its centroid, and the radius of the circle of its area.
struct SimVascularContour {
  int path_point = -1;  // index in the path, -1 if the file does not say
  Vec3 on_path = Vec3::Zero();
  Vec3 center = Vec3::Zero();
  double radius = 0.0;
};

struct SimVascularGroup {
  std::string name;
  std::vector<SimVascularContour> contours;  // at least two, in the order of the path
};

// The first time step of a contour group, in the file's unit. Errors: less than two contours, a
// contour of less than three points or without area, malformed XML; each names file and line.
Result<SimVascularGroup> parse_ctgr(std::string_view text, std::string_view name);

// The points of a path, in the file's unit.
Result<std::vector<Vec3>> parse_pth(std::string_view text, std::string_view name);

// One tree from one or several vessels. A .pth gives its vessel's points between the contours and
// needs the .ctgr of the same name (in the list or beside it) for the radii: without it, an error.
// A vessel that begins or ends inside another's lumen is joined to it.
Result<CenterlineTree> read_simvascular(const std::vector<std::filesystem::path>& paths,
                                        const CenterlineFileOptions& options = {});

}  // namespace angiospline
