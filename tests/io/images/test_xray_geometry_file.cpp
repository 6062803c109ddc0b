#include <fstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "io/images/image_file.h"
#include "io/images/xray_geometry_file.h"

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

TEST_F(XrayFiles, ViewsThatAreWrittenAreReadAgain) {
  std::vector<XrayView> views;
  for (const double angle : {0.0, 80.0}) {
    CArm arm;
    arm.angle_deg = angle;
    arm.centre_mm = Vec3(1, 2, 3);
    arm.pixel_mm = 0.8;
    arm.pixels = 8;
    Image<float> image;
    image.grid.size = {8, 8, 1};
    for (int i = 0; i < 64; ++i) image.voxels.push_back(static_cast<float>(angle + i) / 3);
    views.push_back({c_arm_geometry(arm), image});
  }
  ASSERT_TRUE(write_xray_views(views, folder_ / "out.json").has_value());
  const auto again = read_xray_views(folder_ / "out.json");
  ASSERT_TRUE(again.has_value()) << again.error().message();
  ASSERT_EQ(again->size(), views.size());
  for (std::size_t k = 0; k < views.size(); ++k) {
    EXPECT_EQ((*again)[k].image.voxels, views[k].image.voxels);
    const Vec3 p(4, -1, 10);
    EXPECT_TRUE((*again)[k].geometry.project(p)->isApprox(*views[k].geometry.project(p), 1e-12));
  }
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
