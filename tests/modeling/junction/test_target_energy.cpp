// A junction's energy: its models against a twin that sums the squares one by one, normals and
// tangent lengths held, as Gauss-Newton does.
#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "base/random.h"
#include "modeling/junction/patch_basis.h"
#include "modeling/junction/rules.h"
#include "modeling/junction/target_energy.h"
#include "tests/modeling/junction/sample_junction.h"

namespace angiospline {
namespace {

Eigen::VectorXd random_vector(Eigen::Index size, double length, Random& random) {
  Eigen::VectorXd x(size);
  for (double& v : x) v = length * random.gaussian();
  return x;
}

JunctionNet moved(JunctionNet net, const Eigen::VectorXd& move) {
  net.apply(move);
  return net;
}

// Half the weighted squares of one patch at `net`, feet and lengths taken from `base`.
double patch_energy(const SampleJunction& j, int p, const JunctionNet& base, const JunctionNet& net,
                    const EnergyWeights& w) {
  const JunctionPatch& patch = j.topology.patches[static_cast<std::size_t>(p)];
  const JunctionSaddle& saddle = j.topology.saddles[static_cast<std::size_t>(patch.saddle)];
  const auto radius = [&](int b) { return j.layout.openings[static_cast<std::size_t>(b)].radius; };
  const double own = radius(patch.branch);
  const double least = std::min(radius(saddle.branch_a), radius(saddle.branch_b));
  const int last = j.layout.grid.size() - 1;
  const auto node = [&](int a, int b) -> Vec3 {
    return j.layout.nodes.col(j.layout.grid.at(p, a, b));
  };
  double along_u = 0, along_v = 0;
  for (int line = 0; line <= last; ++line) {
    for (int k = 0; k < last; ++k) {
      along_u += (node(k + 1, line) - node(k, line)).norm();
      along_v += (node(line, k + 1) - node(line, k)).norm();
    }
  }
  const double extent = std::max(along_u, along_v) / (2 * (last + 1));

  const PatchNet P0 = patch_net(base, p), P = patch_net(net, p);
  double sum = 0;
  for (int a = 1; a <= last; ++a) {
    for (int b = 0; b <= last; ++b) {
      const double u = static_cast<double>(a) / last, v = static_cast<double>(b) / last;
      const PatchBasis f = patch_basis({u, v});
      const double share = (a == last ? 0.5 : 1.0) * (b == 0 || b == last ? 0.5 : 1.0);
      const double pole = (last - a) + std::min(b, last - b) <= 1 ? w.pole : 1.0;
      const double scale = (1 - u) * own + u * least;
      const Vec3 at = P0 * f.value;
      JunctionTarget::Foot foot{0, j.layout.normals.col(j.layout.grid.at(p, a, b))};
      if (w.distance > 0) foot = j.target.foot(at);
      const auto squared_length = [&](const Vec3& t) {
        return std::pow(std::max(t.norm(), junction_rules::kShortestTangent * scale), 2);
      };
      const double off = foot.distance + foot.normal.dot(P * f.value - at);
      sum += pole * share * w.distance * off * off / (scale * scale);
      for (const PatchColumn& d : {f.u, f.v}) {
        sum +=
            pole * share * w.tangent * std::pow(foot.normal.dot(P * d), 2) / squared_length(P0 * d);
      }
      const double longer = std::max(1.0, extent / scale);
      const double anchor = scale * longer * longer;
      sum += w.anchor * share * (P * f.value - node(a, b)).squaredNorm() / (anchor * anchor);
    }
  }
  double smallest = own;
  for (int a = 1; a <= last; ++a) {
    const double u = static_cast<double>(a) / last;
    smallest = std::min(smallest, (1 - u) * own + u * least);
  }
  const auto point = [&](int a, int b) -> Vec3 { return P.col(kPatchSize * a + b); };
  for (int a = 0; a < kPatchSize; ++a) {
    for (int b = 1; b + 1 < kPatchSize; ++b) {
      const Vec3 along = point(a, b - 1) - 2 * point(a, b) + point(a, b + 1);
      const Vec3 across = point(b - 1, a) - 2 * point(b, a) + point(b + 1, a);
      sum += w.roughness * (along.squaredNorm() + across.squaredNorm()) / (smallest * smallest);
    }
  }
  return sum / 2;
}

double twin(const SampleJunction& j, const JunctionNet& base, const JunctionNet& net,
            const EnergyWeights& weights) {
  double sum = 0;
  for (int p = 0; p < static_cast<int>(j.topology.patches.size()); ++p) {
    sum += patch_energy(j, p, base, net, weights);
  }
  return sum;
}

class TargetEnergyOf : public testing::TestWithParam<EnergyWeights> {};

TEST_P(TargetEnergyOf, AStepIsItsTwinsToRounding) {
  const EnergyWeights weights = GetParam();
  Random random(5);
  for (const JunctionSpec& spec : {y_spec(), four_spec()}) {
    const SampleJunction j = sample_junction(spec);
    JunctionNet net = start_net(j.topology, j.layout);
    net.apply(random_vector(net.unknowns, 0.02, random));
    TargetEnergy energy(j.topology, &j.target, j.layout, net);
    const std::vector<PatchModel>& models = energy.updated(net, weights);
    const double now = twin(j, net, net, weights);
    for (int trial = 0; trial < 5; ++trial) {
      const Eigen::VectorXd x = random_vector(net.unknowns, 0.05, random);
      double model = 0;
      for (const PatchModel& m : models) {
        Eigen::VectorXd part(m.gradient.size());
        for (Eigen::Index k = 0; k < part.size(); ++k) {
          part(k) = x(m.unknowns[static_cast<std::size_t>(k)]);
        }
        const Eigen::MatrixXd H = m.hessian.selfadjointView<Eigen::Lower>();
        model += m.gradient.dot(part) + part.dot(H * part) / 2;
      }
      const double exact = twin(j, net, moved(net, x), weights) - now;
      EXPECT_NEAR(model, exact, 1e-10 * (1 + std::abs(exact)));
      EXPECT_GT(std::abs(exact), 1e-6);  // not vacuous
    }
  }
}

INSTANTIATE_TEST_SUITE_P(EachTerm, TargetEnergyOf,
                         testing::Values(EnergyWeights{10, 0, 0, 0, 4},
                                         EnergyWeights{0, 1, 0, 0, 4},
                                         EnergyWeights{0, 0, 0.3, 0, 1},
                                         EnergyWeights{0, 0, 0, 0.003, 1}, EnergyWeights{}));

TEST(TargetEnergy, NeedsNoTargetWhereDistancesDoNotCount) {
  const SampleJunction j = sample_junction(y_spec());
  const JunctionNet net = start_net(j.topology, j.layout);
  TargetEnergy with(j.topology, &j.target, j.layout, net),
      without(j.topology, nullptr, j.layout, net);
  const EnergyWeights weights{0, 1, 1, 0.01, 1};
  const auto a = with.updated(net, weights);
  const auto b = without.updated(net, weights);
  ASSERT_EQ(a.size(), j.topology.patches.size());
  for (std::size_t p = 0; p < a.size(); ++p) {
    EXPECT_EQ(a[p].gradient, b[p].gradient);
    EXPECT_GT(a[p].gradient.norm(), 0);
  }
}

TEST(PatchBasis, AddsUpToOneAndItsDerivativesToNothing) {
  Random random(2);
  for (int trial = 0; trial < 20; ++trial) {
    const Vec2 uv(random.uniform(0, 1), random.uniform(0, 1));
    const PatchBasis f = patch_basis(uv);
    EXPECT_NEAR(f.value.sum(), 1, 1e-14);
    EXPECT_NEAR(f.u.sum(), 0, 1e-13);
    EXPECT_NEAR(f.v.sum(), 0, 1e-13);
    const double h = 1e-5;
    const PatchColumn by_u =
        (patch_basis(uv + Vec2(h, 0)).value - patch_basis(uv - Vec2(h, 0)).value) / (2 * h);
    EXPECT_LT((by_u - f.u).cwiseAbs().maxCoeff(), 1e-7);
  }
}

}  // namespace
}  // namespace angiospline
