// Subcommands and their options, which parse straight into variables of ours. CLI11, which takes
// seconds to compile, stays behind this header.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/vector.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace angiospline::cli {

// An option that was added, for what else is asked of it.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  Option required() const;
  Option between(int least, int most) const;
  Option between(double least, double most) const;
  Option positive() const;
  Option not_negative() const;
  Option one_of(const std::vector<std::string>& words) const;
  Option needs(const Option& other) const;     // is an error without it
  Option excludes(const Option& other) const;  // is an error with it

 private:
  CLI::Option* option_;
};

// One subcommand. A name is "POSITIONAL", "-s,--long" or "--long"; "!--no-x" sets a flag to false.
// Targets must outlive the parsing, and hold the default when they are added: help shows it.
class Command {
 public:
  using Points = std::vector<Vec3>;
  using Paths = std::vector<std::filesystem::path>;

  explicit Command(CLI::App* app, std::function<int()>* chosen) : app_(app), chosen_(chosen) {}

  void alias(const std::string& name) const;

  Option add(const std::string& name, std::string& target, const std::string& help) const;
  Option add(const std::string& name, std::filesystem::path& target, const std::string& help) const;
  Option add(const std::string& name, int& target, const std::string& help) const;
  Option add(const std::string& name, std::uint64_t& target, const std::string& help) const;
  Option add(const std::string& name, double& target, const std::string& help) const;
  Option add(const std::string& name, std::optional<int>& target, const std::string& help) const;
  Option add(const std::string& name, std::optional<std::size_t>& target,
             const std::string& help) const;
  Option add(const std::string& name, std::optional<double>& target, const std::string& help) const;

  // One after the other, or the option again.
  Option add(const std::string& name, std::vector<std::string>& target,
             const std::string& help) const;
  Option add(const std::string& name, Paths& target, const std::string& help) const;

  Option flag(const std::string& name, bool& target, const std::string& help) const;
  Option flag(const std::string& name, const std::function<void()>& found,
              const std::string& help) const;

  // A text that `read` makes sense of: the message of the Error it returns goes to the user.
  Option text(const std::string& name,
              const std::function<std::optional<std::string>(const std::string&)>& read,
              const std::string& help) const;

  // X,Y,Z: one point; or points, one each time the option is given.
  Option point(const std::string& name, const std::function<void(const Vec3&)>& found,
               const std::string& help) const;
  Option points(const std::string& name, Points& target, const std::string& help) const;

  // One of some words, each of which stands for a value.
  template <typename Target, typename Value>
  Option choose(const std::string& name, Target& target,
                const std::vector<std::pair<std::string, Value>>& words,
                const std::string& help) const {
    std::vector<std::string> texts;
    std::string now;
    for (const auto& [text, value] : words) {
      texts.push_back(text);
      if (target == value) now = text;
    }
    return word(
        name, texts, now, [&target, words](std::size_t k) { target = words[k].second; }, help);
  }

  // What to do when the command line names this command; returns the exit code.
  void runs(std::function<int()> verb) const;

 private:
  Option word(const std::string& name, const std::vector<std::string>& words,
              const std::string& now, const std::function<void(std::size_t)>& found,
              const std::string& help) const;

  CLI::App* app_;
  std::function<int()>* chosen_;
};

class CommandLine {
 public:
  CommandLine(const std::string& program, const std::string& help, const std::string& version);
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  Command command(const std::string& name, const std::string& help);

  // Parses, then runs the command that was named; the exit code. Mistakes are told in one line.
  int run(int argc, const char* const* argv);

 private:
  std::unique_ptr<CLI::App> app_;
  std::function<int()> chosen_;
};

}  // namespace angiospline::cli
