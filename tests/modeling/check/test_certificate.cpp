#include <cmath>
#include <map>
#include <numbers>

#include <BRepAlgoAPI_Cut.hxx>
#include <BRepBuilderAPI_NurbsConvert.hxx>
#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCone.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepPrimAPI_MakeSphere.hxx>
#include <BRepPrimAPI_MakeTorus.hxx>
#include <BRep_Builder.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS_Compound.hxx>
#include <gtest/gtest.h>

#include "base/random.h"
#include "kernel/geometry/triangle_crossing.h"
#include "modeling/check/certificate.h"
#include "modeling/solid/boundary_mesh.h"
#include "modeling/solid/solid_shape.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

Certificate certificate_of(const SurfaceNetwork& network) {
  const Result<Solid> solid = make_solid(network);
  EXPECT_TRUE(solid) << solid.error().message();
  return certify(solid.value()).value();
}

std::vector<std::pair<std::string, SurfaceNetwork>> all_samples() {
  return {{"sheared tube", crafted::sheared_tube(1, 6, 1)},
          {"bent tube", samples::bent_tube()},
          {"tube with a T-vertex", samples::tube_with_t_vertex()},
          {"tube of quarters", crafted::tube_of_quarters(1, 6)},
          {"torus", samples::torus()},
          {"one patch tube", crafted::one_patch_tube(1, 5)},
          {"creased tube", crafted::creased_tube(1, 6, 10)}};
}

TEST(Certificate, FindsEverySampleClosedValidAndFreeOfSelfIntersection) {
  for (const auto& [name, network] : all_samples()) {
    SCOPED_TRACE(name);
    const Certificate c = certificate_of(network);
    EXPECT_EQ(c.solids, 1);
    EXPECT_TRUE(c.closed);
    EXPECT_TRUE(c.valid);
    EXPECT_FALSE(c.self_intersecting);
    EXPECT_EQ(c.free_edges, 0);
    EXPECT_LT(c.max_gap_mm, 1e-12);
    EXPECT_EQ(c.genus, name == "torus" ? 1 : 0);
    EXPECT_GT(c.edge_samples, 0);
    EXPECT_TRUE(c.warnings.empty());
  }
}

TEST(Certificate, IntegratesVolumeExactlyAndAreaClosely) {
  for (const auto& [name, network] : all_samples()) {
    SCOPED_TRACE(name);
    const Certificate c = certificate_of(network);
    const double volume = samples::exact_volume_mm3(network);
    EXPECT_NEAR(c.volume_mm3, volume, 1e-12 * volume);
    double wall = 0;
    for (const FaceCertificate& face : c.faces) {
      if (face.kind == FaceKind::kWall) wall += face.area_mm2;
    }
    const double expected = samples::wall_area_mm2(network);
    EXPECT_NEAR(wall, expected, 1e-6 * expected);
  }
  const Certificate tube = certificate_of(crafted::sheared_tube(1, 6));
  EXPECT_EQ(tube.faces.back().name, "outlet_2");
  EXPECT_EQ(tube.faces.back().kind, FaceKind::kOutlet);
  EXPECT_NEAR(tube.faces.back().area_mm2, crafted::unit_disc_area(), 1e-12);
  EXPECT_NEAR(tube.area_mm2, 2 * std::numbers::pi * 7, 4e-5);
}

TEST(Certificate, OfANetworkIsTheOneOfItsSolid) {
  for (const auto& [name, network] : all_samples()) {
    SCOPED_TRACE(name);
    const Certificate a = certificate_of(network);
    const Certificate b = certify(network).value();
    EXPECT_EQ(a.solids, b.solids);
    EXPECT_EQ(a.closed, b.closed);
    EXPECT_EQ(a.valid, b.valid);
    EXPECT_EQ(a.self_intersecting, b.self_intersecting);
    EXPECT_NEAR(a.volume_mm3, b.volume_mm3, 1e-12 * a.volume_mm3);
    EXPECT_NEAR(a.area_mm2, b.area_mm2, 1e-12 * a.area_mm2);
    EXPECT_EQ(a.faces.size(), b.faces.size());
    EXPECT_EQ(a.smooth_edges, b.smooth_edges);
    EXPECT_EQ(a.genus, b.genus);
    EXPECT_NEAR(a.max_normal_angle_deg, b.max_normal_angle_deg, 1e-7);
    EXPECT_EQ(a.min_jacobian_ratio, b.min_jacobian_ratio);
    EXPECT_EQ(a.max_curvature_times_radius, b.max_curvature_times_radius);
    EXPECT_LT((a.lowest_mm - b.lowest_mm).norm(), 1e-12);
    EXPECT_LT((a.highest_mm - b.highest_mm).norm(), 1e-12);
  }
}

