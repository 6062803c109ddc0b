// The command reference, the man page and the completions are what scripts/make_reference.py makes
// of the program's help, and each of them knows every command and every option.
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/run_program.h"
#include "tests/shapes/paths.h"

namespace angiospline::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPython = "/usr/bin/python3";
constexpr const char* kGenerated[] = {"docs/reference.md", "cli/man/angiospline.1",
                                      "cli/completions/angiospline.bash",
                                      "cli/completions/_angiospline"};

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

std::string committed(const std::string& name) {
  return text_of(testing_paths::source_folder() / name);
}

// What a shell command prints.
std::string output_of(const std::string& command, const TemporaryFolder& folder) {
  EXPECT_EQ(std::system((command + " >'" + (folder / "said") + "' 2>&1").c_str()), 0)
      << command << "\n"
      << text_of(folder / "said");
  return text_of(folder / "said");
}

// The names of the subcommands in the order of the program's help, each with its other names.
std::vector<std::vector<std::string>> commands() {
  const std::string help = run_angiospline({"--help"}).out;
  static const std::regex kNames(R"(\n  ([a-z][a-z-]*(?:, [a-z][a-z-]*)*)  )");
  static const std::regex kName("[a-z][a-z-]*");
  const std::string listed = help.substr(help.find("Subcommands:"));
  const std::sregex_iterator none;
  std::vector<std::vector<std::string>> result;
  for (std::sregex_iterator line(listed.begin(), listed.end(), kNames); line != none; ++line) {
    const std::string head = (*line)[1];
    result.emplace_back();
    for (std::sregex_iterator at(head.begin(), head.end(), kName); at != none; ++at) {
      result.back().push_back(at->str());
    }
  }
  return result;
}

// The long names of a command's options.
std::set<std::string> options_of(const std::string& command) {
  const std::string help = run_angiospline({command, "--help"}).out;
  static const std::regex kOption(R"(\n  (?:-\w,)?(--[a-z][a-z-]*))");
  std::set<std::string> names;
  for (std::sregex_iterator at(help.begin(), help.end(), kOption), none; at != none; ++at) {
    names.insert((*at)[1]);
  }
  return names;
}

TEST(Reference, IsWhatTheProgramSaysOfItself) {
  if (!fs::exists(kPython)) GTEST_SKIP() << "no " << kPython;
  const TemporaryFolder folder;
  output_of(std::string(kPython) + " '" +
                (testing_paths::source_folder() / "scripts/make_reference.py").string() + "' '" +
                program_path() + "' '" + folder.path().string() + "'",
            folder);
  for (const char* name : kGenerated) {
    EXPECT_EQ(text_of(folder.path() / name), committed(name))
        << name << ": run scripts/make_reference.py with the program and commit what it writes";
  }
}

TEST(Reference, PageManPageAndCompletionsKnowEveryCommandAndOption) {
  const std::string page = committed("docs/reference.md");
  std::string man = committed("cli/man/angiospline.1");
  man.erase(std::remove(man.begin(), man.end(), '\\'), man.end());
  const std::string zsh = committed("cli/completions/_angiospline");
  int options = 0;
  for (const std::vector<std::string>& names : commands()) {
    const std::string& command = names.front();
    const std::size_t section = page.find("\n## " + command + "\n");
    ASSERT_NE(section, std::string::npos) << command;
    const std::string own = page.substr(section, page.find("\n## ", section + 1) - section);
    EXPECT_NE(man.find(".SS angiospline " + command), std::string::npos) << command;
    for (const std::string& name : names) {
      EXPECT_NE(zsh.find("'" + name + ":"), std::string::npos) << name;
      if (name == command) continue;
      EXPECT_NE(own.find("Also called `" + name + "`"), std::string::npos) << name;
    }
    for (const std::string& option : options_of(command)) {
      EXPECT_TRUE(std::regex_search(own, std::regex("[`, ]" + option + "[` ,]")))
          << command << " " << option;
      EXPECT_NE(man.find("fB" + option + "fR"), std::string::npos) << command << " " << option;
      EXPECT_TRUE(std::regex_search(zsh, std::regex(option + "[\\[}]"))) << command << option;
      ++options;
    }
  }
  EXPECT_GT(options, 80);
}

// What bash offers at the end of a command line.
std::string offered(const std::string& words, const TemporaryFolder& folder) {
  const std::string script =
      "source '" + (testing_paths::source_folder() / "cli/completions/angiospline.bash").string() +
      "'; COMP_WORDS=(" + words +
      "); COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _angiospline; echo \"${COMPREPLY[@]}\"";
  const std::string file = folder.write("complete.sh", script);
  return output_of("bash '" + file + "'", folder);
}

TEST(BashCompletion, OffersCommandsOptionsAndChoices) {
  const TemporaryFolder folder;
  std::string all;
  for (const std::vector<std::string>& names : commands()) {
    for (const std::string& name : names) all += name + " ";
  }
  EXPECT_NE(all.find("seed build "), std::string::npos) << all;
  EXPECT_EQ(offered("angiospline ''", folder).substr(0, all.size()), all);
  EXPECT_EQ(offered("angiospline conv", folder), "convert\n");
  EXPECT_EQ(offered("angiospline seed tree.swc --clear", folder), "--clearance\n");
  EXPECT_EQ(offered("angiospline build tree.swc --clear", folder), "--clearance\n");
  EXPECT_EQ(offered("angiospline seed tree.swc --frame ''", folder), "LPS RAS\n");
  EXPECT_EQ(offered("angiospline phantom ri", folder), "rings\n");
}

TEST(BashCompletion, LeavesFilesToTheShell) {
  const TemporaryFolder folder;
  EXPECT_EQ(offered("angiospline seed tr", folder), "\n");
  EXPECT_EQ(offered("angiospline phantom rings -o ''", folder), "\n");
}

}  // namespace
}  // namespace angiospline::test
