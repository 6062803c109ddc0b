// What region growing is made of, each part against a plain twin.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "base/random.h"
#include "recovery/imaging/segment/adaptive_threshold.h"
#include "recovery/imaging/segment/bricks.h"
#include "recovery/imaging/segment/growing_front.h"
#include "recovery/imaging/segment/growing_labels.h"

namespace angiospline::region_growing {
namespace {

Image<float> random_image(Random& random, const Voxel& size) {
  ImageGrid grid;
  grid.size = size;
  Image<float> image(grid);
  for (float& v : image.voxels) v = static_cast<float>(random.below(40));  // with ties
  return image;
}

Voxel random_voxel(Random& random, const Voxel& size) {
  return {random.below(size[0]), random.below(size[1]), random.below(size[2])};
}

TEST(Bricks, HoldWhatADenseVolumeHolds) {
  struct Cube {
    std::array<int, 512> values{};
  };
  using Store = Bricks<Cube>;
  Random random(1);
  const Voxel size{19, 8, 30};
  Store store(size);
  std::map<Voxel, int> dense;
  EXPECT_EQ(store.find(3, 3, 3), nullptr);
  for (int k = 1; k <= 400; ++k) {
    const Voxel v = random_voxel(random, size);
    store.touch(v[0], v[1], v[2]).values[Store::within(v[0], v[1], v[2])] = k;
    dense[v] = k;
  }
  for (const auto& [v, value] : dense) {
    const Cube* cube = store.find(v[0], v[1], v[2]);
    ASSERT_NE(cube, nullptr);
    EXPECT_EQ(cube->values[Store::within(v[0], v[1], v[2])], value);
  }
  std::size_t held = 0;
  Voxel last{-1, -1, -1};
  store.for_each([&](const Voxel& low, const Cube& cube) {
    EXPECT_LT((std::array{last[2], last[1], last[0]}), (std::array{low[2], low[1], low[0]}));
    last = low;
    held += static_cast<std::size_t>(
        std::count_if(cube.values.begin(), cube.values.end(), [](int v) { return v != 0; }));
  });
  EXPECT_EQ(held, dense.size());
}

TEST(VoxelFlags, AreThoseThatWereSet) {
  Random random(2);
  const Voxel size{20, 11, 9};
  VoxelFlags flags(size);
  std::set<Voxel> seen, vessel;
  for (int k = 0; k < 300; ++k) {
    const Voxel v = random_voxel(random, size);
    flags.set(v, VoxelFlags::kSeen);
    seen.insert(v);
    if (k % 3 != 0) continue;
    flags.set(v, VoxelFlags::kVessel);
    vessel.insert(v);
  }
  for (int z = 0; z < size[2]; ++z)
    for (int y = 0; y < size[1]; ++y)
      for (int x = 0; x < size[0]; ++x) {
        EXPECT_EQ(flags.any({x, y, z}, VoxelFlags::kSeen), seen.contains({x, y, z}));
        EXPECT_EQ(flags.any({x, y, z}, VoxelFlags::kVessel), vessel.contains({x, y, z}));
      }
  std::set<Voxel> met;
  flags.for_each_with(VoxelFlags::kVessel, [&](const Voxel& v) { met.insert(v); });
  EXPECT_EQ(met, vessel);
}

TEST(LabelledMoments, AreThoseOfTheLabelledVoxelsInTheBox) {
  Random random(3);
  for (const int half : {1, 2, 4}) {
    const Image<float> image = random_image(random, {21, 17, 20});
    const Voxel size = image.grid.size;
    LabelledMoments moments(size, half);
    std::set<Voxel> labelled;
    while (labelled.size() < 600) {
      const Voxel v = random_voxel(random, size);
      if (labelled.insert(v).second) moments.add(v, static_cast<double>(image[v]));
    }
    for (int k = 0; k < 100; ++k) {
      const Voxel v = random_voxel(random, size);
      const Box box = box_around(v, half, size);
      Moments plain;
      for_each(box, [&](const Voxel& u) {
        if (labelled.contains(u)) plain.add(static_cast<double>(image[u]) - moments.reference());
      });
      const Moments fast = moments.around(v, box);
      ASSERT_EQ(fast.count, plain.count);
      EXPECT_EQ(fast.sum, plain.sum);  // whole numbers: exact in any order
      EXPECT_EQ(fast.sum_of_squares, plain.sum_of_squares);
    }
  }
}

TEST(Moments, OfEqualValuesDeviateByNothing) {
  Moments m;
  for (int k = 0; k < 7; ++k) m.add(0.1);
  EXPECT_NEAR(m.mean(), 0.1, 1e-15);
  Moments zero;
  for (int k = 0; k < 7; ++k) zero.add(0);
  EXPECT_EQ(zero.deviation(), 0);
}

TEST(GreyValues, AreTheWholeImageSmoothedWhereverTheyAreAskedFor) {
  Random random(4);
  const Image<float> image = random_image(random, {23, 18, 20});
  const Image<float> whole = smoothed(Image<float>(image), 1.3);
  const GreyValues<float> lazy(image, 1.3);
  const GreyValues<float> plain(image, 0);
  for (int k = 0; k < 400; ++k) {
    const Voxel v = random_voxel(random, image.grid.size);
    EXPECT_EQ(lazy.at(v), static_cast<double>(whole[v]));
    EXPECT_EQ(plain.at(v), static_cast<double>(image[v]));
  }
}

TEST(GrowingFront, HandsOutTheBrightestAndOfEqualOnesTheFirst) {
  GrowingFront<int> front;
  front.push(1, 10);
  front.push(3, 11);
  front.push(3, 12);
  front.push(2, 13);
  std::vector<int> order;
  std::size_t examined = 0;
  const auto limit = front.grow(examined, std::nullopt, 100, {}, [&](const auto& candidate) {
    order.push_back(candidate.at);
    ++examined;
    if (candidate.at == 12) front.push(5, 14);  // met on the way, and brighter
  });
  ASSERT_TRUE(limit);
  EXPECT_FALSE(*limit);
  EXPECT_EQ(order, (std::vector<int>{11, 12, 14, 13, 10}));
}

TEST(GrowingFront, StopsAtTheLimitAndOnRequest) {
  GrowingFront<int> front;
  for (int k = 0; k < 10; ++k) front.push(k, k);
  std::size_t examined = 0;
  const auto count = [&](const auto&) { ++examined; };
  const auto limited = front.grow(examined, 4, 100, {}, count);
  ASSERT_TRUE(limited);
  EXPECT_TRUE(*limited);
  EXPECT_EQ(examined, 4U);
  Progress stop;
  stop.stop_requested = [] { return true; };
  const auto stopped = front.grow(examined, std::nullopt, 1, stop, count);
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().kind, ErrorKind::kCancelled);
  EXPECT_EQ(examined, 4U);
}

// The rule of thesis 4.1, in plain loops: S1 labelled vessel in the box, S2 the N/2 brightest
// unlabelled ones connected to the candidate.
struct PlainRule {
  const Image<float>& image;
  const GrowOptions& options;
  std::set<Voxel> vessel, background;

