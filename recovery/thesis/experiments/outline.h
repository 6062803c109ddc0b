// A closed outline in a slice as a mask.
#pragma once

#include "recovery/imaging/image/image.h"

namespace angiospline {

// 1 where a pixel's centre is inside the outline (points in order, closed), by the number of its
// sides between the pixel and the border along its row (odd: inside); centres on the outline fall
// to either side. Requires a grid of one slice. O(sides * rows they cover + pixels).
Mask mask_inside(const Points3& outline_mm, const ImageGrid& grid);

}  // namespace angiospline
