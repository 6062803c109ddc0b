// Our files in other programs. Each test skips, and says so, where the program is not installed.
#include <array>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/index.h"
#include "io/cad/gmsh_script.h"
#include "io/cad/iges_file.h"
#include "io/cad/step_file.h"
#include "io/export/export_model.h"
#include "io/model/certificate_json.h"
#include "modeling/build/build_model.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/paths.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

struct Outcome {
  int code = -1;
  std::string output;
};

Outcome run(const std::string& command) {
  Outcome result;
  FILE* pipe = ::popen((command + " 2>&1 </dev/null").c_str(), "r");
  if (pipe == nullptr) return result;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr) {
    result.output += buffer.data();
  }
  result.code = ::pclose(pipe);
  return result;
}

bool is_installed(const std::string& program) { return run("command -v " + program).code == 0; }

// A tube with T-vertices and, apart from it, a bent one: two solids, eight kinds of faces.
SurfaceNetwork two_tubes() {
  SurfaceNetwork network = crafted::tube_of_quarters(1, 6);
  SurfaceNetwork other = samples::bent_tube();
  other.control_points_mm.row(0).array() += 20;
  for (Rim& rim : other.rims) {
    rim.center_mm.x() += 20;
    rim.name += "_b";
  }
  append(network, other);
  return network;
}

// A bifurcation, or a small tree of three junctions of which one has four branches.
CenterlineTree straight_tree(const std::vector<Vec3>& nodes,
                             const std::vector<std::array<int, 2>>& branches,
                             const std::vector<double>& radii_mm) {
  CenterlineTree tree;
  for (std::size_t n = 0; n < nodes.size(); ++n)
    tree.nodes.push_back({std::string("n").append(std::to_string(n)), nodes[n]});
  for (std::size_t b = 0; b < branches.size(); ++b) {
    const auto& [from, to] = branches[b];
    CenterlineBranch branch{std::string("b").append(std::to_string(b)), from, to, Points3(3, 9),
                            Eigen::VectorXd::Constant(9, radii_mm[b])};
    for (int k = 0; k < 9; ++k)
      branch.points_mm.col(k) =
          nodes[index(from)] + k / 8.0 * (nodes[index(to)] - nodes[index(from)]);
    tree.branches.push_back(branch);
  }
  return tree;
}

CenterlineTree bifurcation() {
  return straight_tree({{0, 0, 0}, {0, 0, 20}, {10, 0, 36}, {-9, 3, 34}}, {{0, 1}, {1, 2}, {1, 3}},
                       {2.0, 1.6, 1.4});
}

CenterlineTree small_tree() {
  return straight_tree({{0, 0, 0},
                        {0, 0, 24},
                        {16, 0, 44},
                        {-16, 4, 42},
                        {12, 4, 66},
                        {34, 0, 52},
                        {20, -20, 56},
                        {-14, -16, 58},
                        {-30, 14, 52}},
                       {{0, 1}, {1, 2}, {1, 3}, {2, 4}, {2, 5}, {2, 6}, {3, 7}, {3, 8}},
                       {3.0, 2.4, 2.2, 1.5, 1.6, 1.4, 1.5, 1.4});
}

