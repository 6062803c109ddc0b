// Small networks made by hand, for tests of what reads, writes, meshes and measures networks.
#pragma once

#include "modeling/network/model.h"
#include "modeling/network/surface_network.h"

namespace angiospline::samples {

// A straight tube about z from 0 to `length_mm`, two half patches with `rows` control rows; regions
// "wall_a"; rims "inlet" at z = 0 and "outlet_end".
SurfaceNetwork tube(double radius_mm = 1.0, double length_mm = 5.0, int rows = 8);

// The same with one half of its upper part split in two: its join lies on T-vertices and its
// dependent control points are listed. Regions "wall_a" and "wall_b".
SurfaceNetwork tube_with_t_vertex(double radius_mm = 1.0, double length_mm = 5.0);

// A closed ring about z of four patches; no rims, genus 1.
SurfaceNetwork torus(double ring_radius_mm = 3.0, double tube_radius_mm = 1.0);

// A bent, tapering, twisted tube: `tube` with its control points moved.
SurfaceNetwork bent_tube();

// A model about `network` with a tree, assumptions, warnings and a failed part.
Model model_of(SurfaceNetwork network);

// Volume inside a network without rims or with plane ones, and the area of its wall, by
// Gauss-Legendre quadrature; the volume is exact for patches of degree 5.
double exact_volume_mm3(const SurfaceNetwork& network);
double wall_area_mm2(const SurfaceNetwork& network);

}  // namespace angiospline::samples
