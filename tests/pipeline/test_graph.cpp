// Mask files to skeletons and centerlines.
#include <filesystem>
#include <string>

#include <gtest/gtest.h>

#include "io/centerlines/centerline_file.h"
#include "io/images/image_file.h"
#include "pipeline/graph.h"
#include "pipeline/segment_file.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/phantoms/phantom.h"
#include "tests/cli/run_program.h"

namespace angiospline {
namespace {

class GraphFile : public testing::Test {
 protected:
  void SetUp() override {
    const auto phantom = make_phantom(PhantomKind::kBentVessel);
    ASSERT_TRUE(phantom);
    truth_ = phantom->truth;
    ASSERT_TRUE(write_image(truth_, mask_));
  }

  test::TemporaryFolder folder_;
  std::string mask_ = folder_ / "mask.nrrd";
  Mask truth_;
};

TEST_F(GraphFile, ThinningCountsWhatItWritesAndKeepsTheTopology) {
  const auto thinned = thin_file(mask_, folder_ / "skeleton.nrrd", {.topology = true});
  ASSERT_TRUE(thinned) << thinned.error().message();
  const auto skeleton = read_mask(folder_ / "skeleton.nrrd");
  ASSERT_TRUE(skeleton);
  EXPECT_EQ(thinned->voxels_before, voxel_count(truth_));
  EXPECT_EQ(thinned->voxels_after, voxel_count(*skeleton));
  EXPECT_LT(thinned->voxels_after, thinned->voxels_before / 5);
  ASSERT_TRUE(thinned->topology_before && thinned->topology_after);
  EXPECT_EQ(thinned->topology_before->components, thinned->topology_after->components);
  EXPECT_EQ(thinned->topology_before->cycles, thinned->topology_after->cycles);

  const auto uncounted = thin_file(mask_, folder_ / "skeleton.nrrd");
  ASSERT_TRUE(uncounted);
  EXPECT_FALSE(uncounted->topology_before);
}

TEST_F(GraphFile, ASkeletonWithItsMaskGivesTheRadiiThatTheMaskAloneGives) {
  GraphFileOptions whole;
  whole.vessels.thinning = {};  // as thin_file thins
  const auto from_mask = graph_file(mask_, {folder_.path() / "a.swc"}, whole);
  ASSERT_TRUE(from_mask) << from_mask.error().message();
  ASSERT_TRUE(thin_file(mask_, folder_ / "skeleton.nrrd"));
  GraphFileOptions two = whole;
  two.mask = mask_;
  const auto from_both = graph_file(folder_ / "skeleton.nrrd", {folder_.path() / "b.swc"}, two);
  ASSERT_TRUE(from_both) << from_both.error().message();

  const CenterlineTree& a = from_mask->vessels.tree;
  const CenterlineTree& b = from_both->vessels.tree;
  ASSERT_EQ(a.branches.size(), 1U);
  ASSERT_EQ(b.branches.size(), 1U);
  EXPECT_EQ(a.branches[0].points_mm, b.branches[0].points_mm);
  EXPECT_EQ(a.branches[0].radii_mm, b.branches[0].radii_mm);
  EXPECT_NEAR(a.branches[0].radii_mm.mean(), 2.5, 0.3);
  EXPECT_TRUE(read_centerline_file(folder_ / "a.swc"));
}

TEST_F(GraphFile, ChecksItsTargetsFirstAndNamesTheFileInErrors) {
  const auto target = graph_file("missing.nrrd", {folder_.path() / "out.docx"});
  ASSERT_FALSE(target);
  EXPECT_NE(target.error().where.find("out.docx"), std::string::npos);

  Mask point(truth_.grid);
  point.voxels[point.voxels.size() / 2] = 1;
  ASSERT_TRUE(write_image(point, folder_ / "point.nrrd"));
  const auto none = graph_file(folder_ / "point.nrrd", {});
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().where.find(folder_ / "point.nrrd"), 0U) << none.error().message();
}

}  // namespace
}  // namespace angiospline
