// Programs side by side and copies of this process: what they say comes back, whatever ends them.
#include <chrono>
#include <csignal>
#include <filesystem>
#include <functional>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "base/process.h"

namespace angiospline {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::vector<std::string> shell(const std::string& script) { return {"/bin/sh", "-c", script}; }

std::map<std::size_t, ChildRun> run(const std::vector<std::vector<std::string>>& commands, int jobs,
                                    const std::function<bool()>& stop = {}) {
  std::map<std::size_t, ChildRun> runs;
  run_children(commands, jobs, stop, [&](std::size_t k, const ChildRun& one) { runs[k] = one; });
  return runs;
}

TEST(RunChildren, TellsEachOnesExitCodeAndWhatItSaidOnBothStreams) {
  const auto runs = run({shell("echo out; echo err >&2; exit 7"), shell("exit 0")}, 1);
  ASSERT_EQ(runs.size(), 2U);
  EXPECT_EQ(runs.at(0).exit_code, 7);
  EXPECT_EQ(runs.at(0).out, "out\n");
  EXPECT_EQ(runs.at(0).err, "err\n");
  EXPECT_EQ(runs.at(1).exit_code, 0);
  EXPECT_EQ(runs.at(1).out, "");
}

TEST(RunChildren, OneThatCrashesOrCannotStartTakesNoneDown) {
  const auto runs = run({shell("kill -SEGV $$"), {"/no/such/program"}, shell("echo alive")}, 3);
  ASSERT_EQ(runs.size(), 3U);
  EXPECT_EQ(runs.at(0).exit_code, 128 + SIGSEGV);
  EXPECT_NE(runs.at(1).exit_code, 0);
  EXPECT_NE(runs.at(1).err.find("/no/such/program"), std::string::npos);
  EXPECT_EQ(runs.at(2).out, "alive\n");
}

TEST(RunChildren, AChildThatReadsFindsTheEndOfItsInput) {
  EXPECT_EQ(run({shell("cat; echo done")}, 1).at(0).out, "done\n");
}

TEST(RunChildren, AsManyAsAllowedRunAtOnceAndNoMore) {
  const std::filesystem::path folder = testing::TempDir() + "run_children";
  std::filesystem::create_directories(folder);
  const std::string in = "cd '" + folder.string() + "'; ";

  // Each waits for the other's file: alone none would ever end well.
  const auto meet = [&](const char* mine, const char* other) {
    return shell(in + "touch " + mine + "; for i in $(seq 600); do [ -e " + other +
                 " ] && exit 0; sleep 0.1; done; exit 1");
  };
  for (const auto& [k, one] : run({meet("a", "b"), meet("b", "a")}, 2)) {
    EXPECT_EQ(one.exit_code, 0) << k;
  }

  // Each says whether another one is at work.
  const auto alone = shell(in + "mkdir busy || exit 1; sleep 0.1; rmdir busy");
  for (const auto& [k, one] : run({alone, alone, alone}, 1)) EXPECT_EQ(one.exit_code, 0) << k;
  std::filesystem::remove_all(folder);
}

TEST(RunChildren, ARequestToStopEndsThoseThatRunAndStartsNoOther) {
  const auto start = Clock::now();
  const auto runs = run({shell("exec sleep 60"), shell("exec sleep 60")}, 1,
                        [&] { return seconds_since(start) > 0.2; });
  EXPECT_LT(seconds_since(start), 30);
  ASSERT_EQ(runs.size(), 1U);
  EXPECT_EQ(runs.at(0).exit_code, 128 + SIGTERM);
}

TEST(OwnProgram, IsAFileThatExists) { EXPECT_TRUE(std::filesystem::exists(own_program())); }

Result<void> aside(const SideProcess::Work& work, const Progress& progress = {}) {
  auto copy = SideProcess::start(work);
  if (!copy) throw std::runtime_error("no process");
  return copy->wait(progress);
}

TEST(SideProcess, ReturnsSuccessAndLeavesTheParentsMemoryAlone) {
  int value = 1;
  EXPECT_TRUE(aside([&](const Progress&) -> Result<void> {
    value = 2;
    return {};
  }));
  EXPECT_EQ(value, 1);
}

TEST(SideProcess, ReturnsTheErrorWordForWord) {
  const Error error{ErrorKind::kCannotWrite, "no\nspace", std::string("a\0b", 3), "\xff\xfe",
                    "12\n3"};
  const auto result = aside([&](const Progress&) -> Result<void> { return fail(error); });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, error.kind);
  EXPECT_EQ(result.error().what, error.what);
  EXPECT_EQ(result.error().where, error.where);
  EXPECT_EQ(result.error().value, error.value);
  EXPECT_EQ(result.error().rule, error.rule);
}

TEST(SideProcess, AnAnswerLargerThanAPipeHoldsComesWhole) {
  const std::string large(1 << 20, 'x');
  const auto result = aside([&](const Progress&) -> Result<void> {
    return fail({ErrorKind::kFailed, large, {}, {}, {}});
  });
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().what, large);
}

TEST(SideProcess, AnExceptionOrACrashIsAFailureThatSaysHow) {
  const auto thrown =
      aside([](const Progress&) -> Result<void> { throw std::runtime_error("bad knot"); });
  ASSERT_FALSE(thrown);
  EXPECT_EQ(thrown.error().kind, ErrorKind::kFailed);
  EXPECT_NE(thrown.error().message().find("bad knot"), std::string::npos);
  const auto crashed = aside([](const Progress&) -> Result<void> {
    std::raise(SIGKILL);
    return {};
  });
  ASSERT_FALSE(crashed);
  EXPECT_NE(crashed.error().message().find("signal 9"), std::string::npos);
}

// Work that goes on until it is asked to stop, or for a minute.
Result<void> patient(const Progress& progress) {
  for (const auto start = Clock::now(); seconds_since(start) < 60;) {
    if (progress.should_stop()) return fail(cancelled("patience"));
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return {};
}

TEST(SideProcess, PassesOnARequestToStop) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  const auto start = Clock::now();
  const auto result = aside(patient, progress);
  EXPECT_LT(seconds_since(start), 30);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().kind, ErrorKind::kCancelled);
}

TEST(SideProcess, OneThatNobodyWaitsForIsAskedToStop) {
  const auto start = Clock::now();
  { const auto copy = SideProcess::start(patient); }
  EXPECT_LT(seconds_since(start), 30);
}

}  // namespace
}  // namespace angiospline
