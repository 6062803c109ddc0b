// Many trees: what becomes of each, what their processes are asked, and that nothing is done twice.
// A script stands in for the program; tests/cli/test_seed_batch.cpp runs the real one.
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "pipeline/batch.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

std::string contents(const fs::path& path) {
  std::ifstream stream(path);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

class Batch : public testing::Test {
 protected:
  Batch() {
    fs::create_directory(trees_);
    for (const char* name : {"a.swc", "b.swc", "c.swc"}) {
      std::ofstream(trees_ / name) << "1 3 0 0 0 1 -1\n2 3 0 0 5 1 1\n# " << name << "\n";
    }
    options_.jobs = 1;
    options_.formats = "stl";
    become("exit 0");
  }

  // The program notes its arguments, writes the file it was asked for, prints figures, and then
  // does as `script` says.
  void become(const std::string& script) {
    const std::string path = folder_.write(
        "program", "#!/bin/sh\necho \"$@\" >>'" + calls_.string() +
                       "'\nfor last in \"$@\"; do :; done\necho solid >\"$last\"\n" +
                       "echo '{\"branches\": 3, \"failed\": [], \"check\": {\"solids\": 1, "
                       "\"volume_mm3\": 2.5}}'\n" +
                       script + "\n");
    fs::permissions(path, fs::perms::owner_all);
    options_.program = path;
  }

  BatchReport run(const Progress& progress = {}) {
    calls_before_ = calls();
    auto report = build_batch({trees_}, out_, options_, progress);
    EXPECT_TRUE(report) << report.error().message();
    return report ? *report : BatchReport();
  }

  long calls() const {
    const std::string text = contents(calls_);
    return std::count(text.begin(), text.end(), '\n');
  }
  long new_calls() const { return calls() - calls_before_; }

  test::TemporaryFolder folder_;
  fs::path trees_ = folder_.path() / "trees";
  fs::path out_ = folder_.path() / "out";
  fs::path calls_ = folder_.path() / "calls";
  long calls_before_ = 0;
  BatchOptions options_;
};

TEST_F(Batch, EachTreeHasItsStateByTheExitCodeOfItsProcess) {
  become(
      "echo 'failed: wall_2: it folds' >&2; echo 'angiospline: a.swc:2: bad' >&2\n"
      "case \"$2\" in *a.swc*) exit 2;; *b.swc*) kill -SEGV $$;; esac; exit 1");
  const BatchReport report = run();
  ASSERT_EQ(report.trees.size(), 3U);
  EXPECT_EQ(report.trees[0].state, TreeState::kRefused);
  EXPECT_EQ(report.trees[0].message, "a.swc:2: bad");
  EXPECT_EQ(report.trees[1].state, TreeState::kCrashed);
  EXPECT_EQ(report.trees[1].exit_code, 128 + SIGSEGV);
  EXPECT_EQ(report.trees[1].message, "ended by signal " + std::to_string(SIGSEGV));
  EXPECT_EQ(report.trees[2].state, TreeState::kUnsound);
  EXPECT_FALSE(report.stopped);
  EXPECT_EQ(count_states(report),
            (std::map<std::string, int>{{"refused", 1}, {"crashed", 1}, {"unsound", 1}}));
}

TEST_F(Batch, FiguresAreThoseThatTheProgramPrints) {
  const BatchReport report = run();
  ASSERT_EQ(report.trees.size(), 3U);
  for (const BatchTree& tree : report.trees) {
    ASSERT_TRUE(tree.figures) << tree.name;
    EXPECT_EQ(tree.figures->branches, 3);
    EXPECT_EQ(tree.figures->solids, 1);
    EXPECT_EQ(tree.figures->volume_mm3, 2.5);
  }
  EXPECT_TRUE(fs::exists(out_ / "summary.json"));
  EXPECT_EQ(contents(out_ / "summary.csv").substr(0, 11), "name,input,");
}

TEST_F(Batch, OneThatWasStoppedGoesOnWhereItWas) {
  Progress progress;
  progress.stop_requested = [&] { return calls() >= 1; };
  become("sleep 0.2; exit 0");
  BatchReport report = run(progress);
  EXPECT_TRUE(report.stopped);
  EXPECT_EQ(new_calls(), 1);
  ASSERT_EQ(report.trees.size(), 3U);
  EXPECT_EQ(report.trees[1].state, TreeState::kStopped);
  EXPECT_EQ(report.trees[2].state, TreeState::kStopped);

  become("exit 0");
  const bool first_done = fs::exists(out_ / "a.seed.json");
  report = run();
  EXPECT_EQ(new_calls(), first_done ? 2 : 3);
  EXPECT_FALSE(report.stopped);
  for (const BatchTree& tree : report.trees) EXPECT_EQ(tree.exit_code, 0) << tree.name;

  report = run();
  EXPECT_EQ(new_calls(), 0);
  EXPECT_EQ(count_states(report), (std::map<std::string, int>{{"unchanged", 3}}));
}

TEST_F(Batch, ATreeIsBuiltAgainWhenItsBytesOrAnOptionOrAFileChanged) {
  run();
  std::ofstream(trees_ / "b.swc", std::ios::app) << "# more\n";
  run();
  EXPECT_EQ(new_calls(), 1);

  fs::remove(out_ / "c.stl");
  run();
  EXPECT_EQ(new_calls(), 1);

  options_.build.build.clearance = 0.1;
  run();
  EXPECT_EQ(new_calls(), 3);
}

TEST_F(Batch, TheProgramIsAskedForTheOptionsOfTheCall) {
  options_.build.reading.unit_mm = 1e-6;
  options_.build.reading.frame = CoordinateFrame::kRas;
  options_.build.reading.radius_is_diameter = true;
  options_.build.build.extend_outlets = 2.5;
  options_.build.writing.step_schema = StepSchema::kAp214;
  options_.build.threads = 3;
  run();
  const std::string called = contents(calls_);
  for (const char* words :
       {"seed ", "--json", "--threads 3", "--unit 1e-06mm", "--frame RAS", "--radius-is-diameter",
        "--extend-outlets 2.5", "--step-schema AP214"}) {
    EXPECT_NE(called.find(words), std::string::npos) << words << " in " << called;
  }
  EXPECT_EQ(called.find("--extend-inlets"), std::string::npos);

  // What the child reads is the unit that was given.
  const auto unit = parse_unit_mm("1e-06mm");
  ASSERT_TRUE(unit);
  EXPECT_EQ(*unit, 1e-6);
}

TEST_F(Batch, TellsEachTreeAsItEnds) {
  std::vector<std::string> names;
  const auto report = build_batch({trees_ / "c.swc", trees_ / "a.swc"}, out_, options_, {},
                                  [&](const BatchTree& tree) { names.push_back(tree.name); });
  ASSERT_TRUE(report);
  EXPECT_EQ(names, (std::vector<std::string>{"c", "a"}));
}

TEST_F(Batch, RefusesWhatIsWrongWithTheBatchAsAWhole) {
  options_.formats = "stl,docx";
  EXPECT_FALSE(build_batch({trees_}, out_, options_));
  options_.formats = "stl";
  fs::create_directory(folder_.path() / "empty");
  EXPECT_FALSE(build_batch({folder_.path() / "empty"}, out_, options_));
  EXPECT_EQ(calls(), 0);
}

}  // namespace
}  // namespace angiospline
