#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/analysis/compare_masks.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/segment/segment.h"
#include "recovery/imaging/segment/vesselness.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {
namespace {

Phantom noisy_tree(double snr) {
  PhantomOptions o;
  o.field_mm = 160;
  o.radius_max_mm = 7;
  o.radius_min_mm = 2.5;
  o.ends = 6;
  o.snr = snr;
  o.seed = 3;
  auto p = make_phantom(PhantomKind::kRandomTree, o);
  EXPECT_TRUE(p.has_value());
  return *p;
}

TEST(Gaussian, KeepsConstantsAndTheSumOfGreyValues) {
  ImageGrid grid;
  grid.size = {21, 21, 21};
  grid.spacing_mm = Vec3(1, 1, 2);
  const Image<float> flat(grid, 7.0F);
  for (const float v : smoothed(flat, 1.3).voxels) ASSERT_NEAR(v, 7, 1e-5);
  Image<float> point(grid);
  point[{10, 10, 10}] = 1;
  const Image<float> spread = smoothed(point, 1.5);
  double sum = 0;
  Vec3 variance = Vec3::Zero();
  for (std::size_t i = 0; i < spread.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    const Vec3 d = grid.spacing_mm.cwiseProduct(Vec3(v[0] - 10, v[1] - 10, v[2] - 10));
    sum += static_cast<double>(spread.voxels[i]);
    variance += d.cwiseProduct(d) * static_cast<double>(spread.voxels[i]);
  }
  EXPECT_NEAR(sum, 1, 1e-5);
  // Isotropic in mm whatever the spacing; the cut at three deviations takes 3 % of the variance.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(variance[i] / (1.5 * 1.5), 0.97, 0.05) << i;
}

TEST(Gaussian, LeavesVoxelsThatAreNotFiniteOut) {
  ImageGrid grid;
  grid.size = {9, 9, 9};
  Image<float> image(grid, 5.0F);
  image[{4, 4, 4}] = std::numeric_limits<float>::quiet_NaN();
  image[{0, 0, 0}] = std::numeric_limits<float>::infinity();
  const Image<float> out = smoothed(image, 1.0);
  for (std::size_t i = 0; i < out.voxels.size(); ++i)
    if (std::isfinite(image.voxels[i])) {
      ASSERT_NEAR(out.voxels[i], 5, 1e-5);
    } else {
      ASSERT_FALSE(std::isfinite(out.voxels[i]));
    }
}

TEST(Gaussian, RoundsIntegersAndLeavesFlatAxesAlone) {
  Image<std::uint8_t> slice;
  slice.grid.size = {5, 1, 1};
  slice.voxels = {0, 0, 255, 0, 0};
  const Image<std::uint8_t> out = smoothed(slice, 0.5);
  EXPECT_EQ(out.voxels, (std::vector<std::uint8_t>{0, 27, 201, 27, 0}));
  EXPECT_EQ(smoothed(slice, 0.0).voxels, slice.voxels);
}

TEST(Gaussian, OfABoxIsTheBoxOfTheWhole) {
  Random random(8);
  ImageGrid grid{{19, 12, 9}, Vec3(0.5, 0.8, 1.1), Vec3(3, 2, 1), Mat3::Identity()};
  Image<std::int16_t> whole(grid);
  Image<float> in_float(grid), with_holes(grid);
  for (std::size_t i = 0; i < whole.voxels.size(); ++i) {
    whole.voxels[i] = static_cast<std::int16_t>(std::lround(3000 * random.gaussian()));
    in_float.voxels[i] = whole.voxels[i];
    with_holes.voxels[i] = random.uniform() < 0.05 ? std::numeric_limits<float>::quiet_NaN()
                                                   : static_cast<float>(random.gaussian());
  }
  for (const double sigma : {0.0, 0.4, 1.0}) {
    const Image<float> all = smoothed(in_float, sigma);
    const Image<float> all_with_holes = smoothed(with_holes, sigma);
    for (const auto& [low, high] :
         {std::pair{Voxel{0, 0, 0}, Voxel{18, 11, 8}}, std::pair{Voxel{5, 4, 3}, Voxel{7, 9, 3}},
          std::pair{Voxel{18, 0, 8}, Voxel{18, 0, 8}}}) {
      const auto box = smoothed_box(whole, low, high, sigma);
      const auto box_with_holes = smoothed_box(with_holes, low, high, sigma);
      EXPECT_TRUE(box.grid.origin_mm.isApprox(grid.world_mm(low)));
      for (std::size_t i = 0; i < box.voxels.size(); ++i) {
        const Voxel v = box.grid.voxel(i);
        const Voxel at{low[0] + v[0], low[1] + v[1], low[2] + v[2]};
        ASSERT_EQ(box.voxels[i], all[at]);
        const float hole = all_with_holes[at];
        if (std::isnan(hole))
          ASSERT_TRUE(std::isnan(box_with_holes.voxels[i]));
        else
          ASSERT_NEAR(box_with_holes.voxels[i], hole, 1e-5F);
      }
    }
  }
}

TEST(Segment, FindsANoisyTreeWithoutAnyParameter) {
  for (const double snr : {8.0, 4.0}) {
    const Phantom p = noisy_tree(snr);
    const auto s = segment(p.image);
    ASSERT_TRUE(s.has_value()) << s.error().message();
    EXPECT_TRUE(s->report.seeds_found);
    EXPECT_TRUE(s->report.warnings.empty());
    EXPECT_GE(s->report.choices.size(), 4U);  // it says what it chose
    const auto c = compare_masks(p.truth, s->mask);
    ASSERT_TRUE(c.has_value());
    EXPECT_GT(c->dice, 0.96) << snr;
    EXPECT_EQ(c->result_topology.components, 1);
    EXPECT_EQ(c->result_topology.cavities, 0);
    EXPECT_LE(c->result_topology.cycles, 2);
    EXPECT_LT(c->surface->mean_mm, 0.5);
  }
}

template <typename T>
Image<T> as(const Image<float>& image) {
  Image<T> out(image.grid);
  std::transform(image.voxels.begin(), image.voxels.end(), out.voxels.begin(),
                 [](float v) { return static_cast<T>(v); });
  return out;
}

// Few grey values, so that their smoothed values would tie if they were rounded.
TEST(Segment, GivesTheSameMaskWhateverThePixelType) {
  const Phantom p = noisy_tree(4);
  Image<float> few(p.image.grid);
  for (std::size_t i = 0; i < few.voxels.size(); ++i)
    few.voxels[i] =
        std::clamp(std::round(0.05F * static_cast<float>(p.image.voxels[i])) + 40.0F, 0.0F, 127.0F);
  SegmentOptions given;
  given.seeds_mm = {p.tree.branches.front().points_mm.col(8)};
  const auto expect_same = [](const Result<Segmented>& typed, const Result<Segmented>& in_float) {
    ASSERT_TRUE(typed && in_float);
    EXPECT_EQ(typed->mask.voxels, in_float->mask.voxels);
    EXPECT_EQ(typed->report.choices, in_float->report.choices);
  };
  const auto in_float = segment(few, given);
  EXPECT_GT(compare_masks(p.truth, in_float->mask)->dice, 0.95);
  for (const AnyImage& image : {AnyImage(as<std::uint8_t>(few)), AnyImage(as<std::int8_t>(few)),
                                AnyImage(as<std::int16_t>(few)), AnyImage(as<double>(few))}) {
    SCOPED_TRACE(pixel_type_name(image));
    expect_same(segment(image, given), in_float);
  }
  expect_same(segment(as<std::uint8_t>(few)), segment(few));
}

TEST(Segment, HasNoCliffInM) {
  const Phantom p = noisy_tree(6);
  double least = 1, most = 0;
  for (const double m : {1.0, 1.5, 2.0, 2.5, 3.0}) {
    SegmentOptions o;
    o.seeds_mm = {p.tree.branches.front().points_mm.col(8)};
    o.deviations = m;
    const auto s = segment(p.image, o);
    ASSERT_TRUE(s.has_value());
    const double dice = compare_masks(p.truth, s->mask)->dice;
    least = std::min(least, dice);
    most = std::max(most, dice);
  }
  EXPECT_GT(least, 0.95);
  EXPECT_LT(most - least, 0.03);
}

TEST(Segment, ChoosesTheSameForAScaledAndShiftedImage) {
  const Phantom p = noisy_tree(6);
  Image<float> other(p.image.grid);
  for (std::size_t i = 0; i < other.voxels.size(); ++i)
    other.voxels[i] = 4 * static_cast<float>(p.image.voxels[i]) + 64;
  SegmentOptions o;
  o.seeds_mm = {p.tree.branches.front().points_mm.col(8)};
  Image<float> same(p.image.grid);
  std::copy(p.image.voxels.begin(), p.image.voxels.end(), same.voxels.begin());
  const auto a = segment(same, o), b = segment(other, o);
  ASSERT_TRUE(a && b);
  EXPECT_GT(compare_masks(a->mask, b->mask)->dice, 0.9999);  // but for rounding of grey values
  EXPECT_NEAR(b->report.background, 4 * a->report.background + 64, 0.5);
}

TEST(Segment, WarnsOfALeakIntoTissue) {
  // A vessel that touches a lattice of bars as bright as itself.
  const auto p = make_phantom(PhantomKind::kCylinder, {});
  Image<std::int16_t> image = p->image;
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = image.grid.voxel(i);
    const int in_bars = (v[0] % 12 < 5) + (v[1] % 12 < 5) + (v[2] % 12 < 5);
    if (v[0] >= 36 && in_bars >= 2) image.voxels[i] = 1200;
  }
  SegmentOptions o;
  o.seeds_mm = {Vec3(26, 31.5, 31.5)};
  const auto leaked = segment(image, o), sound = segment(p->image, o);
  ASSERT_TRUE(leaked && sound);
  EXPECT_TRUE(sound->report.warnings.empty());
  ASSERT_EQ(leaked->report.warnings.size(), 1U);
  EXPECT_NE(leaked->report.warnings[0].text.find("leaked"), std::string::npos);
}

