// Centerline+radius files of every dialect, in; SWC and CSV, out.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "modeling/tree/point_graph.h"

namespace angiospline {

enum class CoordinateFrame {
  kLps,  // x to the left, y to the back, z to the head: ITK, DICOM, and the world of this library
  kRas,  // x to the right, y to the front, z to the head: NIfTI, VMTK
};

struct CenterlineFileOptions {
  // The length of the file's unit in mm; unset: what the file says, else its format's habit. What
  // was taken is said in CenterlineTree::assumptions.
  std::optional<double> unit_mm;

  // The column named radius holds diameters.
  bool radius_is_diameter = false;

  // The frame of the file's coordinates; unset: what the file says, else LPS.
  std::optional<CoordinateFrame> frame;

  // VascuSynth only: the width of a voxel in the unit of the radii; unset: VascuSynth's default.
  std::optional<double> voxel_width;
};

// The tree in a file; the suffix says the format: .swc .eswc; .csv .tsv .txt; .tree (the plain text
// definition); .vtp .vtk; .gxl .xml (VascuSynth); .ctgr .pth (SimVascular); .graphml; vertices.csv
// and edges.csv, either of which finds the other; a folder of such a pair or of one tree's
// SimVascular files. Errors name file, line, value and rule: missing, empty or truncated file, a
// value that is no finite number, a radius that is not positive, a parent that does not exist, a
// cycle of parents, an id used twice, no positive length; or say which option decides what the file
// leaves open. Memory O(size of the file), time O(n log n).
Result<CenterlineTree> read_centerline_file(const std::filesystem::path& path,
                                            const CenterlineFileOptions& options = {});

// The trees in a folder, in the order of their names: every file with a suffix from above that is
// not the other table of a pair; the folder itself where it holds one tree's SimVascular files; and
// folders in it that do. Errors: not a folder.
Result<std::vector<std::filesystem::path>> centerline_files_in(const std::filesystem::path& folder);

// Every file that reading `path` may open, sorted: itself, and those it may find beside it.
std::vector<std::filesystem::path> files_of_tree(const std::filesystem::path& path);

// One tree from several files: SimVascular's vessels. A single path is read as above.
Result<CenterlineTree> read_centerline_files(const std::vector<std::filesystem::path>& paths,
                                             const CenterlineFileOptions& options = {});

// A unit of length in mm: "m", "cm", "mm", "um" (or "micrometre" ...), "inch", or a number of them
// ("0.04mm"; a bare number is mm). Errors: anything else, or not positive.
Result<double> parse_unit_mm(std::string_view text);

// ---- for the readers of the single formats
// --------------------------------------------------------

// Coordinates and radii beyond this are refused: their squares must stay finite.
inline constexpr double kLargestFileCoordinate = 1e12;
inline constexpr double kSmallestFileRadius = 1e-12;

// What a file says of itself, for finish_tree.
struct FileFacts {
  double unit_mm = 1.0;
  std::string unit_name = "mm";  // as the assumption spells it
  bool unit_stated = false;      // the file itself says it
  bool has_diameters = false;    // the file itself calls the column a diameter
  std::optional<CoordinateFrame> frame;
  std::vector<std::string> notes;  // further assumptions of the reader
};

// From a graph in the file's own unit and frame to the tree in mm, LPS, with its assumptions
// listed.
Result<CenterlineTree> finish_tree(PointGraph graph, const FileFacts& facts, std::string_view name,
                                   const CenterlineFileOptions& options);

// A coordinate or a radius from a field of a line; the error names the place, the value and the
// rule.
Result<double> parse_coordinate(std::string_view field, std::string_view name, int line);
Result<double> parse_radius(std::string_view field, std::string_view name, int line);

}  // namespace angiospline
