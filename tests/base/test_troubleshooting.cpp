// docs/troubleshooting.md has an entry for each warning code and none for others, and quotes only
// errors that the program has.
#include <cctype>
#include <fstream>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "base/warning.h"
#include "tests/base/source_tree.h"
#include "tests/shapes/paths.h"

namespace angiospline {
namespace {

// The page's lines from the heading `from` to the heading `to`, or to its end.
std::vector<std::string> between(const std::string& from, const std::string& to) {
  std::ifstream file(testing_paths::source_folder() / "docs/troubleshooting.md");
  std::vector<std::string> lines;
  bool inside = false;
  for (std::string line; std::getline(file, line);) {
    if (line == from) inside = true;
    if (inside && !to.empty() && line == to) break;
    if (inside) lines.push_back(line);
  }
  return lines;
}

struct Entry {
  std::string name;
  bool shows_text = false;  // as the program prints it
  bool says_what_to_do = false;
};

std::vector<Entry> warning_entries() {
  std::vector<Entry> entries;
  for (const std::string& line : between("## Warnings", "## Failed parts")) {
    if (line.starts_with("### ")) entries.push_back({line.substr(4)});
    if (entries.empty()) continue;
    Entry& entry = entries.back();
    const std::string start = "    warning [" + entry.name + "]: ";
    if (line.starts_with(start) && line.size() > start.size() + 10) entry.shows_text = true;
    if (line.starts_with("**What to do.** ")) entry.says_what_to_do = true;
  }
  return entries;
}

TEST(Troubleshooting, HasOneEntryForEachWarningCodeAndNoOther) {
  std::multiset<std::string> documented, known;
  for (const Entry& entry : warning_entries()) documented.insert(entry.name);
  for (const WarningKind& kind : warning_kinds()) known.emplace(kind.name);
  EXPECT_EQ(documented, known);
}

TEST(Troubleshooting, EachWarningIsShownAsPrintedAndSaysWhatToDo) {
  int seen = 0;
  for (const Entry& entry : warning_entries()) {
    EXPECT_TRUE(entry.shows_text) << entry.name;
    EXPECT_TRUE(entry.says_what_to_do) << entry.name;
    ++seen;
  }
  EXPECT_GT(seen, 30);
}

// "wall-folds" is kWallFolds in C++.
std::string enumerator(std::string_view name) {
  std::string result = "WarningCode::k";
  bool capital = true;
  for (const char c : name) {
    if (c != '-') result += capital ? static_cast<char>(std::toupper(c)) : c;
    capital = c == '-';
  }
  return result;
}

TEST(Troubleshooting, ExplainsNoCodeThatNothingGives) {
  std::set<std::string> given;
  static const std::regex kCode(R"(WarningCode::k\w+)");
  for (const source_tree::File& file : source_tree::files()) {
    if (file.library == "base") continue;
    for (const std::string& line : file.lines) {
      for (std::sregex_iterator at(line.begin(), line.end(), kCode), none; at != none; ++at) {
        given.insert(at->str());
      }
    }
  }
  for (const WarningKind& kind : warning_kinds()) {
    if (kind.code == WarningCode::kUnspecified) continue;  // of files only
    EXPECT_TRUE(given.contains(enumerator(kind.name))) << kind.name;
  }
}

// Every string literal of the sources, adjacent ones joined as the compiler does it.
std::string all_literals() {
  static const std::regex kLiteral(R"re("((?:[^"\\\n]|\\.)*)")re");
  static const std::regex kBetween(R"(\s*)");
  std::string literals;
  for (const source_tree::File& file : source_tree::files()) {
    if (file.is_header()) continue;
    std::string text;
    for (const std::string& line : file.lines) text += line + "\n";
    auto end_of_last = text.cbegin();
    for (std::sregex_iterator at(text.begin(), text.end(), kLiteral), none; at != none; ++at) {
      if (!std::regex_match(end_of_last, (*at)[0].first, kBetween)) literals += '\n';
      literals += (*at)[1];
      end_of_last = (*at)[0].second;
    }
    literals += '\n';
  }
  return literals;
}

TEST(Troubleshooting, QuotesOnlyErrorsThatTheProgramHas) {
  const std::string literals = all_literals();
  static const std::regex kRow(R"(\| `([^`]+)` \| (.+) \|)");
  int quoted = 0;
  for (const std::string& line : between("### The command line", "")) {
    std::smatch row;
    if (!std::regex_match(line, row, kRow)) continue;
    EXPECT_NE(literals.find(row[1]), std::string::npos) << row[1] << " is not in the sources";
    ++quoted;
  }
  EXPECT_GT(quoted, 90);
}

}  // namespace
}  // namespace angiospline
