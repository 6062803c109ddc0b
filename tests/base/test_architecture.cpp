// The house: libraries and rooms depend on each other downwards only, headers are public or private
// on purpose, heavy libraries stay where they belong, and one name means one thing.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/base/source_tree.h"
#include "tests/shapes/paths.h"

namespace angiospline::source_tree {
namespace {

namespace fs = std::filesystem;

const std::map<std::string, std::set<std::string>>& allowed_libraries() {
  static const std::map<std::string, std::set<std::string>> kAllowed{
      {"base", {"base"}},
      {"kernel", {"base", "kernel"}},
      {"modeling", {"base", "kernel", "modeling"}},
      {"imaging", {"base", "kernel", "imaging"}},
      {"recovery", {"base", "kernel", "modeling", "imaging", "recovery"}},
      {"io", {"base", "kernel", "modeling", "imaging", "io"}},
      {"pipeline", {"base", "kernel", "modeling", "imaging", "recovery", "io", "pipeline"}},
      {"cli", {"base", "kernel", "modeling", "imaging", "recovery", "io", "pipeline", "cli"}},
  };
  return kAllowed;
}

bool matches(const std::string& target, const char* pattern) {
  return std::regex_search(target, std::regex(pattern));
}

constexpr std::size_t kUntestedHeaders = 4;
constexpr int kWalls = 10;

constexpr const char* kOpenCascade =
    "^(BRep|Geom|TopoDS|TopExp|TopTools|STEP|IGES|XCAF|TDF|TDoc|gp_|Standard_|Poly_|TCol|Shape|BOP|"
    "BSplCLib|BSplSLib|TopAbs|TopLoc|Bnd_|Interface_|Quantity_|Message_)";
constexpr const char* kItk = "^(itk|vnl)";
constexpr const char* kVtk = "^vtk";

TEST(Architecture, LibrariesIncludeDownwardsOnly) {
  int checked = 0;
  for (const File& file : files()) {
    for (const std::string& target : file.includes) {
      const File* included = find(target);
      if (!included) continue;
      EXPECT_TRUE(allowed_libraries().at(file.library).contains(included->library))
          << file.path << " includes " << target;
      ++checked;
    }
  }
  EXPECT_GT(checked, 500);
}

TEST(Architecture, RoomsIncludeRoomsListedBeforeThemOnly) {
  int checked = 0;
  for (const auto& [name, library] : libraries()) {
    std::map<std::string, int> floor;
    for (const std::string& room : library.room_order) {
      floor.emplace(room, static_cast<int>(floor.size()));
    }
    for (const File& file : files()) {
      if (file.library != name) continue;
      ASSERT_TRUE(floor.contains(file.room)) << file.path << " lies in no room of " << name;
      for (const std::string& target : file.includes) {
        const File* included = find(target);
        if (!included || included->library != name) continue;
        EXPECT_LE(floor.at(included->room), floor.at(file.room))
            << file.path << " includes " << target << ": the room stands higher in "
            << library.folder << "/CMakeLists.txt";
        ++checked;
      }
    }
  }
  EXPECT_GT(checked, 400);
}

// Which headers are installed.
std::set<std::string> public_headers() {
  std::set<std::string> result;
  for (const auto& [name, library] : libraries()) {
    for (const auto& [folder, room] : library.rooms) {
      for (const std::string& header : room.public_headers) result.insert(folder + "/" + header);
    }
  }
  return result;
}

TEST(Architecture, RoomsListTheirFiles) {
  for (const auto& [name, library] : libraries()) {
    for (const auto& [folder, room] : library.rooms) {
      std::set<std::string> listed;
      for (const auto* list : {&room.public_headers, &room.private_headers, &room.sources}) {
        for (const std::string& file : *list) {
          if (file.front() == '$') continue;  // made by CMake
          EXPECT_TRUE(listed.insert(folder + "/" + file).second)
              << folder << " lists twice: " << file;
        }
      }
      std::set<std::string> there;
      for (const File& file : files()) {
        if (file.room == folder) there.insert(file.path);
      }
      EXPECT_EQ(listed, there) << folder << "/CMakeLists.txt";
    }
  }
}

TEST(Architecture, PublicHeadersIncludePublicHeadersOnly) {
  const std::set<std::string> open = public_headers();
  for (const File& file : files()) {
    for (const std::string& target : file.includes) {
      const File* included = find(target);
      if (!included || included->library == "cli" || open.contains(target)) continue;
      EXPECT_FALSE(open.contains(file.path)) << file.path << " includes the private " << target;
      EXPECT_NE(file.library, "cli") << file.path << " includes the private " << target;
    }
  }
  EXPECT_GT(open.size(), 40u);
  EXPECT_LE(open.size(), 90u) << "only what a user of the libraries needs is public";
}

TEST(Architecture, FoldersHoldFewFiles) {
  std::map<std::string, int> count;
  for (const auto* list : {&files(), &test_files()}) {
    for (const File& file : *list) ++count[file.room];
  }
  for (const auto& [folder, number] : count) {
    if (folder == "benches") continue;
    EXPECT_LE(number, 25) << folder;
  }
  EXPECT_GT(count.size(), 40u);
}

TEST(Architecture, TypeNamesStandInOneHeader) {
  static const std::regex kType(R"(^(?:struct|class|enum class|enum)\s+(\w+)\b[^;]*$)");
  std::map<std::string, std::set<std::string>> homes;
  for (const File& file : files()) {
    if (!file.is_header()) continue;
    for (const std::string& line : file.lines) {
      std::smatch match;
      if (std::regex_match(line, match, kType)) homes[match[1]].insert(file.path);
    }
  }
  for (const auto& [name, headers] : homes) {
    EXPECT_EQ(headers.size(), 1u) << name << " stands in " << *headers.begin() << " and "
                                  << *headers.rbegin();
  }
  EXPECT_GT(homes.size(), 150u);
}

TEST(Architecture, BaseAndKernelKnowFewLibraries) {
  for (const File& file : files()) {
    if (file.library != "base" && file.library != "kernel") continue;
    for (const std::string& target : file.includes) {
      const bool ours = matches(target, "^(base|kernel)/");
      const bool standard = matches(target, "^[a-z_0-9]+$");
      const bool known = matches(
          target, "^(Eigen/|tl/expected.hpp|unistd.h|fcntl.h|spawn.h|poll.h|signal.h|sys/)");
      const bool in_geometry = file.room == "kernel/geometry" && !file.is_header() &&
                               matches(target, "^(nanoflann.hpp|tbb/)");
      EXPECT_TRUE(ours || standard || known || in_geometry) << file.path << " includes " << target;
    }
  }
}

TEST(Architecture, FileFormatLibrariesStayInIo) {
  for (const File& file : files()) {
    if (file.library == "io") continue;
    for (const std::string& target : file.includes) {
      EXPECT_FALSE(matches(target, kItk) || matches(target, kVtk) ||
                   matches(target, "^(tiny_gltf|STEP|IGES|XCAF)"))
          << file.path << " includes " << target;
    }
  }
}

TEST(Architecture, HeavyHeadersNeverCrossOneOfOurs) {
  // These headers exist only to be included by the few files that speak OpenCASCADE.
  const std::set<std::string> speakers{"modeling/solid/solid_shape.h",
                                       "modeling/solid/occt_bspline.h", "io/cad/occt_exchange.h"};
  std::set<std::string> solver_files;
  for (const File& file : files()) {
    for (const std::string& target : file.includes) {
      if (matches(target, "^nlopt")) solver_files.insert(file.path);
      if (speakers.contains(target)) {
        EXPECT_TRUE(!file.is_header() || speakers.contains(file.path))
            << file.path << " includes " << target;
      }
      if (!file.is_header() || speakers.contains(file.path)) continue;
      EXPECT_FALSE(matches(target, kOpenCascade) || matches(target, kItk) ||
                   matches(target, kVtk) || matches(target, "^(nlopt|tiny_gltf|tbb/)"))
          << file.path << " includes " << target;
    }
  }
  EXPECT_EQ(solver_files.size(), 1u) << "NLopt belongs in one file";
}

// Headers that no test includes; one may leave the list, none may join it.
TEST(Architecture, HeadersAreIncludedByATest) {
  std::set<std::string> untested;
  std::ifstream list(testing_paths::source_folder() / "tests/base/untested_headers.txt");
  for (std::string line; std::getline(list, line);) {
    if (!line.empty() && line.front() != '#') untested.insert(line);
  }
  std::set<std::string> tested;
  for (const File& file : test_files()) {
    if (file.path.starts_with("tests/")) tested.insert(file.includes.begin(), file.includes.end());
  }
  for (const File& file : files()) {
    if (!file.is_header() || file.library == "cli") continue;
    EXPECT_NE(tested.contains(file.path), untested.contains(file.path))
        << file.path
        << (tested.contains(file.path) ? " is tested: take it off tests/base/untested_headers.txt"
                                       : " is included by no test");
  }
  for (const std::string& path : untested) EXPECT_NE(find(path), nullptr) << path << " is gone";
  EXPECT_LE(untested.size(), kUntestedHeaders);
}

TEST(Architecture, LongFunctionsSayWhy) {
  const std::vector<Function> all = functions();
  for (const Function& f : all) {
    EXPECT_TRUE(f.lines <= 60 || f.has_reason) << f.file << ":" << f.line << " has " << f.lines
                                               << " lines: split it, or say \"Long: ...\" above";
  }
  EXPECT_GT(all.size(), 1500u);
}

// A function over 25 lines is written in paragraphs; the number of those that are not may only
// fall.
TEST(Architecture, LongFunctionsHaveParagraphs) {
  int walls = 0;
  std::string names;
  for (const Function& f : functions()) {
    if (f.lines <= 25 || f.blank_lines > 0) continue;
    ++walls;
    names += f.file + ":" + std::to_string(f.line) + "\n";
  }
  EXPECT_LE(walls, kWalls) << "without a blank line:\n" << names;
}

}  // namespace
}  // namespace angiospline::source_tree
