// Where the wall lies along a normal: grey values summed along it, with no threshold and no edge.
#pragma once

#include "recovery/imaging/image/image.h"

namespace angiospline {

// Grey values between voxel centres, in the world's millimetres: cubic convolution (Keys 1981),
// which reproduces quadratics and so neither widens an edge nor moves one on a curved wall. The
// image must outlive it. Safe to ask from several threads.
class GreyField {
 public:
  // Requires at least two voxels along each axis.
  explicit GreyField(const Image<float>& image);

  // Whether p lies between voxel centres, or at most half a voxel beyond the outermost.
  bool covers(const Vec3& p_mm) const;

  // Beyond the outermost voxels their values are held.
  double at(const Vec3& p_mm) const;

  // Edge of the cube of a voxel's volume.
  double voxel_mm() const { return voxel_mm_; }

  // How wide a voxel is along the unit vector n, as its blur has it: sqrt(sum (n_i spacing_i)^2).
  double width_mm(const Vec3& n) const;

  const Image<float>& image() const { return image_; }

 private:
  const Image<float>& image_;
  Mat3 to_index_;
  Vec3 shift_;
  double voxel_mm_;
};

// A place on a surface to second order. Curvatures are positive where the surface is convex: a
// sphere of radius R has 1 / R twice.
struct WallPoint {
  Vec3 point_mm = Vec3::Zero();
  Vec3 normal = Vec3::Zero();  // unit, out of the vessel
  double largest_curvature = 0.0;
  double smallest_curvature = 0.0;
};

// The place that lies `offset_mm` farther out along the normal, on the parallel surface. Curvatures
// grow to five times what they were at most.
WallPoint parallel_point(const WallPoint& at, double offset_mm);

// Grey values of the vessel and of what lies around it, near one place.
struct WallLevels {
  double inside = 1.0;
  double outside = 0.0;

  double contrast() const { return inside - outside; }
};

struct ProfileOptions {
  double half_window_vox = 1.0;  // of the sum, in widths of a voxel along the normal
  double noise = 0.0;            // standard deviation of the grey values, for the gates
};

// What the sum says.
struct WallOffset {
  double offset_mm = 0.0;  // of the wall from the point along its normal; positive: the wall is
                           // farther out; at most twice the half window
  double window_mm = 0.0;  // length of the sum: its variance is noise^2 window voxel_area
  bool measured = false;   // false: the window leaves the image, or there is no contrast
};

// The offset d for which as much bright stuff lies along the normal as the image has there,
//   int_-h^h f(s) w(s) ds = int_-h^d w(s) ds,   w(s) = (1 + k1 s) (1 + k2 s),
// f = (grey - outside) / (inside - outside), used as it is: no clipping, no threshold. w is how a
// strip of the surface grows along its normals, so that a blur, which keeps the sum of grey values,
// does not move a curved wall. Where f rises again on the way out (another vessel) or falls again
// on the way in, by more than a quarter and more than four standard deviations of the noise, the
// profile is held from there on. Where a wall is more curved than the window is long the window is
// shortened on the side of the centre. Simpson's rule, 16 steps.
WallOffset wall_offset(const GreyField& field, const WallPoint& at, const WallLevels& levels,
                       const ProfileOptions& options = {});

// Mean grey value on either side of the wall, 1.6 to 3.6 voxel widths away from it; a weight of
// zero: there is no room (the vessel is too thin, or the image ends, or, outside, grey rises by
// more than `gate` above its least value on the way).
struct WallSides {
  double inside = 0.0;
  double inside_weight = 0.0;
  double outside = 0.0;
  double outside_weight = 0.0;
};
WallSides wall_sides(const GreyField& field, const WallPoint& at, double gate);

}  // namespace angiospline