TEST(Certificate, MeasuresACreaseAndSaysWhereItIs) {
  for (const double crease : {0.001, 1.0, 10.0}) {
    const Certificate c = certificate_of(crafted::creased_tube(1, 6, crease));
    // The quintic circle is round within 2e-6, and so is the angle.
    EXPECT_NEAR(c.max_normal_angle_deg, crease, 1e-4 * crease);
    EXPECT_EQ((std::array<std::string, 2>{"wall_1", "wall_2"}), c.worst_edge);
    EXPECT_NEAR(c.worst_point_mm.z(), 3.0, 1e-12);
    EXPECT_EQ(c.smooth_edges, 6);
  }
  const Certificate smooth = certificate_of(crafted::sheared_tube(1, 6));
  EXPECT_LT(smooth.max_normal_angle_deg, 1e-9);  // rims are right angles but no smooth edges
  EXPECT_EQ(smooth.smooth_edges, 2);
}

TEST(Certificate, SeesACreaseThatIsOnlyAtACorner) {
  SurfaceNetwork network = crafted::tube_of_quarters(1, 6);
  const double before = certificate_of(network).max_normal_angle_deg;
  // Turn the tangent plane of one patch at one corner: move its inner neighbour of the corner.
  const Patch& patch = network.patches[2];
  network.control_points_mm.col(patch.control[7]) += Vec3(0.05, 0, 0);
  const Certificate c = certificate_of(network);
  EXPECT_LT(before, 1e-6);
  EXPECT_GT(c.max_normal_angle_deg, 0.1);
}

TEST(Certificate, BoxesTheTorusTightly) {
  const Certificate c = certificate_of(samples::torus(3, 1));
  // The quintic circle's own extremes, to its accuracy.
  for (const int axis : {0, 1}) {
    EXPECT_NEAR(c.highest_mm(axis), 4, 2e-5);
    EXPECT_NEAR(c.lowest_mm(axis), -4, 2e-5);
  }
  EXPECT_NEAR(c.highest_mm.z(), 1, 2e-5);
  // No point of a fine grid lies outside.
  const SurfaceNetwork network = samples::bent_tube();
  const Certificate bent = certificate_of(network);
  for (std::size_t p = 0; p < network.patches.size(); ++p) {
    const BSplineSurface<3> surface = patch_surface(network, static_cast<int>(p));
    for (int i = 0; i <= 200; ++i) {
      for (int j = 0; j <= 200; ++j) {
        const Vec3 s =
            surface.at(surface.u().first() + (surface.u().last() - surface.u().first()) * i / 200,
                       surface.v().first() + (surface.v().last() - surface.v().first()) * j / 200);
        ASSERT_TRUE((s.array() <= bent.highest_mm.array() + 1e-9).all());
        ASSERT_TRUE((s.array() >= bent.lowest_mm.array() - 1e-9).all());
      }
    }
  }
}

TEST(Certificate, KnowsTheCurvatureOfATube) {
  const Certificate c = certificate_of(crafted::sheared_tube(2.5, 6));
  ASSERT_TRUE(c.max_curvature_times_radius);
  EXPECT_NEAR(*c.max_curvature_times_radius, 1.0, 2e-3);  // the quintic's curvature ripples
}

TEST(Certificate, SeesAFoldedPatchByItsJacobian) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  EXPECT_GT(certificate_of(network).min_jacobian_ratio, 0.9);
  const Patch& patch = network.patches[1];
  // Push a control point of the middle far along the axis: the parameter lines turn back.
  network.control_points_mm(2, patch.control[2 * 6 + 2]) += 20;
  network.control_points_mm(2, patch.control[2 * 6 + 3]) -= 20;
  const Certificate c = certify(network).value();
  EXPECT_LT(c.min_jacobian_ratio, 0.1);
  EXPECT_EQ(c.min_jacobian_face, "wall_1");
}

