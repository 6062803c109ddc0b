// What a Solid hides: OpenCASCADE's shape. Only the few files that know OpenCASCADE include this.
#pragma once

#include <TopoDS_Shape.hxx>

#include "modeling/solid/solid.h"

namespace angiospline {

struct SolidShape {
  TopoDS_Shape shape;  // a solid, a compound of solids, or whatever a foreign file held
};

inline Solid make_solid_value(TopoDS_Shape shape, std::vector<SolidFace> faces) {
  return {std::make_shared<const SolidShape>(SolidShape{std::move(shape)}), std::move(faces)};
}

}  // namespace angiospline
