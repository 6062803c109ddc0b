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

// The same curve or surface whatever it is: homogeneous (w x, w y, w z, w), weights 1 where it is
// polynomial, clamped over its domain where it is periodic. Exact to rounding; degrees up to 25.
BSplineCurve<4> homogeneous_from_occt(const Geom_BSplineCurve& curve);
BSplineSurface<4> homogeneous_from_occt(const Geom_BSplineSurface& surface);

// Rational ones from homogeneous control points. Requires positive weights, clamped knots.
Handle(Geom_BSplineCurve) rational_to_occt(const BSplineCurve<4>& curve);
Handle(Geom_BSplineSurface) rational_to_occt(const BSplineSurface<4>& surface);

// The closed curve as a periodic one: its distinct control points and one period of knots. Requires
// is_periodic(curve) and floating knots.
Handle(Geom_BSplineCurve) periodic_to_occt(const BSplineCurve<3>& curve);

}  // namespace angiospline
