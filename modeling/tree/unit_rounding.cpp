#include "modeling/tree/unit_rounding.h"

#include <cmath>
#include <limits>

namespace angiospline {
namespace {

// No length that people choose is a power of two over this, where one more digit in the last place
// would double the step.
constexpr double kOffRoundLengths = 1.37;

double step_of(double length) {
  return std::ldexp(1.0, std::ilogb(length * kOffRoundLengths) - kKeptBits);
}

double to_step(double value, double step) {
  const double rounded = std::nearbyint(value / step) * step;
  return std::isfinite(rounded) ? rounded : value;
}

}  // namespace

CenterlineTree rounded(CenterlineTree tree) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 high = -low;
  for (const CenterlineBranch& branch : tree.branches) {
    low = low.cwiseMin(branch.points_mm.rowwise().minCoeff());
    high = high.cwiseMax(branch.points_mm.rowwise().maxCoeff());
  }
  const double extent = (high - low).maxCoeff();
  if (!(extent > 0) || !std::isfinite(extent)) return tree;
  const double step = step_of(extent);
  const auto on_grid = [step](double x) { return to_step(x, step); };
  for (CenterlineNode& node : tree.nodes) node.position_mm = node.position_mm.unaryExpr(on_grid);
  for (CenterlineBranch& branch : tree.branches) {
    branch.points_mm = branch.points_mm.unaryExpr(on_grid).eval();
    for (double& radius : branch.radii_mm) {
      if (radius > 0 && std::isfinite(radius)) radius = to_step(radius, step_of(radius));
    }
  }
  return tree;
}

}  // namespace angiospline
