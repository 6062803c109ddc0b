// Closed boundary representations; OpenCASCADE stays behind this header.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "base/result.h"
#include "modeling/surface_network.h"

namespace angiospline {

// A solid's geometry as OpenCASCADE holds it (a TopoDS_Shape, defined in modeling/solid_shape.h,
// which only the few files that know OpenCASCADE include).
struct SolidShape;

// What a face is for, and its name and colour.
enum class FaceKind { kWall, kInlet, kOutlet, kCap };

struct SolidFace {
  std::string name;
  FaceKind kind = FaceKind::kWall;
  double radius_mm = 0.0;  // smallest vessel radius where known, otherwise 0
};

// One or several closed solids (one a component) with named faces; copies share the shape.
struct Solid {
  std::shared_ptr<const SolidShape> shape;
  std::vector<SolidFace> faces;  // in the order in which the shape is explored
};

// One closed solid for each component: every join one shared edge, every rim closed by a plane cap.
// Edges lie on parameter lines, so nothing is approximated. Errors: the first defect of the network,
// or what OpenCASCADE refused, naming the face.
Result<Solid> make_solid(const SurfaceNetwork& network);

}  // namespace angiospline
