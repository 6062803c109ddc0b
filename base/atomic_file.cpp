#include "base/atomic_file.h"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include <fcntl.h>
#include <unistd.h>

namespace angiospline {
namespace {

namespace fs = std::filesystem;

tl::unexpected<Error> cannot_write(const fs::path& path, std::string what, std::string rule = {}) {
  return fail({ErrorKind::kCannotWrite, std::move(what), path.string(), {}, std::move(rule)});
}

// A folder with a name of its own, removed with all it holds at the end of the scope.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const fs::path& parent) {
    std::string name = (parent / ".angiospline-XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) path_ = name;
  }
  ~TemporaryFolder() {
    std::error_code ignored;
    if (!path_.empty()) fs::remove_all(path_, ignored);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

// An open file descriptor that closes itself.
class Descriptor {
 public:
  Descriptor(const fs::path& path, int flags)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, 0666)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;

  bool open() const { return fd_ >= 0; }
  bool flush_to_disk() const { return ::fsync(fd_) == 0; }
  bool write_all(std::string_view bytes) const {
    while (!bytes.empty()) {
      const ::ssize_t count = ::write(fd_, bytes.data(), bytes.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return false;
      bytes.remove_prefix(static_cast<std::size_t>(count));
    }
    return true;
  }

 private:
  int fd_;
};

// Devices and pipes cannot be renamed over: the finished bytes are written into them.
Result<void> write_through(const fs::path& path,
                           const std::function<Result<void>(const fs::path&)>& write) {
  const TemporaryFolder folder(fs::temp_directory_path());
  if (folder.path().empty()) {
    return cannot_write(fs::temp_directory_path(), std::strerror(errno));
  }
  const fs::path temporary = folder.path() / path.filename();
  if (auto done = write(temporary); !done) return done;
  const Result<std::string> bytes = read_file(temporary);
  if (!bytes) return cannot_write(path, "nothing was written", bytes.error().message());
  const Descriptor target(path, O_WRONLY);
  if (!target.open() || !target.write_all(*bytes)) return cannot_write(path, std::strerror(errno));
  return {};
}

}  // namespace

Result<void> write_atomically(const fs::path& given,
                              const std::function<Result<void>(const fs::path&)>& write) {
  std::error_code ec;
  if (given.filename().empty()) return cannot_write(given, "not a file name");
  const fs::file_status status = fs::status(given, ec);
  if (fs::is_directory(status)) {
    return cannot_write(given, "a folder is in the place of the file");
  }

  // Devices and pipes cannot be renamed over; links are followed to the file they name.
  if (fs::exists(status) && !fs::is_regular_file(status)) return write_through(given, write);
  const fs::path path = fs::exists(status) ? fs::canonical(given, ec) : given;
  const fs::path parent = path.has_parent_path() ? path.parent_path() : fs::path(".");
  if (!fs::is_directory(parent, ec)) {
    return cannot_write(given, "the folder does not exist", "folder " + parent.string());
  }

  const TemporaryFolder folder(parent);
  if (folder.path().empty()) return cannot_write(given, std::strerror(errno));
  const fs::path temporary = folder.path() / path.filename();
  if (auto done = write(temporary); !done) return done;

  // The data is on the disk before the name is: a crash leaves the old file or the new one.
  const Descriptor written(temporary, O_RDONLY);
  if (!written.open()) return cannot_write(given, "nothing was written");
  if (!written.flush_to_disk()) return cannot_write(given, std::strerror(errno));
  fs::rename(temporary, path, ec);
  if (ec) return cannot_write(given, ec.message());
  return {};
}

Result<void> write_file(const fs::path& path, std::string_view bytes) {
  return write_atomically(path, [&](const fs::path& temporary) -> Result<void> {
    const Descriptor file(temporary, O_WRONLY | O_CREAT | O_EXCL);
    if (!file.open() || !file.write_all(bytes)) return cannot_write(path, std::strerror(errno));
    return {};
  });
}

Result<std::string> read_file(const fs::path& path) {
  const auto bad = [&](std::string what) {
    return fail({ErrorKind::kBadInput, std::move(what), path.string(), {}, {}});
  };
  std::error_code ec;
  if (fs::is_directory(path, ec)) return bad("is a folder, not a file");
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  if (!file) return bad(errno != 0 ? std::strerror(errno) : "cannot be opened");
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (file.bad()) return bad("cannot be read");
  return bytes;
}

}  // namespace angiospline
