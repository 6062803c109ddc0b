#include "io/text/text_file.h"

#include <charconv>
#include <cmath>
#include <fstream>

#include <fmt/format.h>

namespace angiospline {
namespace {

constexpr std::string_view kSpaces = " \t\v\f";

// from_chars takes no plus sign.
std::string_view without_plus(std::string_view text) {
  const bool plus = text.size() > 1 && text[0] == '+' && text[1] != '-' && text[1] != '+';
  return plus ? text.substr(1) : text;
}

std::string_view unquoted(std::string_view field) {
  field = trimmed(field);
  if (field.size() >= 2 && field.front() == '"' && field.back() == '"') {
    field = trimmed(field.substr(1, field.size() - 2));
  }
  return field;
}

}  // namespace

Result<std::string> read_bytes(const std::filesystem::path& path, std::size_t max_bytes) {
  const std::string name = path.string();
  std::error_code code;
  const auto status = std::filesystem::status(path, code);
  if (!std::filesystem::exists(status)) {
    return fail({ErrorKind::kBadInput, "no such file", name, {}, {}});
  }
  if (std::filesystem::is_directory(status)) {
    return fail({ErrorKind::kBadInput, "is a folder, not a file", name, {}, {}});
  }

  // Read in blocks: whatever the file says of its size, no more than max_bytes is kept.
  std::ifstream stream(path, std::ios::binary);
  if (!stream) return fail({ErrorKind::kBadInput, "cannot be opened for reading", name, {}, {}});
  std::string text;
  std::string block(std::size_t{1} << 16, '\0');
  while (stream.read(block.data(), static_cast<std::streamsize>(block.size())),
         stream.gcount() > 0) {
    text.append(block.data(), static_cast<std::size_t>(stream.gcount()));
    if (text.size() > max_bytes) {
      return fail({ErrorKind::kBadInput, "is too large", name,
                   fmt::format("over {} bytes", max_bytes),
                   fmt::format("a file may have {} bytes", max_bytes)});
    }
  }

  if (stream.bad()) return fail({ErrorKind::kBadInput, "cannot be read to its end", name, {}, {}});
  if (text.empty()) {
    return fail({ErrorKind::kBadInput, "is empty", name, {}, "there must be at least one point"});
  }
  return text;
}

Result<std::string> read_text_file(const std::filesystem::path& path, std::size_t max_bytes) {
  Result<std::string> text = read_bytes(path, max_bytes);
  if (!text) return text;
  const Result<std::string_view> plain = plain_text(*text, path.string());
  if (!plain) return fail(plain.error());
  if (plain->size() < text->size()) text->erase(0, text->size() - plain->size());
  return text;
}

Result<std::string_view> plain_text(std::string_view text, std::string_view name) {
  const auto bad = [&](std::string what, std::string rule) {
    return fail({ErrorKind::kBadInput, std::move(what), std::string(name), {}, std::move(rule)});
  };
  if (text.substr(0, 3) == "\xEF\xBB\xBF") text.remove_prefix(3);
  if (text.substr(0, 2) == "\xFF\xFE" || text.substr(0, 2) == "\xFE\xFF") {
    return bad("is UTF-16 text", "save it as UTF-8 or ASCII");
  }
  if (text.find_first_not_of(" \t\r\n\v\f") == std::string_view::npos) {
    return bad("is empty", "there must be at least one point");
  }
  if (const auto zero = text.find('\0'); zero != std::string_view::npos) {
    return bad(fmt::format("is not text: byte {} is zero", zero), "centerline files are text");
  }
  return text;
}

std::optional<std::string_view> LineReader::next() {
  if (rest_.empty()) return std::nullopt;
  const std::size_t end = rest_.find_first_of("\r\n");
  const std::string_view found = rest_.substr(0, end);
  if (end == std::string_view::npos) {
    rest_ = {};
  } else {
    const bool two = rest_[end] == '\r' && end + 1 < rest_.size() && rest_[end + 1] == '\n';
    rest_.remove_prefix(end + (two ? 2 : 1));
  }
  ++line_;
  return found;
}

std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(kSpaces);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kSpaces) - first + 1);
}

std::string_view trimmed_lines(std::string_view text) {
  constexpr std::string_view kBlank = " \t\v\f\r\n";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

void split_fields(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  if (separator != ' ') {
    for (std::size_t end = line.find(separator);; end = line.find(separator)) {
      fields.push_back(unquoted(line.substr(0, end)));
      if (end == std::string_view::npos) return;
      line.remove_prefix(end + 1);
    }
  }
  while (true) {
    const std::size_t first = line.find_first_not_of(kSpaces);
    if (first == std::string_view::npos) return;
    line.remove_prefix(first);
    const std::size_t end = line.find_first_of(kSpaces);
    fields.push_back(line.substr(0, end));
    if (end == std::string_view::npos) return;
    line.remove_prefix(end);
  }
}

char separator_of(std::string_view line) {
  for (const char c : {';', '\t', ','}) {
    if (line.find(c) != std::string_view::npos) return c;
  }
  return ' ';
}

std::optional<double> parse_number(std::string_view text) {
  text = without_plus(text);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

std::optional<long long> parse_whole_number(std::string_view text) {
  text = without_plus(text);
  long long value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc{} && end == text.data() + text.size()) return value;
  const std::optional<double> number = parse_number(text);
  if (!number || std::abs(*number) > 9e15 || *number != std::floor(*number)) return std::nullopt;
  return static_cast<long long>(*number);
}

std::string at_line(std::string_view name, int line) { return fmt::format("{}:{}", name, line); }

std::string quoted_value(std::string_view text) {
  constexpr std::size_t kLongest = 40;
  std::string value(text.substr(0, kLongest));
  for (char& c : value) {
    if (static_cast<unsigned char>(c) < 0x20) c = '?';
  }
  return text.size() > kLongest ? value + "..." : value;
}

}  // namespace angiospline