TEST(Certificate, FindsTwoVesselsThatCross) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  SurfaceNetwork other = crafted::sheared_tube(1, 6);
  other.regions[0].name = "wall_other";
  // Lay the other across: z to x.
  const Points3 p = other.control_points_mm;
  other.control_points_mm.row(0) = p.row(2).array() - 3.0;
  other.control_points_mm.row(2) = -p.row(0).array() + 3.0;
  for (Rim& rim : other.rims) {
    rim.center_mm = Vec3(rim.center_mm.z() - 3.0, rim.center_mm.y(), 3.0 - rim.center_mm.x());
    rim.normal = Vec3(rim.normal.z(), rim.normal.y(), -rim.normal.x());
  }
  SurfaceNetwork apart = network;
  append(network, other);
  const Certificate c = certificate_of(network);
  EXPECT_EQ(c.solids, 2);
  EXPECT_TRUE(c.self_intersecting);
  ASSERT_EQ(c.self_intersections.size(), 1U);
  EXPECT_EQ(c.self_intersections[0].faces, (std::array<std::string, 2>{"wall_1", "wall_other"}));
  // Both surfaces pass within the mesh's fineness of that point.
  const Vec3 at = c.self_intersections[0].at_mm;
  EXPECT_NEAR(std::hypot(at.x(), at.y()), 1.0, 0.01);
  EXPECT_NEAR(std::hypot(at.z() - 3.0, at.y()), 1.0, 0.01);
  // Two radii and a bit to the side they pass each other.
  other.control_points_mm.row(1).array() += 2.02;
  for (Rim& rim : other.rims) rim.center_mm.y() += 2.02;
  append(apart, other);
  EXPECT_FALSE(certificate_of(apart).self_intersecting);
}

TEST(Certificate, FindsATubeThatRunsBackThroughItself) {
  // A tube whose axis is bent so sharply that its inner wall folds over: radius above the bend's.
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  const Patch& patch = network.patches[0];
  for (const int i : {1, 2, 3, 4}) {
    for (const int j : {2, 3}) {
      // The front half is pushed through the back half.
      network.control_points_mm.col(patch.control[static_cast<std::size_t>(6 * i + j)]) +=
          Vec3(0, -6, 0);
    }
  }
  const Certificate c = certify(network).value();
  EXPECT_TRUE(c.self_intersecting);
  ASSERT_FALSE(c.self_intersections.empty());
  EXPECT_EQ(c.self_intersections[0].faces, (std::array<std::string, 2>{"wall_1", "wall_1"}));
}

TEST(Certificate, OfTheSameModelDoesNotDependOnItsScale) {
  const Certificate one = certificate_of(samples::bent_tube());
  for (const double scale : {1e-3, 1e3}) {
    SurfaceNetwork network = samples::bent_tube();
    network.control_points_mm *= scale;
    for (Rim& rim : network.rims) {
      rim.center_mm *= scale;
      rim.radius_mm *= scale;
    }
    for (Region& region : network.regions) region.radius_mm *= scale;
    const Certificate c = certify(network).value();
    EXPECT_NEAR(c.volume_mm3, one.volume_mm3 * scale * scale * scale, 1e-11 * c.volume_mm3);
    EXPECT_NEAR(c.min_jacobian_ratio, one.min_jacobian_ratio, 1e-12);
    EXPECT_NEAR(*c.max_curvature_times_radius, *one.max_curvature_times_radius, 1e-9);
    EXPECT_EQ(c.self_intersecting, one.self_intersecting);
  }
}

Solid solid_of_shape(const TopoDS_Shape& shape) {
  std::vector<SolidFace> faces;
  for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) {
    faces.push_back({"face_" + std::to_string(faces.size() + 1)});
  }
  return make_solid_value(shape, std::move(faces));
}