  bool decide(const Voxel& c) const {
    const Box box = box_around(c, options.neighbourhood_vox / 2, image.grid.size);
    Moments s1;
    for_each(box, [&](const Voxel& u) {
      if (vessel.contains(u)) s1.add(static_cast<double>(image[u]));
    });
    std::vector<Voxel> s2{c}, met;
    std::set<Voxel> known{c};
    for (Voxel last = c; static_cast<int>(s2.size()) < options.neighbourhood_vox / 2;) {
      for_each(box_around(last, 1, image.grid.size), [&](const Voxel& u) {
        for (std::size_t k = 0; k < 3; ++k)
          if (u[k] < box.low[k] || u[k] > box.high[k]) return;
        if (vessel.contains(u) || background.contains(u) || !known.insert(u).second) return;
        met.push_back(u);
      });
      if (met.empty()) break;
      const auto best =
          std::max_element(met.begin(), met.end(),
                           [&](const Voxel& a, const Voxel& b) { return image[a] < image[b]; });
      last = *best;
      met.erase(best);
      s2.push_back(last);
    }
    double sum = 0;
    for (const Voxel& v : s2) sum += static_cast<double>(image[v]);
    return sum / static_cast<double>(s2.size()) >= s1.mean() - options.deviations * s1.deviation();
  }
};

TEST(AdaptiveThreshold, DecidesAsTheRuleInPlainLoops) {
  Random random(5);
  GrowOptions options;
  int vessels = 0, others = 0;
  for (const int edge : {3, 5, 7}) {
    options.neighbourhood_vox = edge;
    options.deviations = 0.6;
    const Image<float> image = random_image(random, {12, 11, 10});
    AdaptiveThreshold<float> rule(image, options);
    PlainRule plain{image, options, {}, {}};
    for (int k = 0; k < 300; ++k) {
      const Voxel v = random_voxel(random, image.grid.size);
      if (plain.vessel.contains(v) || plain.background.contains(v)) continue;
      if (random.below(3) > 0) {
        rule.label_vessel(v);
        plain.vessel.insert(v);
      } else {
        rule.label_background(v);
        plain.background.insert(v);
      }
    }
    for (int k = 0; k < 300; ++k) {
      const Voxel v = random_voxel(random, image.grid.size);
      if (plain.vessel.contains(v) || plain.background.contains(v)) continue;
      const Box box = box_around(v, edge / 2, image.grid.size);
      bool any = false;
      for_each(box, [&](const Voxel& u) { any = any || plain.vessel.contains(u); });
      if (!any) continue;
      const bool expected = plain.decide(v);
      EXPECT_EQ(rule.decide(v).vessel, expected);
      ++(expected ? vessels : others);
    }
  }
  EXPECT_GT(vessels, 50);
  EXPECT_GT(others, 50);
}

}  // namespace
}  // namespace angiospline::region_growing
