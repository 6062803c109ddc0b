#include "recovery/centerline_overlap.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include <nanoflann.hpp>

namespace angiospline {
namespace {

// Points along branches; each stands for the same length but for the rounding of whole steps.
struct Samples {
  std::vector<Vec3> points;
  std::vector<double> radii;
  std::vector<double> lengths;  // that each point stands for

  // What nanoflann wants of a point set.
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t k, std::size_t axis) const {
    return points[k][static_cast<Eigen::Index>(axis)];
  }
  template <typename B>
  bool kdtree_get_bbox(B&) const {
    return false;
  }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<double, Samples>,
                                                 Samples, 3, std::size_t>;

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

struct Nearest {
  std::size_t point;
  double distance_mm;
};

Nearest nearest(const Tree& tree, const Vec3& point) {
  std::size_t at = 0;
  double squared = 0;
  tree.knnSearch(point.data(), 1, &at, &squared);
  return {at, std::sqrt(squared)};
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
  const nanoflann::KDTreeSingleIndexAdaptorParams leaf(16);
  const Tree near_truth(3, t, leaf), near_result(3, r, leaf);
  double found_mm = 0, correct_mm = 0, moment = 0;
  for (std::size_t k = 0; k < t.points.size(); ++k)
    if (nearest(near_result, t.points[k]).distance_mm <= t.radii[k]) found_mm += t.lengths[k];
  for (std::size_t k = 0; k < r.points.size(); ++k) {
    const Nearest n = nearest(near_truth, r.points[k]);
    if (n.distance_mm > t.radii[n.point]) continue;
    correct_mm += r.lengths[k];
    moment += r.lengths[k] * n.distance_mm;
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