TEST(Segment, RaisesTheThresholdUntilALeakIsShut) {
  PhantomOptions phantom;
  phantom.snr = 12;
  const auto p = make_phantom(PhantomKind::kCylinder, phantom);
  Image<std::int16_t> image = p->image;  // bars of tissue, brighter than half of the vessel
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = image.grid.voxel(i);
    const int in_bars = (v[0] % 12 < 5) + (v[1] % 12 < 5) + (v[2] % 12 < 5);
    if (p->truth.voxels[i] == 0 && in_bars >= 2)
      image.voxels[i] = static_cast<std::int16_t>(image.voxels[i] + 560);
  }
  SegmentOptions o;
  o.seeds_mm = {Vec3(31.5, 31.5, 31.5)};
  const auto s = segment(image, o);
  ASSERT_TRUE(s.has_value()) << s.error().message();
  EXPECT_TRUE(s->report.warnings.empty());
  EXPECT_TRUE(std::any_of(s->report.choices.begin(), s->report.choices.end(), [](const auto& text) {
    return text.find("growing leaked") != std::string::npos;
  }));
  EXPECT_GT(compare_masks(p->truth, s->mask)->dice, 0.95);
}

// A vessel that touches a ball of tissue nearly as bright, without any hole in it.
TEST(Segment, SaysWhenItLeaksIntoTissueWithoutHolesAndCutsItOnRequest) {
  Image<std::int16_t> image(ImageGrid{{72, 64, 96}, Vec3::Ones(), Vec3::Zero(), Mat3::Identity()});
  Random random(5);
  std::size_t vessel = 0;
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = image.grid.voxel(i);
    const bool tube = std::hypot(v[0] - 16, v[1] - 32) <= 3.5;
    const bool ball = std::hypot(v[0] - 44, v[1] - 32, v[2] - 48) <= 18;
    const bool neck =
        std::abs(v[1] - 32) <= 1 && std::abs(v[2] - 48) <= 1 && v[0] > 16 && v[0] < 30;
    const double grey = tube ? 1000 : ball ? 950 : neck ? 800 : 200;
    vessel += tube;
    image.voxels[i] = static_cast<std::int16_t>(std::lround(grey + 40 * random.gaussian()));
  }
  SegmentOptions o;
  o.seeds_mm = {Vec3(16, 32, 10)};
  const auto leaked = segment(image, o);
  ASSERT_TRUE(leaked.has_value()) << leaked.error().message();
  ASSERT_TRUE(leaked->report.swelling.has_value());
  const Swelling& s = *leaked->report.swelling;
  EXPECT_FALSE(s.cut);
  EXPECT_GT(s.voxels, 15000U);
  EXPECT_NEAR(s.neck[0], 24, 5);  // from the tube's wall to the ball's
  EXPECT_NEAR(s.neck[1], 32, 3);
  EXPECT_NEAR(s.neck[2], 48, 3);
  EXPECT_NEAR(s.beyond_depth_mm, 18, 2);
  EXPECT_NEAR(s.vessel_depth_mm, 4, 1);
  EXPECT_FALSE(leaked->report.warnings.empty());
  o.cut_swellings = true;
  const auto sound = segment(image, o);
  ASSERT_TRUE(sound.has_value()) << sound.error().message();
  ASSERT_TRUE(sound->report.swelling.has_value());
  EXPECT_TRUE(sound->report.swelling->cut);
  EXPECT_NEAR(static_cast<double>(voxel_count(sound->mask)), static_cast<double>(vessel),
              0.1 * static_cast<double>(vessel));
}

