// Solid shapes to partial volumes: how much of each voxel a union of shapes fills.
#pragma once

#include <functional>
#include <vector>

#include "recovery/imaging/image/image.h"

namespace angiospline {

// A solid given by a function that is negative inside and whose slope is at most `steepness`
// (1 for a signed distance). All lengths in the grid's own frame: mm along its axes, voxel (0, 0,
// 0) centred at zero.
struct Shape {
  std::function<double(const Vec3& at_mm)> inside;
  Vec3 low_mm, high_mm;  // bounding box
  double steepness = 1.0;
};

// Ball of radius ra at a, swept to the ball of radius rb at b (exact distance). a == b: a ball.
Shape round_cone(const Vec3& a, double ra, const Vec3& b, double rb);

// Ring of radius R about `centre`, tube radius r, axis a unit vector (exact distance).
Shape torus(const Vec3& centre, const Vec3& axis, double ring_radius, double tube_radius);

// Right circular cylinder from a to b, flat ends (exact distance).
Shape flat_cylinder(const Vec3& a, const Vec3& b, double radius);

// Filled fraction of each voxel by the union of `shapes`, in steps of 1/64: the share of 4x4x4
// regular samples inside. Time: 64 evaluations a voxel on a boundary, one elsewhere in the bounding
// boxes; memory beyond the result: 8 bytes a voxel of eight slices.
Image<float> coverage(const ImageGrid& grid, const std::vector<Shape>& shapes);

}  // namespace angiospline
