#include <BRepCheck_Analyzer.hxx>
#include <BRepGProp.hxx>
#include <BRep_Tool.hxx>
#include <GProp_GProps.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <gtest/gtest.h>

#include "modeling/solid/solid.h"
#include "modeling/solid/solid_shape.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

struct Sample {
  const char* name;
  SurfaceNetwork network;
  int vertices, edges, faces;
};

std::vector<Sample> all_samples() {
  std::vector<Sample> samples;
  samples.push_back({"sheared tube", crafted::sheared_tube(1, 6, 1), 4, 6, 4});
  samples.push_back({"bent tube", samples::bent_tube(), 4, 6, 4});
  samples.push_back({"tube of quarters", crafted::tube_of_quarters(1, 6), 10, 16, 8});
  samples.push_back({"torus", samples::torus(), 4, 8, 4});
  samples.push_back({"one patch tube", crafted::one_patch_tube(1, 5), 2, 3, 3});
  samples.push_back({"creased tube", crafted::creased_tube(1, 6, 10), 6, 10, 6});
  return samples;
}

int count(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  TopTools_IndexedMapOfShape map;
  TopExp::MapShapes(shape, kind, map);
  return map.Extent();
}

double volume_of(const TopoDS_Shape& shape) {
  GProp_GProps properties;
  BRepGProp::VolumePropertiesGK(shape, properties, 1e-10);
  return properties.Mass();
}

TEST(MakeSolid, SharesEveryVertexAndEdgeAndClosesTheShell) {
  for (const Sample& sample : all_samples()) {
    SCOPED_TRACE(sample.name);
    const Result<Solid> solid = make_solid(sample.network);
    ASSERT_TRUE(solid) << solid.error().message();
    const TopoDS_Shape& shape = solid->shape->shape;
    EXPECT_EQ(shape.ShapeType(), TopAbs_SOLID);
    EXPECT_EQ(count(shape, TopAbs_SHELL), 1);
    EXPECT_EQ(count(shape, TopAbs_VERTEX), sample.vertices);
    EXPECT_EQ(count(shape, TopAbs_EDGE), sample.edges);
    EXPECT_EQ(count(shape, TopAbs_FACE), sample.faces);
    for (TopExp_Explorer at(shape, TopAbs_SHELL); at.More(); at.Next()) {
      EXPECT_TRUE(BRep_Tool::IsClosed(at.Current()));
    }
  }
}

TEST(MakeSolid, PassesOpenCascadesChecks) {
  for (const Sample& sample : all_samples()) {
    SCOPED_TRACE(sample.name);
    const Result<Solid> solid = make_solid(sample.network);
    ASSERT_TRUE(solid) << solid.error().message();
    EXPECT_TRUE(BRepCheck_Analyzer(solid->shape->shape).IsValid());
  }
}

TEST(MakeSolid, HasTheVolumeOfTheNetwork) {
  for (const Sample& sample : all_samples()) {
    SCOPED_TRACE(sample.name);
    const Result<Solid> solid = make_solid(sample.network);
    ASSERT_TRUE(solid) << solid.error().message();
    const double exact = samples::exact_volume_mm3(sample.network);
    EXPECT_GT(exact, 0);
    EXPECT_NEAR(volume_of(solid->shape->shape), exact, 1e-9 * exact);
  }
  // And the samples' own truth: a section's area times the length.
  EXPECT_NEAR(samples::exact_volume_mm3(crafted::sheared_tube(2, 6, 1)),
              4 * 6 * crafted::unit_disc_area(), 1e-9);
}

TEST(MakeSolid, IsExactSoThatTolerancesStaySmallest) {
  for (const Sample& sample : all_samples()) {
    SCOPED_TRACE(sample.name);
    const Result<Solid> solid = make_solid(sample.network);
    ASSERT_TRUE(solid) << solid.error().message();
    for (TopExp_Explorer at(solid->shape->shape, TopAbs_EDGE); at.More(); at.Next()) {
      EXPECT_LE(BRep_Tool::Tolerance(TopoDS::Edge(at.Current())), 1e-7);
    }
  }
}

