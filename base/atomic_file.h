// Files that appear whole or not at all: written under a temporary name, then renamed.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>

#include "base/result.h"

namespace angiospline {

// Lets `write` fill a file and moves it to `path` when it succeeded; on any failure `path` is as it
// was before and nothing else is left behind. `write` gets a path with the file name of `path`, so
// that writers which go by the suffix work, inside a fresh folder beside `path`, on the same file
// system. The bytes are flushed to the disk before the rename, so a full disk is seen here.
// A link is followed and stays a link; a device or pipe (/dev/stdout) gets the finished bytes.
// Errors: that of `write`; kCannotWrite naming `path` for a missing folder, a folder in the place
// of the file, no permission, a full disk.
Result<void> write_atomically(
    const std::filesystem::path& path,
    const std::function<Result<void>(const std::filesystem::path&)>& write);

// The same for bytes in memory.
Result<void> write_file(const std::filesystem::path& path, std::string_view bytes);

// The bytes of a file. Errors: kBadInput naming `path` for a missing or unreadable file or a
// folder.
Result<std::string> read_file(const std::filesystem::path& path);

}  // namespace angiospline
