// Bad input gets one line on stderr that names file, place, value and rule; exit code 2; no file
// left.
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

struct BadTree {
  const char* name;                    // of the test
  const char* file;                    // name of the input file
  const char* text;                    // its contents
  std::vector<const char*> names_all;  // what the one line must contain
};

void PrintTo(const BadTree& tree, std::ostream* stream) { *stream << tree.name; }

class SeedRefuses : public testing::TestWithParam<BadTree> {};

TEST_P(SeedRefuses, WithOneLineAndLeavesNoFile) {
  const BadTree& bad = GetParam();
  const TemporaryFolder folder;
  const std::string input = folder.write(bad.file, bad.text);
  const ProgramRun run =
      run_angiospline({"seed", input, "-o", folder / "out.step", folder / "out.glb"});
  EXPECT_EQ(run.exit_code, 2) << run.err;
  EXPECT_TRUE(is_one_line(run.err)) << run.err;
  EXPECT_EQ(run.out, "");
  for (const char* word : bad.names_all) {
    EXPECT_NE(run.err.find(word), std::string::npos) << "no '" << word << "' in: " << run.err;
  }
  EXPECT_EQ(folder.files(), std::vector<std::string>{bad.file});
}

INSTANTIATE_TEST_SUITE_P(
    Trees, SeedRefuses,
    testing::Values(
        BadTree{"Empty", "tree.swc", "", {"tree.swc"}},
        BadTree{"OnlyComments", "tree.swc", "# nothing here\n", {"tree.swc"}},
        BadTree{"Truncated", "tree.swc", "1 3 0 0 0 1 -1\n2 3 0 0 5", {"tree.swc:2"}},
        BadTree{
            "NonNumeric", "tree.swc", "1 3 0 0 0 1 -1\n2 3 0 zero 5 1 1\n", {"tree.swc:2", "zero"}},
        BadTree{
            "NotANumber", "tree.swc", "1 3 0 0 0 1 -1\n2 3 0 nan 5 1 1\n", {"tree.swc:2", "nan"}},
        BadTree{"Infinite", "tree.swc", "1 3 0 0 0 1 -1\n2 3 0 0 inf 1 1\n", {"tree.swc:2", "inf"}},
        BadTree{"NegativeRadius",
                "tree.swc",
                "1 3 0 0 0 1 -1\n2 3 0 0 5 -0.5 1\n",
                {"tree.swc:2", "-0.5", "positive"}},
        BadTree{"ZeroRadius",
                "tree.swc",
                "1 3 0 0 0 1 -1\n2 3 0 0 5 0 1\n",
                {"tree.swc:2", "0", "positive"}},
        BadTree{"MissingParent",
                "tree.swc",
                "1 3 0 0 0 1 -1\n2 3 0 0 5 1 7\n",
                {"tree.swc:2", "7", "parent"}},
        BadTree{"CycleOfParents",
                "tree.swc",
                "1 3 0 0 0 1 2\n2 3 0 0 5 1 3\n3 3 0 0 9 1 1\n",
                {"tree.swc", "cycle"}},
        BadTree{"DuplicateId", "tree.swc", "1 3 0 0 0 1 -1\n1 3 0 0 5 1 1\n", {"tree.swc:2", "1"}},
        BadTree{"AllZeroLength",
                "tree.swc",
                "1 3 2 2 2 1 -1\n2 3 2 2 2 1 1\n3 3 2 2 2 1 2\n",
                {"tree.swc", "length"}},
        BadTree{"CsvNonNumeric",
                "tree.csv",
                "x,y,z,radius\n0,0,0,1\n0,0,five,1\n",
                {"tree.csv:3", "five"}},
        BadTree{"CsvNegativeRadius",
                "tree.csv",
                "x,y,z,radius\n0,0,0,1\n0,0,5,-1\n",
                {"tree.csv:3", "-1"}},
        BadTree{"CsvEmpty", "tree.csv", "", {"tree.csv"}},
        BadTree{"UnknownSuffix", "tree.docx", "1 3 0 0 0 1 -1\n", {"tree.docx"}}),
    [](const testing::TestParamInfo<BadTree>& tested) { return std::string(tested.param.name); });

