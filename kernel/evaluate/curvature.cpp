#include "kernel/evaluate/curvature.h"

#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "kernel/evaluate/rational.h"

namespace angiospline {

SurfaceJet surface_jet(const BSplineSurface<3>& s, double u, double v) {
  return {s.at(u, v),       s.at(u, v, 1, 0), s.at(u, v, 0, 1),
          s.at(u, v, 2, 0), s.at(u, v, 1, 1), s.at(u, v, 0, 2)};
}

SurfaceJet surface_jet(const BSplineSurface<4>& rational, double u, double v) {
  const Eigen::Matrix3Xd S = rational_derivatives<3>(rational, u, v, 2);
  return {S.col(0), S.col(1), S.col(2), S.col(3), S.col(4), S.col(5)};
}

FundamentalForms fundamental_forms(const SurfaceJet& jet) {
  FundamentalForms forms;
  const Vec3 cross = jet.u.cross(jet.v);
  const double area = cross.norm();
  constexpr double kParallel = 64 * std::numeric_limits<double>::epsilon();
  if (!(area > kParallel * jet.u.norm() * jet.v.norm())) return forms;
  forms.regular = true;
  forms.normal = cross / area;
  forms.first << jet.u.squaredNorm(), jet.u.dot(jet.v), jet.u.dot(jet.v), jet.v.squaredNorm();
  forms.second << jet.uu.dot(forms.normal), jet.uv.dot(forms.normal), jet.uv.dot(forms.normal),
      jet.vv.dot(forms.normal);
  return forms;
}

// In an orthonormal frame of the tangent plane the shape operator is symmetric, so its eigenvalues
// are real by construction, however the parameters are skewed.
PrincipalCurvatures principal_curvatures(const SurfaceJet& jet) {
  const FundamentalForms forms = fundamental_forms(jet);
  if (!forms.regular) return {};
  const Vec3 e1 = jet.u.normalized();
  const Vec3 e2 = forms.normal.cross(e1);
  // (u, v) coordinates of e1 and e2: the inverse of [Su.e1 Sv.e1; 0 Sv.e2].
  const double a = jet.u.norm();
  const double b = jet.v.dot(e1);
  const double c = jet.v.dot(e2);
  Eigen::Matrix2d to_uv;
  to_uv << 1 / a, -b / (a * c), 0, 1 / c;
  const Eigen::Matrix2d shape = to_uv.transpose() * forms.second * to_uv;

  const double half = 0.5 * (shape(0, 0) + shape(1, 1));
  const double difference = 0.5 * (shape(0, 0) - shape(1, 1));
  const double radius = std::hypot(difference, shape(0, 1));
  const double angle = 0.5 * std::atan2(shape(0, 1), difference);
  PrincipalCurvatures k;
  k.largest = half + radius;
  k.smallest = half - radius;
  k.largest_direction = std::cos(angle) * e1 + std::sin(angle) * e2;
  k.smallest_direction = -std::sin(angle) * e1 + std::cos(angle) * e2;
  return k;
}

namespace {

// The k-th derivative, or zero where what is left of its terms is their rounding, as it is where
// control points coincide.
Vec3 derivative_or_zero(const BSplineCurve<3>& curve, double t, int k) {
  if (k > curve.knots().degree()) return Vec3::Zero();
  const BasisValues basis = basis_at(curve.knots(), t, k);
  Vec3 sum = Vec3::Zero();
  double terms = 0;
  for (int j = 0; j < curve.knots().order(); ++j) {
    const Vec3 term = basis.values(k, j) * curve.control_points().col(basis.first + j);
    sum += term;
    terms += term.norm();
  }
  constexpr double kRounding = 64 * std::numeric_limits<double>::epsilon();
  if (sum.norm() <= kRounding * terms) return Vec3::Zero();
  return sum;
}

double curvature_of(const Vec3& d1, const Vec3& d2) {
  const double speed = d1.norm();
  return speed > 0 ? d1.cross(d2).norm() / (speed * speed * speed) : 0;
}

double torsion_of(const Vec3& d1, const Vec3& d2, const Vec3& d3) {
  const Vec3 binormal = d1.cross(d2);
  const double squared = binormal.squaredNorm();
  return squared > 0 ? binormal.dot(d3) / squared : 0;
}

}  // namespace

double curvature(const BSplineCurve<3>& curve, double t) {
  return curvature_of(derivative_or_zero(curve, t, 1), derivative_or_zero(curve, t, 2));
}

double torsion(const BSplineCurve<3>& curve, double t) {
  return torsion_of(derivative_or_zero(curve, t, 1), derivative_or_zero(curve, t, 2),
                    derivative_or_zero(curve, t, 3));
}

double curvature(const BSplineCurve<4>& rational, double t) {
  const Eigen::Matrix3Xd d = rational_derivatives<3>(rational, t, 2);
  return curvature_of(d.col(1), d.col(2));
}

double torsion(const BSplineCurve<4>& rational, double t) {
  const Eigen::Matrix3Xd d = rational_derivatives<3>(rational, t, 3);
  return torsion_of(d.col(1), d.col(2), d.col(3));
}

}  // namespace angiospline
