// A short, repeatable fuzz of every reader of centerlines, from the corpus of tests/fuzz: what runs
// without clang and in every build. scripts/run_fuzz.sh does the long one.
#include <algorithm>
#include <array>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "base/random.h"
#include "tests/fuzz/reader_checks.h"
#include "tests/shapes/paths.h"

namespace angiospline {
namespace {

constexpr int kTrials = 250;  // for each file of the corpus

struct Subject {
  const char* name;
  fuzz::Reader read;
};

constexpr std::array kSubjects = {Subject{"swc", parse_swc},
                                  Subject{"csv", parse_csv_centerline},
                                  Subject{"tree", parse_tree_definition},
                                  Subject{"gxl", parse_gxl},
                                  Subject{"graphml", parse_graphml},
                                  Subject{"vtp", parse_vtp_centerline},
                                  Subject{"vtk", parse_vtk_centerline},
                                  Subject{"tables", fuzz::tables},
                                  Subject{"simvascular", fuzz::simvascular}};

// Pieces that files hold by accident or malice.
constexpr std::array<std::string_view, 24> kNasty = {"nan",
                                                     "-inf",
                                                     "1e999",
                                                     "1e-320",
                                                     "-1",
                                                     "0",
                                                     "999999999999",
                                                     "1,5",
                                                     "\r",
                                                     "\r\n",
                                                     "\xEF\xBB\xBF",
                                                     ";",
                                                     "\t",
                                                     "#",
                                                     "<!ENTITY a \"&a;&a;\">",
                                                     "&a;",
                                                     "<",
                                                     "]]>",
                                                     "\"",
                                                     " ",
                                                     "4294967295",
                                                     "2 2 2",
                                                     "mm",
                                                     "-0"};

std::string mutated(std::string text, Random& random) {
  const auto place = [&] { return std::size_t(random.below(static_cast<int>(text.size()) + 1)); };
  const int changes = 1 + random.below(4);
  for (int k = 0; k < changes; ++k) {
    const std::size_t at = place();
    switch (random.below(5)) {
      case 0:  // another byte
        if (at < text.size()) text[at] = static_cast<char>(random.below(256));
        break;
      case 1:  // a piece gone
        text.erase(at, std::size_t(random.below(30)));
        break;
      case 2:  // a piece twice
        text.insert(place(), text.substr(at, std::size_t(random.below(60))));
        break;
      case 3:  // something nasty instead of what was there
        text.replace(at, std::min(text.size() - at, std::size_t(random.below(6))),
                     kNasty[std::size_t(random.below(static_cast<int>(kNasty.size())))]);
        break;
      default:  // cut short
        if (random.below(4) == 0) text.resize(at);
    }
  }
  return text;
}

class FuzzedReader : public ::testing::TestWithParam<Subject> {};

TEST_P(FuzzedReader, GivesATreeThatKeepsItsInvariantsOrAnErrorOfOneLine) {
  const Subject& subject = GetParam();
  const auto folder = testing_paths::source_folder() / "tests/fuzz/corpus" / subject.name;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry);
  std::sort(files.begin(), files.end());
  ASSERT_FALSE(files.empty());
  Random random(17);
  int trees = 0, refused = 0;
  for (const auto& file : files) {
    std::ifstream stream(file, std::ios::binary);
    const std::string whole{std::istreambuf_iterator<char>(stream), {}};
    EXPECT_TRUE(fuzz::read_and_check(subject.read, whole)) << file;
    for (int k = 0; k < kTrials; ++k) {
      (fuzz::read_and_check(subject.read, mutated(whole, random)) ? trees : refused) += 1;
    }
  }
  EXPECT_GT(trees, 0);
  EXPECT_GT(refused, 0);
}

INSTANTIATE_TEST_SUITE_P(Readers, FuzzedReader, ::testing::ValuesIn(kSubjects),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace angiospline
