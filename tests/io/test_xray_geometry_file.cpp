#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "io/image_file.h"
#include "io/xray_geometry_file.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

class XrayFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() / ("angiospline-xray-" + std::to_string(::getpid()));
    fs::create_directories(folder_);
    Image<float> image;
    image.grid.size = {8, 8, 1};
    image.voxels.assign(64, 0.25F);
    ASSERT_TRUE(write_image(image, folder_ / "a.tif").has_value());
  }
  void TearDown() override { fs::remove_all(folder_); }

  Result<std::vector<XrayView>> read(const std::string& json) const {
    std::ofstream(folder_ / "views.json") << json;
    return read_xray_views(folder_ / "views.json");
  }

  fs::path folder_;
};

TEST_F(XrayFiles, BothWaysToStateAViewAgree) {
  const auto views = read(R"({"schema": 1, "views": [
    {"image": "a.tif", "angle_deg": 0, "centre_mm": [1, 2, 3], "source_to_centre_mm": 700,
     "source_to_detector_mm": 1000, "pixel_mm": 2},
    {"image": "a.tif", "source_mm": [1, 2, -697], "first_pixel_mm": [-6, -5, 303],
     "column_axis": [5, 0, 0], "row_axis": [0, 1, 0], "pixel_mm": [2, 2]}]})");
  ASSERT_TRUE(views.has_value()) << views.error().message();
  ASSERT_EQ(views->size(), 2U);
  for (const Vec3& p : {Vec3(1, 2, 3), Vec3(4, -1, 10)}) {
    const auto a = (*views)[0].geometry.project(p), b = (*views)[1].geometry.project(p);
    ASSERT_TRUE(a && b);
    EXPECT_TRUE(a->isApprox(*b, 1e-9)) << a->transpose() << " " << b->transpose();
  }
  EXPECT_EQ((*views)[0].image.voxels[5], 0.25F);
}

TEST_F(XrayFiles, ErrorsNameViewAndField) {
  const std::string arm =
      R"("angle_deg": 0, "centre_mm": [1, 2, 3], "source_to_centre_mm": 700, "source_to_detector_mm": 1000)";
  const std::pair<std::string, const char*> cases[] = {
      {"nonsense", "not a file of X-ray views"},
      {R"({"views": []})", "not a file of X-ray views"},
      {R"({"views": [{"image": "none.tif"}]})", "there is no such file"},
      {R"({"views": [{}]})", "view 1: image: field is missing"},
      {R"({"views": [{"image": "a.tif", )" + arm + "}]}", "view 1: pixel_mm: field is missing"},
      {R"({"views": [{"image": "a.tif", )" + arm + R"(, "pixel_mm": -1}]})",
       "view 1: pixel_mm: field is not usable: -1"},
      {R"({"views": [{"image": "a.tif", "source_mm": [0, 0]}]})", "view 1: source_mm"},
      {R"({"views": [{"image": "a.tif", "source_mm": [0, 0, 1], "first_pixel_mm": [0, 0, 0],
          "column_axis": [1, 0, 0], "row_axis": [2, 0, 0], "pixel_mm": [1, 1]}]})",
       "axes span no plane"}};
  for (const auto& [json, says] : cases) {
    const auto views = read(json);
    ASSERT_FALSE(views.has_value()) << json;
    EXPECT_NE(views.error().message().find(says), std::string::npos) << views.error().message();
  }
}

}  // namespace
}  // namespace angiospline
