#include "recovery/analysis/compare_centerlines.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "kernel/geometry/point_index.h"

namespace angiospline {
namespace {

// Points along branches; each stands for the same length but for the rounding of whole steps.
struct Samples {
  std::vector<Vec3> points;
  std::vector<double> radii;
  std::vector<double> lengths;  // that each point stands for
};

Samples sampled(const CenterlineTree& tree, double step_mm) {
  Samples out;
  for (const CenterlineBranch& branch : tree.branches)
    for (Eigen::Index i = 0; i + 1 < branch.points_mm.cols(); ++i) {
      const Vec3 a = branch.points_mm.col(i), b = branch.points_mm.col(i + 1);
      const double length = (b - a).norm();
      if (length == 0) continue;
      const int pieces = std::max(1, static_cast<int>(std::ceil(length / step_mm)));
      for (int k = 0; k < pieces; ++k) {
        const double s = (k + 0.5) / pieces;
        out.points.push_back((1 - s) * a + s * b);
        out.radii.push_back((1 - s) * branch.radii_mm[i] + s * branch.radii_mm[i + 1]);
        out.lengths.push_back(length / pieces);
      }
    }
  return out;
}

double total_length(const CenterlineTree& tree) {
  double length = 0;
  for (const CenterlineBranch& branch : tree.branches) length += length_mm(branch);
  return length;
}

double step_for(const CenterlineTree& truth, double length_mm) {
  constexpr double kMostPoints = 1e6;
  double radius = std::numeric_limits<double>::infinity();
  for (const CenterlineBranch& branch : truth.branches)
    radius = std::min(radius, branch.radii_mm.minCoeff());
  return std::max(0.25 * radius, length_mm / kMostPoints);
}

}  // namespace

CenterlineOverlap centerline_overlap(const CenterlineTree& truth, const CenterlineTree& result) {
  CenterlineOverlap out;
  out.truth_length_mm = total_length(truth);
  out.result_length_mm = total_length(result);
  const double both_mm = out.truth_length_mm + out.result_length_mm;
  if (both_mm == 0) return out;
  if (out.truth_length_mm == 0 || out.result_length_mm == 0) {
    out.overlap = 0;
    (out.truth_length_mm == 0 ? out.correct : out.found) = 0;
    return out;
  }

  const double step = step_for(truth, both_mm);
  const Samples t = sampled(truth, step), r = sampled(result, step);
  const PointIndex near_truth(t.points), near_result(r.points);

  // A sample of one is found where the other comes within the radius of the true vessel.
  double found_mm = 0, correct_mm = 0, moment = 0;
  for (std::size_t k = 0; k < t.points.size(); ++k)
    if (near_result.nearest(t.points[k]).distance <= t.radii[k]) found_mm += t.lengths[k];
  for (std::size_t k = 0; k < r.points.size(); ++k) {
    const NearestPoint n = near_truth.nearest(r.points[k]);
    if (n.distance > t.radii[static_cast<std::size_t>(n.point)]) continue;
    correct_mm += r.lengths[k];
    moment += r.lengths[k] * n.distance;
  }

  // Over the samples' own sums, so that all of it is exactly 1.
  const double t_mm = std::accumulate(t.lengths.begin(), t.lengths.end(), 0.0);
  const double r_mm = std::accumulate(r.lengths.begin(), r.lengths.end(), 0.0);
  out.found = found_mm / t_mm;
  out.correct = correct_mm / r_mm;
  out.overlap = (found_mm + correct_mm) / (t_mm + r_mm);
  out.offset_mm = correct_mm > 0 ? moment / correct_mm : 0;
  return out;
}

}  // namespace angiospline
