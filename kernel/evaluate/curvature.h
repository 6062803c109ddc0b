// Normals, fundamental forms and curvatures at a point.
#pragma once

#include "base/vector.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// A surface to second order at one parameter pair.
struct SurfaceJet {
  Vec3 point;
  Vec3 u, v;        // first partials
  Vec3 uu, uv, vv;  // second partials
};
SurfaceJet surface_jet(const BSplineSurface<3>& surface, double u, double v);
SurfaceJet surface_jet(const BSplineSurface<4>& rational, double u, double v);

// With the unit normal n = Su x Sv / |Su x Sv|: I = (E F; F G), II = (L M; M N), L = Suu . n ...
// Where the partials are parallel to rounding, `regular` is false and all else is zero.
struct FundamentalForms {
  bool regular = false;
  Vec3 normal = Vec3::Zero();
  Eigen::Matrix2d first = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d second = Eigen::Matrix2d::Zero();
};
FundamentalForms fundamental_forms(const SurfaceJet& jet);

// Positive where the surface bends towards its normal; a sphere with outward normals has
// -1/r twice. Directions are unit tangent vectors, orthogonal; at an umbilic any such pair. Zero
// where the surface is not regular.
struct PrincipalCurvatures {
  double largest = 0.0;
  double smallest = 0.0;
  Vec3 largest_direction = Vec3::Zero();
  Vec3 smallest_direction = Vec3::Zero();

  double mean() const { return 0.5 * (largest + smallest); }
  double gauss() const { return largest * smallest; }
};
PrincipalCurvatures principal_curvatures(const SurfaceJet& jet);

// Curvature |c' x c''| / |c'|^3 (zero where c' is zero) and torsion (zero where curvature is).
double curvature(const BSplineCurve<3>& curve, double t);
double torsion(const BSplineCurve<3>& curve, double t);
double curvature(const BSplineCurve<4>& rational, double t);
double torsion(const BSplineCurve<4>& rational, double t);

}  // namespace angiospline
