#include "base/process.h"

#include <array>
#include <atomic>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <mutex>
#include <string_view>
#include <thread>
#include <utility>

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/contract.h"

extern char** environ;

namespace angiospline {
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

  // A child that waited for input would hang the batch.
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

  // Polled and not waited for: a request to stop has to reach the child while it runs.
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
  for (const std::vector<std::string>& command : commands) EXPECTS(!command.empty());
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

namespace {

volatile std::sig_atomic_t copy_should_stop = 0;
extern "C" void note_stop_of_copy(int) { copy_should_stop = 1; }

Error crashed(std::string how) {
  return {
      ErrorKind::kFailed, "a process that did part of the work crashed", {}, std::move(how), {}};
}

// A Result on its way through a pipe: numbers of bytes with a line feed behind each, then the
// bytes. First the kind of the error, "-" for success.
void append(std::string& packed, const std::string& text) {
  packed += std::to_string(text.size()) + "\n" + text;
}

std::string packed(const Result<void>& result) {
  std::string text;
  append(text, result ? "-" : std::to_string(static_cast<int>(result.error().kind)));
  if (result) return text;
  const Error& error = result.error();
  for (const std::string* part : {&error.what, &error.where, &error.value, &error.rule}) {
    append(text, *part);
  }
  return text;
}

// The next piece, which is taken off the front; nothing if it is not whole.
std::optional<std::string> next_piece(std::string_view& packed) {
  std::size_t size = 0;
  const auto [end, error] = std::from_chars(packed.data(), packed.data() + packed.size(), size);
  const auto digits = static_cast<std::size_t>(end - packed.data());
  if (error != std::errc() || digits == packed.size() || packed[digits] != '\n')
    return std::nullopt;
  packed.remove_prefix(digits + 1);
  if (packed.size() < size) return std::nullopt;
  std::string piece(packed.substr(0, size));
  packed.remove_prefix(size);
  return piece;
}

Result<void> unpacked(std::string_view packed) {
  std::array<std::string, 5> pieces;  // the kind, and the four parts of an error
  for (std::size_t k = 0; k < pieces.size(); ++k) {
    auto piece = next_piece(packed);
    if (!piece) return fail(crashed("it left no result"));
    pieces[k] = *std::move(piece);
    if (pieces[0] == "-") return {};
  }
  return fail(
      {static_cast<ErrorKind>(std::stoi(pieces[0])), pieces[1], pieces[2], pieces[3], pieces[4]});
}

// In the copy: never returns. `listening` are the signals blocked before it was made.
[[noreturn]] void work_apart(const SideProcess::Work& work, int pipe, const sigset_t& listening) {
  ::setpgid(0, 0);  // Ctrl-C at the terminal reaches the parent, which asks once
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::signal(SIGTERM, note_stop_of_copy);
  ::pthread_sigmask(SIG_SETMASK, &listening, nullptr);
  Progress progress;
  progress.stop_requested = [] { return copy_should_stop != 0; };

  // Nothing may leave this function: what lies above it on the stack is the parent's business.
  std::string answer;
  try {
    answer = packed(work(progress));
  } catch (const std::exception& failure) {
    answer = packed(fail(crashed(failure.what())));
  } catch (...) {
    answer = packed(fail(crashed("an exception of no known type")));
  }

  std::size_t sent = 0;
  while (sent < answer.size()) {
    const ::ssize_t count = ::write(pipe, answer.data() + sent, answer.size() - sent);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    sent += static_cast<std::size_t>(count);
  }
  ::_exit(0);
}

}  // namespace

std::optional<SideProcess> SideProcess::start(const Work& work) {
  std::array<int, 2> pipe{-1, -1};
  if (::pipe2(pipe.data(), O_CLOEXEC) != 0) return std::nullopt;

  // A request to stop that comes before the copy listens waits until it does.
  sigset_t stop;
  sigset_t before;
  ::sigemptyset(&stop);
  ::sigaddset(&stop, SIGTERM);
  ::pthread_sigmask(SIG_BLOCK, &stop, &before);
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe[0]);
    work_apart(work, pipe[1], before);
  }
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ::close(pipe[1]);
  if (child < 0) {
    ::close(pipe[0]);
    return std::nullopt;
  }
  return SideProcess(child, pipe[0]);
}

SideProcess::SideProcess(SideProcess&& other) noexcept
    : process_(std::exchange(other.process_, -1)), pipe_(std::exchange(other.pipe_, -1)) {}

SideProcess::~SideProcess() {
  if (process_ < 0) return;
  ::kill(process_, SIGTERM);
  static_cast<void>(wait());
}

Result<void> SideProcess::wait(const Progress& progress) {
  EXPECTS(process_ >= 0);

  // All of the answer, asking the copy once to stop when we are asked.
  std::string answer;
  bool asked = false;
  for (;;) {
    if (!asked && progress.should_stop()) {
      ::kill(process_, SIGTERM);
      asked = true;
    }
    pollfd ready{pipe_, POLLIN, 0};
    if (::poll(&ready, 1, static_cast<int>(kPoll.count())) == 0) continue;
    std::array<char, 4096> buffer;
    const ::ssize_t count = ::read(pipe_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    answer.append(buffer.data(), static_cast<std::size_t>(count));
  }

  // The pipe has closed: the copy ended or crashed.
  ::close(std::exchange(pipe_, -1));
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (WIFSIGNALED(status)) return fail(crashed("signal " + std::to_string(WTERMSIG(status))));
  return unpacked(answer);
}

}  // namespace angiospline
