// Our files in other programs. Each test skips, and says so, where the program is not installed.
#include <array>
#include <cstdio>
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/cad/gmsh_script.h"
#include "io/cad/iges_file.h"
#include "io/cad/step_file.h"
#include "io/export/export_model.h"
#include "io/model/certificate_json.h"
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

class ExternalPrograms : public testing::Test {
 protected:
  ExternalPrograms() {
    folder_ = fs::temp_directory_path() / ("angiospline_programs_" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    solid_ = make_solid(two_tubes()).value();
  }
  ~ExternalPrograms() override { fs::remove_all(folder_); }

  std::string at(const char* name) const { return (folder_ / name).string(); }

  fs::path folder_;
  Solid solid_;
};

TEST_F(ExternalPrograms, GmshMeshesTheStepAndKeepsOurNamesThroughTheScript) {
  if (!is_installed("gmsh")) GTEST_SKIP() << "gmsh is not installed";
  ASSERT_TRUE(write_step(solid_, at("model.step")));
  ASSERT_TRUE(write_gmsh_script(solid_, at("model.step"), at("model.geo")));
  ASSERT_TRUE(write_file(at("model.json"), to_json(certify(solid_).value()).dump()));
  const Outcome mesh = run("gmsh -3 -format msh2 -o " + at("model.msh") + " " + at("model.geo"));
  EXPECT_EQ(mesh.code, 0);
  EXPECT_EQ(mesh.output.find("Error"), std::string::npos) << mesh.output;
  const Outcome groups = run("/usr/bin/python3 " + testing_paths::source_folder().string() +
                             "/tests/io/export/programs/check_mesh_groups.py " + at("model.json") +
                             " " + at("model.msh"));
  EXPECT_EQ(groups.code, 0) << groups.output;
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
  ASSERT_TRUE(write_file(at("open.py"),
                         "import Part\n"
                         "s = Part.Shape()\n"
                         "s.read('" +
                             at("model.igs") +
                             "')\n"
                             "print('solids', len(s.Solids), 'valid', s.isValid(), 'closed', "
                             "all(x.isClosed() for x in s.Shells), 'faces', len(s.Faces))\n"));
  const Outcome opened = run("freecadcmd " + at("open.py"));
  EXPECT_NE(opened.output.find("solids 2 valid True closed True faces 12"), std::string::npos)
      << opened.output;
}

TEST_F(ExternalPrograms, NetgenMeshesTheStepAndShowsOurNames) {
  if (!is_installed("netgen")) GTEST_SKIP() << "netgen is not installed";
  // Debian's netgen asks for a library without its version: only libnglib-dev has the link.
  const std::string libraries = "/usr/lib/x86_64-linux-gnu/netgen";
  fs::create_symlink(libraries + "/libgui.so.6.2", folder_ / "libgui.so");
  const Solid one = make_solid(crafted::tube_of_quarters(1, 6)).value();
  ASSERT_TRUE(write_step(one, at("model.step")));
  const Outcome mesh = run("LD_LIBRARY_PATH=" + folder_.string() + ":" + libraries +
                           " netgen -batchmode -coarse -geofile=" + at("model.step") +
                           " -meshfile=" + at("model.vol"));
  if (mesh.output.find("couldn't load file") != std::string::npos) {
    GTEST_SKIP() << "netgen does not start here: " << mesh.output;
  }
  const auto volume = read_file(at("model.vol"));
  ASSERT_TRUE(volume) << mesh.output;
  const std::size_t names = volume->find("bcnames");
  ASSERT_NE(names, std::string::npos);
  for (const SolidFace& face : one.faces) {
    EXPECT_NE(volume->find(face.name, names), std::string::npos) << face.name;
  }
}

}  // namespace
}  // namespace angiospline
