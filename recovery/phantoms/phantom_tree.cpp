#include "recovery/phantoms/phantom_tree.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/random.h"

namespace angiospline {
namespace {

constexpr double kGap_mm = 4.0;  // clear space between branches that do not meet
constexpr int kTries = 500;      // for one bifurcation before its branch stays an end
constexpr int kPointsPerBranch = 17;
constexpr double kTaper = 0.01;

struct Tip {
  int node;
  Vec3 direction;
  double radius;
  bool closed = false;
};

Vec3 perpendicular(const Vec3& d, Random& random) {
  const Vec3 other = std::abs(d[0]) < 0.6 ? Vec3::UnitX() : Vec3::UnitY();
  const Vec3 u = d.cross(other).normalized(), v = d.cross(u);
  const double angle = random.uniform(0, 2 * std::numbers::pi);
  return std::cos(angle) * u + std::sin(angle) * v;
}

// A bowed branch: a quadratic Bezier curve, tapering by a hundredth.
CenterlineBranch branch_from(const Vec3& start, const Vec3& direction, double radius,
                             Random& random) {
  const double length = radius * random.uniform(5, 10);
  const Vec3 middle = start + direction * length / 2;
  const Vec3 end = start + direction * length +
                   perpendicular(direction, random) * length * random.uniform(0, 0.2);

  CenterlineBranch b;
  b.points_mm.resize(3, kPointsPerBranch);
  b.radii_mm.resize(kPointsPerBranch);
  for (int k = 0; k < kPointsPerBranch; ++k) {
    const double t = static_cast<double>(k) / (kPointsPerBranch - 1);
    b.points_mm.col(k) = (1 - t) * (1 - t) * start + 2 * t * (1 - t) * middle + t * t * end;
    b.radii_mm[k] = radius * (1 - kTaper * t);
  }
  return b;
}

Vec3 end_direction(const CenterlineBranch& b) {
  return (b.points_mm.rightCols<1>() - b.points_mm.col(kPointsPerBranch - 2)).normalized();
}

class Growth {
 public:
  explicit Growth(const PhantomOptions& options) : o_(options), random_(options.seed) {}

  Result<CenterlineTree> grow() {
    plant();
    int ends = 1;
    while (ends < o_.ends) {
      Tip* tip = thickest_open_tip();
      if (tip == nullptr)
        return fail({ErrorKind::kFailed, "random tree found no room", "phantom tree",
                     fmt::format("{} of {} ends placed", ends, o_.ends),
                     "a larger field, a thinner smallest branch or another seed may do"});

      if (bifurcate(*tip))
        ++ends;
      else
        tip->closed = true;
    }
    return std::move(tree_);
  }

 private:
  void plant() {
    const double r = o_.radius_max_mm;
    const Vec3 root(o_.field_mm / 2, o_.field_mm / 2, 2 * r);
    tree_.nodes.push_back({"root", root});
    tree_.inlets = {0};
    add(branch_from(root, Vec3::UnitZ(), r, random_), 0);
  }

  void add(CenterlineBranch b, int from) {
    const int to = static_cast<int>(tree_.nodes.size());
    b.name = fmt::format("branch_{}", tree_.branches.size() + 1);
    b.from = from;
    b.to = to;
    tree_.nodes.push_back({fmt::format("node_{}", to), b.points_mm.rightCols<1>()});
    tips_.push_back({to, end_direction(b), b.radii_mm[kPointsPerBranch - 1]});
    tree_.branches.push_back(std::move(b));
  }

  Tip* thickest_open_tip() {
    Tip* best = nullptr;
    for (Tip& t : tips_)
      if (!t.closed && t.radius > o_.radius_min_mm && (best == nullptr || t.radius > best->radius))
        best = &t;
    return best;
  }

  bool bifurcate(Tip& tip) {
    for (int k = 0; k < kTries; ++k) {
      const double share = random_.uniform(0.38, 0.62);
      const double r1 = tip.radius * std::cbrt(share), r2 = tip.radius * std::cbrt(1 - share);

      // Murray's law: r^3 is shared (Murray: The physiological principle of minimum work, PNAS 12,
      // 1926).
      if (std::min(r1, r2) * (1 - kTaper) < o_.radius_min_mm) continue;

      const Vec3 side = perpendicular(tip.direction, random_);
      const Vec3 start = tree_.nodes[static_cast<std::size_t>(tip.node)].position_mm;

      // The thinner daughter turns away more, as in vessels.
      const double a1 = random_.uniform(0.45, 0.9) * (1.3 - share);
      const double a2 = random_.uniform(0.45, 0.9) * (0.3 + share);
      const auto d1 = (std::cos(a1) * tip.direction + std::sin(a1) * side).normalized();
      const auto d2 = (std::cos(a2) * tip.direction - std::sin(a2) * side).normalized();

      CenterlineBranch b1 = branch_from(start, d1, r1, random_);
      CenterlineBranch b2 = branch_from(start, d2, r2, random_);
      if (a1 + a2 < 0.7 || !has_room(b1, tip.node) || !has_room(b2, tip.node)) continue;

      const int node = tip.node;
      tip.closed = true;  // before add(), which may move the tips
      add(std::move(b1), node);
      add(std::move(b2), node);
      return true;
    }
    return false;
  }

  // Inside the field, and clear of every branch; of the one it springs from, once it has left it.
  bool has_room(const CenterlineBranch& b, int from) const {
    for (int k = 0; k < kPointsPerBranch; ++k) {
      const Vec3 p = b.points_mm.col(k);
      const double r = b.radii_mm[k];
      if (p.minCoeff() < r + kGap_mm || p.maxCoeff() > o_.field_mm - r - kGap_mm) return false;

      for (const CenterlineBranch& other : tree_.branches)
        for (int j = 0; j < kPointsPerBranch; ++j) {
          const double clear = r + other.radii_mm[j] + kGap_mm;
          if ((other.points_mm.col(j) - p).norm() >= clear) continue;
          const bool near_node =
              other.to == from && (p - b.points_mm.col(0)).norm() < 2.5 * (r + other.radii_mm[j]);
          if (!near_node) return false;
        }
    }
    return true;
  }

  const PhantomOptions& o_;
  Random random_;
  CenterlineTree tree_;
  std::vector<Tip> tips_;
};

}  // namespace

Result<CenterlineTree> random_tree(const PhantomOptions& options) { return Growth(options).grow(); }

}  // namespace angiospline
