// Runs the built program as a user would, in a folder of its own.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace angiospline::test {

struct ProgramRun {
  int exit_code = -1;
  std::string out;
  std::string err;
};

// A fresh folder that goes away with the object.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::string operator/(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const;  // its path
  std::vector<std::string> files() const;  // sorted names, folders included

 private:
  std::filesystem::path path_;
};

// The path of the program under test.
std::string program_path();

// The program with these arguments; waits for its end.
ProgramRun run_angiospline(const std::vector<std::string>& arguments);

// The first lines of a text: what should be one line ends with its only line feed.
bool is_one_line(const std::string& text);

}  // namespace angiospline::test
