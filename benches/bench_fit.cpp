// How near the default fit comes to analytic truths, beside marching cubes on the same images.
// Modes:
//   table [phantom ...]   every phantom at every SNR: cylinder potato bent bifurcation tree
//   crowded               neighbours, unequal voxels, a ramp, Rician noise; SNR 8 and 4
//   starts [phantom ...]  displaced and resized starts at SNR 8 and 4
//   own                   bifurcation and tree from their own segmentation, SNR 8
//   local                 a throat, a bleb, a bulge: refinement where residuals are large
// ALL=1: every start, not only those that stay beyond the goal; REDUCE=x: FitOptions::reduction;
// FINER=n: ::refinements. SEEDS=n: noise seeds (default 3); FIRST=n: the first of them (default 1);
// SNR=x: only this one.
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "benches/fit_phantoms.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"
#include "modeling/network/tessellation.h"
#include "recovery/centerlines/vessels_from_mask.h"
#include "recovery/fit/closed_surface.h"
#include "recovery/fit/fit_model.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/mask/morphology.h"
#include "recovery/imaging/segment/segment.h"

namespace angiospline {
namespace {

double from_environment(const char* name, double otherwise) {
  const char* value = std::getenv(name);
  return value != nullptr ? std::atof(value) : otherwise;
}
std::uint64_t first_seed() { return static_cast<std::uint64_t>(from_environment("FIRST", 1)); }
int seeds() { return static_cast<int>(from_environment("SEEDS", 3)); }
bool wanted_snr(double snr) { return snr == from_environment("SNR", snr); }

struct Kind {
  const char* name;
  PhantomKind kind;
};
constexpr Kind kKinds[] = {{"cylinder", PhantomKind::kCylinder},
                           {"potato", PhantomKind::kPotato},
                           {"bent", PhantomKind::kBentVessel},
                           {"bifurcation", PhantomKind::kBifurcation},
                           {"tree", PhantomKind::kRandomTree}};

// Voxels above the middle of the grey values after smoothing: where a closed surface starts.
Mask rough_mask(const Image<float>& image) {
  const Image<float> smooth = smoothed(Image<float>(image), 1.5);
  Mask mask(image.grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    mask.voxels[i] = static_cast<double>(smooth.voxels[i]) > kBackground + kContrast / 2;
  }
  return mask;
}

Result<Model> start_of(const FitPhantom& phantom, const Image<float>& image) {
  if (!phantom.tree.branches.empty()) return build_model(phantom.tree);
  return closed_model(largest_component(rough_mask(image)));  // the others are noise
}

struct Outcome {
  Accuracy accuracy;
  double missed = 0, seconds = 0;
  int control_points = 0, numbers = 0, nodes = 0;
  double freedom = 0, wave = 0, angle_deg = 0, jacobian = 1;
  bool sound = true;
  std::string told;
};

// Coordinates of the control points and interior knots of the patches.
int numbers_of(const SurfaceNetwork& network) {
  auto count = 3 * static_cast<int>(network.control_points_mm.cols());
  for (const Patch& p : network.patches) {
    count += p.u.control_point_count() + p.v.control_point_count() - 12;
  }
  return count;
}

Result<Outcome> outcome(const FitPhantom& phantom, const Model& start, const Image<float>& image) {
  const auto before = std::chrono::steady_clock::now();
  FitOptions options;
  if (std::getenv("WAVE")) options.displacement.wave_factors = {from_environment("WAVE", 1)};
  options.reduction = from_environment("REDUCE", options.reduction);
  options.refinements = static_cast<int>(from_environment("FINER", options.refinements));
  const auto fitted = fit_model(start, image, options);
  if (!fitted) return fail(fitted.error());
  Outcome o;
  o.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
  const SurfaceNetwork& network = fitted->model.network;
  const auto mesh = tessellate(network);
  const auto certificate = certify(network);
  o.accuracy = accuracy(phantom, mesh->mesh, network.rims);
  o.missed = missed_percent(phantom, mesh->mesh);
  o.control_points = fitted->report.control_points;
  o.numbers = numbers_of(network);
  o.nodes = fitted->report.nodes;
  o.freedom = fitted->report.degrees_of_freedom;
  o.wave = fitted->report.wave_factor;
  o.angle_deg = certificate->max_normal_angle_deg;
  o.jacobian = certificate->min_jacobian_ratio;
  o.sound = certificate->closed && certificate->valid && !certificate->self_intersecting;
  for (const HeldRegion& h : fitted->report.held) o.told += "   " + h.name + ": " + h.why + "\n";
  for (const std::string& h : fitted->report.without_edge) o.told += "   " + h + ": no edge\n";
  return o;
}

void table(const std::vector<std::string>& only) {
  std::printf(
      "mean distance to the truth in voxels (marching cubes at its best threshold); missed: "
      "percent "
      "of the truth's voxels\n"
      "phantom     SNR    ours    p95    bias missed | cubes   at | ours/cubes | points numbers "
      "nodes "
      "cubes' ratio stl | G1 deg    J   s\n");
  for (const Kind& kind : kKinds) {
    if (!only.empty() && std::find(only.begin(), only.end(), kind.name) == only.end()) continue;
    const FitPhantom phantom = fit_phantom(kind.kind);
    for (const double snr : {0.0, 8.0, 4.0, 2.0, 1.0}) {
      if (!wanted_snr(snr)) continue;
      const int repeats = snr > 0 ? seeds() : 1;
      Outcome sum;
      double cubes = 0, cube_numbers = 0, stl = 0, threshold = 0;
      int done = 0;
      for (int k = 0; k < repeats; ++k) {
        const Image<float> image =
            with_noise(phantom, snr, first_seed() + static_cast<std::uint64_t>(k));
        const auto start = start_of(phantom, image);
        if (!start) {
          std::printf("%s\n", start.error().message().c_str());
          continue;
        }
        const auto o = outcome(phantom, *start, image);
        if (!o) {
          std::printf("%s\n", o.error().message().c_str());
          continue;
        }
        const MarchingCubes peer = marching_cubes(phantom, image);
        sum.accuracy.mean_vox += o->accuracy.mean_vox;
        sum.accuracy.p95_vox += o->accuracy.p95_vox;
        sum.accuracy.bias_vox += o->accuracy.bias_vox;
        sum.missed += o->missed;
        sum.seconds += o->seconds;
        sum.control_points += o->control_points;
        sum.numbers += o->numbers;
        sum.nodes += o->nodes;
        sum.angle_deg = std::max(sum.angle_deg, o->angle_deg);
        sum.jacobian = std::min(sum.jacobian, o->jacobian);
        sum.sound = sum.sound && o->sound;
        sum.told += o->told;
        sum.wave = o->wave;
        sum.freedom = o->freedom;
        cubes += peer.accuracy.mean_vox;
        threshold += peer.threshold;
        cube_numbers += 3.0 * static_cast<double>(peer.points + peer.triangles);
        stl += 12.0 * static_cast<double>(peer.triangles);
        ++done;
      }
      if (done == 0) continue;
      std::printf(
          "%-11s %3.0f  %.4f %.4f %+.4f %5.2f | %.4f %.2f | %.2f | %d %d %d %.0f %.0f %.0f | %.1g "
          "%.2f %.2f%s wave %.1f dof %.0f\n",
          kind.name, snr, sum.accuracy.mean_vox / done, sum.accuracy.p95_vox / done,
          sum.accuracy.bias_vox / done, sum.missed / done, cubes / done, threshold / done,
          sum.accuracy.mean_vox / cubes, sum.control_points / done, sum.numbers / done,
          sum.nodes / done, cube_numbers / done, cube_numbers / sum.numbers, stl / sum.numbers,
          sum.angle_deg, sum.jacobian, sum.seconds / done, sum.sound ? "" : " UNSOUND", sum.wave,
          sum.freedom);
      std::printf("%s", sum.told.c_str());
      std::fflush(stdout);
    }
  }
}

// The mean over seeds of the mean distance, and soundness.
double mean_of(const FitPhantom& phantom, const std::function<Image<float>(std::uint64_t)>& image) {
  double sum = 0;
  for (int k = 0; k < seeds(); ++k) {
    const Image<float> noisy = image(first_seed() + static_cast<std::uint64_t>(k));
    const auto start = start_of(phantom, noisy);
    const auto o = start ? outcome(phantom, *start, noisy) : Result<Outcome>(fail(start.error()));
    if (!o) {
      std::printf("%s\n", o.error().message().c_str());
      return -1;
    }
    sum += o->accuracy.mean_vox / seeds();
  }
  return sum;
}

void crowded() {
  std::printf(
      "mean distance in voxels (of the voxel's volume); in brackets over the isolated one\n");
  const FitPhantom alone = fit_phantom(PhantomKind::kBentVessel);
  const FitPhantom pair = bent_pair();
  const FitPhantom tall = fit_phantom(PhantomKind::kBentVessel, Vec3(1, 1, 2));
  const FitPhantom wide = fit_phantom(PhantomKind::kCylinder);
  const FitPhantom tall_wide = fit_phantom(PhantomKind::kCylinder, Vec3(1, 1, 2));
  for (const double snr : {8.0, 4.0}) {
    if (!wanted_snr(snr)) continue;
    for (const auto& [name, base, unequal] :
         {std::tuple{"bent", &alone, &tall}, std::tuple{"cylinder", &wide, &tall_wide}}) {
      const auto noisy = [snr](const FitPhantom& p) {
        return [&p, snr](std::uint64_t s) { return with_noise(p, snr, s); };
      };
      const double isolated = mean_of(*base, noisy(*base));
      std::printf("%-8s SNR %.0f  isolated %.4f", name, snr, isolated);
      const auto row = [&](const char* what, double mean) {
        std::printf("  %s %.4f (%.2f)", what, mean, mean / isolated);
        std::fflush(stdout);
      };
      if (base == &alone) row("neighbour", mean_of(pair, noisy(pair)));
      row("1:1:2", mean_of(*unequal, noisy(*unequal)));
      row("ramp", mean_of(*base, [&, p = base](std::uint64_t s) { return with_ramp(*p, snr, s); }));
      row("Rician",
          mean_of(*base, [&, p = base](std::uint64_t s) { return with_rician_noise(*p, snr, s); }));
      std::printf("\n");
    }
  }
}

// The tree moved sideways and resized.
CenterlineTree displaced(CenterlineTree tree, const Vec3& by, double factor) {
  for (CenterlineNode& n : tree.nodes) n.position_mm += by;
  for (CenterlineBranch& b : tree.branches) {
    b.points_mm.colwise() += by;
    b.radii_mm *= factor;
  }
  return tree;
}

void starts(const std::vector<std::string>& only) {
  std::printf("mean distance in voxels from starts displaced and resized\n");
  for (const Kind& kind : kKinds) {
    if (kind.kind == PhantomKind::kPotato || kind.kind == PhantomKind::kRandomTree) continue;
    if (!only.empty() && std::find(only.begin(), only.end(), kind.name) == only.end()) continue;
    const FitPhantom phantom = fit_phantom(kind.kind);
    for (const double snr : {8.0, 4.0}) {
      if (!wanted_snr(snr)) continue;
      const Image<float> image = with_noise(phantom, snr, first_seed());
      double worst = 0, sum = 0;
      int count = 0, failed = 0;
      for (const double size : {0.0, 1.5, 3.0}) {
        for (const Vec3& way : {Vec3(1, 0, 0), Vec3(-0.6, 0.8, 0), Vec3(0, -1, 0)}) {
          if (size == 0 && way.x() != 1) continue;
          for (const double factor : {0.5, 1.0, 1.5}) {
            const auto start = build_model(displaced(phantom.tree, size * way, factor));
            const auto o =
                start ? outcome(phantom, *start, image) : Result<Outcome>(fail(start.error()));
            const std::string what =
                fmt::format("{} by {:.1f} along ({:.1f}, {:.1f}, {:.1f}), radius x {:.1f}",
                            kind.name, size, way.x(), way.y(), way.z(), factor);
            ++count;
            if (!o) {
              std::printf("   %s: %s\n", what.c_str(), o.error().message().c_str());
              ++failed;
              continue;
            }
            worst = std::max(worst, o->accuracy.mean_vox);
            sum += o->accuracy.mean_vox;
            if (o->accuracy.mean_vox > (snr > 4 ? 0.1 : 0.15) || !o->sound || std::getenv("ALL")) {
              std::printf(
                  "   %s: %.3f (p95 %.3f, bias %+.3f, wave %.1f, %.0f free, %d points)%s\n%s",
                  what.c_str(), o->accuracy.mean_vox, o->accuracy.p95_vox, o->accuracy.bias_vox,
                  o->wave, o->freedom, o->control_points, o->sound ? "" : " UNSOUND",
                  o->told.c_str());
            }
          }
        }
      }
      std::printf("%-11s SNR %.0f: %d starts, %d failed, mean %.4f, worst %.4f\n", kind.name, snr,
                  count, failed, sum / std::max(1, count - failed), worst);
      std::fflush(stdout);
    }
  }
}

void own() {
  std::printf("from their own segmentation at SNR 8, mean distance in voxels\n");
  for (const Kind& kind : kKinds) {
    if (kind.kind != PhantomKind::kBifurcation && kind.kind != PhantomKind::kRandomTree) continue;
    const FitPhantom phantom = fit_phantom(kind.kind);
    for (int k = 0; k < seeds(); ++k) {
      const Image<float> image =
          with_noise(phantom, 8, first_seed() + static_cast<std::uint64_t>(k));
      const auto segmented = segment(AnyImage(image));
      if (!segmented) {
        std::printf("%s\n", segmented.error().message().c_str());
        continue;
      }
      const auto vessels = vessels_from_mask(segmented->mask);
      const auto start = vessels ? build_model(vessels->tree) : Result<Model>(fail(vessels.error()));
      if (!start) {
        std::printf("%s\n", start.error().message().c_str());
        continue;
      }
      const auto o = outcome(phantom, *start, image);
      if (!o) {
        std::printf("%s\n", o.error().message().c_str());
        continue;
      }
      const auto mesh = tessellate(start->network);
      std::printf(
          "%-11s seed %d: %d branches, seeded %.4f -> %.4f (p95 %.4f, bias %+.4f), G1 %.1g deg, J "
          "%.2f, %.1f s%s\n%s",
          kind.name, k, static_cast<int>(vessels->tree.branches.size()),
          accuracy(phantom, mesh->mesh, start->network.rims).mean_vox, o->accuracy.mean_vox,
          o->accuracy.p95_vox, o->accuracy.bias_vox, o->angle_deg, o->jacobian, o->seconds,
          o->sound ? "" : " UNSOUND", o->told.c_str());
      std::fflush(stdout);
    }
  }
}

// Small features: with and without refinement where residuals are large.
void local() {
  std::printf("mean (95 %%) distance in voxels near a small feature and elsewhere, three seeds\n");
  for (const auto& [name, kind] :
       {std::pair{"throat", LocalKind::kThroat}, std::pair{"bleb", LocalKind::kBleb},
        std::pair{"bulge", LocalKind::kBulge}}) {
    const LocalPhantom local = local_phantom(kind);
    const FitPhantom& phantom = local.phantom;
    for (const double snr : {8.0, 4.0, 2.0}) {
      if (!wanted_snr(snr)) continue;
      std::printf("%-7s SNR %.0f", name, snr);
      for (const int times : {0, 3}) {
        double near = 0, near95 = 0, far = 0, seconds = 0;
        int points = 0;
        bool sound = true;
        std::string refined;
        for (int k = 0; k < seeds(); ++k) {
          const Image<float> image =
              with_noise(phantom, snr, first_seed() + static_cast<std::uint64_t>(k));
          const auto start = start_of(phantom, image);
          FitOptions options;
          options.refinements = times;
          const auto before = std::chrono::steady_clock::now();
          const auto fitted =
              start ? fit_model(*start, image, options) : Result<FittedModel>(fail(start.error()));
          if (!fitted) {
            std::printf("  %s", fitted.error().message().c_str());
            continue;
          }
          seconds +=
              std::chrono::duration<double>(std::chrono::steady_clock::now() - before).count();
          const auto mesh = tessellate(fitted->model.network);
          const auto& rims = fitted->model.network.rims;
          const Accuracy there = accuracy(phantom, mesh->mesh, rims, local.there);
          near += there.mean_vox / seeds();
          near95 += there.p95_vox / seeds();
          far += accuracy(phantom, mesh->mesh, rims, [&](const Vec3& p) { return !local.there(p); })
                     .mean_vox /
                 seeds();
          points += fitted->report.control_points / seeds();
          const auto certificate = certify(fitted->model.network);
          sound = sound && certificate->closed && certificate->valid &&
                  !certificate->self_intersecting && certificate->max_normal_angle_deg < 0.01;
          for (const std::string& r : fitted->report.refined) refined = " refined " + r;
          for (const HeldRegion& h : fitted->report.held) refined += " held " + h.name;
        }
        std::printf(" | %d times: near %.3f (%.3f) elsewhere %.3f, %d points, %.1f s%s%s", times,
                    near, near95, far, points, seconds / seeds(), refined.c_str(),
                    sound ? "" : " UNSOUND");
        std::fflush(stdout);
      }
      std::printf("\n");
    }
  }
}

}  // namespace
}  // namespace angiospline

int main(int argc, char** argv) {
  const std::string mode = argc > 1 ? argv[1] : "";
  const std::vector<std::string> only(argv + std::min(argc, 2), argv + argc);
  if (mode.empty() || mode == "table") angiospline::table(only);
  if (mode.empty() || mode == "crowded") angiospline::crowded();
  if (mode.empty() || mode == "starts") angiospline::starts(only);
  if (mode.empty() || mode == "own") angiospline::own();
  if (mode.empty() || mode == "local") angiospline::local();
}
