// How long work tells its caller where it is, and learns that it should stop.
#pragma once

#include <functional>
#include <string_view>

#include "base/result.h"

namespace angiospline {

// Passed by const reference to every long verb; a default one is silent and never stops.
// Both functions may be called from any thread.
struct Progress {
  std::function<void(std::string_view stage, double fraction)> report;  // fraction in [0, 1]
  std::function<bool()> stop_requested;

  void at(std::string_view stage, double fraction) const {
    if (report) report(stage, fraction);
  }
  bool should_stop() const { return stop_requested && stop_requested(); }
};

// The error a verb returns when it saw should_stop().
inline Error cancelled(std::string_view stage) {
  return Error{ErrorKind::kCancelled, "stopped on request", std::string(stage), {}, {}};
}

}  // namespace angiospline
