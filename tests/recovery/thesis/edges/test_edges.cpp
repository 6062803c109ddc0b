#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/random.h"
#include "recovery/phantoms/phantom.h"
#include "recovery/thesis/edges/edge_detection.h"
#include "recovery/thesis/edges/edge_masks.h"
#include "recovery/thesis/edges/rules.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

ImageGrid grid_of_size(const Voxel& size, const Vec3& spacing = Vec3::Ones()) {
  ImageGrid grid;
  grid.size = size;
  grid.spacing_mm = spacing;
  return grid;
}

// A plane step of height 100 through the middle of the image, by exact partial volumes.
Image<float> step(const ImageGrid& grid, const Vec3& normal, double shift_mm = 0) {
  Image<float> image(grid);
  const Vec3 middle(grid.size[0] / 2, grid.size[1] / 2, grid.size[2] / 2);
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    const Vec3 at = grid.spacing_mm.cwiseProduct(Vec3(v[0], v[1], v[2]) - middle);
    image.voxels[i] = static_cast<float>(
        100 * share_beyond_plane(at - shift_mm * normal, grid.spacing_mm, normal));
  }
  return image;
}

TEST(EdgeMasks, PartialVolumesAreThoseOfSampling) {
  Random random(7);
  for (int trial = 0; trial < 200; ++trial) {
    Vec3 n(random.gaussian(), random.gaussian(), random.gaussian());
    if (trial % 3 == 0) n[trial % 2] = 0;
    if (trial % 7 == 0) n = Vec3::Unit(trial % 3);
    n.normalize();
    const Vec3 edges(random.uniform(0.5, 2), random.uniform(0.5, 2), random.uniform(0.5, 2));
    const Vec3 c(random.uniform(-1, 1), random.uniform(-1, 1), random.uniform(-1, 1));
    constexpr int kCount = 24;
    int inside = 0;
    for (int k = 0; k < kCount * kCount * kCount; ++k) {
      const Vec3 u((k % kCount + 0.5) / kCount, (k / kCount % kCount + 0.5) / kCount,
                   (k / kCount / kCount + 0.5) / kCount);
      inside += n.dot(c + edges.cwiseProduct(u - Vec3::Constant(0.5))) > 0;
    }
    EXPECT_NEAR(share_beyond_plane(c, edges, n), inside / std::pow(kCount, 3), 0.025);
  }
}

TEST(EdgeMasks, AreTheMasksThatThesisAndPaperPrint) {
  // Rows of figure 6.2 from the top (y = 2) down; they are rounded to about a hundredth.
  const int zero[25] = {-100, -100, 0,    100,  100, -100, -100, 0,    100,  100, -100, -100, 0,
                        100,  100,  -100, -100, 0,   100,  100,  -100, -100, 0,   100,  100};
  const int thirty[25] = {-100, 32,  100,  100,  100, -100, -78, 92,   100,  100,  -100, -100, 0,
                          100,  100, -100, -100, -92, 78,   100, -100, -100, -100, -32,  100};
  for (const int degrees : {0, 30}) {
    const double a = degrees * kPi / 180;
    const EdgeMask mask = edge_mask({std::cos(a), std::sin(a), 0}, Vec3::Ones(), true);
    for (int y = 2; y >= -2; --y)
      for (int x = -2; x <= 2; ++x)
        EXPECT_NEAR(100 * mask.weight({x, y, 0}),
                    (degrees == 0 ? zero : thirty)[(2 - y) * 5 + x + 2], 1.6)
            << degrees << " degrees at " << x << "," << y;
  }
}

TEST(EdgeMasks, Are12InThePlaneAnd62InSpaceAllDistinct) {
  EXPECT_EQ(edge_directions(true).size(), 6U);
  EXPECT_EQ(edge_directions(false).size(), 31U);
  for (const bool flat : {true, false}) {
    const auto normals = edge_directions(flat);
    for (std::size_t i = 0; i < normals.size(); ++i)
      for (std::size_t j = 0; j < i; ++j)
        EXPECT_LT(std::abs(normals[i].dot(normals[j])), std::cos(14 * kPi / 180));
  }
}

TEST(EdgeMasks, SumToZeroAndAreOdd) {
  for (const Vec3& spacing : {Vec3(1, 1, 1), Vec3(0.5, 0.7, 1.4)})
    for (const Vec3& n : edge_directions(false)) {
      const EdgeMask mask = edge_mask(n, spacing, false);
      double sum = 0;
      for (int k = 0; k < 125; ++k) {
        sum += mask.weights[static_cast<std::size_t>(k)];
        EXPECT_EQ(mask.weights[static_cast<std::size_t>(k)],
                  -mask.weights[static_cast<std::size_t>(124 - k)]);
      }
      EXPECT_NEAR(sum, 0, 1e-12);
    }
}

