#include "pipeline/stopwatch.h"

#include <utility>

namespace angiospline {

void Stopwatch::lap(std::string stage) {
  const auto now = std::chrono::steady_clock::now();
  laps_.emplace_back(std::move(stage), std::chrono::duration<double>(now - last_).count());
  last_ = now;
}

}  // namespace angiospline
