// Edge masks: time of find_edges beside a dense convolution with every mask, and where edges of
// curved walls are found.
//   bench_edges speed [edge 256] [threads 1]     a random tree of vessels at SNR 8, 4, 2, 1
//   bench_edges large [edge 512] [threads 2]     the gated operator alone
//   bench_edges bias                              offsets on cylinders and spheres
// The dense convolution applies all 62 masks of 125 weights to every voxel of some slices, row by
// row so that the compiler can use vectors, and its time is scaled to the volume. CPU seconds.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>

#include <fmt/format.h>
#include <tbb/global_control.h>

#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/phantoms/phantom.h"
#include "recovery/thesis/edges/edge_detection.h"
#include "recovery/thesis/edges/edge_localisation.h"
#include "recovery/thesis/edges/edge_masks.h"

namespace {

using namespace angiospline;

double cpu_seconds() {
  std::timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

double wall_seconds() {
  std::timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

Phantom tree(int edge, double snr) {
  PhantomOptions options;
  options.field_mm = edge;
  options.snr = snr;
  options.ends = 8;
  options.radius_max_mm = 6;
  options.radius_min_mm = 1.5;
  Result<Phantom> phantom = make_phantom(PhantomKind::kRandomTree, options);
  if (!phantom) {
    fmt::print(stderr, "{}\n", phantom.error().message());
    std::exit(1);
  }
  return std::move(*phantom);
}

// Every mask over `slices` slices in the middle of the volume, two away from its border: the
// strongest answer of each voxel, summed so that nothing is left out by the compiler.
double dense_seconds(const Image<std::int16_t>& image, int slices) {
  const ImageGrid& grid = image.grid;
  std::vector<EdgeMask> masks;
  for (const Vec3& n : edge_directions(false)) {
    masks.push_back(edge_mask(n, grid.spacing_mm, false));
    masks.push_back(edge_mask(-n, grid.spacing_mm, false));
  }
  const auto nx = static_cast<std::size_t>(grid.size[0]);
  std::vector<float> voxels(image.voxels.begin(), image.voxels.end());
  std::vector<float> strongest(nx), answer(nx);
  double sum = 0;
  const double start = cpu_seconds();
  for (int z = grid.size[2] / 2; z < grid.size[2] / 2 + slices; ++z)
    for (int y = 2; y < grid.size[1] - 2; ++y) {
      std::fill(strongest.begin(), strongest.end(), 0.0F);
      for (const EdgeMask& mask : masks) {
        std::fill(answer.begin(), answer.end(), 0.0F);
        for (int oz = -2; oz <= 2; ++oz)
          for (int oy = -2; oy <= 2; ++oy)
            for (int ox = -2; ox <= 2; ++ox) {
              const auto w = static_cast<float>(mask.weight({ox, oy, oz}));
              const float* in = voxels.data() + grid.offset({2 + ox, y + oy, z + oz});
              for (std::size_t x = 0; x < nx - 4; ++x) answer[x] += w * in[x];
            }
        for (std::size_t x = 0; x < nx - 4; ++x) strongest[x] = std::max(strongest[x], answer[x]);
      }
      sum += static_cast<double>(strongest[nx / 2]);
    }
  const double seconds = cpu_seconds() - start;
  if (sum < 0) fmt::print("{}\n", sum);
  return seconds * grid.size[2] / slices;
}

bool same(const EdgeField& a, const EdgeField& b) {
  return a.edges.size() == b.edges.size() &&
         std::equal(a.edges.begin(), a.edges.end(), b.edges.begin(),
                    [](const Edge& p, const Edge& q) {
                      return p.voxel == q.voxel && p.strength == q.strength && p.normal == q.normal;
                    });
}

void speed(int edge) {
  fmt::print("{}^3, contrast 1000, threshold half of it; CPU seconds\n", edge);
  fmt::print(" SNR   dense  all masks  gated   dense/gated  voxels left   edges  same edges\n");
  for (const double snr : {8.0, 4.0, 2.0, 1.0}) {
    const Phantom phantom = tree(edge, snr);
    const double dense = dense_seconds(phantom.image, 6);
    EdgeOptions options{EdgeContrast{500}, EdgeThinning::kNone, EdgeGate::kNone};
    double start = cpu_seconds();
    const auto all = find_edges(phantom.image, options);
    const double shared = cpu_seconds() - start;
    options.gate = EdgeGate::kMoments;
    start = cpu_seconds();
    const auto gated = find_edges(phantom.image, options);
    const double seconds = cpu_seconds() - start;
    fmt::print("{:4.0f} {:7.1f} {:8.1f} {:8.2f} {:10.1f} {:11.1f} % {:8} {:>8}\n", snr, dense,
               shared, seconds, dense / seconds,
               100.0 * static_cast<double>(gated->examined) /
                   static_cast<double>(phantom.image.grid.voxel_count()),
               gated->edges.size(), same(*all, *gated) ? "yes" : "NO");
  }
}

void large(int edge) {
  for (const double snr : {8.0, 4.0}) {
    const Phantom phantom = tree(edge, snr);
    const double wall = wall_seconds(), cpu = cpu_seconds();
    const auto field = find_edges(phantom.image, {EdgeContrast{500}});
    fmt::print("{}^3 at SNR {}: {:.1f} s, {:.1f} s CPU, {} edges\n", edge, snr,
               wall_seconds() - wall, cpu_seconds() - cpu, field->edges.size());
  }
}

// Mean offset of edges from the true wall, outward positive, on ideal partial volumes.
void bias() {
  fmt::print("mean offset (standard deviation) in voxels, outward positive\n");
  fmt::print("shape      R    peak of the mask     corrected        edges\n");
  for (const bool ball : {false, true})
    for (const double radius : {2.5, 5.0, 10.0}) {
      double sum[2] = {}, squares[2] = {};
      std::size_t count = 0;
      for (const double shift : {0.0, 0.23, 0.41}) {
        ImageGrid grid;
        const int edge = static_cast<int>(2 * radius) + 24;
        grid.size = {edge, edge, edge};
        const Vec3 centre = Vec3::Constant(edge / 2) + shift * Vec3(1, -0.6, 0.3);
        const Vec3 axis = ball ? Vec3(Vec3::Zero())
                               : Vec3(Vec3(0.3, 0.2, 1) + shift * Vec3(1, -1, 0)).normalized();
        const Image<float> filled =
            coverage(grid, {round_cone(centre - 60 * axis, radius, centre + 60 * axis, radius)});
        const auto field = find_edges(filled, {EdgeContrast{0.4}, EdgeThinning::kAcross});
        const auto raw = localise_edges(filled, *field, EdgeCorrection::kNone);
        const auto better = localise_edges(filled, *field);
        for (std::size_t i = 0; i < raw.size(); ++i) {
          const auto offset = [&](const Vec3& p) {
            const Vec3 d = p - centre;
            return (d - d.dot(axis) * axis).norm() - radius;
          };
          if (((raw[i].point_mm - centre).cwiseAbs().maxCoeff()) > edge / 2 - 6) continue;
          ++count;
          for (const int k : {0, 1}) {
            const double d = offset(k == 0 ? raw[i].point_mm : better[i].point_mm);
            sum[k] += d;
            squares[k] += d * d;
          }
        }
      }
      const auto n = static_cast<double>(count);
      fmt::print("{:8} {:4}", ball ? "sphere" : "cylinder", radius);
      for (const int k : {0, 1})
        fmt::print("   {:+.3f} ({:.3f})", sum[k] / n,
                   std::sqrt(std::max(0.0, squares[k] / n - sum[k] * sum[k] / n / n)));
      fmt::print("   {:8}\n", count);
    }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "speed";
  const int edge = argc > 2 ? std::atoi(argv[2]) : what == "large" ? 512 : 256;
  const int threads = argc > 3 ? std::atoi(argv[3]) : what == "large" ? 2 : 1;
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism,
                                  static_cast<std::size_t>(threads));
  if (what == "speed") speed(edge);
  if (what == "large") large(edge);
  if (what == "bias") bias();
  return 0;
}
