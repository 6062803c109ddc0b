// Laws on B-spline surfaces that other programs wrote (the .g2 text files of real data).
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include <gtest/gtest.h>

#include "kernel/evaluate/rational.h"
#include "kernel/reduce/reduce.h"
#include "kernel/refine/control_mesh.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"
#include "kernel/refine/split.h"
#include "kernel/spline/evaluator.h"
#include "tests/shapes/random_splines.h"

namespace angiospline {
namespace {

KnotVector read_knots(std::istream& in) {
  int count = 0;
  int order = 0;
  in >> count >> order;
  std::vector<double> knots(static_cast<std::size_t>(count + order));
  for (double& t : knots) in >> t;
  return *KnotVector::make(order - 1, knots);
}

// Every surface (class 200) of a file, homogeneous; i runs fastest in the file.
std::vector<BSplineSurface<4>> read_surfaces(const std::filesystem::path& file) {
  std::vector<BSplineSurface<4>> surfaces;
  std::ifstream in(file);
  std::string line;
  while (std::getline(in, line)) {
    std::istringstream header(line);
    int kind = 0;
    int major = 0;
    if (!(header >> kind >> major) || kind != 200 || major != 1) continue;
    int dimension = 0;
    int rational = 0;
    in >> dimension >> rational;
    if (dimension != 3) continue;
    const KnotVector u = read_knots(in);
    const KnotVector v = read_knots(in);
    const int m = u.control_point_count();
    const int n = v.control_point_count();
    Eigen::Matrix4Xd net = Eigen::Matrix4Xd::Ones(4, static_cast<Eigen::Index>(m) * n);
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < m; ++i) {
        for (int c = 0; c < 3 + rational; ++c) in >> net(c, static_cast<Eigen::Index>(i) * n + j);
      }
    }
    if (in) surfaces.emplace_back(u, v, net);
  }
  return surfaces;
}

std::vector<BSplineSurface<4>> all_surfaces(const std::string& folder) {
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/cad/gotools")) {
    if (entry.path().extension() == ".g2") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::vector<BSplineSurface<4>> surfaces;
  for (const auto& file : files) {
    for (BSplineSurface<4>& s : read_surfaces(file)) surfaces.push_back(std::move(s));
  }
  return surfaces;
}

TEST(real_data_Surfaces, KeepTheLawsOfTheKernel) {
  const char* folder = std::getenv("ANGIOSPLINE_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  const auto surfaces = all_surfaces(folder);
  ASSERT_GE(surfaces.size(), 3u);
  Random random(1);
  for (const BSplineSurface<4>& s : surfaces) {
    const double size =
        (s.control_points().rowwise().maxCoeff() - s.control_points().rowwise().minCoeff()).norm();
    const SurfaceEvaluator<4> evaluator(s);
    const BSplineSurface<4> fine = refine(s, *with_knots(s.u(), random_new_knots(random, s.u(), 7)),
                                          *with_knots(s.v(), random_new_knots(random, s.v(), 7)));
    const BSplineSurface<4> raised = elevate(s, 1, 2);
    for (int k = 0; k < 50; ++k) {
      const double u = random_parameter(random, s.u());
      const double v = random_parameter(random, s.v());
      const Eigen::Vector4d at = s.at(u, v);
      EXPECT_LT((evaluator.point(u, v) - at).norm(), 1e-13 * size);
      EXPECT_LT((fine.at(u, v) - at).norm(), 1e-13 * size);
      EXPECT_LT((raised.at(u, v) - at).norm(), 1e-13 * size);
    }
    SurfaceReductionOptions options;
    options.tolerance = 1e-3 * size;
    const auto reduced = reduce(fine, options);
    ASSERT_TRUE(reduced) << reduced.error().message();
    EXPECT_LE(reduced->surface.control_points().cols(), s.control_points().cols());
    for (int k = 0; k < 200; ++k) {
      const double u = random_parameter(random, s.u());
      const double v = random_parameter(random, s.v());
      EXPECT_LE((reduced->surface.at(u, v) - s.at(u, v)).norm(),
                reduced->error_bound + 1e-12 * size);
    }
  }
  RecordProperty("surfaces", static_cast<int>(surfaces.size()));
}

TEST(real_data_Surfaces, TheRationalCylinderHasItsRadiusEverywhere) {
  const char* folder = std::getenv("ANGIOSPLINE_DATA");
  if (folder == nullptr) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  const auto surfaces = read_surfaces(std::string(folder) + "/cad/gotools/cylinder_sf.g2");
  ASSERT_FALSE(surfaces.empty());
  const BSplineSurface<4>& s = surfaces.front();
  Random random(2);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Matrix3Xd at = rational_derivatives<3>(s, random_parameter(random, s.u()),
                                                        random_parameter(random, s.v()), 0);
    EXPECT_NEAR(at.col(0).head<2>().norm(), 1.5, 1e-12);
  }
}

}  // namespace
}  // namespace angiospline
