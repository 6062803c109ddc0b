#include "tests/base/source_tree.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "tests/shapes/paths.h"

namespace angiospline::source_tree {
namespace {

namespace fs = std::filesystem;

const fs::path& root() {
  static const fs::path kRoot = testing_paths::source_folder();
  return kRoot;
}

std::vector<std::string> lines_of(const fs::path& path) {
  std::ifstream stream(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

std::string library_of(const std::string& path) {
  if (path.starts_with("recovery/imaging/")) return "imaging";
  return path.substr(0, path.find('/'));
}

std::vector<File> read_files(const std::vector<std::string>& folders) {
  static const std::regex kInclude(R"re(^\s*#\s*include\s*["<]([^">]+)[">])re");
  std::vector<File> result;
  for (const std::string& folder : folders) {
    if (!fs::exists(root() / folder)) continue;
    for (const auto& entry : fs::recursive_directory_iterator(root() / folder)) {
      const std::string suffix = entry.path().extension().string();
      if (suffix != ".h" && suffix != ".cpp") continue;

      File file;
      file.path = fs::relative(entry.path(), root()).string();
      file.library = library_of(file.path);
      file.room = fs::path(file.path).parent_path().string();
      file.lines = lines_of(entry.path());
      for (const std::string& line : file.lines) {
        std::smatch match;
        if (line.starts_with("#") && std::regex_search(line, match, kInclude)) {
          file.includes.push_back(match[1]);
        }
      }
      result.push_back(std::move(file));
    }
  }
  std::sort(result.begin(), result.end(),
            [](const File& a, const File& b) { return a.path < b.path; });
  return result;
}

// The words of a CMake list behind each of its upper-case keys, comments left out.
std::map<std::string, std::vector<std::string>> keyed_words(const fs::path& path,
                                                            const std::string& command) {
  std::string text;
  for (const std::string& line : lines_of(path)) text += line.substr(0, line.find('#')) + "\n";
  std::map<std::string, std::vector<std::string>> result;
  const std::size_t start = text.find(command + "(");
  if (start == std::string::npos) return result;
  const std::size_t first = start + command.size() + 1;
  std::istringstream words(text.substr(first, text.find(')', first) - first));
  static const std::regex kKey("[A-Z_]+");
  std::string key;
  for (std::string word; words >> word;) {
    while (!word.empty() && word.back() == ')') word.pop_back();
    if (std::regex_match(word, kKey)) {
      key = word;
    } else if (!word.empty()) {
      result[key].push_back(word);
    }
  }
  return result;
}

Library library_in(const std::string& folder) {
  Library library{folder, {}, {}};
  auto words = keyed_words(root() / folder / "CMakeLists.txt", "angiospline_library");
  for (const std::string& name : words["ROOMS"]) {
    const std::string room = folder + "/" + name;
    auto lists = keyed_words(root() / room / "CMakeLists.txt", "angiospline_room");
    library.room_order.push_back(room);
    library.rooms[room] = {lists["PUBLIC"], lists["PRIVATE"], lists["SOURCES"]};
  }
  if (library.rooms.empty()) {
    library.room_order = {folder};
    library.rooms[folder] = {words["HEADERS"], words["PRIVATE_HEADERS"], words["SOURCES"]};
  }
  return library;
}

std::size_t indent_of(const std::string& line) {
  return std::min(line.find_first_not_of(' '), line.size());
}

// Whether a line, indented as the definitions of its namespace or class are, opens a function's
// body: what clang-format leaves at the end of a signature.
bool opens_function(const std::string& line, std::size_t indent) {
  if (line.empty() || line.back() != '{') return false;
  const std::string first = line.substr(indent, line.find_first_of(" ({", indent) - indent);
  static const std::set<std::string> kOther{
      "namespace", "struct", "class", "enum", "union",  "extern", "if", "for",  "while",
      "switch",    "do",     "else",  "try",  "return", "}",      "//", "case", ""};
  if (kOther.contains(first)) return false;
  // An initialiser in braces is no function.
  const std::size_t equals = line.find(" = ");
  return equals == std::string::npos || line.find('(') < equals;
}

}  // namespace

const std::vector<File>& files() {
  static const std::vector<File> kFiles =
      read_files({"base", "kernel", "modeling", "recovery", "io", "pipeline", "cli"});
  return kFiles;
}

const std::vector<File>& test_files() {
  static const std::vector<File> kFiles = read_files({"tests", "benches"});
  return kFiles;
}

const File* find(const std::string& path) {
  const auto& all = files();
  const auto place = std::lower_bound(
      all.begin(), all.end(), path,
      [](const File& file, const std::string& wanted) { return file.path < wanted; });
  return place != all.end() && place->path == path ? &*place : nullptr;
}

const std::map<std::string, Library>& libraries() {
  static const std::map<std::string, Library> kLibraries = [] {
    std::map<std::string, Library> result;
    for (const char* folder :
         {"base", "kernel", "modeling", "recovery/imaging", "recovery", "io", "pipeline"}) {
      if (!fs::exists(root() / folder)) continue;
      result[library_of(std::string(folder) + "/")] = library_in(folder);
    }
    return result;
  }();
  return kLibraries;
}

std::vector<Function> functions() {
  std::vector<Function> result;
  for (const File& file : files()) {
    const auto& lines = file.lines;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      if (lines[i].empty() || lines[i].back() != '{') continue;

      // A signature over several lines starts at the last line that is indented as a definition is.
      std::size_t first = i;
      while (first > 0 && indent_of(lines[first]) > 2) --first;
      const std::size_t indent = indent_of(lines[first]);
      std::string signature;
      for (std::size_t k = first; k <= i; ++k)
        signature += lines[k].substr(k == first ? 0 : indent);
      const bool whole = signature.find(';') == std::string::npos;
      if (indent > 2 || !whole || !opens_function(signature, indent)) continue;

      const std::string closing = std::string(indent, ' ') + "}";
      std::size_t end = i + 1;
      Function function{file.path, static_cast<int>(first) + 1, 0, 0, false};
      while (end < lines.size() && lines[end] != closing) {
        function.blank_lines += lines[end].empty() ? 1 : 0;
        ++end;
      }
      if (end == lines.size()) continue;
      function.lines = static_cast<int>(end - first + 1);
      function.has_reason = first > 0 && lines[first - 1].find("Long: ") != std::string::npos;
      result.push_back(function);
      i = end;
    }
  }
  return result;
}

}  // namespace angiospline::source_tree