constexpr const char* kGoodTree = "1 3 0 0 0 2 -1\n2 3 0 0 10 2 1\n3 3 0 0 20 2 2\n";

TEST(Seed, RefusesAMissingFile) {
  const TemporaryFolder folder;
  const ProgramRun run = run_angiospline({"seed", folder / "none.swc", "-o", folder / "out.step"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(is_one_line(run.err)) << run.err;
  EXPECT_NE(run.err.find("none.swc"), std::string::npos);
  EXPECT_TRUE(folder.files().empty());
}

TEST(Seed, RefusesATargetThatCannotBeWrittenAndKeepsNothing) {
  const TemporaryFolder folder;
  const std::string input = folder.write("tree.swc", kGoodTree);
  for (const char* name :
       {"out.step", "out.iges", "out.brep", "out.glb", "out.stl", "out.vtp", "out.json"}) {
    const ProgramRun run =
        run_angiospline({"seed", input, "-o", folder / ("missing/" + std::string(name))});
    EXPECT_EQ(run.exit_code, 2) << name << ": " << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
    EXPECT_NE(run.err.find(name), std::string::npos) << run.err;
  }
  EXPECT_EQ(folder.files(), std::vector<std::string>{"tree.swc"});
}

TEST(Seed, RefusesAnOutputSuffixItDoesNotKnowBeforeAnyWork) {
  const TemporaryFolder folder;
  const std::string input = folder.write("tree.swc", kGoodTree);
  const ProgramRun run =
      run_angiospline({"seed", input, "-o", folder / "out.step", folder / "out.dwg"});
  EXPECT_EQ(run.exit_code, 2);
  EXPECT_TRUE(is_one_line(run.err)) << run.err;
  EXPECT_NE(run.err.find("out.dwg"), std::string::npos);
  EXPECT_EQ(folder.files(), std::vector<std::string>{"tree.swc"});
}

TEST(Command, RefusesUnknownWordsWithOneLine) {
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {},
           {"fly"},
           {"seed"},
           {"seed", "a.swc"},
           {"check"},
           {"phantom", "teapot", "-o", "x.mha"},
           {"recover", "a.mha", "--seed", "1,2", "-o", "out"},
           {"recover", "a.mha", "--seed", "1,2,x", "-o", "out"}}) {
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
  }
}

TEST(Command, HelpOfEverySubcommandGoesToStandardOutput) {
  for (const char* verb : {"recover", "seed", "segment", "thin", "graph", "smooth", "check",
                           "compare", "compare-masks", "convert", "phantom"}) {
    const ProgramRun run = run_angiospline({verb, "--help"});
    EXPECT_EQ(run.exit_code, 0);
    EXPECT_NE(run.out.find("-h,--help"), std::string::npos);
    EXPECT_EQ(run.err, "");
  }
}

class RecoverRefuses : public testing::Test {
 protected:
  // A dark cube with one bright bar, 24 x 24 x 24.
  void SetUp() override {
    const ProgramRun run =
        run_angiospline({"phantom", "cylinder", "-o", folder_ / "image.nrrd", "--snr", "8"});
    ASSERT_EQ(run.exit_code, 0) << run.err;
  }

  void expect_refusal(const std::vector<std::string>& arguments,
                      const std::vector<std::string>& words) {
    const std::vector<std::string> before = folder_.files();
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 2) << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
    for (const std::string& word : words) {
      EXPECT_NE(run.err.find(word), std::string::npos) << "no '" << word << "' in: " << run.err;
    }
    EXPECT_EQ(folder_.files(), before);
  }

  TemporaryFolder folder_;
};

