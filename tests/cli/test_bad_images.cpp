// Images and masks that are odd or broken: every command gives a stated answer, or one line on
// stderr with exit code 2 and no file left.
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "tests/cli/run_program.h"
#include "tests/shapes/dicom_slice.h"

namespace angiospline::test {
namespace {

using nlohmann::json;
namespace fs = std::filesystem;

// A MetaImage of 8-bit voxels with any header lines put in.
std::string meta_image(const std::string& size, const std::string& more,
                       const std::string& voxels) {
  return "ObjectType = Image\nNDims = 3\nDimSize = " + size + "\n" + more +
         "ElementType = MET_UCHAR\nElementDataFile = LOCAL\n" + voxels;
}

class Images : public testing::Test {
 protected:
  void expect_refusal(const std::vector<std::string>& arguments,
                      const std::vector<std::string>& words) {
    const std::vector<std::string> before = folder_.files();
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments[1] << run.err;
    EXPECT_TRUE(is_one_line(run.err)) << run.err;
    for (const std::string& word : words)
      EXPECT_NE(run.err.find(word), std::string::npos) << "no '" << word << "' in: " << run.err;
    EXPECT_EQ(folder_.files(), before);
  }

  // As an image and as a mask.
  void expect_refusal_everywhere(const std::string& file, const std::vector<std::string>& words) {
    expect_refusal({"segment", folder_ / file, "-o", folder_ / "mask.nrrd"}, words);
    expect_refusal({"graph", folder_ / file, "-o", folder_ / "tree.swc"}, words);
  }

  json figures(const std::vector<std::string>& arguments) {
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return json::parse(run.out, nullptr, false);
  }