TEST(Swelling, IsNoneInAVesselThatWidensOrAnEmptyMask) {
  Mask mask(ImageGrid{{40, 40, 60}, Vec3::Ones(), Vec3::Zero(), Mat3::Identity()});
  EXPECT_FALSE(find_swelling(mask, mask).has_value());
  Mask before(mask.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const Voxel v = mask.grid.voxel(i);
    const double radius = v[2] < 30 ? 5 : 10;
    mask.voxels[i] = std::hypot(v[0] - 20, v[1] - 20) <= radius ? 1 : 0;
    before.voxels[i] = v[2] < 30 ? mask.voxels[i] : 0;
  }
  EXPECT_FALSE(find_swelling(mask, before).has_value());
  const auto parts = find_swelling(mask, before, 1.5);  // but by another measure it is one
  ASSERT_TRUE(parts.has_value());
  EXPECT_NEAR(parts->swelling.neck[2], 30, 5);
  EXPECT_EQ(voxel_count(parts->vessel) + parts->swelling.voxels, voxel_count(mask));
}

TEST(Segment, DarkVesselsAreFoundToo) {
  PhantomOptions o;
  o.background = 1200;
  o.vessel = 200;
  o.snr = 8;
  const auto p = make_phantom(PhantomKind::kBifurcation, o);
  SegmentOptions s;
  s.polarity = Polarity::kDark;
  const auto found = segment(p->image, s);
  ASSERT_TRUE(found.has_value()) << found.error().message();
  EXPECT_GT(compare_masks(p->truth, found->mask)->dice, 0.96);
}

