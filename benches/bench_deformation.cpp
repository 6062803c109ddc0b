// Deformation: the 12 surfaces of a bifurcation by the factorised solver beside the thesis's
// pseudo-inverse, and the cost of an iteration on ever larger meshes.
//   bench_deformation bifurcation        388 nodes or nearly; preparation and iterations apart
//   bench_deformation linear [most 1000000]
//   SNR=8 bench_deformation models        whole models by edges, their distance from the truth
// CPU seconds of one thread.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/SVD>
#include <fmt/format.h>
#include <tbb/global_control.h>

#include "benches/fit_phantoms.h"
#include "modeling/build/build_model.h"
#include "modeling/network/tessellation.h"
#include "recovery/phantoms/phantom.h"
#include "recovery/thesis/deform/deform_model.h"
#include "recovery/thesis/deform/solver.h"

namespace {

using namespace angiospline;

double cpu_seconds() {
  std::timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

// Seconds of `work`, and what it returned.
template <typename Work>
auto timed(double& seconds, Work&& work) {
  const double start = cpu_seconds();
  auto result = work();
  seconds = cpu_seconds() - start;
  return result;
}

void bifurcation() {
  const auto phantom = make_phantom(PhantomKind::kBifurcation);
  const auto model = build_model(phantom->tree);
  NetworkMeshOptions fineness;
  fineness.least_pieces = 2;
  DeformMesh mesh = control_mesh(refine_network(model->network, fineness)->network);
  mesh.nodes_mm.colwise() += Vec3(1, 0.6, 0);
  const auto edges_by = [&](EdgeThinning thinning) {
    return edge_points(*find_edges(phantom->image, {EdgePercentile{97}, thinning}),
                       phantom->image.grid);
  };
  fmt::print("{} patches, {} nodes\n", model->network.patches.size(), mesh.node_count());

  // The thesis inverts the assembled matrix of all coordinates; here they share one n x n.
  double seconds = 0;
  const ElementSystem system(mesh, 1, {});
  timed(seconds, [&] { return divide_by_svd(system.laplacian()); });
  fmt::print("pseudo-inverse, n x n          {:8.3f} s\n", seconds);
  const Eigen::Index n = 3 * mesh.node_count();
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(n, n);
  const Eigen::MatrixXd one(system.laplacian());
  for (Eigen::Index i = 0; i < one.rows(); ++i)
    for (Eigen::Index j = 0; j < one.cols(); ++j)
      for (int k = 0; k < 3; ++k) all(3 * i + k, 3 * j + k) = one(i, j);
  timed(seconds, [&] {
    return Eigen::BDCSVD<Eigen::MatrixXd>(all, Eigen::ComputeThinU | Eigen::ComputeThinV)
        .singularValues()
        .eval();
  });
  fmt::print("pseudo-inverse, 3n x 3n        {:8.3f} s\n", seconds);
  for (const EdgeThinning thinning : {EdgeThinning::kNone, EdgeThinning::kAcross}) {
    const EdgePoints edges = edges_by(thinning);
    for (const DeformMethod method : {DeformMethod::kSparse, DeformMethod::kEulerSvd}) {
      DeformOptions options =
          method == DeformMethod::kSparse ? DeformOptions{} : thesis_options(method);
      if (method == DeformMethod::kEulerSvd) options.time_step = 0.005;
      const auto fit = timed(seconds, [&] { return deform(mesh, edges, 1, options); });
      fmt::print("{:10} on {:6} edges       {:8.3f} s, {} iterations, {}\n", to_string(method),
                 edges.count(), seconds, fit->report.iterations,
                 to_string(fit->report.termination));
    }
  }
}

// A tube of `count` nodes and a shell of edges about two voxels from it, one an element.
void linear(double most) {
  fmt::print("{:>8} | {:^43} | {:^43}\n", "", "sparse", "runge-kutta-1");
  fmt::print("{:>8}", "nodes");
  for (int method = 0; method < 2; ++method)
    fmt::print(" | {:>9} {:>11} {:>9} {:>11}", "set-up s", "first it. s", "it. ms", "us per node");
  fmt::print("\n");
  for (double count = 1000; count <= most * 1.01; count *= 10) {
    const int columns = static_cast<int>(std::sqrt(count / 4)), rows = 4 * columns;
    const double radius = columns / (2 * std::numbers::pi);
    DeformMesh mesh;
    mesh.nodes_mm.resize(3, static_cast<Eigen::Index>(rows) * columns);
    mesh.springs.resize(2, static_cast<Eigen::Index>(2 * rows - 1) * columns);
    EdgePoints edges;
    edges.at_mm.resize(3, mesh.nodes_mm.cols());
    edges.normals.resize(3, mesh.nodes_mm.cols());
    edges.strength = Eigen::VectorXd::Ones(mesh.nodes_mm.cols());
    const auto node = [&](int r, int c) { return r * columns + (c + columns) % columns; };
    Eigen::Index spring = 0;
    for (int r = 0; r < rows; ++r)
      for (int c = 0; c < columns; ++c) {
        const double a = 2 * std::numbers::pi * c / columns;
        const Vec3 out(std::cos(a), std::sin(a), 0);
        const int k = node(r, c);
        mesh.nodes_mm.col(k) = radius * out + Vec3(0, 0, r);
        edges.at_mm.col(k) = (radius + 2 + 0.3 * std::sin(7 * a)) * out + Vec3(0, 0, r + 0.2);
        edges.normals.col(k) = -out;
        const int side = node(r, c + 1);
        mesh.springs.col(spring++) << std::min(k, side), std::max(k, side);
        if (r + 1 == rows) continue;
        mesh.springs.col(spring++) << k, node(r + 1, c);
        mesh.faces.push_back({k, side, node(r + 1, c + 1), node(r + 1, c)});
      }
    fmt::print("{:8}", mesh.node_count());
    for (const DeformMethod method : {DeformMethod::kSparse, DeformMethod::kRungeKutta1}) {
      DeformOptions options =
          method == DeformMethod::kSparse ? DeformOptions{} : thesis_options(method);
      options.rest_speed = 1e-12;
      options.most_iterations = 8;
      // Whether to stop is asked before each iteration.
      std::vector<double> starts;
      Progress clock;
      clock.stop_requested = [&] { return starts.push_back(cpu_seconds()), false; };
      const double start = cpu_seconds();
      if (!deform(mesh, edges, 1, options, clock)) return;
      // The first iteration looks up every nearest node. Of the others the median.
      std::vector<double> steps;
      for (std::size_t k = 1; k + 1 < starts.size(); ++k)
        steps.push_back(starts[k + 1] - starts[k]);
      std::sort(steps.begin(), steps.end());
      const double iteration = steps[steps.size() / 2];
      fmt::print(" | {:9.3f} {:11.3f} {:9.2f} {:11.3f}", starts[0] - start, starts[1] - starts[0],
                 1e3 * iteration, 1e6 * iteration / mesh.node_count());
    }
    fmt::print("\n");
    std::fflush(stdout);
  }
}

// Whole models by edges, from their true centerlines and from a start beside them.
void whole_models() {
  const double snr = std::getenv("SNR") != nullptr ? std::atof(std::getenv("SNR")) : 8;
  fmt::print("SNR {}; without what lies within two voxels of open ends\n", snr);
  fmt::print("{:14} {:>6} {:>10} {:>10} {:>10} {:>10} {:>8} {:>6}\n", "phantom", "start",
             "mean vox", "p95 vox", "bias vox", "missed %", "edges", "its");
  constexpr std::pair<PhantomKind, const char*> kPhantoms[] = {
      {PhantomKind::kCylinder, "cylinder"},
      {PhantomKind::kBentVessel, "bent vessel"},
      {PhantomKind::kBifurcation, "bifurcation"}};
  for (const auto& [kind, name] : kPhantoms) {
    const FitPhantom phantom = fit_phantom(kind);
    const Image<float> image = with_noise(phantom, snr, 1);
    for (const double off : {0.0, 1.0}) {
      CenterlineTree tree = phantom.tree;
      const Vec3 shift = off * phantom.voxel_mm * Vec3(0.8, 0.6, 0);
      for (CenterlineNode& n : tree.nodes) n.position_mm += shift;
      for (CenterlineBranch& b : tree.branches) {
        b.points_mm.colwise() += shift;
        b.radii_mm *= 1 + 0.1 * off;
      }
      const auto model = build_model(tree);
      if (!model) continue;
      const auto result = deform_model(*model, image);
      if (!result) {
        fmt::print("{}: {}\n", name, result.error().message());
        continue;
      }
      const auto mesh = tessellate(result->model.network);
      const Accuracy a = accuracy(phantom, mesh->mesh, result->model.network.rims);
      fmt::print("{:14} {:>6} {:10.3f} {:10.3f} {:10.3f} {:10.2f} {:8} {:6}\n", name,
                 off == 0 ? "true" : "beside", a.mean_vox, a.p95_vox, a.bias_vox,
                 missed_percent(phantom, mesh->mesh), result->edges, result->report.iterations);
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "bifurcation";
  const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, 1);
  if (what == "bifurcation") bifurcation();
  if (what == "models") whole_models();
  if (what == "linear") linear(argc > 2 ? std::atof(argv[2]) : 1e6);
  return 0;
}
