// The tolerances of image files.
#pragma once

namespace angiospline::image_formats {

// Direction cosines may miss orthogonality by this much: files write them with four digits or more.
// What is further off is a sheared grid.
inline constexpr double kDirectionRounding = 1e-3;

// The distance of two slices may differ from the usual one by this fraction. Scanners round
// positions to a few micrometres; a tenth is far above that and far below a missing slice.
inline constexpr double kSliceDistanceSlack = 0.1;

// Slices may drift sideways by this part of the smallest spacing over a whole series. More is a
// tilted gantry, whose stack is sheared.
inline constexpr double kLargestDrift = 0.5;

// The sine of the angle between the axes of an X-ray detector is larger: axes less than a degree
// apart span no plane that anyone meant.
inline constexpr double kSmallestAxisSine = 0.01;

}  // namespace angiospline::image_formats
