// Many trees in one command: one broken file stops none of the others, and nothing is done twice.
#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr const char* kTube = "1 3 0 0 0 1 -1\n2 3 0 0 5 1 1\n3 3 0 0 10 1 2\n";
constexpr const char* kThinTube = "1 3 0 0 0 0.5 -1\n2 3 0 0 5 0.5 1\n3 3 0 0 10 0.5 2\n";
constexpr const char* kBroken = "1 3 0 0 0 1 -1\n2 3 0 zero 5 1 1\n";

Json summary_in(const std::string& folder) {
  std::ifstream file(fs::path(folder) / "summary.json");
  return Json::parse(file);
}

Json row(const Json& summary, const std::string& name) {
  for (const Json& tree : summary["trees"]) {
    if (tree["name"] == name) return tree;
  }
  return {};
}

class SeedBatch : public testing::Test {
 protected:
  SeedBatch() {
    fs::create_directory(trees_);
    write("a.swc", kTube);
    write("b.swc", kBroken);
    write("c.swc", kThinTube);
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(fs::path(trees_) / name) << text;
  }
  ProgramRun seed(const std::string& input) const {
    return run_angiospline({"seed", input, "-o", out_, "--format", "json,stl", "--jobs", "2"});
  }

  TemporaryFolder folder_;
  std::string trees_ = folder_ / "trees";
  std::string out_ = folder_ / "out";
};

TEST_F(SeedBatch, ABrokenFileStopsNoneOfTheOthersAndTheExitCodeTells) {
  const ProgramRun run = seed(trees_);
  EXPECT_EQ(run.exit_code, 1) << run.err;
  for (const char* file : {"a.json", "a.stl", "c.json", "c.stl", "summary.csv"}) {
    EXPECT_TRUE(fs::exists(fs::path(out_) / file)) << file;
  }
  EXPECT_FALSE(fs::exists(fs::path(out_) / "b.json"));
  const Json summary = summary_in(out_);
  ASSERT_EQ(summary["trees"].size(), 3U);
  EXPECT_EQ(row(summary, "a")["state"], "done");
  EXPECT_EQ(row(summary, "a")["solids"], 1);
  EXPECT_EQ(row(summary, "b")["state"], "refused");
  EXPECT_NE(row(summary, "b")["message"].get<std::string>().find("b.swc:2"), std::string::npos);
  EXPECT_NE(run.out.find("refused"), std::string::npos) << run.out;
}

TEST_F(SeedBatch, WhatIsFinishedIsDoneAgainOnlyWhenItsInputOrAnOptionChanged) {
  seed(trees_);
  const auto written = fs::last_write_time(fs::path(out_) / "a.stl");
  write("c.swc", kTube);
  write("b.swc", kThinTube);
  const ProgramRun again = seed(trees_);
  EXPECT_EQ(again.exit_code, 0) << again.err;
  const Json summary = summary_in(out_);
  EXPECT_EQ(row(summary, "a")["state"], "unchanged");
  EXPECT_EQ(row(summary, "a")["branches"], 1);
  EXPECT_EQ(row(summary, "b")["state"], "done");
  EXPECT_EQ(row(summary, "c")["state"], "done");
  EXPECT_EQ(fs::last_write_time(fs::path(out_) / "a.stl"), written);

  fs::remove(fs::path(out_) / "a.stl");
  const ProgramRun more =
      run_angiospline({"seed", trees_, "-o", out_, "--format", "json,stl", "--unit", "cm"});
  EXPECT_EQ(more.exit_code, 0) << more.err;
  EXPECT_EQ(summary_in(out_)["states"], Json({{"done", 3}}));
}

TEST_F(SeedBatch, TakesListsAndFilesAndKeepsNamesApart) {
  write("a.csv", "x,y,z,radius\n0,0,0,1\n0,0,5,1\n");
  const std::string list = folder_.write("some.list", "# trees\ntrees/a.swc\n\ntrees/a.csv\n");
  const ProgramRun run =
      run_angiospline({"seed", list, trees_ + "/c.swc", "-o", out_, "--format", "stl", "--json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  const Json summary = Json::parse(run.out);
  ASSERT_EQ(summary["trees"].size(), 3U);
  EXPECT_EQ(summary["trees"][0]["name"], "a_swc");
  EXPECT_EQ(summary["trees"][1]["name"], "a_csv");
  EXPECT_EQ(summary["trees"][2]["name"], "c");
}

TEST_F(SeedBatch, RefusesAnEmptyFolderAndAnUnknownFormat) {
  const std::string empty = folder_ / "empty";
  fs::create_directory(empty);
  EXPECT_EQ(seed(empty).exit_code, 2);
  const ProgramRun run = run_angiospline({"seed", trees_, "-o", out_, "--format", "step,docx"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_NE(run.err.find(".docx"), std::string::npos) << run.err;
}

}  // namespace
}  // namespace angiospline::test
