// The seed command as its users meet it: units, options that belong to one format, a full disk and
// Ctrl-C.
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <sys/wait.h>
#include <unistd.h>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

// A fork whose arms bend a little, in millimetres times `scale`.
std::string fork_swc(double scale, double radius_factor = 1.0) {
  std::string text;
  int id = 0;
  const auto add = [&](double x, double y, double z, double r, int parent) {
    text += fmt::format("{} 3 {:.17g} {:.17g} {:.17g} {:.17g} {}\n", ++id, scale * x, scale * y,
                        scale * z, scale * radius_factor * r, parent);
    return id;
  };
  int trunk = -1;
  for (int k = 0; k <= 8; ++k) trunk = add(0.02 * k * k, 0, 2.0 * k, 1.5, trunk);
  int left = trunk, right = trunk;
  for (int k = 1; k <= 8; ++k) {
    left = add(1.28 - 1.3 * k, 0.05 * k * k, 16 + 1.5 * k, 1.1, left);
    right = add(1.28 + 1.2 * k, -0.04 * k * k, 16 + 1.7 * k, 1.2, right);
  }
  return text;
}

// What another scale changes in a volume: the solution of a junction stops when it is smooth, and
// where it stops depends on the last digits of its input (measured: 1e-5).
constexpr double kRounding = 5e-5;

Json seeded(const ProgramRun& run) {
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Json json = Json::parse(run.out, nullptr, false);
  EXPECT_TRUE(json.is_object()) << run.out;
  return json;
}

TEST(SeedUnits, TheSameTreeInEveryUnitGivesTheSameModelAndTheSameReport) {
  const TemporaryFolder folder;
  const auto run_in = [&](const std::string& unit, double scale) {
    const std::string tree = folder.write(unit + ".swc", fork_swc(scale));
    return seeded(
        run_angiospline({"seed", tree, "--unit", unit, "-o", folder / (unit + ".json"), "--json"}));
  };
  const Json mm = run_in("mm", 1);
  for (const auto& [unit, scale] : {std::pair{"m", 1e-3}, {"cm", 0.1}, {"um", 1e3}}) {
    const Json other = run_in(unit, scale);
    for (const char* key :
         {"branches", "junctions", "loops", "failed", "warnings", "warning_codes"}) {
      EXPECT_EQ(other[key], mm[key]) << unit << ": " << key;
    }
    for (const char* key : {"closed", "valid", "solids", "self_intersecting", "genus"}) {
      EXPECT_EQ(other["check"][key], mm["check"][key]) << unit << ": " << key;
    }
    ASSERT_EQ(other["check"]["faces"].size(), mm["check"]["faces"].size());
    for (std::size_t f = 0; f < mm["check"]["faces"].size(); ++f) {
      EXPECT_EQ(other["check"]["faces"][f]["name"], mm["check"]["faces"][f]["name"]);
    }
    const double volume = mm["check"]["volume_mm3"];
    EXPECT_EQ(other["check"]["volume_mm3"].get<double>(), volume) << unit;
    EXPECT_EQ(other["check"]["max_normal_angle_deg"], mm["check"]["max_normal_angle_deg"]) << unit;
    EXPECT_NE(other["assumptions"].dump().find("as given"), std::string::npos);
  }
}

TEST(SeedUnits, ATreeAThousandTimesAsLargeGivesTheSameModelAThousandTimesAsLarge) {
  const TemporaryFolder folder;
  const auto run_at = [&](const std::string& name, double scale) {
    const std::string tree = folder.write(name + ".swc", fork_swc(scale));
    return seeded(run_angiospline({"seed", tree, "-o", folder / (name + ".step"), "--json"}));
  };
  const Json one = run_at("one", 1);
  for (const auto& [name, scale] : {std::pair{"small", 1e-3}, {"large", 1e3}}) {
    const Json other = run_at(name, scale);
    EXPECT_EQ(other["failed"], one["failed"]);
    EXPECT_EQ(other["warnings"].size(), one["warnings"].size());
    EXPECT_EQ(other["check"]["valid"], true) << name;
    EXPECT_NEAR(other["check"]["volume_mm3"].get<double>() / (scale * scale * scale),
                one["check"]["volume_mm3"].get<double>(),
                kRounding * one["check"]["volume_mm3"].get<double>())
        << name;
    EXPECT_NEAR(other["check"]["min_jacobian_ratio"].get<double>(),
                one["check"]["min_jacobian_ratio"].get<double>(), 0.01);
  }
}

