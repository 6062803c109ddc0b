// B-splines to and from OpenCASCADE, exactly: same knots, same control points.
// Only the few files that know OpenCASCADE include this header.
#pragma once

#include <optional>

#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>

#include "kernel/curve.h"
#include "kernel/surface.h"

namespace angiospline {

// The same curve or surface. Requires clamped knots, positive degrees up to 25 (OpenCASCADE's
// largest) and interior multiplicities up to the degree.
Handle(Geom_BSplineCurve) to_occt(const BSplineCurve<3>& curve);
Handle(Geom_BSplineSurface) to_occt(const BSplineSurface<3>& surface);

// The same curve or surface, if it is polynomial and not periodic; nothing otherwise.
std::optional<BSplineCurve<3>> from_occt(const Geom_BSplineCurve& curve);
std::optional<BSplineSurface<3>> from_occt(const Geom_BSplineSurface& surface);

}  // namespace angiospline
