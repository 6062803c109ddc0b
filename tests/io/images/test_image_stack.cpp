#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "io/images/image_stack.h"
#include "io/images/rules.h"
#include "tests/shapes/dicom_slice.h"

namespace angiospline::image_formats {
namespace {

namespace fs = std::filesystem;

// What reading a series with slices at these heights ends with: the distance, or the error's text.
std::string read_at(const std::vector<double>& heights_mm) {
  const fs::path folder = fs::temp_directory_path() / ("image_stack_" + std::to_string(getpid()));
  fs::create_directories(folder);
  for (std::size_t k = 0; k < heights_mm.size(); ++k) {
    std::ofstream(folder / (std::to_string(k) + ".dcm"), std::ios::binary)
        << test::dicom_slice(heights_mm[k], "1.2.3");
  }
  const auto stack = read_image_folder(folder, {}, {});
  fs::remove_all(folder);
  if (!stack) return stack.error().what;
  EXPECT_EQ(stack->format, "DICOM series");
  return std::to_string(grid_of(stack->image).spacing_mm[2]);
}

TEST(ImageStack, DistancesOfSlicesMayDifferByTheirRoundingOnly) {
  EXPECT_EQ(read_at({0, 1, 2, 3}), "1.000000");
  const double slack = kSliceDistanceSlack;
  EXPECT_EQ(read_at({0, 1, 2, 3 + 0.9 * slack}), std::to_string(1 + 0.3 * slack));
  EXPECT_EQ(read_at({0, 1, 2, 3 + 1.1 * slack}), "slices are not at even distances");
  EXPECT_EQ(read_at({0, 1, 2, 3 - 1.1 * slack}), "slices are not at even distances");
  EXPECT_EQ(read_at({0, 1, 2, 2 + 0.9 * slack}), "two slices are at the same place");
}

TEST(ImageStack, PicturesTakeTheirSpacingFromTheCallerOrAreSaidToHaveNone) {
  AnyImage image = Image<float>{};
  std::vector<std::string> notes;
  ReadImageOptions options;
  options.stack_spacing_mm = Vec3(1, 2, 3);
  set_stack_geometry(image, options, notes);
  EXPECT_EQ(grid_of(image).spacing_mm, Vec3(1, 2, 3));
  EXPECT_TRUE(notes.empty());

  set_stack_geometry(image, {}, notes);
  EXPECT_EQ(grid_of(image).spacing_mm, Vec3(1, 1, 1));
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("carries no spacing"), std::string::npos);
}

TEST(ImageStack, AFolderThatCannotBeReadIsNamed) {
  const auto stack = read_image_folder("no/such/folder", {}, {});
  ASSERT_FALSE(stack);
  EXPECT_EQ(stack.error().what, "folder cannot be read");
  EXPECT_EQ(stack.error().where, "no/such/folder");
}

}  // namespace
}  // namespace angiospline::image_formats
