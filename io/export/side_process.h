// Work in a copy of this process, for libraries that keep their state in globals and so cannot be
// used from two threads.
#pragma once

#include <functional>
#include <optional>

#include "base/progress.h"
#include "base/result.h"

namespace angiospline {

// One piece of work under way beside its parent, which sees nothing of it but its Result: the copy
// has its own memory. Start it while no other thread of ours is at work: only the calling thread
// goes on in the copy, and what others had locked would stay locked.
class SideProcess {
 public:
  using Work = std::function<Result<void>(const Progress&)>;

  // Nothing if the system refuses a process: then the caller does the work itself.
  static std::optional<SideProcess> start(const Work& work);

  // The work's result. A request to stop is passed on; the work ends as it would at home. Errors:
  // those of the work; the copy crashed.
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
