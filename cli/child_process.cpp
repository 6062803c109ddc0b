#include "cli/child_process.h"

#include <atomic>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <mutex>
#include <thread>

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

extern char** environ;

namespace angiospline::cli {
namespace {

constexpr auto kPoll = std::chrono::milliseconds(20);

// A file without a name that a child writes and its parent reads.
class Capture {
 public:
  Capture() : file_(std::tmpfile()) {}
  ~Capture() {
    if (file_ != nullptr) std::fclose(file_);
  }
  Capture(const Capture&) = delete;
  Capture& operator=(const Capture&) = delete;

  int descriptor() const { return file_ == nullptr ? -1 : ::fileno(file_); }

  std::string text() const {
    std::string result;
    if (file_ == nullptr) return result;
    std::rewind(file_);
    char buffer[4096];
    for (std::size_t n = 0; (n = std::fread(buffer, 1, sizeof buffer, file_)) > 0;) {
      result.append(buffer, n);
    }
    return result;
  }

 private:
  std::FILE* file_;
};

pid_t start(const std::vector<std::string>& command, int out, int err) {
  std::vector<std::string> words = command;
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, err, STDERR_FILENO);
  // A group of its own: Ctrl-C at the terminal reaches the parent alone, which then asks once.
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP);
  posix_spawnattr_setpgroup(&attributes, 0);
  pid_t child = -1;
  if (posix_spawn(&child, arguments[0], &actions, &attributes, arguments.data(), environ) != 0) {
    child = -1;
  }
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

ChildRun run_one(const std::vector<std::string>& command, const std::function<bool()>& stop) {
  ChildRun run;
  const Capture out;
  const Capture err;
  const auto begin = std::chrono::steady_clock::now();
  const pid_t child = start(command, out.descriptor(), err.descriptor());
  if (child < 0) {
    run.err = "cannot start " + command.front();
    return run;
  }
  bool told = false;
  int status = 0;
  for (;;) {
    const pid_t ended = ::waitpid(child, &status, WNOHANG);
    if (ended == child) break;
    if (ended < 0 && errno != EINTR) return run;
    if (!told && stop && stop()) {
      ::kill(child, SIGTERM);
      told = true;
    }
    std::this_thread::sleep_for(kPoll);
  }
  run.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  run.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  run.out = out.text();
  run.err = err.text();
  return run;
}

}  // namespace

std::string own_program() {
  std::error_code code;
  return std::filesystem::read_symlink("/proc/self/exe", code).string();
}

void run_children(const std::vector<std::vector<std::string>>& commands, int jobs,
                  const std::function<bool()>& stop,
                  const std::function<void(std::size_t, const ChildRun&)>& done) {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  const auto work = [&] {
    for (std::size_t k = next++; k < commands.size() && !(stop && stop()); k = next++) {
      const ChildRun run = run_one(commands[k], stop);
      const std::scoped_lock lock(mutex);
      done(k, run);
    }
  };
  std::vector<std::thread> threads;
  for (int j = 1; j < jobs && static_cast<std::size_t>(j) < commands.size(); ++j) {
    threads.emplace_back(work);
  }
  work();
  for (std::thread& thread : threads) thread.join();
}

}  // namespace angiospline::cli