// As a coil leaves it: vessel and background lose four fifths of their signal along the vessel.
TEST(Segment, FollowsAVesselWhoseSignalFades) {
  Image<float> image;
  image.grid.size = {48, 48, 160};
  image.voxels.resize(image.grid.voxel_count());
  Mask truth(image.grid);
  Random random(3);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = image.grid.voxel(i);
    const double gain = std::exp(-1.6 * v[2] / 160.0);
    const bool inside = std::hypot(v[0] - 24.0, v[1] - 24.0) <= 8;
    truth.voxels[i] = inside;
    image.voxels[i] = static_cast<float>(gain * (inside ? 2000 : 350) + 60 * random.gaussian());
  }
  SegmentOptions o;
  o.seeds_mm = {Vec3(24, 24, 20)};
  const auto s = segment(image, o);
  ASSERT_TRUE(s.has_value()) << s.error().message();
  const auto c = compare_masks(truth, s->mask);
  ASSERT_TRUE(c.has_value());
  EXPECT_GT(c->dice, 0.97);
  EXPECT_EQ(c->result_topology, c->truth_topology);
  EXPECT_TRUE(s->report.warnings.empty());
}

// ---- metrics ----------------------------------------------------------------------------------

Mask box(const Vec3& spacing, int from, int to) {
  ImageGrid grid;
  grid.size = {30, 30, 30};
  grid.spacing_mm = spacing;
  Mask m(grid);
  for (int z = 5; z < 15; ++z)
    for (int y = 5; y < 15; ++y)
      for (int x = from; x < to; ++x) m[{x, y, z}] = 1;
  return m;
}

