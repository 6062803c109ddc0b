// angiospline recover on an image with a branching vessel and, apart from it, a blob.
#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "io/images/image_file.h"
#include "recovery/phantoms/phantom.h"
#include "tests/cli/run_program.h"

namespace angiospline::test {
namespace {

constexpr double kBlobRadius = 11;  // mm

// The bifurcation at SNR 8 and a ball beside it, 4 voxels from any wall at least; partial volumes.
Image<float> vessel_and_blob(const Vec3& centre) {
  PhantomOptions options;
  options.snr = 8;
  const auto phantom = make_phantom(PhantomKind::kBifurcation, options);
  Image<float> image(phantom->image.grid);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = image.grid.voxel(i);
    const double out = (image.grid.world_mm(v) - centre).norm() - kBlobRadius;
    image.voxels[i] =
        static_cast<float>(phantom->image.voxels[i] + 1000 * std::clamp(0.5 - out, 0.0, 1.0));
  }
  return image;
}

TEST(RecoverClosed, ABlobBesideAVesselBecomesASolidOfItsOwn) {
  const TemporaryFolder folder;
  const Vec3 centre(63.5, 104, 50);
  ASSERT_TRUE(write_image(vessel_and_blob(centre), folder / "image.nrrd"));
  for (const bool fit : {true, false}) {
    std::vector<std::string> command{"recover", folder / "image.nrrd", "--seed", "63.5,63.5,30",
                                     "--seed",  "63.5,104,50",         "-o",     folder / "out",
                                     "--json"};
    if (!fit) command.emplace_back("--no-fit");
    const ProgramRun run = run_angiospline(command);
    ASSERT_EQ(run.exit_code, 0) << run.err;
    const auto json = nlohmann::json::parse(run.out);
    EXPECT_EQ(json["check"]["solids"], 2);
    EXPECT_TRUE(json["check"]["closed"]);
    EXPECT_TRUE(json["check"]["valid"]);
    EXPECT_FALSE(json["check"]["self_intersecting"]);
    EXPECT_LT(json["check"]["max_normal_angle_deg"], 0.01);
    EXPECT_EQ(json["branches"], 3);
    double blob = 0;
    std::set<std::string> names;
    for (const auto& face : json["check"]["faces"]) {
      const std::string name = face["name"];
      names.insert(name);
      if (name.find("closed_1") != std::string::npos) blob += face["area_mm2"].get<double>();
    }
    // Of the ball, within a tenth of a voxel where it was fitted.
    const double radius = std::sqrt(blob / (4 * 3.14159265358979));
    EXPECT_NEAR(radius, kBlobRadius, fit ? 0.1 : 0.3);
    EXPECT_GT(names.size(), 4U);
  }
}

}  // namespace
}  // namespace angiospline::test
