// From centerline files to model files as a library call.
#include <filesystem>

#include <gtest/gtest.h>

#include "io/model/model_file.h"
#include "pipeline/build.h"
#include "pipeline/finish_model.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

constexpr const char* kFork =
    "1 3 0 0 0 2 -1\n2 3 0 0 15 2 1\n3 3 0 0 30 2 2\n"
    "4 3 8 0 42 1.5 3\n5 3 16 0 54 1.5 4\n6 3 -8 0 42 1.5 3\n7 3 -16 0 54 1.5 6\n";

TEST(BuildFile, WritesASoundModelThatIsTrueToItsTree) {
  const test::TemporaryFolder folder;
  const auto built = build_file({folder.write("fork.swc", kFork)},
                                {folder.path() / "a.json", folder.path() / "a.stl"});
  ASSERT_TRUE(built) << built.error().message();
  EXPECT_TRUE(is_sound(built->certificate));
  EXPECT_EQ(built->model.name, "fork");
  EXPECT_EQ(built->model.tree.branches.size(), 3U);
  EXPECT_GT(built->fidelity.sections, 10);
  EXPECT_LT(built->fidelity.mean_radius_error, 0.01);
  EXPECT_EQ(built->files, (std::vector<std::string>{folder / "a.json", folder / "a.stl"}));
  for (const std::string& file : built->files) EXPECT_TRUE(std::filesystem::exists(file)) << file;

  // What is returned is what was written.
  const auto read = read_model(folder / "a.json");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->network.control_points_mm, built->model.network.control_points_mm);
}

TEST(BuildFile, IsTheSameOnOneProcessor) {
  const test::TemporaryFolder folder;
  const std::string tree = folder.write("fork.swc", kFork);
  const auto all = build_file({tree}, {folder.path() / "all.stl"});
  BuildFileOptions options;
  options.threads = 1;
  options.name = "single";
  const auto one = build_file({tree}, {folder.path() / "one.stl"}, options);
  ASSERT_TRUE(all && one);
  EXPECT_EQ(one->model.name, "single");
  EXPECT_EQ(one->model.network.control_points_mm, all->model.network.control_points_mm);
}

TEST(BuildFile, ChecksItsTargetsBeforeItReads) {
  const test::TemporaryFolder folder;
  const auto built = build_file({folder.path() / "missing.swc"}, {folder.path() / "out.docx"});
  ASSERT_FALSE(built);
  EXPECT_NE(built.error().where.find("out.docx"), std::string::npos);
  EXPECT_TRUE(folder.files().empty());
}

}  // namespace
}  // namespace angiospline
