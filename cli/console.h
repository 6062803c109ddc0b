// What every subcommand shares: talk on stderr, progress on a terminal, Ctrl-C, exit codes.
#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "base/progress.h"
#include "base/result.h"
#include "base/warning.h"

namespace angiospline::cli {

constexpr int kSuccess = 0;
constexpr int kFailure = 1;  // the input is sound, the result is not what was asked for
constexpr int kBadInput = 2;
constexpr int kStopped = 130;

// Draws "stage  42 %  0:07 left" on stderr when that is a terminal, and is silent otherwise.
// Ctrl-C asks the running stage to stop; a second one ends the program at once.
class Console {
 public:
  Console();
  ~Console();
  Console(const Console&) = delete;
  Console& operator=(const Console&) = delete;

  Progress progress() const;
  void finish_line() const;                 // leaves the progress line behind before other talk
  void say(std::string_view text) const;    // one line on stderr
  void warn(const Warning& warning) const;  // one line, "warning [code]: text"

 private:
  struct State;
  std::shared_ptr<State> state_;
};

// Prints one JSON object on standard output.
void print_json(std::string_view text);

// Prints the error as one line on stderr and returns the exit code of its kind.
int report_error(const Error& error);

}  // namespace angiospline::cli
