// The colours of pictures: of parts, and of numbers by size. sRGB, each channel in [0, 1].
#pragma once

#include <string>

#include "base/vector.h"
#include "kernel/geometry/triangle_mesh.h"

namespace angiospline {

// The colour of a part, the same as its face's in the CAD files (modeling/solid/solid.h): inlets
// red, outlets blue, other caps grey, and for walls a soft hue that depends on the name alone.
Vec3 part_colour(const MeshPart& part);

// A colour for t in [0, 1] (clamped) on a scale that is read right in grey and by the colour-blind:
// sequential is viridis; diverging runs from blue over near white at 0.5 to red. NaN is grey.
Vec3 sequential_colour(double t);
Vec3 diverging_colour(double t);

// The smallest and largest finite values of a field; where both signs occur the range is made
// symmetric about 0 and the scale is diverging. An empty field gives [0, 1].
struct ColourScale {
  double low = 0.0;
  double high = 1.0;
  bool diverging = false;

  Vec3 colour(double value) const;
};
ColourScale scale_of(const MeshField& field);

// Channel by channel, for glTF, which wants linear light.
Vec3 linear_from_srgb(const Vec3& srgb);

std::string css(const Vec3& srgb);  // "#rrggbb"

}  // namespace angiospline
