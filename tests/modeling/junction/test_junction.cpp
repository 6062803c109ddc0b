#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/junction/junction.h"

namespace angiospline {
namespace {

JunctionSpec spec_of(const std::vector<Vec3>& directions, const std::vector<double>& radii) {
  JunctionSpec spec;
  spec.name = "7";
  for (std::size_t b = 0; b < directions.size(); ++b) {
    std::string name("b");
    name.append(std::to_string(b));
    spec.branches.push_back({name, directions[b].normalized(), radii[b], 0.0});
  }
  return spec;
}

JunctionSpec y_spec() {
  const double c = 0.5, s = std::sqrt(0.75);
  return spec_of({{-1, 0, 0}, {c, s, 0}, {c, -s, 0}}, {1, 1, 1});
}

// The largest angle between normals over a join, corners included.
double worst_join_angle_deg(const SurfaceNetwork& network) {
  double worst = 0;
  for (const Join& join : network.joins) {
    for (int k = 0; k <= 20; ++k) {
      const auto normal = [&](const Side& side, double t) {
        const Vec2 uv =
            side_parameters(network.patches[static_cast<std::size_t>(side.patch)], side.side, t);
        return normal_vector(patch_surface(network, side.patch), uv.x(), uv.y());
      };
      const Vec3 a = normal(join.a, join_parameter_a(join, k / 20.0));
      const Vec3 b = normal(join.b, join_parameter_b(join, k / 20.0));
      worst = std::max(worst, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
  }
  return worst * 180 / std::numbers::pi;
}

// Laws of every junction, whatever its branches.
void expect_lawful(const JunctionSpec& spec, const Junction& junction) {
  ASSERT_EQ(junction.openings.size(), spec.branches.size());
  EXPECT_LT(worst_join_angle_deg(junction.network), 1e-6);
  std::size_t sectors = 0;
  for (std::size_t b = 0; b < spec.branches.size(); ++b) {
    const JunctionOpening& opening = junction.openings[b];
    const double r = spec.branches[b].radius_mm;
    ASSERT_EQ(opening.seams.size(), opening.patches.size());
    sectors += opening.seams.size();
    for (std::size_t k = 0; k < opening.patches.size(); ++k) {
      const BSplineSurface<3> patch = patch_surface(junction.network, opening.patches[k]);
      const BSplineSurface<3> next =
          patch_surface(junction.network, opening.patches[(k + 1) % opening.patches.size()]);
      EXPECT_LT((patch.at(0, 0) - opening.center_mm - r * opening.seams[k]).norm(), 1e-12 * r);
      EXPECT_LT((patch.at(0, 1, 0, 1) - next.at(0, 0, 0, 1)).norm(), 1e-12 * r);
      for (const double v : {0.0, 0.2, 0.5, 0.9}) {
        const Vec3 out = patch.at(0, v) - opening.center_mm;
        EXPECT_NEAR(out.dot(opening.axis), 0, 1e-12 * r);
        EXPECT_NEAR(out.norm(), r, 0.02 * r);
        const Vec3 down = patch.at(0, v, 1, 0);
        EXPECT_LT(down.cross(opening.axis).norm(), 1e-12 * down.norm());
        EXPECT_LT(down.dot(opening.axis), 0);
        EXPECT_GT(normal_vector(patch, 0, v).dot(out), 0);
      }
    }
  }
  EXPECT_EQ(sectors, junction.network.patches.size());
  EXPECT_EQ(junction.network.joins.size(), sectors + sectors / 2);
}

TEST(MakeJunction, OfThreeBranchesIsTheSixPatchesOfTheThesis) {
  const Result<Junction> junction = make_junction(y_spec());
  ASSERT_TRUE(junction) << junction.error().message();
  EXPECT_EQ(junction->network.patches.size(), 6u);
  EXPECT_EQ(junction->network.joins.size(), 9u);
  EXPECT_EQ(junction->network.regions.size(), 1u);
  EXPECT_EQ(junction->network.regions[0].name, "junction_7");
  expect_lawful(y_spec(), *junction);
}

TEST(MakeJunction, IsSmoothForRandomDirectionsAndRadii) {
  Random random(20);
  int made = 0;
  for (int trial = 0; trial < 12; ++trial) {
    const int count = 3 + trial % 4;
    std::vector<Vec3> d;
    std::vector<double> r;
    while (static_cast<int>(d.size()) < count) {
      const Vec3 v = Vec3(random.gaussian(), random.gaussian(), random.gaussian()).normalized();
      bool apart = true;
      for (const Vec3& other : d) apart = apart && v.dot(other) < std::cos(0.9);
      if (!apart) continue;
      d.push_back(v);
      r.push_back(random.uniform(0.4, 1.0));
    }
    const JunctionSpec spec = spec_of(d, r);
    const Result<Junction> junction = make_junction(spec);
    if (!junction) continue;
    ++made;
    expect_lawful(spec, *junction);
  }
  EXPECT_GE(made, 11);
}

// Two junctions that became one: each branch keeps its own axis.
TEST(MakeJunction, TakesBranchesThatDoNotMeetInAPoint) {
  JunctionSpec spec =
      spec_of({{-1, 0.2, 0}, {-0.3, -1, 0.2}, {1, 0.3, 0.1}, {0.4, 0.2, 1}}, {1.0, 0.7, 0.8, 0.6});
  for (const std::size_t b : {0U, 1U}) spec.branches[b].offset_mm = Vec3(-0.7, 0, 0);
  for (const std::size_t b : {2U, 3U}) spec.branches[b].offset_mm = Vec3(0.7, 0, 0);
  const Result<Junction> junction = make_junction(spec);
  ASSERT_TRUE(junction) << junction.error().message();
  expect_lawful(spec, *junction);
  EXPECT_TRUE(junction->fair);
  const auto distances = opening_distances_mm(spec);
  ASSERT_TRUE(distances);
  for (std::size_t b = 0; b < 4; ++b) {
    const JunctionBranch& branch = spec.branches[b];
    const Vec3 arm = junction->openings[b].center_mm - branch.offset_mm;
    EXPECT_LT(arm.cross(branch.direction).norm(), 1e-12);
    EXPECT_GT(arm.dot(branch.direction), 0);
    EXPECT_NEAR(junction->openings[b].center_mm.norm(), (*distances)[b], 1e-12);
    EXPECT_LT(
        (place_on_branch_mm(branch, (*distances)[b]) - junction->openings[b].center_mm).norm(),
        1e-9);
  }
}

TEST(MakeJunction, GrowsWithItsSpec) {
  JunctionSpec large = y_spec();
  for (JunctionBranch& b : large.branches) b.radius_mm *= 1000;
  const Result<Junction> one = make_junction(y_spec());
  const Result<Junction> thousand = make_junction(large);
  ASSERT_TRUE(one && thousand);
  const double error =
      (thousand->network.control_points_mm - 1000 * one->network.control_points_mm).norm();
  EXPECT_LT(error, 1e-9 * thousand->network.control_points_mm.norm());
}

TEST(MakeJunction, IsTheSameEveryTime) {
  const Result<Junction> a = make_junction(y_spec());
  const Result<Junction> b = make_junction(y_spec());
  ASSERT_TRUE(a && b);
  EXPECT_EQ(a->network.control_points_mm, b->network.control_points_mm);
}

TEST(MakeJunction, StopsOnRequest) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const Result<Junction> junction = make_junction(y_spec(), {}, progress);
  ASSERT_FALSE(junction);
  EXPECT_EQ(junction.error().kind, ErrorKind::kCancelled);
}

TEST(MakeJunction, OfOrdinaryBranchesIsGentleAndNearItsCylinders) {
  const JunctionSpec spec =
      spec_of({{-1, 0, 0}, {0.8, 0.55, 0.1}, {0.7, -0.7, 0}, {0, 0.2, 1}}, {1.0, 0.8, 0.7, 0.5});
  const Result<Junction> junction = make_junction(spec);
  ASSERT_TRUE(junction) << junction.error().message();
  EXPECT_TRUE(junction->fair);
  EXPECT_LT(junction->curvature_times_radius, 10);
  EXPECT_LT(junction->moved_over_radius, 0.15);
  EXPECT_LT(junction->worst_angle_deg, 1e-6);
}

// Every junction asked for the impossible is an error that names it; nothing is made up.
TEST(MakeJunction, RefusesBadSpecsNamingTheJunctionAndTheBranch) {
  const auto refuses = [](const JunctionSpec& spec, const std::string& what,
                          const std::string& branch) {
    const Result<Junction> junction = make_junction(spec);
    ASSERT_FALSE(junction) << what;
    EXPECT_EQ(junction.error().kind, ErrorKind::kBadInput) << what;
    for (const std::string& word : {what, branch, std::string("junction 7")}) {
      EXPECT_NE(junction.error().message().find(word), std::string::npos)
          << word << " is not in: " << junction.error().message();
    }
  };
  JunctionSpec spec = y_spec();
  spec.branches[2].direction = spec.branches[0].direction;
  refuses(spec, "same direction", "b0 and b2");
  spec = y_spec();
  spec.branches[1].radius_mm = -0.5;
  refuses(spec, "-0.5", "b1");
  spec = y_spec();
  spec.branches[1].direction.setZero();
  refuses(spec, "not a unit vector", "b1");
  spec = y_spec();
  spec.branches[2].longest_mm = -1;
  refuses(spec, "longest distance", "b2");
  spec = y_spec();
  spec.center_mm.x() = std::numeric_limits<double>::infinity();
  refuses(spec, "centre is not finite", "");
  // Directions that span no plane: of three on one line two are the same.
  spec = y_spec();
  spec.branches[1].direction = -spec.branches[0].direction;
  spec.branches[2].direction = spec.branches[0].direction;
  refuses(spec, "same direction", "b0 and b2");
  spec = y_spec();
  spec.branches[1].offset_mm.y() = std::numeric_limits<double>::quiet_NaN();
  refuses(spec, "offset is not finite", "b1");
  for (const std::size_t count : {0U, 1U, 2U}) {
    spec = y_spec();
    spec.branches.resize(count);
    refuses(spec, "too few branches", "");
  }
  spec = y_spec();
  while (spec.branches.size() < 25) spec.branches.push_back(spec.branches.back());
  refuses(spec, "too many branches", "");
}

TEST(OpeningDistances, AreWhereTheOpeningsCome) {
  const JunctionSpec spec = y_spec();
  const auto distances = opening_distances_mm(spec);
  const Result<Junction> junction = make_junction(spec);
  ASSERT_TRUE(distances && junction);
  for (std::size_t b = 0; b < 3; ++b) {
    EXPECT_NEAR((junction->openings[b].center_mm - spec.center_mm).norm(), (*distances)[b], 1e-12);
  }
}

TEST(OpeningDistances, ShrinkForShortBranchesAndSayWhatIsNeeded) {
  JunctionSpec spec = y_spec();
  const double free = opening_distances_mm(spec).value()[1];
  spec.branches[1].longest_mm = 0.8 * free;
  const auto shorter = opening_distances_mm(spec);
  ASSERT_TRUE(shorter) << shorter.error().message();
  EXPECT_LE((*shorter)[1], 0.8 * free);
  spec.branches[1].longest_mm = 0.1;
  const auto none = opening_distances_mm(spec);
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message().find("too short"), std::string::npos);
  EXPECT_NE(none.error().message().find("b1"), std::string::npos);
}

TEST(OpeningDistances, RefuseBadBranchesByName) {
  const auto message = [](const JunctionSpec& spec) {
    const auto result = opening_distances_mm(spec);
    return result ? std::string() : result.error().message();
  };
  JunctionSpec spec = y_spec();
  spec.branches[2].direction = spec.branches[1].direction;
  EXPECT_NE(message(spec).find("b1 and b2"), std::string::npos);
  spec = y_spec();
  spec.branches[1].radius_mm = 0;
  EXPECT_NE(message(spec).find("b1: radius is not positive"), std::string::npos);
  spec.branches[1].radius_mm = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(message(spec).find("b1: radius is not positive"), std::string::npos);
  spec = y_spec();
  spec.branches[0].direction *= 2;
  EXPECT_NE(message(spec).find("b0: direction is not a unit vector"), std::string::npos);
  spec.branches[0].direction.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_NE(message(spec).find("b0: direction is not a unit vector"), std::string::npos);
  spec = y_spec();
  spec.branches.pop_back();
  EXPECT_NE(message(spec).find("too few branches"), std::string::npos);
  spec.branches.pop_back();
  EXPECT_NE(message(spec).find("too few branches"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
