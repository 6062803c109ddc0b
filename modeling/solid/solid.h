// Closed boundary representations; OpenCASCADE stays behind this header.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

// A solid's geometry as OpenCASCADE holds it (a TopoDS_Shape, defined in
// modeling/solid/solid_shape.h, which only the few files that know OpenCASCADE include).
struct SolidShape;

// What a face is for, and its name and colour.
enum class FaceKind { kWall, kInlet, kOutlet, kCap };

struct SolidFace {
  std::string name;
  FaceKind kind = FaceKind::kWall;
  double radius_mm = 0.0;      // smallest vessel radius where known, otherwise 0
  Vec3 colour = Vec3::Zero();  // red, green, blue in [0, 1] (sRGB)
};

// "wall", "inlet", "outlet", "cap".
std::string_view to_string(FaceKind kind);

// The kind a name tells of: "inlet...", "outlet..." and "cap..." (any case), otherwise a wall.
FaceKind kind_of_name(std::string_view name);

// The kind of the cap that closes a rim.
FaceKind kind_of_rim(RimKind kind);

// Inlets red, outlets blue, caps grey; walls a soft hue that depends on the name alone.
Vec3 face_colour(FaceKind kind, std::string_view name);

// One or several closed solids (one a component) with named faces; copies share the shape.
struct Solid {
  std::shared_ptr<const SolidShape> shape;
  std::vector<SolidFace> faces;  // in the order in which the shape is explored
};

// One closed solid for each component: every join one shared edge, every rim closed by a plane cap.
// The faces stand in the order of the patches, then of the rims, component by component. Edges lie
// on parameter lines, so nothing is approximated: an edge's tolerance is the gap that was measured
// (and OpenCASCADE's smallest, 1e-7 mm). Nothing is sewn; O(size).
// Errors: the first defect of the network, naming patch, side or rim; a rim that is not plane;
// sides that are joined but not the same curve; a component that is inside out.
Result<Solid> make_solid(const SurfaceNetwork& network);

}  // namespace angiospline