TEST(Certificate, MeasuresTrimmedFacesOfAnyKind) {
  using std::numbers::pi;
  struct Truth {
    const char* name;
    TopoDS_Shape shape;
    double volume, area;
    int genus;
    Vec3 lowest, highest;
  };
  const gp_Ax2 axis(gp_Pnt(5, 5, -1), gp_Dir(0, 0, 1));
  const TopoDS_Shape drilled = BRepAlgoAPI_Cut(BRepPrimAPI_MakeBox(10, 10, 10).Shape(),
                                               BRepPrimAPI_MakeCylinder(axis, 2, 12).Shape())
                                   .Shape();
  gp_Trsf away;
  away.SetTranslation(gp_Vec(100, 200, 300));
  const std::vector<Truth> truths = {
      {"box", BRepPrimAPI_MakeBox(1, 2, 3).Shape(), 6, 22, 0, {0, 0, 0}, {1, 2, 3}},
      {"cylinder",
       BRepPrimAPI_MakeCylinder(2, 5).Shape(),
       20 * pi,
       28 * pi,
       0,
       {-2, -2, 0},
       {2, 2, 5}},
      {"sphere", BRepPrimAPI_MakeSphere(3).Shape(), 36 * pi, 36 * pi, 0, {-3, -3, -3}, {3, 3, 3}},
      {"torus",
       BRepPrimAPI_MakeTorus(4, 1).Shape(),
       8 * pi * pi,
       16 * pi * pi,
       1,
       {-5, -5, -1},
       {5, 5, 1}},
      {"cone", BRepPrimAPI_MakeCone(3, 0, 4).Shape(), 12 * pi, 24 * pi, 0, {-3, -3, 0}, {3, 3, 4}},
      {"drilled box", drilled, 1000 - 40 * pi, 600 - 8 * pi + 40 * pi, 1, {0, 0, 0}, {10, 10, 10}},
      {"drilled box as splines",
       BRepBuilderAPI_NurbsConvert(drilled).Shape(),
       1000 - 40 * pi,
       600 - 8 * pi + 40 * pi,
       1,
       {0, 0, 0},
       {10, 10, 10}},
      {"drilled box far away",
       drilled.Moved(TopLoc_Location(away)),
       1000 - 40 * pi,
       600 - 8 * pi + 40 * pi,
       1,
       {100, 200, 300},
       {110, 210, 310}}};
  for (const Truth& truth : truths) {
    SCOPED_TRACE(truth.name);
    const Certificate c = certify(solid_of_shape(truth.shape)).value();
    EXPECT_EQ(c.solids, 1);
    EXPECT_TRUE(c.closed);
    EXPECT_TRUE(c.valid);
    EXPECT_FALSE(c.self_intersecting);
    EXPECT_EQ(c.free_edges, 0);
    EXPECT_EQ(c.genus, truth.genus);
    EXPECT_NEAR(c.volume_mm3, truth.volume, 1e-8 * truth.volume);
    EXPECT_NEAR(c.area_mm2, truth.area, 1e-8 * truth.area);
    EXPECT_LT((c.lowest_mm - truth.lowest).cwiseAbs().maxCoeff(), 2e-7);
    EXPECT_LT((c.highest_mm - truth.highest).cwiseAbs().maxCoeff(), 2e-7);
    EXPECT_LT(c.max_gap_mm, 1e-7);
  }
  const Certificate box = certify(solid_of_shape(truths[0].shape)).value();
  EXPECT_EQ(box.smooth_edges, 12);
  EXPECT_NEAR(box.max_normal_angle_deg, 90.0, 1e-9);
}

TEST(Certificate, CallsAnOpenShapeOpen) {
  const TopoDS_Shape box = BRepPrimAPI_MakeBox(1, 1, 1).Shape();
  TopoDS_Compound five;
  BRep_Builder builder;
  builder.MakeCompound(five);
  int k = 0;
  for (TopExp_Explorer at(box, TopAbs_FACE); at.More(); at.Next(), ++k) {
    if (k > 0) builder.Add(five, at.Current());
  }
  const Certificate c = certify(solid_of_shape(five)).value();
  EXPECT_EQ(c.solids, 0);
  EXPECT_FALSE(c.closed);
  EXPECT_FALSE(c.valid);
  EXPECT_EQ(c.free_edges, 4);
  EXPECT_FALSE(c.genus);
  EXPECT_NEAR(c.area_mm2, 5.0, 1e-12);
  EXPECT_EQ(c.volume_mm3, 0.0);
}

TEST(Certificate, CallsASolidInsideOutInvalid) {
  const Certificate c =
      certify(solid_of_shape(BRepPrimAPI_MakeBox(1, 1, 1).Shape().Reversed())).value();
  EXPECT_NEAR(c.volume_mm3, -1.0, 1e-12);
  EXPECT_FALSE(c.valid);
}

