#include "benches/junction_classes.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/core.h>

namespace angiospline {
namespace {

constexpr double kDegree = std::numbers::pi / 180;

Vec3 random_direction(Random& random) {
  Vec3 v(random.gaussian(), random.gaussian(), random.gaussian());
  return v.normalized();
}

double least_angle(const std::vector<Vec3>& d) {
  double least = std::numbers::pi;
  for (std::size_t a = 0; a < d.size(); ++a) {
    for (std::size_t b = a + 1; b < d.size(); ++b) {
      least = std::min(least, std::acos(std::clamp(d[a].dot(d[b]), -1.0, 1.0)));
    }
  }
  return least;
}

// Turned at random, so that nothing depends on the axes.
JunctionSpec spec_of(std::vector<Vec3> directions, const std::vector<double>& radii,
                     Random& random) {
  const Eigen::Quaterniond turn(
      Eigen::Vector4d(random.gaussian(), random.gaussian(), random.gaussian(), random.gaussian())
          .normalized());
  JunctionSpec spec;
  spec.name = std::string("j");
  for (std::size_t b = 0; b < directions.size(); ++b) {
    JunctionBranch branch;
    branch.name = fmt::format("b{}", b);
    branch.name = fmt::format("b{}", b);
    branch.direction = (turn * directions[b]).normalized();
    branch.radius_mm = radii[b];
    spec.branches.push_back(std::move(branch));
  }
  return spec;
}

std::vector<double> random_radii(int count, double low, Random& random) {
  std::vector<double> r;
  for (int k = 0; k < count; ++k) r.push_back(random.uniform(low, 1.0));
  return r;
}

JunctionSpec spread(int count, double angle_deg, double low, Random& random) {
  std::vector<Vec3> d;
  do {
    d.clear();
    for (int k = 0; k < count; ++k) d.push_back(random_direction(random));
  } while (least_angle(d) < angle_deg * kDegree);
  return spec_of(d, random_radii(count, low, random), random);
}

JunctionSpec ordinary(Random& random) { return spread(3, 50, 0.3, random); }

// A parent and two daughters 15 to 40 degrees apart.
JunctionSpec acute(Random& random) {
  const double angle = random.uniform(15, 40) * kDegree;
  const double tilt = random.uniform(-0.5, 0.5) * angle;
  const double out = random.uniform(-20, 20) * kDegree;
  const auto in_plane = [](double a) { return Vec3(std::cos(a), std::sin(a), 0); };
  const Vec3 parent(-std::cos(out), 0, std::sin(out));
  return spec_of({parent, in_plane(tilt + angle / 2), in_plane(tilt - angle / 2)},
                 {1.0, random.uniform(0.5, 1.0), random.uniform(0.5, 1.0)}, random);
}

// All within a half space, none closer than 35 degrees.
JunctionSpec one_sided(int count, Random& random) {
  std::vector<Vec3> d;
  do {
    d.clear();
    while (static_cast<int>(d.size()) < count) {
      const Vec3 v = random_direction(random);
      if (v.z() > 0.1) d.push_back(v);
    }
  } while (least_angle(d) < 35 * kDegree);
  return spec_of(d, random_radii(count, 0.4, random), random);
}
JunctionSpec one_sided_3(Random& random) { return one_sided(3, random); }
JunctionSpec one_sided_4(Random& random) { return one_sided(4, random); }

// A parent and three daughters around a cone of 25 to 50 degrees.
JunctionSpec cone_3(Random& random) {
  const double half = random.uniform(25, 50) * kDegree;
  std::vector<Vec3> d{Vec3(0, 0, -1)};
  std::vector<double> r{1.0};
  for (int k = 0; k < 3; ++k) {
    const double turn = (120 * k + random.uniform(-20, 20)) * kDegree;
    d.emplace_back(std::sin(half) * std::cos(turn), std::sin(half) * std::sin(turn),
                   std::cos(half));
    r.push_back(random.uniform(0.4, 0.8));
  }
  return spec_of(d, r, random);
}

JunctionSpec random_4(Random& random) { return spread(4, 40, 0.4, random); }
JunctionSpec random_5(Random& random) { return spread(5, 40, 0.4, random); }
JunctionSpec random_6(Random& random) { return spread(6, 40, 0.4, random); }
JunctionSpec random_8(Random& random) { return spread(8, 35, 0.4, random); }

// A thin branch on a nearly straight trunk.
JunctionSpec twig(Random& random) {
  const double bend = random.uniform(0, 30) * kDegree;
  const double lean = random.uniform(40, 140) * kDegree;
  const double turn = random.uniform(0, 360) * kDegree;
  const Vec3 out(std::cos(lean), std::sin(lean) * std::cos(turn), std::sin(lean) * std::sin(turn));
  return spec_of({Vec3(-1, 0, 0), Vec3(std::cos(bend), std::sin(bend), 0), out},
                 {1.0, random.uniform(0.8, 1.0), random.uniform(0.1, 0.3)}, random);
}

// A side branch on a straight trunk whose two halves are collinear to half a degree.
JunctionSpec collinear(Random& random) {
  const double bend = random.uniform(0, 0.5) * kDegree;
  const double lean = random.uniform(50, 130) * kDegree;
  return spec_of({Vec3(-1, 0, 0), Vec3(std::cos(bend), std::sin(bend), 0),
                  Vec3(std::cos(lean), 0, std::sin(lean))},
                 {1.0, random.uniform(0.9, 1.0), random.uniform(0.3, 1.0)}, random);
}

// Four or five branches in one plane, one-sided or not: fans.
JunctionSpec planar(Random& random) {
  const int count = 3 + random.below(3);
  const double span = random.uniform(35.0 * count, 320.0) * kDegree;
  std::vector<Vec3> d;
  do {
    d.clear();
    for (int k = 0; k < count; ++k) {
      const double a = random.uniform(0, 1) * span;
      d.emplace_back(std::cos(a), std::sin(a), 0);
    }
  } while (least_angle(d) < 30 * kDegree);
  return spec_of(d, random_radii(count, 0.4, random), random);
}

}  // namespace

const std::vector<JunctionClass>& junction_classes() {
  static const std::vector<JunctionClass> kClasses{
      {"ordinary", ordinary},       {"acute", acute},
      {"one-sided 3", one_sided_3}, {"one-sided 4", one_sided_4},
      {"cone 3", cone_3},           {"random 4", random_4},
      {"random 5", random_5},       {"random 6", random_6},
      {"random 8", random_8},       {"twig", twig},
      {"collinear", collinear},     {"planar", planar}};
  return kClasses;
}

}  // namespace angiospline