TEST(EdgeMasks, TurnIntoEachOtherWithTheGrid) {
  int turned = 0;
  const auto normals = edge_directions(false);
  for (const Vec3& n : normals) {
    const EdgeMask mask = edge_mask(n, Vec3::Ones(), false);
    // A quarter turn about z takes n to (-ny, nx, nz), and offsets with it.
    const EdgeMask other = edge_mask({-n[1], n[0], n[2]}, Vec3::Ones(), false);
    for (int z = -2; z <= 2; ++z)
      for (int y = -2; y <= 2; ++y)
        for (int x = -2; x <= 2; ++x)
          EXPECT_NEAR(other.weight({-y, x, z}), mask.weight({x, y, z}), 1e-12);
    for (const Vec3& m : normals)
      turned += std::abs(std::abs(m.dot(Vec3(n[0], -n[1], n[2]))) - 1) < 1e-12;
  }
  EXPECT_EQ(turned, 31);  // the set is its own mirror image
}

TEST(Edges, OwnMaskAnswersAStepWithItsHeight) {
  for (const Vec3& spacing : {Vec3(1, 1, 1), Vec3(0.6, 0.6, 1.2)}) {
    const ImageGrid grid = grid_of_size({9, 9, 9}, spacing);
    for (const Vec3& half : edge_directions(false))
      for (const double sign : {1.0, -1.0}) {
        const Vec3 n = sign * half;
        const auto field = find_edges(step(grid, n), {EdgeContrast{50}});
        ASSERT_TRUE(field) << field.error().message();
        bool found = false;
        for (const Edge& e : field->edges) {
          if (e.voxel != Voxel{4, 4, 4}) continue;
          found = true;
          EXPECT_NEAR(static_cast<double>(e.strength), 100, 0.01);
          EXPECT_NEAR(field->normals[static_cast<std::size_t>(e.normal)].dot(n), 1, 1e-9);
        }
        EXPECT_TRUE(found);
      }
  }
}

TEST(Edges, ThinnedPlanesStandWhereTheyAre) {
  int seen = 0;
  for (const Vec3& n : edge_directions(false)) {
    const ImageGrid grid = grid_of_size({15, 15, 15});
    EdgeOptions options{EdgeContrast{30}};
    options.thinning = EdgeThinning::kAcross;
    double offsets = 0;
    int count = 0;
    for (const double shift : {-0.37, -0.13, 0.13, 0.37}) {  // no two voxels are equally near
      const auto field = find_edges(step(grid, n, shift), options);
      ASSERT_TRUE(field);
      for (const Edge& e : field->edges) {
        bool inner = true;
        for (const int x : e.voxel) inner = inner && x >= 4 && x <= 10;
        if (!inner) continue;
        const double off = n.dot(Vec3(e.voxel[0] - 7, e.voxel[1] - 7, e.voxel[2] - 7)) - shift;
        EXPECT_LE(std::abs(off), 0.87);
        offsets += off;
        ++count;
      }
    }
    ASSERT_GT(count, 80);
    EXPECT_NEAR(offsets / count, 0, 0.02);
    ++seen;
  }
  EXPECT_EQ(seen, 31);
}

bool same(const EdgeField& a, const EdgeField& b) {
  if (a.edges.size() != b.edges.size() || a.threshold != b.threshold) return false;
  for (std::size_t i = 0; i < a.edges.size(); ++i)
    if (a.edges[i].voxel != b.edges[i].voxel || a.edges[i].strength != b.edges[i].strength ||
        a.edges[i].normal != b.edges[i].normal)
      return false;
  return true;
}

TEST(Edges, GateChangesNothingAtAnyNoiseOrThreshold) {
  std::size_t spared = 0;
  for (const double snr : {1.0, 4.0, 20.0})
    for (const double percent : {80.0, 97.0}) {
      PhantomOptions options;
      options.snr = snr;
      options.spacing_mm = Vec3(1, 1, 1.3);
      const auto phantom = make_phantom(PhantomKind::kBentVessel, options);
      ASSERT_TRUE(phantom);
      EdgeOptions edges{EdgePercentile{percent}, EdgeThinning::kNone, EdgeGate::kNone};
      const auto all = find_edges(phantom->image, edges);
      edges.gate = EdgeGate::kMoments;
      const auto gated = find_edges(phantom->image, edges);
      ASSERT_TRUE(all && gated);
      EXPECT_TRUE(same(*all, *gated)) << "SNR " << snr << ", percentile " << percent;
      EXPECT_GT(all->edges.size(), 100U);
      EXPECT_EQ(all->examined, phantom->image.voxels.size());
      spared += all->examined - gated->examined;
    }
  EXPECT_GT(spared, 10000U);
}

