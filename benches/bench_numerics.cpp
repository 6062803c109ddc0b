// FrontalFactor beside Eigen's SimplicialLDLT on the same matrices, in turn: medians of CPU time
// for the analysis of the pattern, the factors and one solve. Ratios are ours over Eigen's:
// `factor` alone and `all`, analysis and factors together.
#include <algorithm>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <utility>
#include <vector>

#include <Eigen/SparseCholesky>
#include <benchmark/benchmark.h>

#include "base/random.h"
#include "kernel/numerics/frontal_factor.h"

namespace angiospline {
namespace {

using Sparse = Eigen::SparseMatrix<double>;
using Triplets = std::vector<Eigen::Triplet<double>>;

// The Laplacian of a grid of side * side nodes.
Sparse laplacian(int side) {
  Triplets entries;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const int at = y * side + x;
      double neighbours = 0;
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {1, 0}, {0, -1}, {0, 1}}) {
        if (x + dx < 0 || x + dx >= side || y + dy < 0 || y + dy >= side) continue;
        entries.emplace_back(at, at + dy * side + dx, -1.0);
        ++neighbours;
      }
      entries.emplace_back(at, at, neighbours);
    }
  }
  Sparse K(side * side, side * side);
  K.setFromTriplets(entries.begin(), entries.end());
  return K;
}

Sparse lower_of(const Sparse& A) {
  Sparse lower = A.triangularView<Eigen::Lower>();
  lower.makeCompressed();
  return lower;
}

// I + 50 K'K: a smoothing of values at the nodes.
Sparse smoothing(int side) {
  const Sparse K = laplacian(side);
  Sparse A = 50.0 * Sparse(K.transpose() * K);
  A.diagonal().array() += 1.0;
  return lower_of(A);
}

// [H J'; J -1e-6 I] with H = I + 50 K'K and an equation among four neighbours for every fourth
// node.
Sparse constrained_smoothing(int side) {
  const Sparse H = smoothing(side);
  const int n = side * side;
  Triplets entries;
  for (int c = 0; c < n; ++c) {
    for (Sparse::InnerIterator it(H, c); it; ++it) {
      entries.emplace_back(static_cast<int>(it.row()), c, it.value());
    }
  }
  Random random(1);
  int equation = n;
  for (int y = 0; y + 1 < side; y += 2) {
    for (int x = 0; x + 1 < side; x += 2, ++equation) {
      for (const int node : {y * side + x, y * side + x + 1, (y + 1) * side + x}) {
        entries.emplace_back(equation, node, random.gaussian());
      }
      entries.emplace_back(equation, equation, -1e-6);
    }
  }
  Sparse A(equation, equation);
  A.setFromTriplets(entries.begin(), entries.end());
  A.makeCompressed();
  return A;
}

double cpu_ms() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Times {
  std::vector<double> analysis, factor, again, solve;
};

double median_of(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

// Appends one round to `times` and returns the solution.
template <typename Analyse, typename Factor, typename Solve>
Eigen::VectorXd round(Times& times, Analyse&& analyse, Factor&& factor, Solve&& solve) {
  const double start = cpu_ms();
  analyse();
  const double analysed = cpu_ms();
  factor();
  const double factored = cpu_ms();
  factor();
  const double again = cpu_ms();
  Eigen::VectorXd x = solve();
  times.analysis.push_back(analysed - start);
  times.factor.push_back(factored - analysed);
  times.again.push_back(again - factored);
  times.solve.push_back(cpu_ms() - again);
  return x;
}

void in_turn(benchmark::State& state, const Sparse& A) {
  const Eigen::VectorXd right = Eigen::VectorXd::LinSpaced(A.rows(), -1, 1);
  Times ours, peer;
  double difference = 0;
  for (auto _ : state) {
    std::optional<FrontalFactor> frontal;
    const Eigen::VectorXd x = round(
        ours, [&] { frontal.emplace(A); },
        [&] {
          if (!frontal->factor(A)) std::abort();
        },
        [&] { return frontal->solve(right); });

    Eigen::SimplicialLDLT<Sparse> simplicial;
    const Eigen::VectorXd y = round(
        peer, [&] { simplicial.analyzePattern(A); },
        [&] {
          simplicial.factorize(A);
          if (simplicial.info() != Eigen::Success) std::abort();
        },
        [&]() -> Eigen::VectorXd { return simplicial.solve(right); });
    difference = std::max(difference, (x - y).norm() / y.norm());
  }

  const double analysis = median_of(ours.analysis), factor = median_of(ours.factor);
  const double peer_analysis = median_of(peer.analysis), peer_factor = median_of(peer.factor);
  state.counters["n"] = static_cast<double>(A.rows());
  state.counters["analysis_ms"] = analysis;
  state.counters["factor_ms"] = factor;
  state.counters["again_ms"] = median_of(ours.again);
  state.counters["solve_ms"] = median_of(ours.solve);
  state.counters["eigen_analysis_ms"] = peer_analysis;
  state.counters["eigen_factor_ms"] = peer_factor;
  state.counters["eigen_again_ms"] = median_of(peer.again);
  state.counters["eigen_solve_ms"] = median_of(peer.solve);
  state.counters["factor_ratio"] = factor / peer_factor;
  state.counters["again_ratio"] = median_of(ours.again) / median_of(peer.again);
  state.counters["all_ratio"] = (analysis + factor) / (peer_analysis + peer_factor);
  state.counters["difference"] = difference;
}

void smoothing_in_turn(benchmark::State& state) {
  in_turn(state, smoothing(static_cast<int>(state.range(0))));
}
BENCHMARK(smoothing_in_turn)
    ->Arg(40)
    ->Arg(100)
    ->Arg(200)
    ->Iterations(9)
    ->Unit(benchmark::kMillisecond);

void constrained_in_turn(benchmark::State& state) {
  in_turn(state, constrained_smoothing(static_cast<int>(state.range(0))));
}
BENCHMARK(constrained_in_turn)
    ->Arg(40)
    ->Arg(100)
    ->Arg(200)
    ->Iterations(9)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace angiospline

BENCHMARK_MAIN();