  TemporaryFolder folder_;
};

TEST_F(Images, AnEmptyMaskIsRefused) {
  folder_.write("mask.mha", meta_image("6 6 6", "", std::string(216, '\0')));
  for (const char* verb : {"thin", "graph"})
    expect_refusal(
        {verb, folder_ / "mask.mha", "-o", folder_ / (verb[0] == 't' ? "a.mha" : "a.swc")},
        {"mask.mha", "mask is empty"});
}

TEST_F(Images, AFullMaskAndASingleVoxelThinToOnePieceAndAreNoVessels) {
  std::string one(216, '\0');
  one[43] = 1;
  for (const auto& [voxels, why] :
       {std::pair{std::string(216, '\1'), "mask is full"}, std::pair{one, "no branch"}}) {
    folder_.write("mask.mha", meta_image("6 6 6", "", voxels));
    const json j = figures({"thin", folder_ / "mask.mha", "-o", folder_ / "axis.mha", "--json"});
    EXPECT_LE(j["voxels_out"], 5);
    EXPECT_EQ(j["before"], j["after"]);
    EXPECT_EQ(j["after"], (json{{"components", 1}, {"cavities", 0}, {"cycles", 0}}));
    fs::remove(folder_ / "axis.mha");
    expect_refusal({"graph", folder_ / "mask.mha", "-o", folder_ / "tree.swc"}, {"mask.mha", why});
  }
}

TEST_F(Images, AMaskThatTouchesTheBorderIsAVesselUpToTheBorder) {
  std::string bar(10 * 10 * 30, '\0');
  for (int z = 0; z < 30; ++z)
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 4; ++x) bar[static_cast<std::size_t>(x + 10 * (y + 10 * z))] = 1;
  folder_.write("mask.mha", meta_image("10 10 30", "", bar));
  const json j = figures({"graph", folder_ / "mask.mha", "-o", folder_ / "tree.swc", "--json"});
  ASSERT_EQ(j["branches"].size(), 1U);
  EXPECT_NEAR(j["branches"][0]["length_mm"].get<double>(), 30, 1.5);
}

TEST_F(Images, ThatAreNotVolumesOfScalarsAreRefused) {
  folder_.write("four.mha",
                "ObjectType = Image\nNDims = 4\nDimSize = 2 2 2 2\nElementType = MET_UCHAR\n"
                "ElementDataFile = LOCAL\n" +
                    std::string(16, '\1'));
  expect_refusal_everywhere("four.mha", {"four.mha", "4-D"});
  folder_.write("vector.mha",
                meta_image("4 4 4", "ElementNumberOfChannels = 3\n", std::string(192, '\1')));
  expect_refusal_everywhere("vector.mha", {"vector.mha", "vectors", "3"});
}

TEST_F(Images, WithoutAPositiveSpacingAreRefused) {
  for (const char* spacing : {"1 0 1", "1 -1 1", "nan 1 1"}) {
    folder_.write("image.mha",
                  meta_image("4 4 4", std::string("ElementSpacing = ") + spacing + "\n",
                             std::string(64, '\1')));
    expect_refusal({"segment", folder_ / "image.mha", "-o", folder_ / "mask.nrrd"},
                   {"image.mha", "spacing", "positive"});
  }
}

TEST_F(Images, WithASlopeThatMakesNoSenseAreRefused) {
  for (const char* slope : {"0", "nan"}) {
    folder_.write(
        "image.mha",
        meta_image("4 4 4", std::string("ElementToIntensityFunctionSlope = ") + slope + "\n",
                   std::string(64, '\1')));
    expect_refusal({"segment", folder_ / "image.mha", "-o", folder_ / "mask.nrrd"},
                   {"image.mha", "slope"});
  }
}

TEST_F(Images, DicomFoldersThatAreNotOneSoundSeriesAreRefused) {
  fs::create_directories(folder_ / "gap");
  fs::create_directories(folder_ / "mixed");
  for (const int z : {0, 1, 2, 4, 5})
    folder_.write("gap/" + std::to_string(z) + ".dcm", dicom_slice(z, "1.2.3.4"));
  expect_refusal_everywhere("gap", {"gap", "not at even distances", "2 mm"});
  for (const int z : {0, 1, 2})
    for (const char* series : {"1.2.3.4", "1.2.3.5"})
      folder_.write("mixed/" + std::string(series) + std::to_string(z) + ".dcm",
                    dicom_slice(z, series));
  expect_refusal_everywhere("mixed", {"mixed", "several DICOM series", "1.2.3.5 (3 slices)"});
  // One slice without its last voxel.
  fs::create_directories(folder_ / "cut");
  for (const int z : {0, 1, 2}) {
    const std::string slice = dicom_slice(z, "1.2.3.4");
    folder_.write("cut/" + std::to_string(z) + ".dcm",
                  z == 1 ? slice.substr(0, slice.size() - 2) : slice);
  }
  expect_refusal_everywhere("cut", {"1.dcm", "file is cut short"});
  // The way out that the message offers.
  expect_refusal({"segment", folder_ / "mixed", "--series", "1.2.3.5", "--seed-voxel", "90,1,1",
                  "-o", folder_ / "mask.nrrd"},
                 {"seed is outside the image", "(4, 3, 2)"});
}

TEST_F(Images, VoxelsThatAreNotNumbersAreBackgroundAndCounted) {
  // A straight vessel with a block beside it that is not a number.
  std::string voxels;
  for (int z = 0; z < 48; ++z)
    for (int y = 0; y < 32; ++y)
      for (int x = 0; x < 32; ++x) {
        const bool vessel = (x - 16) * (x - 16) + (y - 16) * (y - 16) <= 9;
        float v = vessel ? 1000.0F : 100.0F;
        if (x < 4 && y < 4) v = std::numeric_limits<float>::quiet_NaN();
        char bytes[4];
        std::memcpy(bytes, &v, 4);
        voxels.append(bytes, 4);
      }
  folder_.write("nan.mha",
                "ObjectType = Image\nNDims = 3\nDimSize = 32 32 48\nElementType = MET_FLOAT\n"
                "ElementDataFile = LOCAL\n" +
                    voxels);
  const ProgramRun run =
      run_angiospline({"segment", folder_ / "nan.mha", "-o", folder_ / "mask.nrrd", "--json"});
  ASSERT_EQ(run.exit_code, 0) << run.err;
  EXPECT_NE(run.err.find("768 of 49152 voxels are NaN or infinite"), std::string::npos) << run.err;
  EXPECT_NEAR(json::parse(run.out)["voxels"].get<double>(), 29 * 48, 29 * 8);
  std::string none;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (int i = 0; i < 512; ++i) none.append(reinterpret_cast<const char*>(&nan), 4);
  folder_.write("none.mha",
                "ObjectType = Image\nNDims = 3\nDimSize = 8 8 8\nElementType = MET_FLOAT\n"
                "ElementDataFile = LOCAL\n" +
                    none);
  expect_refusal({"graph", folder_ / "none.mha", "-o", folder_ / "tree.swc"},
                 {"none.mha", "mask is empty"});
  const ProgramRun nothing =
      run_angiospline({"segment", folder_ / "none.mha", "-o", folder_ / "none.nrrd"});
  EXPECT_EQ(nothing.exit_code, 2);
  EXPECT_TRUE(is_one_line(nothing.err)) << nothing.err;
  EXPECT_NE(nothing.err.find("no vessel was found"), std::string::npos) << nothing.err;
  EXPECT_FALSE(fs::exists(folder_ / "none.nrrd"));
}

TEST_F(Images, TwoModalitiesOfTheRingsAreMadeAndGrownTogether) {
  const ProgramRun made =
      run_angiospline({"phantom", "rings", "--snr", "20", "--xray", folder_ / "views.json", "-o",
                       folder_ / "volume.mha", "--truth", folder_ / "truth.nrrd"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_TRUE(fs::exists(folder_ / "views_4.mha"));
  const std::size_t seeds = made.err.find("--seed ");
  ASSERT_NE(seeds, std::string::npos) << made.err;  // what to grow from is said
  const std::string seed = made.err.substr(seeds + 7, made.err.find(' ', seeds + 7) - seeds - 7);
  const json j =
      figures({"segment", folder_ / "volume.mha", "--xray", folder_ / "views.json", "--seed", seed,
               "--background", "400", "--limit", "20000", "-o", folder_ / "mask.nrrd", "--json"});
  EXPECT_GT(j["by_views"], 100);
  EXPECT_GT(j["by_volume"], 100);
  expect_refusal({"phantom", "cylinder", "--xray", folder_ / "v.json", "-o", folder_ / "c.mha"},
                 {"cylinder"});
}

}  // namespace
}  // namespace angiospline::test
