// Work in other processes: programs side by side, and a copy of this process for one piece of work.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"

namespace angiospline {

// ---- programs, each in a process of its own, so that none can take another down

struct ChildRun {
  int exit_code = -1;  // of the program; 128 + the signal that ended it; -1: it never started
  double seconds = 0.0;
  std::string out;  // what it said on standard output
  std::string err;  // and on standard error
};

// This program's own file; empty where the system does not tell.
std::string own_program();

// Runs each command (program and arguments) at most `jobs` at a time, and calls `done` with its
// index as each ends, one at a time. When `stop` says so, running ones get SIGTERM and are waited
// for, and no more are started. Children read nothing (/dev/null) and do not hear Ctrl-C at the
// terminal: their parent asks them to stop. Requires commands that are not empty.
void run_children(const std::vector<std::vector<std::string>>& commands, int jobs,
                  const std::function<bool()>& stop,
                  const std::function<void(std::size_t, const ChildRun&)>& done);

// ---- a copy of this process, for libraries that keep their state in globals and so cannot be used
// from two threads

// One piece of work under way beside its parent, which sees nothing of it but its Result: the copy
// has its own memory. Start it while no other thread of ours is at work: only the calling thread
// goes on in the copy, and what others had locked would stay locked.
class SideProcess {
 public:
  using Work = std::function<Result<void>(const Progress&)>;

  // Nothing if the system refuses a process: then the caller does the work itself.
  static std::optional<SideProcess> start(const Work& work);

  // The work's result. A request to stop is passed on; the work ends as it would at home. Errors:
  // those of the work, word for word; kFailed if the copy crashed, saying how. Requires that it was
  // not called before.
  Result<void> wait(const Progress& progress = {});

  SideProcess(SideProcess&& other) noexcept;
  SideProcess& operator=(SideProcess&&) = delete;
  ~SideProcess();  // asks it to stop and waits for its end

 private:
  SideProcess(int process, int pipe) : process_(process), pipe_(pipe) {}
  int process_ = -1;
  int pipe_ = -1;
};

}  // namespace angiospline
