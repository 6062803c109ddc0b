// How long each stage of a verb took.
#pragma once

#include <chrono>
#include <string>
#include <utility>
#include <vector>

namespace angiospline {

// Names of stages and their seconds, in the order in which they ended.
using StageSeconds = std::vector<std::pair<std::string, double>>;

// Runs from its making; a lap is the time since the one before. Verbs that are stages of others
// take one by reference, as they take a Progress.
class Stopwatch {
 public:
  void lap(std::string stage);
  const StageSeconds& laps() const { return laps_; }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
  StageSeconds laps_;
};

}  // namespace angiospline
