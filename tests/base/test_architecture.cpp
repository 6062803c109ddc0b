// The folders depend on each other downwards only, and heavy libraries stay where they belong.
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace {

namespace fs = std::filesystem;

struct Include {
  std::string file;    // relative to the source folder
  std::string folder;  // the file's top-level folder
  std::string target;  // what it includes
};

const std::map<std::string, std::set<std::string>>& allowed_folders() {
  static const std::map<std::string, std::set<std::string>> kAllowed{
      {"base", {"base"}},
      {"kernel", {"base", "kernel"}},
      {"modeling", {"base", "kernel", "modeling"}},
      {"recovery", {"base", "kernel", "modeling", "recovery"}},
      {"io", {"base", "kernel", "modeling", "recovery", "io"}},
      {"cli", {"base", "kernel", "modeling", "recovery", "io", "cli"}},
      {"samples", {"base", "kernel", "modeling", "recovery", "io", "samples"}},
  };
  return kAllowed;
}

std::vector<Include> includes_of_all_sources() {
  static const std::regex kInclude(R"re(^\s*#\s*include\s*["<]([^">]+)[">])re");
  std::vector<Include> includes;
  const fs::path root = ANGIOSPLINE_SOURCE_DIR;
  for (const auto& [folder, allowed] : allowed_folders()) {
    for (const auto& entry : fs::recursive_directory_iterator(root / folder)) {
      const std::string suffix = entry.path().extension().string();
      if (suffix != ".h" && suffix != ".cpp") continue;
      std::ifstream stream(entry.path());
      std::string line;
      std::smatch match;
      while (std::getline(stream, line)) {
        if (std::regex_search(line, match, kInclude)) {
          includes.push_back({fs::relative(entry.path(), root).string(), folder, match[1]});
        }
      }
    }
  }
  return includes;
}

bool is_header(const std::string& file) { return file.ends_with(".h"); }

bool matches(const std::string& target, const char* pattern) {
  return std::regex_search(target, std::regex(pattern));
}

constexpr const char* kOpenCascade =
    "^(BRep|Geom|TopoDS|TopExp|TopTools|STEP|IGES|XCAF|TDF|TDoc|gp_|Standard_|Poly_|TCol|Shape|BOP|"
    "BSplCLib|BSplSLib|TopAbs|TopLoc|Bnd_|Interface_|Quantity_|Message_)";
constexpr const char* kItk = "^(itk|vnl)";
constexpr const char* kVtk = "^vtk";

TEST(Architecture, IncludesPointDownwardsOnly) {
  int checked = 0;
  for (const Include& include : includes_of_all_sources()) {
    const std::string folder = include.target.substr(0, include.target.find('/'));
    if (!allowed_folders().contains(folder) || folder == include.target) continue;
    EXPECT_TRUE(allowed_folders().at(include.folder).contains(folder))
        << include.file << " includes " << include.target;
    ++checked;
  }
  EXPECT_GT(checked, 20);
}

TEST(Architecture, BaseAndKernelKnowOnlyEigenAndTheStandardLibrary) {
  for (const Include& include : includes_of_all_sources()) {
    if (include.folder != "base" && include.folder != "kernel") continue;
    const bool ours = matches(include.target, "^(base|kernel)/");
    const bool standard = matches(include.target, "^[a-z_0-9]+$");
    const bool known = matches(include.target, "^(Eigen/|tl/expected.hpp|unistd.h|fcntl.h|sys/)");
    EXPECT_TRUE(ours || standard || known) << include.file << " includes " << include.target;
  }
}

TEST(Architecture, FileFormatLibrariesStayInIo) {
  for (const Include& include : includes_of_all_sources()) {
    if (include.folder == "io") continue;
    EXPECT_FALSE(matches(include.target, kItk) || matches(include.target, kVtk) ||
                 matches(include.target, "^(tiny_gltf|STEP|IGES|XCAF)"))
        << include.file << " includes " << include.target;
  }
}

TEST(Architecture, HeavyHeadersNeverCrossOneOfOurs) {
  // These headers exist only to be included by the few files that speak OpenCASCADE.
  const std::set<std::string> speakers{"modeling/solid_shape.h", "modeling/occt_bspline.h",
                                       "io/exchange.h"};
  std::set<std::string> solver_files;
  for (const Include& include : includes_of_all_sources()) {
    if (matches(include.target, "^nlopt")) solver_files.insert(include.file);
    if (!is_header(include.file) || speakers.contains(include.file)) continue;
    EXPECT_FALSE(matches(include.target, kOpenCascade) || matches(include.target, kItk) ||
                 matches(include.target, kVtk) ||
                 matches(include.target, "^(nlopt|tiny_gltf|tbb/)"))
        << include.file << " includes " << include.target;
  }
  EXPECT_LE(solver_files.size(), 1u) << "NLopt belongs in one file";
}

TEST(Architecture, HeadersThatSpeakOpenCascadeAreIncludedBySourcesOnly) {
  for (const Include& include : includes_of_all_sources()) {
    if (include.target != "modeling/solid_shape.h" && include.target != "modeling/occt_bspline.h") {
      continue;
    }
    EXPECT_TRUE(!is_header(include.file) || include.file.starts_with("modeling/occt_") ||
                include.file == "modeling/solid_shape.h")
        << include.file << " includes " << include.target;
    EXPECT_TRUE(include.folder == "modeling" || include.folder == "io") << include.file;
  }
}

}  // namespace
