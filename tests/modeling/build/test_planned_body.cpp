// Junctions and bodies of a plan, one at a time, and how they are put together.
#include <cmath>
#include <numbers>
#include <set>

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include "base/index.h"
#include "modeling/build/assembly.h"
#include "modeling/build/built_junction.h"
#include "modeling/build/plan.h"
#include "modeling/build/plan_measures.h"
#include "modeling/build/planned_body.h"
#include "modeling/build/rules.h"
#include "modeling/tree/smooth_centerlines.h"
#include "tests/shapes/network_measures.h"

namespace angiospline {
namespace {

// Three branches of 20 mm at 120 degrees in a plane, 1 mm thick; the first end is the inlet.
SmoothedTree star() {
  CenterlineTree tree;
  tree.nodes.push_back({"m", Vec3::Zero()});
  for (int k = 0; k < 3; ++k) {
    const double angle = 2 * std::numbers::pi * k / 3;
    const Vec3 tip(20 * std::cos(angle), 20 * std::sin(angle), 0);
    tree.nodes.push_back({std::string(1, "abc"[k]), tip});
    CenterlineBranch branch;
    branch.name = "m_" + tree.nodes.back().name;
    branch.from = 0;
    branch.to = k + 1;
    branch.points_mm.resize(3, 21);
    for (int i = 0; i <= 20; ++i) branch.points_mm.col(i) = tip * i / 20;
    branch.radii_mm = Eigen::VectorXd::Ones(21);
    tree.branches.push_back(std::move(branch));
  }
  tree.inlets = {1};
  return smooth_centerlines(tree).value();
}

// The star with its junction built once for all tests.
struct Built {
  SmoothedTree tree = star();
  Plan plan = make_plan(tree, {});
  BuildOptions options;
  std::vector<Junction> junctions{build_junction(plan.nodes[0], {}, {}).junction.value()};
  std::vector<int> number{0, -1, -1, -1};
  std::vector<char> flow{1, 1, 1, 1};

