// Random trees of many bifurcations, from centerlines to a network of patches: seconds on all
// cores, memory, and the figures of the result. bench_trees BIFURCATIONS [SEED]
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <string>

#include <Eigen/Geometry>
#include <fmt/core.h>
#include <sys/resource.h>

#include "base/random.h"
#include "modeling/build/build_model.h"
#include "modeling/check/certificate.h"

namespace {

using namespace angiospline;

constexpr int kPointsPerBranch = 9;
constexpr double kLengthInRadii = 14;

// Bifurcations with daughters 50 to 90 degrees apart, in turning planes; branches lie apart in a
// caterpillar: one daughter goes on, the other ends, so that trees of any size meet themselves
// nowhere.
CenterlineTree random_tree(int bifurcations, Random& random) {
  CenterlineTree tree;
  tree.source = "random tree";
  const auto add_node = [&](const Vec3& p) {
    tree.nodes.push_back({fmt::format("n{}", tree.nodes.size()), p});
    return static_cast<int>(tree.nodes.size()) - 1;
  };
  const auto connect = [&](int from, int to, double radius) {
    CenterlineBranch branch;
    branch.name = fmt::format("b{}", tree.branches.size());
    branch.from = from;
    branch.to = to;
    const Vec3 a = tree.nodes[static_cast<std::size_t>(from)].position_mm;
    const Vec3 b = tree.nodes[static_cast<std::size_t>(to)].position_mm;
    branch.points_mm.resize(3, kPointsPerBranch);
    branch.radii_mm = Eigen::VectorXd::Constant(kPointsPerBranch, radius);
    for (int k = 0; k < kPointsPerBranch; ++k) {
      branch.points_mm.col(k) = a + k * (b - a) / (kPointsPerBranch - 1);
    }
    tree.branches.push_back(std::move(branch));
  };
  int end = add_node(Vec3::Zero());
  tree.inlets = {end};
  const Vec3 forward = Vec3::UnitX();
  double side = 1;
  for (int k = 0; k < bifurcations; ++k) {
    const double trunk = random.uniform(0.9, 1.1);
    const double turn = random.uniform(0, 6.283);
    const Vec3 across(0, std::cos(turn), std::sin(turn));
    const Vec3 bend = (forward + 0.25 * side * across).normalized();
    const int fork =
        add_node(tree.nodes[static_cast<std::size_t>(end)].position_mm + kLengthInRadii * bend);
    connect(end, fork, trunk);
    const double lean = random.uniform(45, 75) * 3.141592653589793 / 180;
    const Vec3 out = std::cos(lean) * forward + std::sin(lean) * across;
    const double radius = random.uniform(0.5, 0.9);
    const int tip = add_node(tree.nodes[static_cast<std::size_t>(fork)].position_mm +
                             kLengthInRadii * radius * out);
    connect(fork, tip, radius);
    end = fork;
    side = -side;
  }
  const int last =
      add_node(tree.nodes[static_cast<std::size_t>(end)].position_mm + kLengthInRadii * forward);
  connect(end, last, 1.0);
  return tree;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "bench_trees BIFURCATIONS [SEED]\n");
    return 2;
  }
  const int bifurcations = std::atoi(argv[1]);
  Random random(argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 1);
  const CenterlineTree tree = random_tree(bifurcations, random);
  const auto start = std::chrono::steady_clock::now();
  const auto model = build_model(tree);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (!model) {
    fmt::print(stderr, "{}\n", model.error().message());
    return 1;
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const double cpu = static_cast<double>(usage.ru_utime.tv_sec) +
                     1e-6 * static_cast<double>(usage.ru_utime.tv_usec);
  CertificateOptions options;
  options.find_self_intersections = false;
  const auto certificate = certify(model->network, options);
  fmt::print(
      "| bifurcations | patches | failed | s | CPU s | CPU ms each | peak MiB | angle, degrees |\n"
      "| {} | {} | {} | {:.2f} | {:.2f} | {:.1f} | {} | {:.2g} |\n",
      bifurcations, model->network.patches.size(), model->failed.size(), seconds, cpu,
      1000 * cpu / bifurcations, usage.ru_maxrss / 1024,
      certificate ? certificate->max_normal_angle_deg : -1.0);
}
