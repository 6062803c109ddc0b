#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <Eigen/Geometry>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/centerlines/vtp_writer.h"
#include "io/export/export_model.h"
#include "io/meshes/glb_file.h"
#include "io/meshes/palette.h"
#include "io/meshes/stl_file.h"
#include "io/meshes/vtk_file.h"
#include "io/text/text_encoding.h"
#include "modeling/network/tessellation.h"
#include "tests/shapes/paths.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

TriangleMesh sample_mesh() {
  auto t = tessellate(samples::tube_with_t_vertex());
  EXPECT_TRUE(t);
  return t->mesh;
}

MeshField height_of(const TriangleMesh& mesh) {
  return {"height_mm", mesh.points_mm.row(2).transpose().array() - 1};
}

class MeshFiles : public testing::Test {
 protected:
  void SetUp() override {
    folder_ =
        fs::temp_directory_path() / ("mesh_files_" + std::to_string(::getpid()) + "_" +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path folder_;
};

// The parts of a GLB, read by hand: the JSON chunk and the binary chunk.
struct Glb {
  nlohmann::json json;
  std::string bytes;

  explicit Glb(const std::string& file) {
    const auto u32 = [&](std::size_t at) {
      std::uint32_t v = 0;
      std::memcpy(&v, file.data() + at, 4);
      return v;
    };
    EXPECT_EQ(u32(0), 0x46546C67U);
    EXPECT_EQ(u32(8), file.size());
    const std::size_t length = u32(12);
    json = nlohmann::json::parse(file.substr(20, length));
    bytes = file.substr(20 + length + 8);
  }

  template <typename T>
  std::vector<T> array(int accessor) const {
    const auto& a = json["accessors"][static_cast<std::size_t>(accessor)];
    const auto& view = json["bufferViews"][a["bufferView"].get<std::size_t>()];
    std::vector<T> items(a["count"].get<std::size_t>());
    std::memcpy(static_cast<void*>(items.data()), bytes.data() + view.value("byteOffset", 0),
                items.size() * sizeof(T));
    return items;
  }
};

TEST_F(MeshFiles, GlbHasANodeForEachPartInMetresAndYUp) {
  const TriangleMesh mesh = sample_mesh();
  const auto bytes = mesh_to_glb(mesh, {.name = "tube"});
  ASSERT_TRUE(bytes) << bytes.error().message();
  const Glb glb(*bytes);
  EXPECT_EQ(glb.json["nodes"][0]["name"], "tube");
  ASSERT_EQ(glb.json["nodes"].size(), 5u);
  double volume_m3 = 0;
  std::size_t triangles = 0;
  for (std::size_t n = 1; n < 5; ++n) {
    EXPECT_EQ(glb.json["nodes"][n]["name"], mesh.parts[n - 1].name);
    const auto& primitive = glb.json["meshes"][n - 1]["primitives"][0];
    const auto points = glb.array<Eigen::Vector3f>(primitive["attributes"]["POSITION"]);
    const auto normals = glb.array<Eigen::Vector3f>(primitive["attributes"]["NORMAL"]);
    const auto indices = glb.array<std::uint16_t>(primitive["indices"]);
    triangles += indices.size() / 3;
    for (std::size_t k = 0; k < indices.size(); k += 3) {
      const Vec3 a = points[indices[k]].cast<double>();
      const Vec3 b = points[indices[k + 1]].cast<double>();
      const Vec3 c = points[indices[k + 2]].cast<double>();
      volume_m3 += a.dot(b.cross(c)) / 6;
      EXPECT_GT((b - a).cross(c - a).dot(normals[indices[k]].cast<double>()), 0);
    }
    for (const auto& p : points) {  // the tube runs along z: up, which is Y in glTF
      EXPECT_GE(p.y(), -1e-9F);
      EXPECT_LE(p.y(), 0.005001F);
    }
  }
  EXPECT_EQ(triangles, static_cast<std::size_t>(mesh.triangles.cols()));
  EXPECT_NEAR(volume_m3 * 1e9, measure(mesh).volume_mm3, 1e-5);  // positive: not mirrored
  EXPECT_EQ(gltf_from_world({1000, 2000, 3000}), Vec3(1, 3, -2));
}

TEST_F(MeshFiles, GlbCarriesAFieldAsColours) {
  const TriangleMesh mesh = sample_mesh();
  const MeshField field = height_of(mesh);
  const auto bytes = mesh_to_glb(mesh, {.name = "tube", .field = field});
  ASSERT_TRUE(bytes);
  const Glb glb(*bytes);
  const auto& wall = glb.json["meshes"][0]["primitives"][0]["attributes"];
  EXPECT_TRUE(wall.contains("COLOR_0"));
  EXPECT_FALSE(glb.json["meshes"][2]["primitives"][0]["attributes"].contains("COLOR_0"));
  EXPECT_EQ(glb.json["nodes"][0]["extras"]["field"], "height_mm");
  EXPECT_DOUBLE_EQ(glb.json["nodes"][0]["extras"]["high"], 4);
  EXPECT_DOUBLE_EQ(glb.json["nodes"][0]["extras"]["low"], -4);
  const auto points = glb.array<Eigen::Vector3f>(wall["POSITION"]);
  const auto colours = glb.array<Eigen::Vector4f>(wall["COLOR_0"]);
  const Vec3 expected = linear_from_srgb(diverging_colour((1000.0 * points[5].y() - 1 + 4) / 8));
  EXPECT_LT((colours[5].head<3>().cast<double>() - expected).norm(), 1e-5);
}

TEST_F(MeshFiles, GlbPassesTheKhronosValidator) {
  const char* modules = std::getenv("ANGIOSPLINE_NODE_MODULES");
  if (modules == nullptr) {
    GTEST_SKIP()
        << "ANGIOSPLINE_NODE_MODULES is not set: the folder in which npm installed gltf-validator";
  }
  TriangleMesh strange = sample_mesh();
  strange.parts[0].name = "wall \"\xff\" \u00b5";
  strange.normals.setZero();
  TriangleMesh large = tessellate(samples::torus(), {.chord_tolerance = 2e-5})->mesh;
  EXPECT_GT(large.points_mm.cols(), 70000);
  int ran = 0;
  for (const auto& [mesh, with_field] :
       {std::pair{sample_mesh(), false}, std::pair{sample_mesh(), true}, std::pair{strange, false},
        std::pair{large, true}}) {
    GlbOptions options;
    if (with_field) options.field = height_of(mesh);
    const fs::path path = folder_ / ("m" + std::to_string(ran++) + ".glb");
    ASSERT_TRUE(write_glb(path, mesh, options));
    const std::string command = std::string("NODE_PATH='") + modules + "' node " +
                                testing_paths::source_folder().string() +
                                "/tests/io/meshes/validate_glb.js " + path.string() + " 2>&1";
    std::string output;
    std::FILE* const pipe = ::popen(command.c_str(), "r");
    ASSERT_NE(pipe, nullptr);
    for (int c = 0; (c = std::fgetc(pipe)) != EOF;) output += static_cast<char>(c);
    EXPECT_EQ(::pclose(pipe), 0);
    EXPECT_EQ(output, "0 0 0 0\n");
  }
  EXPECT_EQ(ran, 4);
}

TEST_F(MeshFiles, OfVeryLargeModelsAreCoarserByDefaultAndSaidToBe) {
  const Model model = samples::model_of(samples::bent_tube());
  const std::vector<fs::path> paths{folder_ / "m.glb", folder_ / "m.stl"};
  ExportOptions options;
  const auto usual = export_model(model, paths, options);
  ASSERT_TRUE(usual) << usual.error().message();
  EXPECT_TRUE(usual->warnings.empty());
  const auto bytes = fs::file_size(paths[0]);

  options.tessellation.most_triangles = 400;
  const auto coarse = export_model(model, paths, options);
  ASSERT_TRUE(coarse) << coarse.error().message();
  ASSERT_EQ(coarse->warnings.size(), 1U);  // one mesh, two files
  EXPECT_NE(coarse->warnings[0].text.find("instead of 0.01, so that there are at most 400"),
            std::string::npos)
      << coarse->warnings[0].text;
  EXPECT_LT(fs::file_size(paths[0]), bytes);

  options.tessellation.coarsen = false;
  const auto refused = export_model(model, paths, options);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().rule.find("with a tolerance of"), std::string::npos);
}

TEST_F(MeshFiles, NothingIsNotWritten) {
  EXPECT_FALSE(write_glb(folder_ / "a.glb", TriangleMesh{}));
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(MeshFiles, AsciiStlReadsBackTheSameClosedMeshAndNames) {
  const TriangleMesh mesh = sample_mesh();
  ASSERT_TRUE(write_stl(folder_ / "a.stl", mesh));
  const auto back = read_stl(folder_ / "a.stl");
  ASSERT_TRUE(back) << back.error().message();
  ASSERT_EQ(back->triangles.cols(), mesh.triangles.cols());
  EXPECT_EQ(back->points_mm.cols(), mesh.points_mm.cols());
  ASSERT_EQ(back->parts.size(), mesh.parts.size());
  for (std::size_t p = 0; p < mesh.parts.size(); ++p) {
    EXPECT_EQ(back->parts[p].name, mesh.parts[p].name);
    EXPECT_EQ(back->parts[p].kind, mesh.parts[p].kind);
  }
  const MeshMeasure a = measure(mesh);
  const MeshMeasure b = measure(*back);
  EXPECT_TRUE(b.closed());
  EXPECT_EQ(a.genus, b.genus);
  EXPECT_NEAR(a.volume_mm3, b.volume_mm3, 1e-7);
  EXPECT_LT((a.lowest_mm - b.lowest_mm).norm(), 1e-8);
  EXPECT_LT((a.highest_mm - b.highest_mm).norm(), 1e-8);
}

TEST_F(MeshFiles, BinaryStlStaysClosed) {
  const TriangleMesh mesh = sample_mesh();
  const std::string bytes = mesh_to_stl(mesh, {.format = StlFormat::kBinary});
  EXPECT_EQ(bytes.size(), 84 + 50 * static_cast<std::size_t>(mesh.triangles.cols()));
  const auto back = mesh_from_stl(bytes, "a.stl");
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_TRUE(measure(*back).closed());
  EXPECT_EQ(back->parts.size(), 4u);
  EXPECT_NEAR(measure(*back).volume_mm3, measure(mesh).volume_mm3, 1e-5);
  EXPECT_FALSE(mesh_from_stl(std::string_view(bytes).substr(0, bytes.size() - 1), "a.stl"));
  std::string wrong = bytes;
  std::memset(wrong.data() + 84 + 12, 0xff, 4);
  ASSERT_FALSE(mesh_from_stl(wrong, "a.stl"));
  EXPECT_EQ(mesh_from_stl(wrong, "a.stl").error().where, "a.stl: facet 1");
}

TEST_F(MeshFiles, FlowStlHasOneWallAndTheRims) {
  TriangleMesh mesh = sample_mesh();
  mesh.parts[3].name = "outlet 7/left";
  const auto back = mesh_from_stl(mesh_to_stl(mesh, {.grouping = StlGrouping::kFlow}), "a.stl");
  ASSERT_TRUE(back);
  std::vector<std::string> names;
  for (const MeshPart& part : back->parts) names.push_back(part.name);
  EXPECT_EQ(names, (std::vector<std::string>{"wall", "inlet", "outlet_7_left"}));
  EXPECT_TRUE(measure(*back).closed());
}

TEST_F(MeshFiles, BrokenStlIsRefusedWithItsLine) {
  const std::string facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n";
  const auto message = [](const std::string& text) {
    const auto result = mesh_from_stl(text, "a.stl");
    return result ? std::string("accepted") : result.error().message();
  };
  EXPECT_EQ(message("solid a\n" + facet + "vertex 0 1 0\nendloop\nendfacet\nendsolid a\n"),
            "accepted");
  EXPECT_EQ(message("SOLID a\r\n" + facet + "vertex 0 1 0\r\nENDLOOP\nendfacet\nendsolid\n"),
            "accepted");
  EXPECT_EQ(message("solid a\n" + facet + "vertex 0 nan 0\n"),
            "a.stl:6: not a finite number: nan (a vertex has three)");
  EXPECT_EQ(message("solid a\n" + facet + "vertex 0 1\n"),
            "a.stl:6: not a finite number (a vertex has three)");
  EXPECT_EQ(message("solid a\n" + facet + "endloop\nendfacet\n"),
            "a.stl:7: facet is not complete: 2 (a facet has three vertices)");
  EXPECT_EQ(message("solid a\n" + facet),
            "a.stl:5: file ends inside a solid (the last line is endsolid)");
  EXPECT_EQ(message("solid a\nendsolid a\n"), "a.stl:2: no facet (a mesh has facets)");
  EXPECT_EQ(
      message("solid a\nbanana\n"),
      "a.stl:2: unknown keyword: banana (solid, facet, outer loop, vertex, endloop, endfacet, "
      "endsolid)");
  EXPECT_EQ(message(""), "a.stl: not an STL file, or cut short: 0 bytes (text starts with solid)");
  EXPECT_FALSE(mesh_from_stl(std::string(84, '\0'), "a.stl"));
}

TEST_F(MeshFiles, VtkFilesReadBackWithTheirParts) {
  const TriangleMesh mesh = sample_mesh();
  for (const char* name : {"a.vtp", "a.vtu", "b.VTU"}) {
    SCOPED_TRACE(name);
    ASSERT_TRUE(write_vtk_mesh(folder_ / name, mesh, {height_of(mesh)}));
    const auto back = read_vtk_mesh(folder_ / name);
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->points_mm, mesh.points_mm);
    EXPECT_EQ(back->triangles, mesh.triangles);
    EXPECT_EQ(back->part_of, mesh.part_of);
    ASSERT_EQ(back->parts.size(), mesh.parts.size());
    EXPECT_EQ(back->parts[3].name, "outlet_end");
    EXPECT_EQ(back->parts[3].kind, PartKind::kOutlet);
    const std::string text = *read_file(folder_ / name);
    for (const char* array : {"ModelFaceID", "CellEntityIds", "FaceNames", "height_mm"}) {
      EXPECT_NE(text.find(array), std::string::npos) << array;
    }
  }
  EXPECT_FALSE(write_vtk_mesh(folder_ / "a.txt", mesh));
  ASSERT_TRUE(write_file(folder_ / "broken.vtp", "<VTKFile type=\"PolyData\"><Pol"));
  EXPECT_FALSE(read_vtk_mesh(folder_ / "broken.vtp"));
  EXPECT_FALSE(read_vtk_mesh(folder_ / "none.vtp"));
}

TEST_F(MeshFiles, CenterlinesKeepPointsAndRadii) {
  const Model model = samples::model_of(samples::tube());
  ASSERT_TRUE(write_vtk_centerlines(folder_ / "c.vtp", model.tree));
  const std::string text = *read_file(folder_ / "c.vtp");
  EXPECT_NE(text.find("MaximumInscribedSphereRadius"), std::string::npos);
  EXPECT_NE(text.find("NumberOfLines=\"1\""), std::string::npos);
  EXPECT_NE(text.find("NumberOfPoints=\"3\""), std::string::npos);
}

TEST(TextEncoding, RepairsTextAndMakesWords) {
  EXPECT_EQ(valid_utf8("a\u00b5\u4e2d\U0001F600"), "a\u00b5\u4e2d\U0001F600");
  EXPECT_EQ(valid_utf8("a\xff\xc3"), "a\uFFFD\uFFFD");
  EXPECT_EQ(valid_utf8("\xc0\xaf"), "\uFFFD\uFFFD");            // overlong
  EXPECT_EQ(valid_utf8("\xed\xa0\x80"), "\uFFFD\uFFFD\uFFFD");  // a surrogate
  EXPECT_EQ(word("outlet 7/\u00e4"), "outlet_7___");
  EXPECT_EQ(word("7"), "_7");
  EXPECT_EQ(word(""), "_");
}

TEST(Palette, ScalesAreSymmetricWhereSignsDiffer) {
  MeshField field{"x", Eigen::Vector3d(-1, 3, std::nan(""))};
  const ColourScale scale = scale_of(field);
  EXPECT_EQ(scale.low, -3);
  EXPECT_EQ(scale.high, 3);
  EXPECT_EQ(css(scale.colour(3)), "#b2182b");
  EXPECT_EQ(css(scale.colour(std::nan(""))), "#b0b0b0");
  EXPECT_EQ(css(sequential_colour(-5)), "#440154");
  field.values.setZero();
  EXPECT_EQ(css(scale_of(field).colour(0)), css(sequential_colour(0.5)));
}

}  // namespace
}  // namespace angiospline
