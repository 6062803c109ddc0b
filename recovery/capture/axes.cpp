#include "recovery/capture/axes.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/index.h"
#include "kernel/fit/penalised_spline.h"
#include "recovery/capture/rules.h"

namespace angiospline {
namespace {

using namespace capture_rules;

class Axis {
 public:
  explicit Axis(const AxisSections& sections) : spline_(spline_of(sections)) {
    const double spacing =
        (sections.along_mm(sections.along_mm.size() - 1) - sections.along_mm(0)) /
        static_cast<double>(sections.along_mm.size() - 1);
    unit_ = std::pow(sections.radius_mm, 6) / spacing;
    criteria_.resize(kStrengths);
    for (int k = 0; k < kStrengths; ++k) {
      criteria_(k) = spline_.criterion(strength(k), kLeastNoise * sections.radius_mm);
    }
  }

  const Eigen::VectorXd& criteria() const { return criteria_; }

  Points3 smoothed(Eigen::Index of_tree) const {
    Eigen::VectorXd drawn = criteria_;
    for (Eigen::Index k = 0; k < kStrengths; ++k) {
      const double off = static_cast<double>(k - of_tree) * kStrengthStep / kPriorDecades;
      drawn(k) += off * off;
    }
    Eigen::Index best = 0;
    drawn.minCoeff(&best);
    return spline_.values_at_samples(spline_.solve(strength(static_cast<int>(best)))).transpose();
  }

 private:
  static PenalisedSpline spline_of(const AxisSections& s) {
    const Eigen::Index n = s.along_mm.size();
    const double first = s.along_mm(0), length = s.along_mm(n - 1) - first;
    const double wanted = std::min(length / (kSpanRadii * s.radius_mm), static_cast<double>(n - 1));
    const int spans = static_cast<int>(std::max(2.0, wanted));
    std::vector<double> breaks;
    for (int k = 0; k <= spans; ++k) breaks.push_back(first + length * k / spans);
    Eigen::VectorXd weights(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      weights(k) = s.measured[index(k)] ? 1.0 : 0.0;
    }
    return PenalisedSpline(KnotVector::clamped(kAxisDegree, breaks), s.along_mm,
                           s.centers_mm.transpose(), weights, kPenalisedOrder);
  }

  double strength(int k) const {
    return unit_ * std::pow(10.0, kFirstStrength + kStrengthStep * k);
  }

  PenalisedSpline spline_;
  double unit_ = 1.0;
  Eigen::VectorXd criteria_;
};

}  // namespace

std::vector<Points3> smooth_axes(const std::vector<AxisSections>& branches) {
  std::vector<std::optional<Axis>> axes(branches.size());
  Eigen::VectorXd all = Eigen::VectorXd::Zero(kStrengths);
  for (std::size_t b = 0; b < branches.size(); ++b) {
    const auto& measured = branches[b].measured;
    if (std::count(measured.begin(), measured.end(), char{1}) < kFewestSections) continue;
    axes[b].emplace(branches[b]);
    all += axes[b]->criteria();
  }

  // The strength that explains all branches together best; each branch's own is drawn to it.
  Eigen::Index of_tree = 0;
  all.minCoeff(&of_tree);

  std::vector<Points3> smooth;
  for (std::size_t b = 0; b < branches.size(); ++b) {
    smooth.push_back(axes[b] ? axes[b]->smoothed(of_tree) : branches[b].centers_mm);
  }
  return smooth;
}

}  // namespace angiospline
