// Independent oracles: scipy's BSpline (through /usr/bin/python3) and SISL where the build found
// it. Each says whether it ran; OpenCASCADE is compared in tests/modeling.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include <gtest/gtest.h>
#include <unistd.h>

#include "kernel/evaluate/grid.h"
#include "kernel/refine/refinement.h"
#include "tests/shapes/random_splines.h"

#ifdef ANGIOSPLINE_HAS_SISL
#include <sisl.h>
#endif

namespace angiospline {
namespace {

// Standard output of a command, or nothing if it failed.
std::string output_of(const std::string& command) {
  std::string text;
  FILE* pipe = popen((command + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return {};
  char buffer[4096];
  while (std::fgets(buffer, sizeof buffer, pipe) != nullptr) text += buffer;
  return pclose(pipe) == 0 ? text : std::string();
}

TEST(Oracle, ScipyEvaluatesTheSameValuesAndDerivatives) {
  if (output_of("/usr/bin/python3 -c 'import scipy.interpolate; print(1)'").empty()) {
    GTEST_SKIP() << "scipy did not run: /usr/bin/python3 with python3-scipy is not there";
  }
  Random random(1);
  std::ostringstream script;
  script.precision(17);
  script << "from scipy.interpolate import BSpline\n";
  std::vector<double> wanted;
  for (int round = 0; round < 40; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(6));
    const BSplineCurve<1> curve = random_curve<1>(random, knots);
    const double t = random.uniform(knots.first(), knots.last());
    script << "s = BSpline([";
    for (const double k : knots.knots()) script << k << ",";
    script << "], [";
    for (Eigen::Index i = 0; i < curve.control_points().cols(); ++i) {
      script << curve.control_points()(0, i) << ",";
    }
    script << "], " << knots.degree() << ")\n";
    for (int d = 0; d <= 2; ++d) {
      script << "print(repr(float(s(" << t << ", nu=" << d << "))))\n";
      wanted.push_back(curve.at(t, d)(0));
    }
  }
  const std::filesystem::path file =
      std::filesystem::temp_directory_path() / ("angiospline_oracle_" + std::to_string(getpid()));
  std::ofstream(file) << script.str();
  std::istringstream answers(output_of("/usr/bin/python3 " + file.string()));
  std::filesystem::remove(file);
  for (std::size_t k = 0; k < wanted.size(); ++k) {
    double answer = std::numeric_limits<double>::quiet_NaN();
    ASSERT_TRUE(answers >> answer) << "answer " << k;
    EXPECT_NEAR(answer, wanted[k], 1e-10 * (1 + std::abs(wanted[k])));
  }
}

TEST(Oracle, SislInsertsKnotsAndEvaluatesTheSame) {
#ifndef ANGIOSPLINE_HAS_SISL
  GTEST_SKIP() << "SISL did not run: libsisl-dev was not there at build time";
#else
  Random random(2);
  for (int round = 0; round < 100; ++round) {
    const KnotVector knots = random_knots(random, 1 + random.below(6), 0, false);
    BSplineCurve<3> curve = random_curve<3>(random, knots);
    std::vector<double> flat = knots.knots();
    Eigen::Matrix3Xd points = curve.control_points();
    SISLCurve* peer =
        newCurve(knots.control_point_count(), knots.order(), flat.data(), points.data(), 1, 3, 1);
    std::vector<double> added;
    for (int k = 0; k < 9; ++k) added.push_back(random.uniform(knots.first(), knots.last()));
    std::sort(added.begin(), added.end());
    SISLCurve* finer = nullptr;
    int status = 0;
    s1018(peer, added.data(), 9, &finer, &status);
    ASSERT_GE(status, 0);
    const BSplineCurve<3> ours = *insert_knots(curve, added);
    ASSERT_EQ(finer->in, ours.knots().control_point_count());
    const Eigen::Map<const Eigen::Matrix3Xd> theirs(finer->ecoef, 3, finer->in);
    EXPECT_LT((ours.control_points() - theirs).cwiseAbs().maxCoeff(), 1e-12);
    int left = 0;
    double derivatives[9];
    const double t = random.uniform(knots.first(), knots.last());
    s1221(peer, 2, t, &left, derivatives, &status);
    for (int d = 0; d <= 2; ++d) {
      const Eigen::Vector3d at = curve.at(t, d);
      EXPECT_LT((at - Eigen::Map<const Eigen::Vector3d>(derivatives + 3 * d)).norm(),
                1e-10 * (1 + at.norm()));
    }
    freeCurve(peer);
    freeCurve(finer);
  }
#endif
}

}  // namespace
}  // namespace angiospline