TEST(Metrics, AMaskIsLikeItself) {
  const Mask m = box(Vec3(1, 2, 3), 5, 15);
  const auto c = compare_masks(m, m);
  ASSERT_TRUE(c.has_value());
  EXPECT_EQ(c->dice, 1);
  EXPECT_EQ(c->missed_percent, 0);
  EXPECT_EQ(c->surface->mean_mm, 0);
  EXPECT_EQ(c->surface->hausdorff_mm, 0);
  EXPECT_EQ(c->truth_topology, c->result_topology);
}

TEST(Metrics, ALongerBoxIsOffByItsExtraLength) {
  const auto c = compare_masks(box(Vec3(0.5, 1, 2), 5, 15), box(Vec3(0.5, 1, 2), 5, 19));
  ASSERT_TRUE(c.has_value());
  EXPECT_EQ(c->missed, 0U);
  EXPECT_EQ(c->beyond, 400U);
  EXPECT_DOUBLE_EQ(c->missed_percent, 40);
  EXPECT_DOUBLE_EQ(c->dice, 2000.0 / 2400);
  EXPECT_DOUBLE_EQ(c->surface->hausdorff_mm, 2.0);  // four voxels of half a millimetre
}

TEST(Metrics, EmptyMasksHaveStatedAnswers) {
  const Mask full = box(Vec3::Ones(), 5, 15);
  Mask none(full.grid);
  EXPECT_EQ(compare_masks(none, none)->dice, 1);
  EXPECT_EQ(compare_masks(full, none)->dice, 0);
  EXPECT_FALSE(compare_masks(full, none)->surface.has_value());
  EXPECT_EQ(compare_masks(full, none)->missed_percent, 100);
}

TEST(Metrics, RefusesMasksOnDifferentGrids) {
  Mask other(box(Vec3::Ones(), 5, 15));
  other.grid.spacing_mm[1] = 2;
  EXPECT_FALSE(compare_masks(box(Vec3::Ones(), 5, 15), other).has_value());
  other = Mask();
  EXPECT_FALSE(compare_masks(box(Vec3::Ones(), 5, 15), other).has_value());
}

TEST(Metrics, CenterlineDiceIsTheHarmonicMeanOfBothShares) {
  const Mask truth = box(Vec3::Ones(), 5, 15), result = box(Vec3::Ones(), 5, 25);
  Mask truth_axis(truth.grid), result_axis(truth.grid);
  for (int x = 5; x < 15; ++x) truth_axis[{x, 10, 10}] = 1;
  for (int x = 5; x < 25; ++x) result_axis[{x, 10, 10}] = 1;
  EXPECT_DOUBLE_EQ(centerline_dice(truth, truth_axis, result, result_axis), 2 * 0.5 / 1.5);
  const Mask none(truth.grid);
  EXPECT_EQ(centerline_dice(none, none, none, none), 1);
}

}  // namespace
}  // namespace angiospline
