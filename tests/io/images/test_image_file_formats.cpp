#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "io/images/image_file_formats.h"

namespace angiospline::image_formats {
namespace {

TEST(ImageFormats, AreToldByTheLongestSuffixWhateverItsCase) {
  ASSERT_NE(suffix_of("a.NII.gz"), nullptr);
  EXPECT_EQ(suffix_of("a.NII.gz")->format, Format::kNifti);
  EXPECT_EQ(suffix_of("folder.nii/a.mhd")->format, Format::kMeta);
  EXPECT_FALSE(suffix_of("a.mhd")->writes);
  EXPECT_EQ(suffix_of("a.gz"), nullptr);
  EXPECT_EQ(suffix_of("a.vti"), nullptr);
  EXPECT_TRUE(is_vti("a.VTI"));
  EXPECT_STREQ(title(Format::kDicom), "DICOM");
}

std::string why(std::vector<long long> axes, int wanted, unsigned components = 1) {
  const Result<void> sound = check_axes({std::move(axes), components, {}}, "f", wanted);
  return sound ? "" : sound.error().what;
}

TEST(ImageFormats, AnImageHasExactlyTheDimensionsWanted) {
  EXPECT_EQ(why({4, 5, 6}, 3), "");
  EXPECT_EQ(why({4, 5, 6, 1}, 3), "") << "one point in time";
  EXPECT_EQ(why({4, 5}, 2), "");
  EXPECT_EQ(why({4, 5, 1}, 2), "");
  EXPECT_EQ(why({4, 5, 6, 2}, 3), "image is 4-D");
  EXPECT_EQ(why({4, 5}, 3), "image is 2-D");
  EXPECT_EQ(why({1, 5, 6}, 3), "image is 2-D") << "whichever axis is flat";
  EXPECT_EQ(why({4, 5, 6}, 2), "image is 3-D");
  EXPECT_EQ(why({4, 0, 6}, 3), "image has no voxels");
  EXPECT_EQ(why({4, 65536, 6}, 3), "image is too large");
  EXPECT_EQ(why({4, 5, 6}, 3, 3), "voxels are vectors");
}

TEST(ImageFormats, AxesThatFilesRoundedAreMadeOrthonormalAndOthersRefused) {
  ImageGrid grid;
  grid.size = {2, 2, 2};
  const double angle = 0.3;
  grid.direction << std::cos(angle), -std::sin(angle), 0, std::sin(angle), std::cos(angle), 0, 0, 0,
      1;
  const Mat3 exact = grid.direction;
  grid.direction = (exact * 1e4).array().round() / 1e4;
  const auto sound = checked(grid, "f");
  ASSERT_TRUE(sound);
  EXPECT_LT((sound->direction.transpose() * sound->direction - Mat3::Identity()).norm(), 1e-14);
  EXPECT_LT((sound->direction - exact).norm(), 2e-4);

  grid.direction(0, 1) += 0.01;
  EXPECT_EQ(checked(grid, "f").error().what, "axes of the image are not orthogonal");
}

TEST(ImageFormats, AnIdentityAndAReflectionStayAsTheyAreToTheBit) {
  ImageGrid grid;
  EXPECT_EQ(checked(grid, "f")->direction, Mat3::Identity());
  grid.direction.diagonal() << -1, -1, 1;
  EXPECT_LT((checked(grid, "f")->direction - grid.direction).norm(), 1e-15);
}

TEST(ImageFormats, SpacingAndOriginMustBeUsable) {
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    ImageGrid grid;
    grid.spacing_mm[1] = bad;
    EXPECT_EQ(checked(grid, "f").error().what, "spacing of axis 1 is not positive") << bad;
  }
  ImageGrid grid;
  grid.origin_mm[2] = std::nan("");
  EXPECT_EQ(checked(grid, "f").error().what, "origin is not finite");
}

}  // namespace
}  // namespace angiospline::image_formats