TEST(SeedUnits, DiametersAndFramesAreTakenAsTheOptionsSay) {
  const TemporaryFolder folder;
  const std::string radii = folder.write("radii.swc", fork_swc(1));
  const std::string diameters = folder.write("diameters.swc", fork_swc(1, 2.0));
  const Json a = seeded(run_angiospline({"seed", radii, "-o", folder / "a.json", "--json"}));
  const Json b = seeded(run_angiospline({"seed", diameters, "--radius-is-diameter", "--frame",
                                         "RAS", "-o", folder / "b.json", "--json"}));
  // Another frame rounds otherwise on the way to the model.
  EXPECT_NEAR(b["check"]["volume_mm3"].get<double>() / a["check"]["volume_mm3"].get<double>(), 1,
              1e-6);
  // RAS to LPS turns x and y round.
  const auto& box_a = a["check"]["bounding_box_mm"];
  const auto& box_b = b["check"]["bounding_box_mm"];
  EXPECT_NEAR(box_b[0][0].get<double>(), -box_a[1][0].get<double>(), 1e-6);
  EXPECT_NEAR(box_b[1][1].get<double>(), -box_a[0][1].get<double>(), 1e-6);
  const std::string said = b["assumptions"].dump();
  EXPECT_NE(said.find("diameters, as given"), std::string::npos) << said;
  EXPECT_NE(said.find("RAS, turned into LPS, as given"), std::string::npos) << said;
  EXPECT_NE(a["assumptions"].dump().find("--radius-is-diameter overrides"), std::string::npos);
}

TEST(SeedVoxelWidth, ScalesTheCourseOfVascuSynthAndIsSaidToBeUnusedElsewhere) {
  const char* const gxl =
      "<gxl><graph id=\"g\">"
      "<node id=\"a\"><attr name=\" nodeType\"><string> root node </string></attr>"
      "<attr name=\" position\"><tup><float>0</float><float>0</float><float>0</float></tup></attr>"
      "</node><node id=\"b\"><attr name=\" position\"><tup><float>0</float><float>0</float>"
      "<float>100</float></tup></attr></node>"
      "<edge id=\"e\" to=\"b\" from=\"a\"><attr name=\" radius\"><float>0.5</float></attr></edge>"
      "</graph></gxl>";
  const TemporaryFolder folder;
  const std::string tree = folder.write("tree.gxl", gxl);
  const Json usual = seeded(run_angiospline({"seed", tree, "-o", folder / "a.json", "--json"}));
  const Json wide = seeded(
      run_angiospline({"seed", tree, "--voxel-width", "0.1", "-o", folder / "b.json", "--json"}));
  // A tube of radius 0.5 that is 100 voxels long.
  constexpr double kPi = 3.141592653589793;
  EXPECT_NEAR(usual["check"]["volume_mm3"].get<double>(), kPi * 0.25 * 4, 0.01 * kPi);
  EXPECT_NEAR(wide["check"]["volume_mm3"].get<double>(), kPi * 0.25 * 10, 0.025 * kPi);
  EXPECT_NE(wide["assumptions"].dump().find("voxel width: 0.1, as given"), std::string::npos);

  const std::string swc = folder.write("tree.swc", fork_swc(1));
  const Json other = seeded(
      run_angiospline({"seed", swc, "--voxel-width", "0.1", "-o", folder / "c.json", "--json"}));
  EXPECT_NE(other["assumptions"].dump().find("voxel width: not used"), std::string::npos);
  EXPECT_EQ(
      run_angiospline({"seed", tree, "--voxel-width", "0", "-o", folder / "d.json"}).exit_code, 2);
}

