#include "cli/console.h"

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <mutex>

#include <fmt/format.h>
#include <unistd.h>

namespace angiospline::cli {
namespace {

volatile std::sig_atomic_t stop_signal = 0;

extern "C" void note_stop(int signal) {
  if (stop_signal != 0) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  stop_signal = signal;
}

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

}  // namespace

struct Console::State {
  std::mutex mutex;
  bool terminal = isatty(STDERR_FILENO) != 0;
  bool drawn = false;
  std::string stage;
  Clock::time_point stage_start = Clock::now();
  Clock::time_point last_draw = Clock::now() - std::chrono::seconds(1);

  void draw(std::string_view name, double fraction) {
    const std::scoped_lock lock(mutex);
    if (name != stage) {
      stage = std::string(name);
      stage_start = Clock::now();
    } else if (seconds_since(last_draw) < 0.1 && fraction < 1) {
      return;
    }
    last_draw = Clock::now();
    const double elapsed = seconds_since(stage_start);
    std::string left;
    if (fraction > 0.02 && fraction < 1 && elapsed > 0.5) {
      const int seconds = static_cast<int>(elapsed * (1 - fraction) / fraction + 0.5);
      left = fmt::format("  {}:{:02} left", seconds / 60, seconds % 60);
    }
    fmt::print(stderr, "\r\033[K{:<28} {:3.0f} %{}", stage, 100 * std::clamp(fraction, 0.0, 1.0),
               left);
    std::fflush(stderr);
    drawn = true;
  }

  void clear() {
    const std::scoped_lock lock(mutex);
    if (!drawn) return;
    fmt::print(stderr, "\r\033[K");
    std::fflush(stderr);
    drawn = false;
  }
};

Console::Console() : state_(std::make_shared<State>()) {
  std::signal(SIGINT, note_stop);
  std::signal(SIGTERM, note_stop);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error like a full disk
}

Console::~Console() { finish_line(); }

Progress Console::progress() const {
  Progress progress;
  progress.stop_requested = [] { return stop_signal != 0; };
  if (state_->terminal) {
    progress.report = [state = state_](std::string_view stage, double fraction) {
      state->draw(stage, fraction);
    };
  }
  return progress;
}

void Console::finish_line() const { state_->clear(); }

void Console::say(std::string_view text) const {
  finish_line();
  fmt::print(stderr, "{}\n", text);
}

void Console::warn(const Warning& warning) const {
  say(fmt::format("warning [{}]: {}", name_of(warning.code), warning.text));
}

void print_json(std::string_view text) { fmt::print("{}\n", text); }

int report_error(const Error& error) {
  fmt::print(stderr, "angiospline: {}\n", error.message());
  switch (error.kind) {
    case ErrorKind::kBadInput:
    case ErrorKind::kCannotWrite:
      return kBadInput;
    case ErrorKind::kCancelled:
      return kStopped;
    case ErrorKind::kFailed:
      break;
  }
  return kFailure;
}

}  // namespace angiospline::cli
