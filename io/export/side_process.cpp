#include "io/export/side_process.h"

#include <array>
#include <cerrno>
#include <csignal>
#include <exception>
#include <string>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

namespace angiospline {
namespace {

constexpr int kPollMilliseconds = 20;

volatile std::sig_atomic_t copy_should_stop = 0;
extern "C" void note_stop_of_copy(int) { copy_should_stop = 1; }

Error crashed(std::string how) {
  return {ErrorKind::kFailed, "a process that wrote a file crashed", {}, std::move(how), {}};
}

std::string packed(const Result<void>& result) {
  if (result) return "{}";
  const Error& e = result.error();
  const nlohmann::json json{{"kind", static_cast<int>(e.kind)},
                            {"what", e.what},
                            {"where", e.where},
                            {"value", e.value},
                            {"rule", e.rule}};
  return json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<void> unpacked(const std::string& text) {
  const nlohmann::json json = nlohmann::json::parse(text, nullptr, false);
  if (!json.is_object()) return fail(crashed("it left no result"));
  if (json.empty()) return {};
  return fail({static_cast<ErrorKind>(json.value("kind", 0)), json.value("what", ""),
               json.value("where", ""), json.value("value", ""), json.value("rule", "")});
}

// In the copy: never returns.
[[noreturn]] void work_apart(const SideProcess::Work& work, int pipe) {
  ::setpgid(0, 0);  // Ctrl-C at the terminal reaches the parent, which asks once
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  std::signal(SIGTERM, note_stop_of_copy);
  Progress progress;
  progress.stop_requested = [] { return copy_should_stop != 0; };
  std::string answer;
  try {
    answer = packed(work(progress));
  } catch (const std::exception& failure) {
    answer = packed(fail(crashed(failure.what())));
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
  const pid_t child = ::fork();
  if (child == 0) {
    ::close(pipe[0]);
    work_apart(work, pipe[1]);
  }
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
  std::string answer;
  bool asked = false;
  for (;;) {
    if (!asked && progress.should_stop()) {
      ::kill(process_, SIGTERM);
      asked = true;
    }
    pollfd ready{pipe_, POLLIN, 0};
    if (::poll(&ready, 1, kPollMilliseconds) == 0) continue;
    std::array<char, 4096> buffer;
    const ::ssize_t count = ::read(pipe_, buffer.data(), buffer.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    answer.append(buffer.data(), static_cast<std::size_t>(count));
  }
  ::close(std::exchange(pipe_, -1));
  int status = 0;
  while (::waitpid(process_, &status, 0) < 0 && errno == EINTR) {
  }
  process_ = -1;
  if (WIFSIGNALED(status)) return fail(crashed(fmt::format("signal {}", WTERMSIG(status))));
  return unpacked(answer);
}

}  // namespace angiospline