TEST_F(RecoverRefuses, ASeedOutsideTheImage) {
  expect_refusal({"recover", folder_ / "image.nrrd", "--seed", "5000,0,0", "-o", folder_ / "out"},
                 {"5000"});
}

TEST_F(RecoverRefuses, ASeedWhereThereIsNoVessel) {
  expect_refusal(
      {"recover", folder_ / "image.nrrd", "--seed-voxel", "1,1,1", "-o", folder_ / "out"},
      {"seed"});
}

TEST_F(RecoverRefuses, ASeedFromWhichTheImageIsFlooded) {
  std::string noise(40 * 40 * 40, '\0');
  std::uint32_t state = 1;  // a linear congruential generator: the same noise everywhere
  for (char& voxel : noise) {
    state = state * 1664525U + 1013904223U;
    voxel = static_cast<char>(100 + (state >> 28U));
  }
  folder_.write("noise.mha",
                "ObjectType = Image\nNDims = 3\nDimSize = 40 40 40\nElementType = MET_UCHAR\n"
                "ElementDataFile = LOCAL\n" +
                    noise);
  for (const char* deviations : {"3", "9"}) {  // full of tunnels; full
    expect_refusal({"recover", folder_ / "noise.mha", "--seed-voxel", "20,20,20", "--smooth", "0",
                    "--background", deviations[0] == '3' ? "106" : "100", "--neighborhood", "3",
                    "--deviations", deviations, "-o", folder_ / "out"},
                   {"noise.mha", "no vessel at the seeds", "loops"});
  }
}

TEST_F(RecoverRefuses, AnImageThatIsMissingEmptyOrTruncated) {
  expect_refusal({"recover", folder_ / "none.mha", "--seed", "1,1,1", "-o", folder_ / "out"},
                 {"none.mha"});
  folder_.write("empty.mha", "");
  expect_refusal({"recover", folder_ / "empty.mha", "--seed", "1,1,1", "-o", folder_ / "out"},
                 {"empty.mha"});
  std::filesystem::copy_file(folder_ / "image.nrrd", folder_ / "short.nrrd");
  std::filesystem::resize_file(folder_ / "short.nrrd",
                               std::filesystem::file_size(folder_ / "short.nrrd") / 2);
  expect_refusal({"recover", folder_ / "short.nrrd", "--seed", "1,1,1", "-o", folder_ / "out"},
                 {"short.nrrd"});
}

TEST_F(RecoverRefuses, ImagesThatAreNotVolumes) {
  const std::string pixels(16, '\7');
  folder_.write("flat.mha",
                "ObjectType = Image\nNDims = 2\nDimSize = 4 4\nElementType = MET_UCHAR\n"
                "ElementDataFile = LOCAL\n" +
                    pixels);
  expect_refusal({"recover", folder_ / "flat.mha", "--seed", "1,1,1", "-o", folder_ / "out"},
                 {"flat.mha", "2"});
  folder_.write("four.mha",
                "ObjectType = Image\nNDims = 4\nDimSize = 2 2 2 2\n"
                "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n" +
                    pixels);
  expect_refusal({"recover", folder_ / "four.mha", "--seed", "1,1,1", "-o", folder_ / "out"},
                 {"four.mha", "4"});
}

TEST_F(RecoverRefuses, AFolderThatCannotBeMade) {
  folder_.write("file", "in the way");
  expect_refusal(
      {"recover", folder_ / "image.nrrd", "--seed-voxel", "32,32,32", "-o", folder_ / "file/out"},
      {"file/out"});
}

TEST_F(RecoverRefuses, MasksThatAreEmptyWhenThinned) {
  const ProgramRun zero = run_angiospline(
      {"segment", folder_ / "image.nrrd", "--seed-voxel", "1,1,1", "-o", folder_ / "mask.nrrd"});
  EXPECT_EQ(zero.exit_code, 2) << zero.err;
  EXPECT_FALSE(std::filesystem::exists(folder_ / "mask.nrrd"));
}

}  // namespace
}  // namespace angiospline::test
