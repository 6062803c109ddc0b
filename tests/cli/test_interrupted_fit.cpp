// fit and recover at a terminal: what they show while they work, and how Ctrl-C stops them.
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include "io/images/image_file.h"
#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

using Clock = std::chrono::steady_clock;

struct TerminalRun {
  int exit_code = -1;
  std::string seen;
  bool pressed = false;                // the stage came up, and Ctrl-C was sent
  double seconds_after_control_c = 0;  // until the program ended
};

// The program at a terminal of its own, where Ctrl-C is pressed once `stage` comes up on it.
TerminalRun stopped_at(const std::string& stage, std::vector<std::string> arguments) {
  TerminalRun run;
  int terminal = -1;
  const pid_t child = forkpty(&terminal, nullptr, nullptr, nullptr);
  if (child == 0) {
    arguments.insert(arguments.begin(), program_path());
    std::vector<char*> pointers;
    for (std::string& word : arguments) pointers.push_back(word.data());
    pointers.push_back(nullptr);
    execv(pointers[0], pointers.data());
    _exit(127);
  }
  Clock::time_point pressed;
  char buffer[4096];
  for (ssize_t got = 0; (got = read(terminal, buffer, sizeof buffer)) > 0;) {
    run.seen.append(buffer, static_cast<std::size_t>(got));
    if (run.pressed || run.seen.find(stage) == std::string::npos) continue;
    run.pressed = write(terminal, "\x03", 1) == 1;
    pressed = Clock::now();
  }
  int status = 0;
  waitpid(child, &status, 0);
  close(terminal);
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  if (run.pressed)
    run.seconds_after_control_c = std::chrono::duration<double>(Clock::now() - pressed).count();
  return run;
}

// "stage  42 %", drawn over the line before it; with the time left on long stages.
bool shows_progress(const std::string& text) {
  static const std::regex drawn("\r\x1b\\[K[a-z ]+ +[0-9]+ %(  [0-9]+:[0-9]{2} left)?");
  return std::regex_search(text, drawn);
}

class Interrupted : public testing::Test {
 protected:
  void SetUp() override {
    ASSERT_EQ(run_angiospline({"phantom", "bifurcation", "--snr", "8", "-o", folder_ / "image.nrrd",
                               "--truth-tree", folder_ / "tree.swc"})
                  .exit_code,
              0);
    ASSERT_EQ(
        run_angiospline({"seed", folder_ / "tree.swc", "-o", folder_ / "seed.json"}).exit_code, 0);
  }

  TemporaryFolder folder_;
};

TEST_F(Interrupted, FitEndsSoonWith130AndLeavesNoFile) {
  const std::vector<std::string> before = folder_.files();
  const std::vector<std::string> fit{"fit",        folder_ / "seed.json", folder_ / "image.nrrd",
                                     "-o",         folder_ / "out.json",  folder_ / "out.step",
                                     "--residual", folder_ / "left.vtp"};
  int stopped = 0;
  for (const char* stage : {"capture", "wall"}) {
    const TerminalRun run = stopped_at(stage, fit);
    ASSERT_TRUE(run.pressed) << run.seen;
    EXPECT_EQ(run.exit_code, 130) << run.seen;
    EXPECT_TRUE(shows_progress(run.seen)) << run.seen;
    EXPECT_NE(run.seen.find("stopped on request"), std::string::npos) << run.seen;
    EXPECT_EQ(folder_.files(), before) << stage;
    EXPECT_LT(run.seconds_after_control_c, 20);  // generous: machines under load
    ++stopped;
  }
  std::vector<std::string> by_edges = fit;
  by_edges.insert(by_edges.end(), {"--solver", "euler-svd", "--iterations", "1000000"});
  const TerminalRun run = stopped_at("deforming", by_edges);
  ASSERT_TRUE(run.pressed) << run.seen;
  EXPECT_EQ(run.exit_code, 130) << run.seen;
  EXPECT_EQ(folder_.files(), before);
  EXPECT_EQ(stopped, 2);
}

TEST_F(Interrupted, RecoverEndsSoonWith130AndKeepsOnlyWholeFiles) {
  const std::vector<std::string> recover{"recover", folder_ / "image.nrrd", "-o", folder_ / "out"};
  const TerminalRun early = stopped_at("vesselness", recover);
  ASSERT_TRUE(early.pressed) << early.seen;
  EXPECT_EQ(early.exit_code, 130) << early.seen;
  EXPECT_TRUE(shows_progress(early.seen)) << early.seen;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "out"));

  const TerminalRun late = stopped_at("wall", recover);
  ASSERT_TRUE(late.pressed) << late.seen;
  EXPECT_EQ(late.exit_code, 130) << late.seen;
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "out"))
    left.push_back(entry.path().filename().string());
  std::sort(left.begin(), left.end());
  EXPECT_EQ(left, (std::vector<std::string>{"centerlines.swc", "centerlines.vtp", "mask.nrrd",
                                            "skeleton.nrrd"}));
  EXPECT_TRUE(read_image(folder_ / "out/mask.nrrd"));
  EXPECT_TRUE(read_image(folder_ / "out/skeleton.nrrd"));
}

TEST_F(Interrupted, NothingIsDrawnInAPipe) {
  const ProgramRun run = run_angiospline(
      {"fit", folder_ / "seed.json", folder_ / "image.nrrd", "-o", folder_ / "out.json"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_EQ(run.err.find('\r'), std::string::npos);
  EXPECT_EQ(run.err.find('\x1b'), std::string::npos);
  EXPECT_TRUE(run.out.empty());
}

}  // namespace
}  // namespace angiospline::test