  BodySurroundings around() const { return {tree, plan, options, junctions, number, flow}; }
};

const Built& built() {
  static const Built kBuilt;
  return kBuilt;
}

TEST(BuiltJunction, IsOfTheSpecificationItWasPlannedWith) {
  const PlannedNode& node = built().plan.nodes[0];
  const BuiltJunction junction = build_junction(node, {}, {});
  ASSERT_TRUE(junction.junction);
  EXPECT_FALSE(junction.error);
  EXPECT_TRUE(same(junction.spec, node.spec));
  EXPECT_TRUE(junction.junction->fair);
}

TEST(BuiltJunction, OfANodeWithoutOpeningsIsItsError) {
  PlannedNode node = built().plan.nodes[0];
  node.error = Error{ErrorKind::kBadInput, "two branches run the same way", "m", {}, {}};
  for (const BuiltJunction& junction :
       {build_junction(node, {}, {}), build_bent_junction(node, {}, {})}) {
    EXPECT_FALSE(junction.junction);
    ASSERT_TRUE(junction.error);
    EXPECT_EQ(junction.error->message(), node.error->message());
  }
}

TEST(Same, TellsEveryFieldApart) {
  const JunctionSpec spec = built().plan.nodes[0].spec;
  EXPECT_TRUE(same(spec, spec));
  std::vector<JunctionSpec> others(7, spec);
  others[0].name += "x";
  others[1].center_mm.x() = std::nextafter(spec.center_mm.x(), 1.0);
  others[2].branches.pop_back();
  others[3].branches[1].direction = -spec.branches[1].direction;
  others[4].branches[2].radius_mm *= 1 + 1e-15;
  others[5].branches[0].longest_mm += 1;
  others[6].branches[0].offset_mm = Vec3::UnitX();
  for (const JunctionSpec& other : others) EXPECT_FALSE(same(spec, other));
}

TEST(OpeningEnd, IsTheCircleOfTheOpeningInTheBodysOrder) {
  const Junction& junction = built().junctions[0];
  for (int k = 0; k < 3; ++k) {
    const JunctionOpening& opening = junction.openings[index(k)];
    for (const bool leaving : {false, true}) {
      const BodyEnd end = opening_end(junction, k, leaving);
      ASSERT_EQ(end.arcs.size(), opening.patches.size());
      EXPECT_TRUE(end.joined);
      EXPECT_EQ(end.tangent, leaving ? opening.axis : Vec3(-opening.axis));
      double turn = 0;
      for (std::size_t a = 0; a < end.arcs.size(); ++a) {
        const Arc& arc = end.arcs[a];
        EXPECT_EQ(arc.col(5), end.arcs[(a + 1) % end.arcs.size()].col(0));
        const Vec3 from = arc.col(0) - end.center_mm;
        const Vec3 to = arc.col(5) - end.center_mm;
        EXPECT_NEAR(from.norm(), end.radius_mm, 1e-9);
        EXPECT_NEAR(from.dot(end.tangent), 0, 1e-9);
        // Clockwise seen from in front of the tangent.
        const Vec3 onward = arc.col(1) - arc.col(0);
        EXPECT_LT(end.tangent.dot(from.cross(onward)), 0);
        const double angle = std::acos(std::clamp(from.normalized().dot(to.normalized()), -1., 1.));
        turn += end.tangent.dot(from.cross(to)) < 0 ? angle : 2 * std::numbers::pi - angle;
      }
      EXPECT_NEAR(turn, 2 * std::numbers::pi, 1e-6);
    }
  }
}

TEST(Assemble, AJunctionAloneIsClosedByACapForEachOpening) {
  std::vector<ClosedOpening> closed;
  for (int k = 0; k < 3; ++k) closed.push_back({0, k, "rim" + std::to_string(k), RimKind::kCap});
  const SurfaceNetwork network = assemble(built().junctions, {}, closed);
  EXPECT_FALSE(find_defect(network));
  ASSERT_EQ(network.rims.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(network.rims[k].name, "rim" + std::to_string(k));
    EXPECT_EQ(network.rims[k].sides.size(), built().junctions[0].openings[k].patches.size());
  }
}

TEST(PlannedBody, RunsFromItsOpeningToARimOfItsName) {
  const PlannedBody body = build_planned_body(built().around(), 1);
  ASSERT_EQ(body.pieces.size(), 1U);
  EXPECT_FALSE(body.folded);
  EXPECT_FALSE(body.failed);
  EXPECT_TRUE(body.warnings.empty());
  const BodyPiece& piece = body.pieces[0];
  EXPECT_EQ(piece.name, "wall_m_b");
  EXPECT_EQ(piece.start_link.kind, BodyLink::Kind::kOpening);
  EXPECT_EQ(piece.start_link.opening, 1);
  EXPECT_EQ(piece.end_link.kind, BodyLink::Kind::kRim);
  EXPECT_EQ(piece.end_link.rim_name, "outlet_b");
  EXPECT_NEAR(piece.radius_mm, 1, 1e-3);
  EXPECT_EQ(build_planned_body(built().around(), 0).pieces[0].end_link.rim_name, "inlet");
}

TEST(PlannedBody, ThreeOfThemCloseTheirJunction) {
  std::vector<BodyPiece> pieces;
  for (int b = 0; b < 3; ++b) pieces.push_back(build_planned_body(built().around(), b).pieces[0]);
  const SurfaceNetwork network = assemble(built().junctions, pieces);
  EXPECT_FALSE(find_defect(network));
  std::set<std::string> names;
  for (const Rim& rim : network.rims) names.insert(rim.name);
  EXPECT_EQ(names, (std::set<std::string>{"inlet", "outlet_b", "outlet_c"}));
  const testing::SeamMeasure seams = testing::measure_seams(network, 7);
  EXPECT_LT(seams.gap_mm, 1e-11);
  EXPECT_LT(seams.angle_deg, 1e-6);
}

TEST(PlannedBody, WithoutADirectionOfFlowEndsInCaps) {
  Built still = built();
  still.flow = {0, 0, 0, 0};
  EXPECT_EQ(build_planned_body(still.around(), 0).pieces[0].end_link.rim_name, "cap_a");
}

TEST(PlannedBody, EndsInACapOfItsOwnWhereItsJunctionCouldNotBeBuilt) {
  Built failed = built();
  failed.number[0] = -1;
  const PlannedBody body = build_planned_body(failed.around(), 2);
  ASSERT_EQ(body.pieces.size(), 1U);
  EXPECT_EQ(body.pieces[0].start_link.kind, BodyLink::Kind::kRim);
  EXPECT_EQ(body.pieces[0].start_link.rim_name, "cap_m_m_c");
}

TEST(PlannedBody, OfAFreeEndBesideTheOpeningIsTheOpeningClosed) {
  Built cut = built();
  const PlannedNode& node = cut.plan.nodes[0];
  const double opens =
      std::max((cut.junctions[0].openings[0].center_mm - node.center_mm).norm(), node.meets_mm[0]);
  PlannedBranch& branch = cut.plan.branches[0];
  branch.samples.resize(4, 2);
  branch.samples << 0, opens + 0.5 * PlannedBodyRules::kShortestPiece, 0, 0, 0, 0, 1, 1;
  measure_length(branch);
  const PlannedBody body = build_planned_body(cut.around(), 0);
  EXPECT_TRUE(body.pieces.empty());
  EXPECT_FALSE(body.failed);
  ASSERT_EQ(body.closed.size(), 1U);
  EXPECT_EQ(body.closed[0].opening, 0);
  EXPECT_EQ(body.closed[0].rim_name, "inlet");
  EXPECT_EQ(body.warnings.size(), 1U);

  // Between junctions that failed nothing is left of it.
  cut.number[0] = -1;
  branch.samples(0, 1) = node.follows_mm(0) + 0.5 * PlannedBodyRules::kShortestPiece;
  measure_length(branch);
  const PlannedBody nothing = build_planned_body(cut.around(), 0);
  ASSERT_TRUE(nothing.failed);
  EXPECT_EQ(nothing.failed->name, "wall_m_a");
}

TEST(PlannedBody, AnExtensionIsAPieceOfItsOwnOnASharedCircle) {
  Built extended = built();
  extended.options.extend_outlets = 3;
  const PlannedBody body = build_planned_body(extended.around(), 1);
  ASSERT_EQ(body.pieces.size(), 2U);
  const BodyPiece& tube = body.pieces[0];
  EXPECT_EQ(tube.name, "extension_outlet_b");
  EXPECT_EQ(tube.start_link.kind, BodyLink::Kind::kCircle);
  EXPECT_EQ(body.pieces[1].end_link.circle, tube.start_link.circle);
  EXPECT_EQ(tube.end_link.rim_name, "outlet_b");
  EXPECT_NEAR((tube.end.center_mm - tube.start.center_mm).norm(), 3 * 2 * 1.0, 1e-2);
  EXPECT_EQ(build_planned_body(extended.around(), 0).pieces.size(), 1U);
}

}  // namespace
}  // namespace angiospline
