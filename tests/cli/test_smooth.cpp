// angiospline smooth: native models in, native models out, and a clear word when it cannot.
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/model/model_file.h"
#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

constexpr const char* kTree =
    "1 3 0 0 0 2 -1\n2 3 0 0 10 2 1\n3 3 0 0 20 2 2\n4 3 6 0 27 1.6 3\n5 3 12 0 34 1.6 4\n"
    "6 3 -6 0 27 1.5 3\n7 3 -12 0 34 1.5 6\n";

class Smooth : public testing::Test {
 protected:
  void SetUp() override {
    const ProgramRun run = run_angiospline({"seed", folder_.write("tree.swc", kTree), "-o",
                                            folder_ / "clean.json", folder_ / "x.step"});
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  // The model with one inner point of each junction patch moved by `share` of the way to the
  // centre.
  std::string roughened(double share) {
    Model model = read_model(folder_ / "clean.json").value();
    for (const Patch& patch : model.network.patches) {
      if (model.network.regions[static_cast<std::size_t>(patch.region)].kind ==
          RegionKind::kJunction) {
        Eigen::Ref<Vec3> point = model.network.control_points_mm.col(patch.control[28]);
        point += share * (Vec3(0, 0, 20) - point);
      }
    }
    EXPECT_TRUE(write_model(folder_ / "rough.json", model));
    return folder_ / "rough.json";
  }

  TemporaryFolder folder_;
};

TEST_F(Smooth, MakesARoughModelTangentPlaneContinuousAndSaysSo) {
  const ProgramRun run =
      run_angiospline({"smooth", roughened(0.05), "-o", folder_ / "out.json", "--json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const auto json = nlohmann::json::parse(run.out);
  EXPECT_GT(json["smoothing"]["before_deg"], 0.1);
  EXPECT_LT(json["smoothing"]["after_deg"], 1e-6);
  EXPECT_LT(json["check"]["max_normal_angle_deg"], 1e-6);
  EXPECT_TRUE(json["check"]["valid"]);
  EXPECT_TRUE(read_model(folder_ / "out.json"));
}

TEST_F(Smooth, NamesTheJunctionItRefusesAndEndsWithOne) {
  const ProgramRun run = run_angiospline({"smooth", roughened(0.9), "-o", folder_ / "out.json"});
  EXPECT_EQ(run.exit_code, 1) << run.err;
  EXPECT_NE(run.err.find("refused: junction_3"), std::string::npos) << run.err;
}

TEST_F(Smooth, RefusesWhatIsNoNativeModelWithOneLineAndNoFile) {
  folder_.write("broken.json", "{\"schema\": \"angiospline-model\", \"schema_version\": 1}");
  folder_.write("empty.json", "");
  for (const char* name : {"x.step", "none.json", "broken.json", "empty.json", "tree.swc"}) {
    const auto before = folder_.files();
    const ProgramRun run = run_angiospline({"smooth", folder_ / name, "-o", folder_ / "out.json"});
    EXPECT_EQ(run.exit_code, 2) << name << ": " << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
    EXPECT_NE(run.err.find(name), std::string::npos) << run.err;
    EXPECT_EQ(folder_.files(), before);
  }
}

TEST_F(Smooth, RefusesToleranceAndTargetsItCannotUse) {
  for (const std::vector<std::string>& more :
       std::vector<std::vector<std::string>>{{"-o", folder_ / "out.json", "--tolerance", "-1"},
                                             {"-o", folder_ / "out.dwg"},
                                             {"-o", folder_ / "none/out.json"}}) {
    std::vector<std::string> arguments{"smooth", folder_ / "clean.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
  }
}

}  // namespace
}  // namespace angiospline::test
