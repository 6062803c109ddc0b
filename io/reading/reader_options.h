// What a caller may say about a centerline file that the file itself leaves open.
#pragma once

#include <optional>
#include <string_view>

#include "base/result.h"

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

// A unit of length in mm: "m", "cm", "mm", "um" (or "micrometre" ...), "inch", or a number of them
// ("0.04mm"; a bare number is mm). Errors: anything else, or not positive.
Result<double> parse_unit_mm(std::string_view text);

}  // namespace angiospline