TEST(MakeSolid, NamesFacesAfterRegionsAndRimsInTheOrderOfTheShape) {
  const Result<Solid> solid = make_solid(crafted::tube_of_quarters(1, 6));
  ASSERT_TRUE(solid) << solid.error().message();
  std::vector<std::string> names;
  for (const SolidFace& face : solid->faces) names.push_back(face.name);
  EXPECT_EQ(names, (std::vector<std::string>{"wall_1", "wall_1", "wall_2", "wall_2", "wall_2",
                                             "wall_2", "inlet", "outlet_2"}));
  EXPECT_EQ(solid->faces[0].kind, FaceKind::kWall);
  EXPECT_EQ(solid->faces[6].kind, FaceKind::kInlet);
  EXPECT_EQ(solid->faces[7].kind, FaceKind::kOutlet);
  EXPECT_EQ(solid->faces[0].radius_mm, 1.0);
  // The last face of the shape is the outlet's cap, at the far end.
  TopTools_IndexedMapOfShape faces;
  TopExp::MapShapes(solid->shape->shape, TopAbs_FACE, faces);
  GProp_GProps properties;
  BRepGProp::SurfaceProperties(faces(8), properties, 1e-9);
  EXPECT_NEAR(properties.CentreOfMass().Z(), 6.0, 1e-9);
  EXPECT_NEAR(properties.Mass(), crafted::unit_disc_area(), 1e-7);
}

TEST(MakeSolid, GivesOneSolidForEachComponent) {
  SurfaceNetwork two = crafted::sheared_tube(1, 6);
  SurfaceNetwork other = samples::torus(3, 1);
  other.control_points_mm.row(0).array() += 20;
  append(two, other);
  const Result<Solid> solid = make_solid(two);
  ASSERT_TRUE(solid) << solid.error().message();
  EXPECT_EQ(count(solid->shape->shape, TopAbs_SOLID), 2);
  EXPECT_EQ(solid->faces.size(), 8U);
  EXPECT_EQ(solid->faces[3].name, "outlet_2");  // caps stand with their component
  EXPECT_TRUE(BRepCheck_Analyzer(solid->shape->shape).IsValid());
}

TEST(MakeSolid, StatesTheGapThatItMeasuredAsTolerance) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  // Give one half its own copy of a control point at a seam, 1e-5 mm away.
  Patch& patch = network.patches[1];
  const Eigen::Index fresh = network.control_points_mm.cols();
  network.control_points_mm.conservativeResize(Eigen::NoChange, fresh + 1);
  network.control_points_mm.col(fresh) =
      network.control_points_mm.col(patch.control[2]) + Vec3(1e-5, 0, 0);
  patch.control[2] = static_cast<int>(fresh);
  const Result<Solid> solid = make_solid(network);
  ASSERT_TRUE(solid) << solid.error().message();
  double largest = 0;
  for (TopExp_Explorer at(solid->shape->shape, TopAbs_EDGE); at.More(); at.Next()) {
    largest = std::max(largest, BRep_Tool::Tolerance(TopoDS::Edge(at.Current())));
  }
  const double gap = 1e-5 * 0.3456;  // the largest value of the quintic's third basis function
  EXPECT_GE(largest, gap);
  EXPECT_LE(largest, 2 * gap);
  EXPECT_TRUE(BRepCheck_Analyzer(solid->shape->shape).IsValid());
}

TEST(MakeSolid, RefusesJoinsThatAreOpen) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  Patch& patch = network.patches[1];
  const Eigen::Index fresh = network.control_points_mm.cols();
  network.control_points_mm.conservativeResize(Eigen::NoChange, fresh + 1);
  network.control_points_mm.col(fresh) =
      network.control_points_mm.col(patch.control[2]) + Vec3(0.1, 0, 0);
  patch.control[2] = static_cast<int>(fresh);
  const Result<Solid> solid = make_solid(network);
  ASSERT_FALSE(solid);
  EXPECT_EQ(solid.error().what, "joined sides are not the same curve");
  EXPECT_NE(solid.error().where.find("wall_1"), std::string::npos);
}

TEST(MakeSolid, RefusesRimsThatAreNotPlane) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  network.control_points_mm(2, network.patches[0].control[2 * 6 + 5]) += 0.5;
  const Result<Solid> solid = make_solid(network);
  ASSERT_FALSE(solid);
  EXPECT_EQ(solid.error().what, "rim is not plane");
  EXPECT_EQ(solid.error().where, "outlet_2");
}

