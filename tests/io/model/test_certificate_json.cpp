#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/model/certificate_json.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

TEST(CertificateJson, HasTheFiguresThatScriptsRelyOn) {
  const nlohmann::json json = to_json(certify(crafted::creased_tube(1, 6, 5)).value());
  EXPECT_EQ(json["solids"], 1);
  EXPECT_EQ(json["closed"], true);
  EXPECT_EQ(json["valid"], true);
  EXPECT_EQ(json["self_intersecting"], false);
  EXPECT_GT(json["volume_mm3"].get<double>(), 18.0);
  EXPECT_GT(json["area_mm2"].get<double>(), 40.0);
  ASSERT_EQ(json["bounding_box_mm"].size(), 2U);
  EXPECT_NEAR(json["bounding_box_mm"][0][2].get<double>(), 0.0, 1e-12);
  EXPECT_NEAR(json["bounding_box_mm"][1][2].get<double>(), 6.0, 1e-12);
  ASSERT_EQ(json["faces"].size(), 6U);
  EXPECT_EQ(json["faces"][0]["name"], "wall_1");
  EXPECT_EQ(json["faces"][0]["kind"], "wall");
  EXPECT_GT(json["faces"][0]["area_mm2"].get<double>(), 9.0);
  EXPECT_EQ(json["smooth_edges"], 6);
  EXPECT_EQ(json["free_edges"], 0);
  EXPECT_LT(json["max_gap_mm"].get<double>(), 1e-12);
  EXPECT_NEAR(json["max_normal_angle_deg"].get<double>(), 5.0, 1e-3);
  EXPECT_EQ(json["worst_edge"], (nlohmann::json{"wall_1", "wall_2"}));
  EXPECT_GT(json["min_jacobian_ratio"].get<double>(), 0.5);
  EXPECT_TRUE(json["max_curvature_times_radius"].is_number());
  EXPECT_EQ(json["genus"], 0);
}

TEST(CertificateJson, HasNullForWhatIsNotThere) {
  Certificate open;
  const nlohmann::json json = to_json(open);
  EXPECT_TRUE(json["worst_edge"].is_null());
  EXPECT_TRUE(json["genus"].is_null());
  EXPECT_TRUE(json["max_curvature_times_radius"].is_null());
  EXPECT_EQ(json["self_intersections"], nlohmann::json::array());
}

TEST(CertificateJson, SaysTheSameInWords) {
  const std::string text = to_text(certify(samples::torus()).value());
  EXPECT_NE(text.find("genus                       1\n"), std::string::npos);
  EXPECT_NE(text.find("closed                      yes\n"), std::string::npos);
}

}  // namespace
}  // namespace angiospline
