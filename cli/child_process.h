// Running programs side by side: each in a process of its own, so that none can take another down.
#pragma once

#include <functional>
#include <string>
#include <vector>

namespace angiospline::cli {

struct ChildRun {
  int exit_code = -1;  // of the program; 128 + the signal that ended it; -1: it never started
  double seconds = 0.0;
  std::string out;  // what it said on standard output
  std::string err;  // and on standard error
};

// This program's own file.
std::string own_program();

// Runs each command (program and arguments) at most `jobs` at a time, and calls `done` with its
// index as each ends, one at a time. When `stop` says so, running ones get SIGTERM and are waited
// for, and no more are started.
void run_children(const std::vector<std::vector<std::string>>& commands, int jobs,
                  const std::function<bool()>& stop,
                  const std::function<void(std::size_t, const ChildRun&)>& done);

}  // namespace angiospline::cli
