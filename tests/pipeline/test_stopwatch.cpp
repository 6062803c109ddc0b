#include <chrono>
#include <thread>

#include <gtest/gtest.h>

#include "pipeline/stopwatch.h"

namespace angiospline {
namespace {

TEST(Stopwatch, LapsFollowEachOtherAndCoverTheTimeBetween) {
  const auto start = std::chrono::steady_clock::now();
  Stopwatch watch;
  EXPECT_TRUE(watch.laps().empty());
  watch.lap("first");
  const auto pause = std::chrono::milliseconds(20);
  std::this_thread::sleep_for(pause);
  watch.lap("second");
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;

  ASSERT_EQ(watch.laps().size(), 2U);
  EXPECT_EQ(watch.laps()[0].first, "first");
  EXPECT_EQ(watch.laps()[1].first, "second");
  EXPECT_GE(watch.laps()[0].second, 0.0);
  EXPECT_GE(watch.laps()[1].second, std::chrono::duration<double>(pause).count());
  EXPECT_LE(watch.laps()[0].second + watch.laps()[1].second, elapsed.count());
}

}  // namespace
}  // namespace angiospline