// A limit on the size of files is what a full disk looks like to a program.
TEST(SeedFullDisk, IsOneLineAndLeavesNoFileOfAnyFormat) {
  const TemporaryFolder folder;
  const std::string tree = folder.write("tree.swc", fork_swc(1));
  for (const char* suffix : {"step", "igs", "brep", "glb", "stl", "vtp", "json", "html"}) {
    const std::string target = folder / (std::string("model.") + suffix);
    const std::string command =
        fmt::format("ulimit -f 4; exec '{}' seed '{}' -o '{}' 2>'{}' >/dev/null", program_path(),
                    tree, target, folder / "err");
    const int status = std::system(("bash -c \"" + command + "\"").c_str());
    ASSERT_TRUE(WIFEXITED(status)) << suffix;
    EXPECT_EQ(WEXITSTATUS(status), 2) << suffix;
    std::ifstream file(folder / "err");
    std::ostringstream said;
    said << file.rdbuf();
    EXPECT_TRUE(is_one_line(said.str())) << suffix << ": " << said.str();
    // A file of the user's folder, not the temporary one in its place.
    EXPECT_EQ(said.str().rfind("angiospline: " + folder / "model", 0), 0U) << said.str();
    EXPECT_EQ(folder.files(), (std::vector<std::string>{"err", "tree.swc"})) << suffix;
  }
}

// The program in a process of its own, with its talk thrown away.
pid_t start_program(const std::vector<std::string>& arguments) {
  const pid_t child = fork();
  if (child != 0) return child;
  setpgid(0, 0);
  const int nowhere = open("/dev/null", O_RDWR);
  for (const int stream : {0, 1, 2}) dup2(nowhere, stream);
  std::vector<std::string> words = arguments;
  words.insert(words.begin(), program_path());
  std::vector<char*> pointers;
  for (std::string& word : words) pointers.push_back(word.data());
  pointers.push_back(nullptr);
  execv(pointers[0], pointers.data());
  _exit(127);
}

int wait_for(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

TEST(SeedInterrupted, ABatchKeepsWhatIsFinishedLeavesNothingHalfWrittenAndGoesOnWhereItStopped) {
  const TemporaryFolder folder;
  const fs::path trees = folder.path() / "trees";
  const fs::path out = folder.path() / "out";
  fs::create_directory(trees);
  constexpr int kTrees = 12;
  for (int k = 0; k < kTrees; ++k) {
    std::ofstream(trees / fmt::format("t{:02}.swc", k)) << fork_swc(1 + 0.01 * k);
  }
  const std::vector<std::string> command{"seed",     trees,           "-o",     out,
                                         "--format", "step,igs,json", "--jobs", "2"};
  const pid_t batch = start_program(command);
  const auto finished = [&] {
    int count = 0;
    std::error_code ignored;
    if (!fs::is_directory(out, ignored)) return 0;
    for (const auto& entry : fs::directory_iterator(out)) {
      count += entry.path().string().ends_with(".seed.json") ? 1 : 0;
    }
    return count;
  };
  for (int k = 0; k < 3000 && finished() < 2; ++k) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  ASSERT_GE(finished(), 2);
  kill(-batch, SIGINT);
  EXPECT_EQ(wait_for(batch), 130);
  const int kept = finished();
  EXPECT_LT(kept, kTrees) << "nothing was left to stop";
  for (const auto& entry : fs::directory_iterator(out)) {
    EXPECT_FALSE(entry.path().filename().string().starts_with('.')) << entry.path();
    if (entry.path().extension() != ".json") continue;
    std::ifstream file(entry.path());
    EXPECT_FALSE(Json::parse(file, nullptr, false).is_discarded()) << entry.path();
  }
  const ProgramRun rest = run_angiospline({command.begin(), command.end()});
  EXPECT_EQ(rest.exit_code, 0) << rest.err;
  std::ifstream file(out / "summary.json");
  const Json states = Json::parse(file)["states"];
  EXPECT_EQ(states["unchanged"], kept);
  EXPECT_EQ(states["done"], kTrees - kept);
}

TEST(SeedInterrupted, OneTreeEndsWith130AndLeavesNoFile) {
  const TemporaryFolder folder;
  std::string trees;
  // Long enough that it does not end by itself before it is stopped.
  const std::string tree = folder.write("long.csv", [] {
    std::string text = "x,y,z,radius\n";
    for (int k = 0; k < 20000; ++k) text += fmt::format("{},{},{},1\n", 2 * k, k % 7, k % 5);
    return text;
  }());
  const pid_t program = start_program(
      {"seed", tree, "-o", folder / "long.step", folder / "long.igs", folder / "long.stl"});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  kill(program, SIGINT);
  EXPECT_EQ(wait_for(program), 130);
  EXPECT_EQ(folder.files(), (std::vector<std::string>{"long.csv"}));
}

}  // namespace
}  // namespace angiospline::test
