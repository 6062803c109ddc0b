// How near the default fit comes to analytic truths, and how long it takes.
//   bench_fit [phantom ...]      cylinder, bent, bifurcation, tree; all without arguments
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <numbers>
#include <string>
#include <vector>

#include "modeling/certificate.h"
#include "modeling/seed_model.h"
#include "modeling/tessellation.h"
#include "recovery/fit_model.h"
#include "recovery/phantom.h"
#include "recovery/rasterize.h"

namespace angiospline {
namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

// Distance to the union of the tree's round cones, negative inside.
double distance_to(const CenterlineTree& tree, const Vec3& p) {
  double least = 1e300;
  for (const CenterlineBranch& b : tree.branches) {
    for (Eigen::Index k = 0; k + 1 < b.points_mm.cols(); ++k) {
      const Vec3 a = b.points_mm.col(k), d = b.points_mm.col(k + 1) - a;
      const double t = std::clamp(d.dot(p - a) / d.squaredNorm(), 0.0, 1.0);
      const double r = (1 - t) * b.radii_mm(k) + t * b.radii_mm(k + 1);
      least = std::min(least, (p - a - t * d).norm() - r);
    }
  }
  return least;
}

struct Accuracy {
  double mean = 0, p95 = 0, bias = 0, missed_percent = 0;
};

Accuracy accuracy_of(const SurfaceNetwork& network, const CenterlineTree& truth, double margin) {
  const auto mesh = tessellate(network);
  std::vector<std::pair<double, double>> distances;
  double area = 0, sum = 0, bias = 0;
  for (Eigen::Index t = 0; t < mesh->mesh.triangles.cols(); ++t) {
    if (!is_wall(
            mesh->mesh
                .parts[static_cast<std::size_t>(mesh->mesh.part_of[static_cast<std::size_t>(t)])]
                .kind))
      continue;
    const Eigen::Vector3i c = mesh->mesh.triangles.col(t);
    const Vec3 a = mesh->mesh.points_mm.col(c(0)), b = mesh->mesh.points_mm.col(c(1)),
               d = mesh->mesh.points_mm.col(c(2));
    const Vec3 middle = (a + b + d) / 3;
    bool near_end = false;
    for (const Rim& rim : network.rims) {
      near_end = near_end || std::abs((middle - rim.center_mm).dot(rim.normal)) < margin;
    }
    const double weight = (b - a).cross(d - a).norm() / 2;
    if (near_end) continue;
    double distance = 0;
    for (const Vec3& p : {a, b, d}) distance += distance_to(truth, p) / 3;
    distances.emplace_back(std::abs(distance), weight);
    sum += weight * std::abs(distance);
    bias += weight * distance;
    area += weight;
  }
  std::sort(distances.begin(), distances.end());
  double seen = 0, p95 = 0;
  for (const auto& [distance, weight] : distances) {
    seen += weight;
    p95 = distance;
    if (seen >= 0.95 * area) break;
  }
  return {sum / area, p95, bias / area, 0};
}

Image<float> as_float(const Image<std::int16_t>& image) {
  Image<float> f(image.grid);
  for (std::size_t i = 0; i < f.voxels.size(); ++i) f.voxels[i] = image.voxels[i];
  return f;
}

void run(const std::string& name, PhantomKind kind, int seeds) {
  for (const double snr : {0.0, 8.0, 4.0, 2.0, 1.0}) {
    if (const char* only = std::getenv("SNR"); only != nullptr && std::atof(only) != snr) continue;
    double mean = 0, bias = 0, p95 = 0, seconds = 0, before = 0, worst_angle = 0,
           least_jacobian = 1;
    int count = 0, held = 0, unsound = 0;
    FitReport report;
    std::string told;
    for (int seed_number = 1; seed_number <= (snr > 0 ? seeds : 1); ++seed_number) {
      PhantomOptions options;
      if (snr > 0) options.snr = snr;
      options.seed = kind == PhantomKind::kRandomTree ? 3 : static_cast<std::uint64_t>(seed_number);
      if (kind == PhantomKind::kRandomTree) {
        options.ends = 10;
        options.field_mm = 128;
      }
      const auto phantom = make_phantom(kind, options);
      if (!phantom) {
        std::printf("%s\n", phantom.error().message().c_str());
        return;
      }
      const auto seed = seed_model(phantom->tree);
      const Image<float> image = as_float(phantom->image);
      FitOptions fit;
      if (const char* r = std::getenv("ROUNDS")) fit.rounds = std::atoi(r);
      if (const char* r = std::getenv("WAVE")) fit.displacement.wave_factors = {std::atof(r)};
      const auto start = std::chrono::steady_clock::now();
      const auto fitted = fit_model(*seed, image, fit);
      seconds += seconds_since(start);
      if (!fitted) {
        std::printf("%s\n", fitted.error().message().c_str());
        continue;
      }
      before += accuracy_of(seed->network, phantom->tree, 2).mean;
      const Accuracy after = accuracy_of(fitted->model.network, phantom->tree, 2);
      mean += after.mean;
      bias += after.bias;
      p95 += after.p95;
      ++count;
      const auto certificate = certify(fitted->model.network);
      worst_angle = std::max(worst_angle, certificate->max_normal_angle_deg);
      least_jacobian = std::min(least_jacobian, certificate->min_jacobian_ratio);
      unsound += !certificate->closed || !certificate->valid || certificate->self_intersecting;
      report = fitted->report;
      held += static_cast<int>(report.held.size());
      for (const HeldRegion& h : report.held) told += "   " + h.name + ": " + h.why + "\n";
      for (const std::string& h : report.without_edge) told += "   " + h + ": no edge\n";
    }
    if (count == 0) continue;
    std::printf(
        "%-11s SNR %3.1f (%.2f): seed %.4f -> mean %.4f p95 %.4f bias %+.4f G1 %.1g deg J %.2f "
        "unsound %d held %d nodes %d cps %d wave %.1f dof %.0f contrast %.0f  %.2f s\n",
        name.c_str(), snr, report.snr, before / count, mean / count, p95 / count, bias / count,
        worst_angle, least_jacobian, unsound, held, report.nodes, report.control_points,
        report.wave_factor, report.degrees_of_freedom, report.contrast, seconds / count);
    std::printf("%s", told.c_str());
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace angiospline

int main(int argc, char** argv) {
  using namespace angiospline;
  const auto wanted = [&](const char* name) {
    if (argc == 1) return true;
    for (int k = 1; k < argc; ++k) {
      if (std::strcmp(argv[k], name) == 0) return true;
    }
    return false;
  };
  const char* repeats = std::getenv("SEEDS");
  const int seeds = repeats != nullptr ? std::atoi(repeats) : 4;
  if (wanted("cylinder")) run("cylinder", PhantomKind::kCylinder, seeds);
  if (wanted("bent")) run("bent", PhantomKind::kBentVessel, seeds);
  if (wanted("bifurcation")) run("bifurcation", PhantomKind::kBifurcation, seeds);
  if (wanted("tree")) run("tree", PhantomKind::kRandomTree, seeds);
}
