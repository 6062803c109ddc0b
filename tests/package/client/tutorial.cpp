#include <cstdio>

#include <angiospline/io/export/export_model.h>
#include <angiospline/modeling/build/build_model.h>
#include <angiospline/modeling/check/certificate.h>

namespace {

// A branch through the given points, with a radius at each.
angiospline::CenterlineBranch branch(const char* name, int from, int to,
                                     const angiospline::Points3& points_mm,
                                     const Eigen::VectorXd& radii_mm) {
  return {.name = name, .from = from, .to = to, .points_mm = points_mm, .radii_mm = radii_mm};
}

}  // namespace

int main() {
  angiospline::CenterlineTree tree;
  tree.nodes = {
      {"heart", {0, 0, 0}}, {"fork", {0, 0, 20}}, {"left", {-9, 1, 36}}, {"right", {9, -1, 34}}};
  tree.branches = {branch("trunk", 0, 1, Eigen::Matrix3d{{0, 0, 0}, {0, 1, 0}, {0, 10, 20}},
                          Eigen::Vector3d(3.0, 2.9, 2.8)),
                   branch("to_left", 1, 2, Eigen::Matrix3d{{0, -4, -9}, {0, 0, 1}, {20, 28, 36}},
                          Eigen::Vector3d(2.2, 2.2, 2.0)),
                   branch("to_right", 1, 3, Eigen::Matrix3d{{0, 4, 9}, {0, 0, -1}, {20, 27, 34}},
                          Eigen::Vector3d(2.0, 2.0, 1.8))};
  tree.inlets = {0};

  const auto model = angiospline::build_model(tree);
  if (!model) return std::puts(model.error().message().c_str()), 1;

  const auto certificate = angiospline::certify(model->network);
  if (!certificate) return std::puts(certificate.error().message().c_str()), 1;
  std::printf("volume %.0f mm3, largest normal angle below 1e-6 degrees: %s\n",
              certificate->volume_mm3, certificate->max_normal_angle_deg < 1e-6 ? "yes" : "no");

  const auto written = angiospline::export_model(*model, {"fork.step", "fork.glb"});
  return written ? 0 : 1;
}
