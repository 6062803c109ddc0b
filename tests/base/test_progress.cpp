// What a verb tells its caller, and how the caller stops it.
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "base/progress.h"
#include "base/version.h"

namespace angiospline {
namespace {

TEST(Progress, ADefaultOneIsSilentAndNeverStops) {
  const Progress progress;
  progress.at("stage", 0.5);
  EXPECT_FALSE(progress.should_stop());
}

TEST(Progress, PassesStagesOnAndAsksEachTime) {
  std::vector<std::pair<std::string, double>> told;
  bool stop = false;
  Progress progress;
  progress.report = [&](std::string_view stage, double fraction) {
    told.emplace_back(stage, fraction);
  };
  progress.stop_requested = [&] { return stop; };
  progress.at("read", 0.25);
  EXPECT_FALSE(progress.should_stop());
  stop = true;
  EXPECT_TRUE(progress.should_stop());
  EXPECT_EQ(told, (std::vector<std::pair<std::string, double>>{{"read", 0.25}}));
}

TEST(Progress, TheErrorOfAStopNamesItsStage) {
  const Error error = cancelled("fit");
  EXPECT_EQ(error.kind, ErrorKind::kCancelled);
  EXPECT_NE(error.message().find("fit"), std::string::npos);
}

TEST(Version, IsThreeNumbers) {
  EXPECT_TRUE(std::regex_match(version(), std::regex(R"(\d+\.\d+\.\d+)"))) << version();
}

}  // namespace
}  // namespace angiospline
