// B-splines to and from OpenCASCADE, exactly: same knots, same control points, periodic as closed.
// Only the few files that know OpenCASCADE include this header.
#pragma once

#include <optional>

#include <Geom_BSplineCurve.hxx>
#include <Geom_BSplineSurface.hxx>

#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The same curve or surface, ends clamped or floating as they are; closed ones and closed
// directions (kernel/refine/periodic.h) are periodic. A period with fewer than degree + 1 poles is
// cut finer first, since OpenCASCADE reads one period only. Requires positive degrees up to 25
// (OpenCASCADE's largest) and multiplicities up to the degree inside and at a seam.
Handle(Geom_BSplineCurve) to_occt(const BSplineCurve<3>& curve);
Handle(Geom_BSplineSurface) to_occt(const BSplineSurface<3>& surface);

// The same from homogeneous control points (w x, w y, w z, w). Requires positive weights. Equal
// weights make a polynomial curve or surface: OpenCASCADE drops them.
Handle(Geom_BSplineCurve) rational_to_occt(const BSplineCurve<4>& curve);
Handle(Geom_BSplineSurface) rational_to_occt(const BSplineSurface<4>& surface);

// The same curve or surface, if it is polynomial; nothing otherwise. Periodic ones come back
// closed: is_periodic, is_periodic_u, is_periodic_v.
std::optional<BSplineCurve<3>> from_occt(const Geom_BSplineCurve& curve);
std::optional<BSplineSurface<3>> from_occt(const Geom_BSplineSurface& surface);

// The same whatever it is: homogeneous, weights 1 where it is polynomial; closed where periodic.
// Poles times weights are rounded once, knots not at all.
BSplineCurve<4> homogeneous_from_occt(const Geom_BSplineCurve& curve);
BSplineSurface<4> homogeneous_from_occt(const Geom_BSplineSurface& surface);

}  // namespace angiospline
