#include "modeling/tree/branch_samples.h"

#include <algorithm>
#include <cmath>

#include "base/index.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;

// Whether the first radius belongs to what comes before: it jumps to the second, and more than the
// radii vary after it.
bool jumps(double r0, double r1, double r2) {
  return std::abs(std::log(r0 / r1)) >
         SampleRules::kJump + SampleRules::kJumpFactor * std::abs(std::log(r1 / r2));
}

// How many parts each gap between given points is cut into: far points get points between them,
// until there are too many; a branch of few points gets as many as make it one of enough.
std::vector<Eigen::Index> parts_of_gaps(const CenterlineBranch& branch, Eigen::Index fewest) {
  const Eigen::Index given = branch.points_mm.cols();
  std::vector<Eigen::Index> parts(index(given - 1), 1);
  Eigen::Index room = SampleRules::kMostBetween * given;
  for (Eigen::Index i = 0; i + 1 < given; ++i) {
    const double length = (branch.points_mm.col(i + 1) - branch.points_mm.col(i)).norm();
    const double radius = 0.5 * (branch.radii_mm(i) + branch.radii_mm(i + 1));
    const double wanted = std::ceil(length / (SampleRules::kGapRadii * radius));
    const auto more = static_cast<Eigen::Index>(std::min(wanted - 1, static_cast<double>(room)));
    parts[index(i)] = std::max(fewest, 1 + std::max<Eigen::Index>(0, more));
    room -= std::max<Eigen::Index>(0, more);
  }
  return parts;
}

// Radii of a branch's ends that are its junctions' get no weight.
void leave_out_parents_radii(const Eigen::VectorXd& r, bool at_start, bool at_end,
                             Eigen::VectorXd& weights) {
  const Eigen::Index given = r.size();
  double& first = weights(0);
  double& last = weights(weights.size() - 1);
  if (given == 3) {  // the middle one decides
    if (at_start && jumps(r(0), r(1), r(1))) first = 0;
    if (at_end && jumps(r(2), r(1), r(1))) last = 0;
  }
  if (given > 3) {
    if (at_start && jumps(r(0), r(1), r(2))) first = 0;
    if (at_end && jumps(r(given - 1), r(given - 2), r(given - 3))) last = 0;
  }
}

}  // namespace

BranchSamples samples_of(const CenterlineBranch& branch, bool start_is_junction,
                         bool end_is_junction) {
  const Eigen::Index given = branch.points_mm.cols();
  const Eigen::Index fewest = given >= SampleRules::kFewestSamples
                                  ? 1
                                  : (SampleRules::kFewestSamples + given - 3) / (given - 1);
  const std::vector<Eigen::Index> parts = parts_of_gaps(branch, fewest);
  Eigen::Index count = 1;
  for (const Eigen::Index n : parts) count += n;

  BranchSamples s;
  s.points.resize(count, 3);
  s.radii.resize(count);
  s.parameters.resize(count);
  s.weights = Eigen::VectorXd::Zero(count);
  Eigen::Index filled = 0;
  const auto add = [&](Eigen::Index i, double t, double weight) {
    const Eigen::Index j = std::min(i + 1, given - 1);
    s.points.row(filled) =
        ((1 - t) * branch.points_mm.col(i) + t * branch.points_mm.col(j)).transpose();
    s.radii(filled) = (1 - t) * branch.radii_mm(i) + t * branch.radii_mm(j);
    s.weights(filled) = weight;
    s.parameters(filled) =
        filled == 0
            ? 0.0
            : s.parameters(filled - 1) + (s.points.row(filled) - s.points.row(filled - 1)).norm();
    ++filled;
  };

  // Points between given ones have a say only where there are too few of these.
  for (Eigen::Index i = 0; i + 1 < given; ++i) {
    const Eigen::Index n = parts[index(i)];
    for (Eigen::Index k = 0; k < n; ++k) {
      add(i, static_cast<double>(k) / static_cast<double>(n), k == 0 || fewest > 1 ? 1.0 : 0.0);
    }
  }
  add(given - 1, 0.0, 1.0);
  s.radius_weights = s.weights;
  leave_out_parents_radii(branch.radii_mm, start_is_junction, end_is_junction, s.radius_weights);
  return s;
}

KnotVector knots_for(const BranchSamples& samples) {
  const double by_radius = samples.length() / (SampleRules::kSpanRadii * samples.radii.mean());
  const double by_samples = 2.0 * static_cast<double>(samples.parameters.size() - 1);
  const int spans = static_cast<int>(
      std::clamp(std::min(by_radius, by_samples), 2.0, double{SampleRules::kMostSpans}));
  return KnotVector::clamped(kDegree, even_breaks(samples.length(), spans));
}

std::vector<double> even_breaks(double last, int spans) {
  std::vector<double> breaks(index(spans) + 1);
  for (int k = 0; k <= spans; ++k) breaks[index(k)] = last * k / spans;
  return breaks;
}

}  // namespace angiospline
