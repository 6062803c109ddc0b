#include <cstdlib>
#include <filesystem>

#include <gtest/gtest.h>

#include "io/cad/iges_file.h"
#include "io/cad/step_file.h"
#include "modeling/check/certificate.h"

namespace angiospline {
namespace {

std::filesystem::path data_folder() {
  const char* folder = std::getenv("ANGIOSPLINE_DATA");
  return folder == nullptr ? "" : folder;
}

#define SKIP_WITHOUT_DATA() \
  if (data_folder().empty()) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set"

TEST(ForeignCad_real_data, StepByOthersIsMeasured) {
  SKIP_WITHOUT_DATA();
  const auto nist = read_step(data_folder() / "cad/nist/nist_ftc_10_asme1_rb.step");
  ASSERT_TRUE(nist) << nist.error().message();
  const Certificate a = certify(*nist).value();
  EXPECT_EQ(a.solids, 1);
  EXPECT_TRUE(a.closed);
  EXPECT_TRUE(a.valid);
  EXPECT_EQ(a.free_edges, 0);
  EXPECT_GT(a.volume_mm3, 0);
  EXPECT_NEAR(a.highest_mm.x() - a.lowest_mm.x(), 158.0, 1e-6);
  const auto rods = read_step(data_folder() / "cad/occt/linkrods.step");
  ASSERT_TRUE(rods) << rods.error().message();
  const Certificate b = certify(*rods).value();
  EXPECT_TRUE(b.valid);
  EXPECT_EQ(b.genus, 2);  // two eyes
}

TEST(ForeignCad_real_data, IgesByOthersIsMeasuredEvenWhereItIsLooseFaces) {
  SKIP_WITHOUT_DATA();
  for (const char* file :
       {"cad/occt/bearing.iges", "cad/occt/hammer.iges", "cad/gotools/surface.igs"}) {
    SCOPED_TRACE(file);
    const auto solid = read_iges(data_folder() / file);
    ASSERT_TRUE(solid) << solid.error().message();
    const Certificate c = certify(*solid).value();
    EXPECT_EQ(c.solids, 0);
    EXPECT_FALSE(c.closed);
    EXPECT_GT(c.free_edges, 0);
    EXPECT_GT(c.area_mm2, 0);
    EXPECT_EQ(c.faces.size(), solid->faces.size());
  }
}

TEST(ForeignCad_real_data, AWrongFormatIsAnError) {
  SKIP_WITHOUT_DATA();
  EXPECT_FALSE(read_step(data_folder() / "cad/occt/hammer.iges"));
  EXPECT_FALSE(read_iges(data_folder() / "cad/occt/linkrods.step"));
}

}  // namespace
}  // namespace angiospline
