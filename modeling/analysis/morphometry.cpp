#include "modeling/analysis/morphometry.h"

#include "base/contract.h"

namespace angiospline {

BranchMorphometry morphometry(const CenterlineBranch& branch) {
  EXPECTS(branch.points_mm.cols() > 0 && branch.radii_mm.size() == branch.points_mm.cols());

  // The trapezoidal rule is exact for a radius that is linear between the points.
  BranchMorphometry measured;
  double radius_integral = 0;
  for (Eigen::Index k = 1; k < branch.points_mm.cols(); ++k) {
    const double step = (branch.points_mm.col(k) - branch.points_mm.col(k - 1)).norm();
    measured.length_mm += step;
    radius_integral += 0.5 * step * (branch.radii_mm[k] + branch.radii_mm[k - 1]);
  }

  measured.mean_radius_mm =
      measured.length_mm > 0 ? radius_integral / measured.length_mm : branch.radii_mm.mean();
  measured.min_radius_mm = branch.radii_mm.minCoeff();
  measured.max_radius_mm = branch.radii_mm.maxCoeff();
  return measured;
}

Eigen::VectorXd arc_lengths_mm(const CenterlineBranch& branch) {
  const Eigen::Index count = branch.points_mm.cols();
  Eigen::VectorXd s = Eigen::VectorXd::Zero(count);
  for (Eigen::Index k = 1; k < count; ++k) {
    s[k] = s[k - 1] + (branch.points_mm.col(k) - branch.points_mm.col(k - 1)).norm();
  }
  return s;
}

}  // namespace angiospline
