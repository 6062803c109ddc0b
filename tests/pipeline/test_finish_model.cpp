// The end of every model: files, one certificate, and what is said of both.
#include <filesystem>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/model/certificate_json.h"
#include "modeling/build/build_model.h"
#include "modeling/solid/solid.h"
#include "pipeline/finish_model.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

Model tube() {
  CenterlineTree tree;
  tree.nodes = {{"a", Vec3(0, 0, 0)}, {"b", Vec3(0, 0, 20)}};
  CenterlineBranch branch;
  branch.name = "tube";
  branch.from = 0;
  branch.to = 1;
  branch.points_mm.resize(3, 5);
  branch.radii_mm.setConstant(5, 2.0);
  for (int i = 0; i < 5; ++i) branch.points_mm.col(i) = Vec3(0, 0, 5.0 * i);
  tree.branches = {branch};
  auto model = build_model(tree);
  EXPECT_TRUE(model);
  return model ? *std::move(model) : Model();
}

TEST(FinishModel, CertifiesTheNetworkAsItIsWhateverTheFiles) {
  const test::TemporaryFolder folder;
  const Model model = tube();
  const auto solid = make_solid(model.network);
  ASSERT_TRUE(solid);
  const auto expected = certify(*solid);
  ASSERT_TRUE(expected);
  for (const bool aside : {false, true}) {
    ExportOptions options;
    options.step_in_side_process = aside;
    Stopwatch watch;
    const auto finished = finish_model(model, {folder.path() / "a.step", folder.path() / "a.json"},
                                       options, {}, watch);
    ASSERT_TRUE(finished) << finished.error().message();
    EXPECT_EQ(to_json(finished->certificate), to_json(*expected));
    EXPECT_TRUE(is_sound(finished->certificate));
    EXPECT_TRUE(std::filesystem::exists(folder / "a.step"));
  }
}

TEST(FinishModel, WarningsAboutFilesJoinThoseOfTheModel) {
  const test::TemporaryFolder folder;
  Model model = tube();
  model.warnings = {{WarningCode::kUnspecified, "of the model"}};
  ExportOptions options;
  options.tessellation.most_triangles = 100;
  Stopwatch watch;
  const auto finished = finish_model(model, {folder.path() / "a.stl"}, options, {}, watch);
  ASSERT_TRUE(finished) << finished.error().message();
  ASSERT_EQ(finished->model.warnings.size(), 2U);
  EXPECT_EQ(finished->model.warnings[0].text, "of the model");
  EXPECT_EQ(finished->model.warnings[1].code, WarningCode::kMeshCoarsened);
}

TEST(FinishModel, CallsBackOnceWithTheModelAfterTheCheck) {
  const test::TemporaryFolder folder;
  const Model model = tube();
  int calls = 0;
  Stopwatch watch;
  const auto finished =
      finish_model(model, {folder.path() / "a.json"}, {}, {}, watch, [&](const Model& given) {
        ++calls;
        EXPECT_EQ(given.network.control_points_mm, model.network.control_points_mm);
        watch.lap("between");
      });
  ASSERT_TRUE(finished);
  EXPECT_EQ(calls, 1);
  std::vector<std::string> stages;
  for (const auto& [stage, seconds] : watch.laps()) stages.push_back(stage);
  EXPECT_EQ(stages, (std::vector<std::string>{"write", "check", "between", "wait for files"}));
}

TEST(CheckTargets, NamesTheFirstThatIsWrong) {
  const test::TemporaryFolder folder;
  EXPECT_TRUE(check_targets({folder.path() / "a.step", folder.path() / "a.stl"}));
  const auto wrong = check_targets({folder.path() / "a.step", folder.path() / "no" / "b.stl"});
  ASSERT_FALSE(wrong);
  EXPECT_NE(wrong.error().where.find("b.stl"), std::string::npos);
}

TEST(IsSound, NeedsAllThree) {
  Certificate certificate;
  certificate.closed = certificate.valid = true;
  EXPECT_TRUE(is_sound(certificate));
  Certificate open = certificate, invalid = certificate, crossing = certificate;
  open.closed = false;
  invalid.valid = false;
  crossing.self_intersecting = true;
  for (const Certificate* bad : {&open, &invalid, &crossing}) EXPECT_FALSE(is_sound(*bad));
}

}  // namespace
}  // namespace angiospline