class ExternalPrograms : public testing::Test {
 protected:
  ExternalPrograms() {
    folder_ = fs::temp_directory_path() / ("angiospline_programs_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    solid_ = make_solid(two_tubes()).value();
  }
  ~ExternalPrograms() override { fs::remove_all(folder_); }

  std::string at(const char* name) const { return (folder_ / name).string(); }

  // What Gmsh makes of the solid by its script: no error, and every face a group of the right area.
  void expect_gmsh_meshes(const Solid& solid) const {
    ASSERT_TRUE(write_step(solid, at("model.step")));
    ASSERT_TRUE(write_gmsh_script(solid, at("model.step"), at("model.geo")));
    ASSERT_TRUE(write_file(at("model.json"), to_json(certify(solid).value()).dump()));
    const Outcome mesh = run("gmsh -3 -format msh2 -o " + at("model.msh") + " " + at("model.geo"));
    EXPECT_EQ(mesh.code, 0);
    EXPECT_EQ(mesh.output.find("Error"), std::string::npos) << mesh.output;
    const Outcome groups = run("/usr/bin/python3 " + testing_paths::source_folder().string() +
                               "/tests/io/export/programs/check_mesh_groups.py " +
                               at("model.json") + " " + at("model.msh"));
    EXPECT_EQ(groups.code, 0) << groups.output;
  }

  // What FreeCAD says of a CAD file: "solids 1 valid True closed True faces 9".
  std::string opened_by_freecad(const std::string& file) const {
    EXPECT_TRUE(write_file(at("open.py"),
                           "import Part\n"
                           "s = Part.Shape()\n"
                           "s.read('" +
                               file +
                               "')\n"
                               "print('solids', len(s.Solids), 'valid', s.isValid(), 'closed', "
                               "all(x.isClosed() for x in s.Shells), 'faces', len(s.Faces))\n"));
    return run("freecadcmd " + at("open.py")).output;
  }

  // Meshes the STEP file of a solid with Netgen and looks for every face's name; nothing where
  // Netgen does not start.
  std::optional<std::string> netgen_volume(const Solid& solid) const {
    // Debian's netgen asks for a library without its version: only libnglib-dev has the link.
    const std::string libraries = "/usr/lib/x86_64-linux-gnu/netgen";
    fs::create_symlink(libraries + "/libgui.so.6.2", folder_ / "libgui.so");
    if (!write_step(solid, at("model.step"))) return std::nullopt;
    const Outcome mesh = run("LD_LIBRARY_PATH=" + folder_.string() + ":" + libraries +
                             " netgen -batchmode -coarse -geofile=" + at("model.step") +
                             " -meshfile=" + at("model.vol"));
    if (mesh.output.find("couldn't load file") != std::string::npos) return std::nullopt;
    const auto volume = read_file(at("model.vol"));
    EXPECT_TRUE(volume) << mesh.output;
    return volume ? *volume : std::string();
  }

  fs::path folder_;
  Solid solid_;
};

TEST_F(ExternalPrograms, GmshMeshesTheStepAndKeepsOurNamesThroughTheScript) {
  if (!is_installed("gmsh")) GTEST_SKIP() << "gmsh is not installed";
  expect_gmsh_meshes(solid_);
}

TEST_F(ExternalPrograms, GmshMeshesABifurcationAndATreeByTheirNames) {
  if (!is_installed("gmsh")) GTEST_SKIP() << "gmsh is not installed";
  for (const CenterlineTree& tree : {bifurcation(), small_tree()}) {
    const auto model = build_model(tree);
    ASSERT_TRUE(model) << model.error().message();
    expect_gmsh_meshes(make_solid(model->network).value());
  }
}

// Gmsh's own element size is a tenth of the model's diagonal, wider than this vessel: it is the
// edges, cut into short pieces, that make it mesh finely enough.
TEST_F(ExternalPrograms, GmshMeshesTheStepOfALongThinVesselWithoutAnyOption) {
  if (!is_installed("gmsh")) GTEST_SKIP() << "gmsh is not installed";
  const Model model = samples::model_of(samples::tube(1.0, 60.0));
  ASSERT_TRUE(export_model(model, {at("long.step")}));
  const Outcome mesh = run("gmsh -3 -o " + at("long.msh") + " " + at("long.step"));
  EXPECT_EQ(mesh.code, 0);
  EXPECT_EQ(mesh.output.find("Error"), std::string::npos) << mesh.output;
  EXPECT_EQ(mesh.output.find("Warning"), std::string::npos) << mesh.output;
}

TEST_F(ExternalPrograms, FreeCadOpensTheIgesAsValidClosedSolids) {
  if (!is_installed("freecadcmd")) GTEST_SKIP() << "freecadcmd is not installed";
  ASSERT_TRUE(write_iges(solid_, at("model.igs")));
  const std::string opened = opened_by_freecad(at("model.igs"));
  EXPECT_NE(opened.find("solids 2 valid True closed True faces 12"), std::string::npos) << opened;
}

TEST_F(ExternalPrograms, FreeCadOpensABifurcationAndATreeAsOneValidClosedSolid) {
  if (!is_installed("freecadcmd")) GTEST_SKIP() << "freecadcmd is not installed";
  for (const CenterlineTree& tree : {bifurcation(), small_tree()}) {
    const auto model = build_model(tree);
    ASSERT_TRUE(model) << model.error().message();
    const Solid solid = make_solid(model->network).value();
    ASSERT_TRUE(write_iges(solid, at("model.igs")));
    ASSERT_TRUE(write_step(solid, at("model.step")));
    const std::string expected =
        "solids 1 valid True closed True faces " + std::to_string(solid.faces.size());
    for (const char* file : {"model.igs", "model.step"}) {
      const std::string opened = opened_by_freecad(at(file));
      EXPECT_NE(opened.find(expected), std::string::npos) << file << ": " << opened;
    }
  }
}

TEST_F(ExternalPrograms, NetgenMeshesTheStepAndShowsOurNames) {
  if (!is_installed("netgen")) GTEST_SKIP() << "netgen is not installed";
  const Solid one = make_solid(crafted::tube_of_quarters(1, 6)).value();
  const auto volume = netgen_volume(one);
  if (!volume) GTEST_SKIP() << "netgen does not start here";
  const std::size_t names = volume->find("bcnames");
  ASSERT_NE(names, std::string::npos);
  for (const SolidFace& face : one.faces) {
    EXPECT_NE(volume->find(face.name, names), std::string::npos) << face.name;
  }
}

TEST_F(ExternalPrograms, NetgenMeshesABifurcationAndShowsOurNames) {
  if (!is_installed("netgen")) GTEST_SKIP() << "netgen is not installed";
  const auto model = build_model(bifurcation());
  ASSERT_TRUE(model) << model.error().message();
  const Solid solid = make_solid(model->network).value();
  const auto volume = netgen_volume(solid);
  if (!volume) GTEST_SKIP() << "netgen does not start here";
  const std::size_t names = volume->find("bcnames");
  ASSERT_NE(names, std::string::npos);
  for (const SolidFace& face : solid.faces) {
    EXPECT_NE(volume->find(face.name, names), std::string::npos) << face.name;
  }
  EXPECT_EQ(volume->find("volumeelements\n0\n"), std::string::npos) << "no tetrahedra";
}

}  // namespace
}  // namespace angiospline
