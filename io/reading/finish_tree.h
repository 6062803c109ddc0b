// The last step of every reader of centerlines: from points in a file's own unit and frame to a
// tree in mm, LPS; and the rules that all numbers in such files obey.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"
#include "modeling/tree/point_graph.h"

namespace angiospline {

// Coordinates and radii beyond this are refused: their squares must stay finite.
inline constexpr double kLargestFileCoordinate = 1e12;
inline constexpr double kSmallestFileRadius = 1e-12;

// What a file says of itself.
struct FileFacts {
  double unit_mm = 1.0;
  std::string unit_name = "mm";  // as the assumption spells it
  bool unit_stated = false;      // the file itself says it
  bool has_diameters = false;    // the file itself calls the column a diameter
  std::optional<CoordinateFrame> frame;
  std::vector<std::string> notes;  // further assumptions of the reader

  // The file itself says that its unit is `name`, which is `mm` long.
  void state_unit(double mm, std::string_view name);
};

// From a graph in the file's own unit and frame to the tree in mm, LPS, with its assumptions
// listed: unit, radii or diameters, frame, the reader's notes, and what tree_from_points assumed.
// What the caller gave is stronger than what the file says. Errors: a length that leaves the range
// of numbers; those of tree_from_points, naming the file. O(n log n).
Result<CenterlineTree> finish_tree(PointGraph graph, const FileFacts& facts, std::string_view name,
                                   const CenterlineFileOptions& options);

// A coordinate or a radius from a field of a line; the error names the place, the value and the
// rule.
Result<double> parse_coordinate(std::string_view field, std::string_view name, int line);
Result<double> parse_radius(std::string_view field, std::string_view name, int line);

// A position whose coordinate k is the text field(k), k = 0, 1, 2; the first bad one is the error.
template <typename FieldOf>
Result<Vec3> parse_position(const FieldOf& field, std::string_view name, int line) {
  Vec3 position;
  for (int k = 0; k < 3; ++k) {
    const Result<double> x = parse_coordinate(field(k), name, line);
    if (!x) return fail(x.error());
    position(k) = *x;
  }
  return position;
}

}  // namespace angiospline
