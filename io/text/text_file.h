// Text files as every reader of ours takes them: whole, bounded, free of BOM, line-end and locale
// trouble.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace angiospline {

// No centerline file is larger; a larger one is a mistake (an image, a mesh, a bomb).
inline constexpr std::size_t kMaxTextFileBytes = std::size_t{1} << 30;

// The bytes of a file, without a UTF-8 byte order mark. Errors: missing, a folder, unreadable,
// empty, larger than `max_bytes`, UTF-16, bytes that are not text (a zero byte).
Result<std::string> read_text_file(const std::filesystem::path& path,
                                   std::size_t max_bytes = kMaxTextFileBytes);

// The bytes of a file as they are. Errors: missing, a folder, unreadable, empty, too large.
Result<std::string> read_bytes(const std::filesystem::path& path,
                               std::size_t max_bytes = kMaxTextFileBytes);

// The checks of read_text_file for text already in memory: empty, UTF-16, zero bytes; drops the
// BOM.
Result<std::string_view> plain_text(std::string_view text, std::string_view name);

// One line after the other; a line ends with \n, \r\n or \r. O(length) in all, no copies.
class LineReader {
 public:
  explicit LineReader(std::string_view text) : rest_(text) {}

  // The next line without its end, or nothing when the text is used up.
  std::optional<std::string_view> next();
  int line() const { return line_; }  // number of the line last returned, from 1

 private:
  std::string_view rest_;
  int line_ = 0;
};

std::string_view trimmed(std::string_view text);        // of spaces and tabs
std::string_view trimmed_lines(std::string_view text);  // of line ends too
std::string lower_case(std::string_view text);          // ASCII only

// Splits at runs of spaces and tabs (`separator` = ' ') or at every `separator`, trimming each
// field and one pair of double quotes. `fields` is cleared first: a buffer kept by the caller's
// loop.
void split_fields(std::string_view line, char separator, std::vector<std::string_view>& fields);

// What separates the columns of a table, by one of its lines: the first of `;`, tab and `,` that
// stands in it, else ' '.
char separator_of(std::string_view line);

// A finite number, written with a decimal point whatever the locale; the whole text must be used.
std::optional<double> parse_number(std::string_view text);

// A whole number; "12.0" counts as one.
std::optional<long long> parse_whole_number(std::string_view text);

// "tree.swc:12".
std::string at_line(std::string_view name, int line);

// A value for an error message: at most 40 characters, without control characters.
std::string quoted_value(std::string_view text);

}  // namespace angiospline