TEST(MakeSolid, RefusesWallsThatAreInsideOut) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  network.control_points_mm.row(0) *= -1;  // a mirror image
  const Result<Solid> solid = make_solid(network);
  ASSERT_FALSE(solid);
  EXPECT_EQ(solid.error().what, "component is inside out");
}

// A bulb on a very long, very thin stem: the cones from the stem's foot to its faces cancel to a
// millionth, as they do in a component of ten thousand branches.
SurfaceNetwork bulb_on_a_stem(double stem_mm) {
  SurfaceNetwork network = samples::tube(1.0, 5.0, 40);
  Points3& points = network.control_points_mm;
  const double foot = points.row(2).minCoeff(), length = points.row(2).maxCoeff() - foot;
  for (Eigen::Index k = 0; k < points.cols(); ++k) {
    const double along = (points(2, k) - foot) / length;
    points(2, k) = stem_mm * std::min(2 * along, 1.0) + along;
    points.col(k).head<2>() *= std::clamp(4 * (along - 0.5), 1e-3, 1.0);
  }
  for (Rim& rim : network.rims) {
    rim.center_mm.z() = rim.center_mm.z() - foot < length / 2 ? 0.0 : stem_mm + 1.0;
  }
  return network;
}

TEST(MakeSolid, SeesTheSideOfAWallWhoseVolumeCancels) {
  for (const double stem_mm : {1.0, 1e3, 1e5}) {
    SurfaceNetwork network = bulb_on_a_stem(stem_mm);
    const Result<Solid> solid = make_solid(network);
    EXPECT_TRUE(solid) << stem_mm << ": " << solid.error().message();
    network.control_points_mm.row(0) *= -1;
    for (Rim& rim : network.rims) rim.center_mm.x() *= -1;
    EXPECT_FALSE(make_solid(network)) << stem_mm;
  }
}

TEST(MakeSolid, RefusesPatchesWhoseNormalsDisagree) {
  SurfaceNetwork network = crafted::sheared_tube(1, 6);
  // Turn patch 1 inside out: transpose its net, and with it the sides that name it.
  Patch& patch = network.patches[1];
  std::vector<int> transposed;
  for (int j = 0; j < 6; ++j) {
    for (int i = 0; i < 6; ++i)
      transposed.push_back(patch.control[static_cast<std::size_t>(i * 6 + j)]);
  }
  patch.control = transposed;
  const auto turn = [](Side& side) {
    if (side.patch != 1) return;
    switch (side.side) {
      case PatchSide::kU0:
        side.side = PatchSide::kV0;
        break;
      case PatchSide::kU1:
        side.side = PatchSide::kV1;
        break;
      case PatchSide::kV0:
        side.side = PatchSide::kU0;
        break;
      case PatchSide::kV1:
        side.side = PatchSide::kU1;
        break;
    }
  };
  for (Join& join : network.joins) turn(join.a), turn(join.b);
  for (Rim& rim : network.rims) {
    for (Side& side : rim.sides) turn(side);
  }
  const Result<Solid> solid = make_solid(network);
  ASSERT_FALSE(solid);
  EXPECT_EQ(solid.error().what, "normals disagree across a join");
}

TEST(MakeSolid, RefusesAnEmptyNetwork) { EXPECT_FALSE(make_solid(SurfaceNetwork{})); }

TEST(FaceNames, TellTheKind) {
  EXPECT_EQ(kind_of_name("inlet"), FaceKind::kInlet);
  EXPECT_EQ(kind_of_name("Outlet_17"), FaceKind::kOutlet);
  EXPECT_EQ(kind_of_name("cap_3"), FaceKind::kCap);
  EXPECT_EQ(kind_of_name("wall_4"), FaceKind::kWall);
  EXPECT_EQ(kind_of_name("junction_4"), FaceKind::kWall);
  EXPECT_EQ(kind_of_name(""), FaceKind::kWall);
  for (const FaceKind kind : {FaceKind::kInlet, FaceKind::kOutlet, FaceKind::kCap}) {
    EXPECT_EQ(kind_of_name(to_string(kind)), kind);
  }
}

}  // namespace
}  // namespace angiospline