TEST(Certificate, StopsOnRequest) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const Result<Certificate> c = certify(crafted::sheared_tube(1, 6), {}, progress);
  ASSERT_FALSE(c);
  EXPECT_EQ(c.error().kind, ErrorKind::kCancelled);
}

TEST(BoundaryMesh, IsClosedAndHasTheVolume) {
  for (const auto& [name, network] : all_samples()) {
    SCOPED_TRACE(name);
    const BoundaryModel model = boundary_of(network).value();
    std::vector<int> faces;
    for (std::size_t f = 0; f < model.faces.size(); ++f) faces.push_back(static_cast<int>(f));
    const BoundaryMesh mesh = mesh_boundary(model, faces);
    std::map<std::pair<int, int>, int> halves;
    double volume = 0;
    for (const auto& t : mesh.triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        const int a = t[k], b = t[(k + 1) % 3];
        halves[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
      }
      volume += mesh.points.col(t[0]).dot(mesh.points.col(t[1]).cross(mesh.points.col(t[2]))) / 6;
    }
    for (const auto& [edge, sum] : halves) EXPECT_EQ(sum, 0);
    const double exact = samples::exact_volume_mm3(network);
    EXPECT_NEAR(volume, exact, 0.05 * exact);
  }
}

TEST(TriangleCrossing, AgreesWithBruteForceOnRandomTriangles) {
  Random random(7);
  Points3 points(3, 600);
  std::vector<std::array<int, 3>> triangles;
  std::vector<int> groups;
  for (int t = 0; t < 200; ++t) {
    const Vec3 center(random.uniform(0, 4), random.uniform(0, 4), random.uniform(0, 4));
    for (int k = 0; k < 3; ++k) {
      points.col(3 * t + k) =
          center + Vec3(random.gaussian(), random.gaussian(), random.gaussian()) * 0.3;
    }
    triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    groups.push_back(t);
  }
  const std::vector<TriangleCrossing> found = crossing_triangles(points, triangles, groups);
  // Two triangles cross when the segment-plane signs and sides say so: an independent test.
  const auto volume = [&](const Vec3& a, const Vec3& b, const Vec3& c, const Vec3& d) {
    return (b - a).cross(c - a).dot(d - a);
  };
  const auto pierces = [&](const Vec3& p, const Vec3& q, int t) {
    const Vec3 a = points.col(3 * t), b = points.col(3 * t + 1), c = points.col(3 * t + 2);
    if ((volume(a, b, c, p) > 0) == (volume(a, b, c, q) > 0)) return false;
    const bool s0 = volume(p, q, a, b) > 0, s1 = volume(p, q, b, c) > 0,
               s2 = volume(p, q, c, a) > 0;
    return s0 == s1 && s1 == s2;
  };
  std::vector<std::array<int, 2>> expected;
  for (int i = 0; i < 200; ++i) {
    for (int j = i + 1; j < 200; ++j) {
      bool meet = false;
      for (int k = 0; k < 3; ++k) {
        meet = meet || pierces(points.col(3 * i + k), points.col(3 * i + (k + 1) % 3), j) ||
               pierces(points.col(3 * j + k), points.col(3 * j + (k + 1) % 3), i);
      }
      if (meet) expected.push_back({i, j});
    }
  }
  ASSERT_GT(expected.size(), 20U);
  ASSERT_EQ(found.size(), expected.size());
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_EQ(found[k].groups, expected[k]);
}

TEST(TriangleCrossing, CountsOverlapInOnePlaneButNotNeighbours) {
  Points3 points(3, 7);
  points << 0, 1, 0, 1, 0.2, 0.8, 0.2,  //
      0, 0, 1, 1, 0.2, 0.2, 0.8,        //
      0, 0, 0, 0, 0, 0, 0;
  // A square's two halves share an edge.
  EXPECT_TRUE(crossing_triangles(points, {{0, 1, 2}, {1, 3, 2}}, {0, 1}).empty());
  // A triangle that lies on one of them.
  EXPECT_EQ(crossing_triangles(points, {{0, 1, 2}, {4, 5, 6}}, {0, 1}).size(), 1U);
  EXPECT_TRUE(crossing_triangles(points, {}, {}).empty());
}

}  // namespace
}  // namespace angiospline