TEST(Edges, AreTheSameOnOneThreadAndOnMany) {
  PhantomOptions options;
  options.snr = 3;
  const auto phantom = make_phantom(PhantomKind::kBentVessel, options);
  const auto many = find_edges(phantom->image);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_TRUE(same(*many, *find_edges(phantom->image)));
}

TEST(Edges, PercentileKeepsThatShareOfTheVoxels) {
  PhantomOptions options;
  options.snr = 2;
  const auto phantom = make_phantom(PhantomKind::kBentVessel, options);
  ASSERT_LE(phantom->image.voxels.size(), edge_rules::kPercentileSample);  // none is left out
  const auto field = find_edges(phantom->image, {EdgePercentile{90}});
  EXPECT_NEAR(
      static_cast<double>(field->edges.size()) / static_cast<double>(phantom->image.voxels.size()),
      0.1, 0.001);
}

TEST(Edges, PixelTypesAgree) {
  const auto phantom = make_phantom(PhantomKind::kBentVessel, {});
  const Image<std::int16_t>& as_int16 = phantom->image;
  Image<float> as_float(as_int16.grid);
  Image<std::uint8_t> as_bytes(as_int16.grid);
  for (std::size_t i = 0; i < as_int16.voxels.size(); ++i) {
    as_float.voxels[i] = static_cast<float>(as_int16.voxels[i]);
    as_bytes.voxels[i] = static_cast<std::uint8_t>(as_int16.voxels[i] / 8);
  }
  const EdgeOptions options{EdgeContrast{400}};
  const auto a = find_edges(as_int16, options);
  EXPECT_TRUE(same(*a, *find_edges(as_float, options)));
  EXPECT_TRUE(same(*a, *find_edges(AnyImage(as_int16), options)));
  const auto bytes = find_edges(as_bytes, {EdgeContrast{50}});
  EXPECT_NEAR(static_cast<double>(bytes->edges.size()), static_cast<double>(a->edges.size()),
              0.03 * static_cast<double>(a->edges.size()));
}

TEST(Edges, DirectionsAreThoseOfTheWorld) {
  ImageGrid grid = grid_of_size({9, 9, 9}, {1, 1, 2});
  grid.direction.col(0) = Vec3::UnitY();
  grid.direction.col(1) = -Vec3::UnitX();
  const auto field = find_edges(step(grid, Vec3::UnitX()), {EdgeContrast{60}});
  ASSERT_FALSE(field->edges.empty());
  for (const Edge& e : field->edges)
    EXPECT_NEAR(field->normals[static_cast<std::size_t>(e.normal)].dot(Vec3::UnitY()), 1, 1e-9);
}

TEST(Edges, AFlatImageGetsPlaneMasks) {
  const ImageGrid grid = grid_of_size({11, 11, 1});
  const Vec3 n(std::cos(kPi / 3), std::sin(kPi / 3), 0);
  const auto field = find_edges(step(grid, n), {EdgeContrast{50}});
  EXPECT_EQ(field->normals.size(), 12U);
  bool found = false;
  for (const Edge& e : field->edges)
    if (e.voxel == Voxel{5, 5, 0}) {
      found = true;
      EXPECT_NEAR(static_cast<double>(e.strength), 100, 0.01);
      EXPECT_NEAR(field->normals[static_cast<std::size_t>(e.normal)].dot(n), 1, 1e-9);
    }
  EXPECT_TRUE(found);
}

TEST(Edges, BadImagesAndOptionsAreNamed) {
  Image<float> image = step(grid_of_size({9, 9, 9}), Vec3::UnitX());
  const auto message = [](const Result<EdgeField>& r) {
    return r ? std::string("no error") : r.error().message();
  };
  EXPECT_NE(message(find_edges(Image<float>(image.grid, 3.0F))).find("constant"),
            std::string::npos);
  EXPECT_NE(message(find_edges(image, {EdgeContrast{-1}})).find("-1"), std::string::npos);
  EXPECT_NE(message(find_edges(image, {EdgePercentile{100}})).find("percentile"),
            std::string::npos);
  image[{3, 4, 5}] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_NE(message(find_edges(image)).find("3,4,5"), std::string::npos);
  EXPECT_NE(message(find_edges(Image<float>())).find("empty"), std::string::npos);
}

TEST(Edges, StopOnRequest) {
  const auto phantom = make_phantom(PhantomKind::kBentVessel, {});
  Progress progress;
  progress.stop_requested = [] { return true; };
  const auto field = find_edges(phantom->image, {}, progress);
  ASSERT_FALSE(field);
  EXPECT_EQ(field.error().kind, ErrorKind::kCancelled);
}

}  // namespace
}  // namespace angiospline
