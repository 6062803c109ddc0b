#include <gtest/gtest.h>

#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/contacts.h"
#include "recovery/imaging/skeleton/rules.h"
#include "tests/shapes/random_trees.h"

namespace angiospline {
namespace {

using test::add_tube;
using test::empty_mask;

// Two tubes of the given radii whose axes cross at an angle, `distance` apart.
Mask crossing(double ra, double rb, double angle_deg, double distance,
              Vec3 spacing = Vec3::Ones()) {
  const Vec3 centre = Vec3::Constant(40);
  Mask mask = empty_mask({static_cast<int>(80 / spacing[0]), static_cast<int>(80 / spacing[1]),
                          static_cast<int>(80 / spacing[2])},
                         spacing);
  const double angle = angle_deg * std::numbers::pi / 180;
  const Vec3 a(1, 0, 0), b(std::cos(angle), std::sin(angle), 0), across(0, 0, 0.5 * distance);
  add_tube(mask, centre - 34 * a - across, centre + 34 * a - across, ra);
  add_tube(mask, centre - 34 * b + across, centre + 34 * b + across, rb);
  return mask;
}

VesselsOptions cutting() {
  VesselsOptions options;
  options.cut_contacts = true;
  return options;
}

TEST(Contacts, OfTwoTubesThatKissAreFoundAndCut) {
  for (const double angle : {90.0, 60.0, 30.0})
    for (const auto& [ra, rb] : {std::pair(5.0, 5.0), std::pair(6.0, 4.0)}) {
      const Mask mask = crossing(ra, rb, angle, ra + rb - 0.7);
      const Vessels touching = vessels_from_mask(mask).value();
      ASSERT_EQ(touching.contacts.size(), 1U) << angle << " " << ra;
      const MaskContact& contact = touching.contacts[0];
      EXPECT_EQ(contact.kind, ContactKind::kKissing);
      EXPECT_LT((contact.at_mm - Vec3::Constant(40)).norm(), 3) << angle;
      EXPECT_NEAR(contact.distance_mm, ra + rb - 0.7, 1.5) << angle;
      EXPECT_GE(contact.distance_mm, contact_rules::kCrossing * (ra + rb)) << angle;
      EXPECT_EQ(component_count(touching.tree), 1);
      const Vessels apart = vessels_from_mask(mask, cutting()).value();
      EXPECT_EQ(apart.contacts_cut, 1);
      EXPECT_EQ(component_count(apart.tree), 2) << angle << " " << ra;
      EXPECT_EQ(apart.tree.branches.size(), 2U) << angle << " " << ra;
      for (const CenterlineBranch& branch : apart.tree.branches)
        EXPECT_NEAR(length_mm(branch), 68 + 4.0 / 3 * branch.radii_mm.mean(), 3);
    }
}

TEST(Contacts, OfUnevenVoxelsAreFoundAndCut) {
  const Mask mask = crossing(6, 6, 70, 11.2, Vec3(1, 1, 2));
  ASSERT_EQ(vessels_from_mask(mask).value().contacts.size(), 1U);
  EXPECT_EQ(component_count(vessels_from_mask(mask, cutting()).value().tree), 2);
}

// Two vessels that run side by side for a while, and apart at both ends.
TEST(Contacts, OverALengthAreFoundAndCut) {
  Mask mask = empty_mask({110, 60, 30});
  for (const double side : {-1.0, 1.0})
    for (int x = 5; x < 104; ++x) {
      const auto y = [&](double t) {
        const double away = std::max(0.0, std::abs(t - 55) - 14);
        return 30 + side * (3.8 + 0.012 * away * away);
      };
      add_tube(mask, Vec3(x, y(x), 15), Vec3(x + 1, y(x + 1), 15), 4);
    }
  const Vessels touching = vessels_from_mask(mask).value();
  EXPECT_EQ(component_count(touching.tree), 1);
  ASSERT_GE(touching.contacts.size(), 1U);
  const Vessels apart = vessels_from_mask(mask, cutting()).value();
  EXPECT_EQ(component_count(apart.tree), 2);
  EXPECT_EQ(apart.tree.branches.size(), 2U);
}

TEST(Contacts, AreBridgesWhereSomethingThinLeadsAcrossAGap) {
  Mask mask = empty_mask({80, 60, 40});
  add_tube(mask, Vec3(6, 20, 20), Vec3(74, 20, 20), 5);
  add_tube(mask, Vec3(6, 35, 20), Vec3(74, 35, 20), 5);
  add_tube(mask, Vec3(40, 20, 20), Vec3(40, 35, 20), 1.5);
  const Vessels v = vessels_from_mask(mask).value();
  ASSERT_EQ(v.contacts.size(), 1U);
  EXPECT_EQ(v.contacts[0].kind, ContactKind::kBridge);
  EXPECT_NEAR(v.contacts[0].distance_mm, 15, 0.5);
  EXPECT_EQ(component_count(vessels_from_mask(mask, cutting()).value().tree), 2);
}

// One of two vessels that kiss forks where it does, away from the other; or both fork there.
TEST(Contacts, WhereVesselsForkAreFoundAndCut) {
  for (const bool both : {false, true})
    for (const double radius : {5.0, 4.0}) {
      Mask mask = crossing(5, radius, 80, 5 + radius - 0.7);
      const double half = 0.5 * (5 + radius - 0.7);
      add_tube(mask, Vec3(40, 40, 40 + half), Vec3(46, 40, 74), 3.5);
      if (both) add_tube(mask, Vec3(40, 40, 40 - half), Vec3(40, 34, 6), 3.5);
      const Vessels touching = vessels_from_mask(mask).value();
      ASSERT_EQ(touching.contacts.size(), 1U) << both << radius;
      EXPECT_EQ(touching.contacts[0].kind, ContactKind::kKissing);
      EXPECT_LT((touching.contacts[0].at_mm - Vec3::Constant(40)).norm(), 3);
      EXPECT_EQ(component_count(touching.tree), 1);
      const Vessels apart = vessels_from_mask(mask, cutting()).value();
      EXPECT_EQ(component_count(apart.tree), 2) << both << radius;
      EXPECT_EQ(apart.tree.branches.size(), both ? 6U : 4U) << both << radius;
    }
}

// A vessel along x, and one that comes at an angle and ends at its wall, `gap` beyond it: the rim
// of its flat cap, or the nearest point of its round one.
Mask end_at_side(double ra, double rb, double angle_deg, double gap, test::Ends ends) {
  Mask mask = empty_mask({90, 80, 60});
  add_tube(mask, Vec3(6, 30, 30), Vec3(84, 30, 30), ra);
  const double angle = angle_deg * std::numbers::pi / 180;
  const Vec3 way(std::cos(angle), std::sin(angle), 0);
  const double cap = ends == test::Ends::kFlat ? rb * std::cos(angle) : rb;
  const Vec3 end(36, 30 + ra + gap + cap, 30);
  add_tube(mask, end, end + 36 * way, rb, ends);
  return mask;
}

TEST(Contacts, OfAnEndWithASideAreFoundAndCut) {
  for (const auto ends : {test::Ends::kFlat, test::Ends::kRound})
    for (const double angle : {90.0, 70.0, 50.0})
      for (const auto& [ra, rb] : {std::pair(5.0, 4.0), std::pair(4.0, 5.0)}) {
        // A whole flat cap touches along the wall; deeper, no neck is left between the two.
        const double gap = ends == test::Ends::kRound ? -0.7 : angle == 90 ? 0.3 : -0.3;
        const Mask mask = end_at_side(ra, rb, angle, gap, ends);
        const Vessels touching = vessels_from_mask(mask).value();
        SCOPED_TRACE(testing::Message() << static_cast<int>(ends) << " " << angle << " " << ra);
        EXPECT_EQ(component_count(touching.tree), 1);
        ASSERT_EQ(touching.contacts.size(), 1U);
        EXPECT_EQ(touching.contacts[0].kind, ContactKind::kEndToSide);
        EXPECT_NEAR(touching.contacts[0].b.radius_mm, rb, 1);
        const Vessels apart = vessels_from_mask(mask, cutting()).value();
        EXPECT_EQ(component_count(apart.tree), 2) << angle << " " << ra;
        EXPECT_EQ(apart.tree.branches.size(), 2U) << angle << " " << ra;
      }
}

TEST(Contacts, AreNoneWhereABranchLeavesOrManyMeet) {
  for (const double angle : {90.0, 60.0, 40.0})
    for (const double rb : {2.0, 3.0, 5.0}) {
      Mask mask = empty_mask({90, 80, 60});
      add_tube(mask, Vec3(6, 30, 30), Vec3(84, 30, 30), 5);
      const double a = angle * std::numbers::pi / 180;
      add_tube(mask, Vec3(36, 30, 30), Vec3(36, 30, 30) + 38 * Vec3(std::cos(a), std::sin(a), 0),
               rb);
      const Vessels v = vessels_from_mask(mask).value();
      EXPECT_TRUE(v.contacts.empty()) << angle << " " << rb;
      EXPECT_EQ(v.tree.branches.size(), 3U);
    }
  std::size_t most = 0;
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    Random random(40 + seed);
    Mask mask = empty_mask({90, 90, 90});
    const Vec3 centre = Vec3::Constant(45);
    for (int k = 0; k < 6; ++k) {
      const Vec3 way(random.gaussian(), random.gaussian(), random.gaussian());
      add_tube(mask, centre, centre + 38 * way.normalized(), random.uniform(3, 5));
    }
    const Vessels v = vessels_from_mask(mask).value();
    EXPECT_TRUE(v.contacts.empty()) << seed;
    most = std::max(most, v.tree.branches.size());
  }
  EXPECT_GE(most, 6U);
}

TEST(Contacts, AreNoneInTreesAndWhereAxesCross) {
  std::size_t junctions = 0;
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    Random random(300 + seed);
    test::RandomTreeOptions options;
    options.extent_mm = 100;
    options.root_radius_mm = 6.5;
    const CenterlineTree truth = test::RandomTree(options, random).grow();
    Mask mask = empty_mask({100, 100, 100});
    test::paint(mask, truth);
    const Vessels v = vessels_from_mask(mask).value();
    EXPECT_TRUE(v.contacts.empty()) << seed;
    junctions += truth.branches.size() / 2;
  }
  EXPECT_GT(junctions, 15U);
  EXPECT_TRUE(vessels_from_mask(crossing(5, 5, 90, 0)).value().contacts.empty());
}

TEST(Contacts, CutChangesNothingElse) {
  const Mask mask = crossing(5, 5, 60, 9.3);
  const Vessels v = vessels_from_mask(mask).value();
  const Mask cut = cut_contacts(mask, v.contacts);
  std::size_t gone = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    if (mask.voxels[i] == cut.voxels[i]) continue;
    ++gone;
    const Vec3 at = mask.grid.world_mm(mask.grid.voxel(i));
    EXPECT_LT((at - Vec3::Constant(40)).norm(), 8);
    EXPECT_EQ(cut.voxels[i], 0);
  }
  EXPECT_GT(gone, 0U);
  EXPECT_LT(gone, 120U);
  EXPECT_EQ(cut_contacts(mask, {}).voxels, mask.voxels);
}

}  // namespace
}  // namespace angiospline
