#include "modeling/body/lead_in.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <Eigen/Geometry>

#include "modeling/body/path.h"
#include "modeling/body/rules.h"

namespace angiospline {
namespace {

// A point of a curve with unit tangent and curvature vector, travelled away from the end.
struct Place {
  Vec4 value = Vec4::Zero();
  Vec3 tangent = Vec3::Zero();
  Vec3 curvature = Vec3::Zero();
};

Place place_at(const BSplineCurve<4>& course, bool from_last, double t) {
  const double own = from_last ? 1 - t : t;
  const Vec3 d1 = course.at(own, 1).head<3>();
  const Vec3 d2 = course.at(own, 2).head<3>();
  const Vec3 unit = d1.normalized();
  return {course.at(own), from_last ? Vec3(-unit) : unit,
          (d2 - d2.dot(unit) * unit) / d1.squaredNorm()};
}

// The quintic in u over [0, 1] that has these values and first two derivatives at its ends.
struct Quintic {
  std::array<Vec3, 6> c;  // Bernstein

  Quintic(const Vec3& p0, const Vec3& v0, const Vec3& a0, const Vec3& p1, const Vec3& v1,
          const Vec3& a1)
      : c{p0, p0 + v0 / 5, p0 + 2 * v0 / 5 + a0 / 20, p1 - 2 * v1 / 5 + a1 / 20, p1 - v1 / 5, p1} {}

  // Value, first and second derivative (de Casteljau).
  std::array<Vec3, 3> at(double u) const {
    std::array<Vec3, 6> b = c;
    std::array<Vec3, 3> result;
    for (int level = 5; level > 0; --level) {
      if (level == 2) result[2] = 20 * (b[2] - 2 * b[1] + b[0]);
      if (level == 1) result[1] = 5 * (b[1] - b[0]);
      for (int i = 0; i < level; ++i) {
        const auto k = static_cast<std::size_t>(i);
        b[k] = (1 - u) * b[k] + u * b[k + 1];
      }
    }
    result[0] = b[0];
    return result;
  }
};

LeadIn sample(const Quintic& quintic, const BSplineCurve<4>& course, bool from_last, double joins) {
  LeadIn lead{joins, Eigen::Matrix4Xd(4, LeadInRules::kSamples), 0.0};
  for (int i = 0; i < LeadInRules::kSamples; ++i) {
    const double u = static_cast<double>(i) / LeadInRules::kSamples;
    const auto [p, d1, d2] = quintic.at(u);
    const double radius = course.at(from_last ? 1 - u * joins : u * joins)(3);
    lead.samples.col(i) << p, radius;
    const double speed = d1.norm();
    const double bend = speed > 0 ? d1.cross(d2).norm() / (speed * speed * speed) * radius
                                  : std::numeric_limits<double>::infinity();
    lead.largest_bend = std::max(lead.largest_bend, bend);
  }
  return lead;
}

}  // namespace

std::optional<LeadIn> find_lead_in(const BSplineCurve<4>& course, bool from_last,
                                   const PathEnd& end, double tightest, double most) {
  if (end.direction.isZero()) return std::nullopt;
  const Vec3 away = from_last ? Vec3(-end.direction) : end.direction;
  const double speed = course.at(from_last ? 1.0 : 0.0, 1).head<3>().norm();
  if (!(speed > 0)) return std::nullopt;

  // The earliest place at which one of the quintics bends little enough, or the least bent of all.
  std::optional<LeadIn> best;
  for (int k = 1; k <= LeadInRules::kSteps; ++k) {
    const double joins = LeadInRules::kStepRadii * k * end.radius_mm / speed;
    if (joins > most) break;
    const Place to = place_at(course, from_last, joins);
    const double chord = (to.value.head<3>() - end.point_mm).norm();

    // In its own parameter the quintic has the course's curvature where it joins: the second
    // derivative is the speed squared times that.
    for (const double reach : LeadInRules::kReaches) {
      const double v = reach * chord;
      const Quintic quintic(end.point_mm, v * away, Vec3::Zero(), to.value.head<3>(),
                            v * to.tangent, v * v * to.curvature);
      LeadIn lead = sample(quintic, course, from_last, joins);
      if (!best || lead.largest_bend < best->largest_bend) best = std::move(lead);
    }
    if (best->largest_bend <= tightest) break;
  }
  return best;
}

}  // namespace angiospline
