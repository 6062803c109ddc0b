#include "recovery/centerlines/centerlines_from_graph.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/median.h"
#include "recovery/centerlines/axis_smoothing.h"
#include "recovery/centerlines/lumen_section.h"
#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/skeleton/pruning.h"

namespace angiospline {
namespace {

constexpr double kOpenWeight = 0.02;  // of a point whose section is open, against 1
constexpr double kLongestRay = 2.5;   // in distances to the wall: beyond, a section is open
constexpr int kRecenterings = 2;
constexpr int kTipRays = 37;  // over the disc of a tip
constexpr double kFullSection =
    0.9;                             // of the radius: a section at a tip that is still the vessel's
constexpr double kMostShift = 0.25;  // of a step: how fast a tip may turn

// All points of all branches as unknowns: the nodes first, then the inner points of each arc.
struct Points {
  std::vector<SmoothingChain> chains;  // one for each arc
  Points3 voxels_mm;                   // where the axis had them
  Points3 at_mm;                       // where they are now
  Eigen::VectorXd inscribed_mm;        // distance of the voxel to the wall
  Eigen::VectorXd radius_mm;           // of the section where it is closed, otherwise 0
  Eigen::VectorXd counted;             // the same by counting voxels, over radius_mm; 0: not known
  std::vector<bool> in_junction;       // within a junction's lumen, where sections mean nothing
};

class Centerlines {
 public:
  Centerlines(const VesselGraph& graph, const Mask& mask, const CenterlineOptions& options)
      : graph_(graph), mask_(mask), options_(options) {
    gather();
  }

  bool run(const Progress& progress) {
    smooth(2.0);
    for (int k = 0; k < kRecenterings; ++k) {
      if (progress.should_stop()) return false;
      progress.at("centerlines", static_cast<double>(k + 1) / (kRecenterings + 2));
      recenter();
      smooth(1.0);
    }
    measure();
    return true;
  }

  CenterlineTree tree() const {
    CenterlineTree tree;
    std::vector<int> number(graph_.nodes.size(), -1);
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      if (graph_.nodes[n].arcs.empty()) continue;
      number[n] = static_cast<int>(tree.nodes.size());
      tree.nodes.push_back(
          {node_name(static_cast<int>(n)), points_.at_mm.col(static_cast<int>(n))});
      const bool is_root = n == 0 || graph_.nodes[n - 1].component != graph_.nodes[n].component;
      if (is_root && graph_.nodes[n].is_end()) tree.inlets.push_back(number[n]);
    }
    std::map<std::string, int> used;
    for (std::size_t a = 0; a < graph_.arcs.size(); ++a) {
      CenterlineBranch branch = branch_of(static_cast<int>(a));
      branch.name = node_name(graph_.arcs[a].to);
      const int times = ++used[branch.name];
      if (times > 1) branch.name += fmt::format("_{}", times);
      branch.from = number[index(graph_.arcs[a].from)];
      branch.to = number[index(graph_.arcs[a].to)];
      set_node(tree, branch.from, branch.points_mm.leftCols<1>());
      set_node(tree, branch.to, branch.points_mm.rightCols<1>());
      tree.branches.push_back(std::move(branch));
    }
    return tree;
  }

 private:
  std::string node_name(int n) const {
    const Voxel& v = graph_.nodes[index(n)].voxel;
    return fmt::format("v{}_{}_{}", v[0], v[1], v[2]);
  }

  static void set_node(CenterlineTree& tree, int n, const Vec3& position) {
    tree.nodes[index(n)].position_mm = position;  // tips have moved; junctions are where they were
  }

  double voxel_mm() const { return graph_.grid.spacing_mm.maxCoeff(); }

  void gather() {
    const SkeletonLabels labels = label_of_graph();
    const AxisRadii radii(mask_, labels);
    std::vector<Voxel> voxels;
    for (const VesselNode& node : graph_.nodes) voxels.push_back(node.voxel);
    for (const VesselArc& arc : graph_.arcs) {
      SmoothingChain chain;
      const auto [begin, end] = kept_part(arc, radii);
      for (std::size_t i = begin; i < end; ++i) {
        if (i == begin && !graph_.nodes[index(arc.from)].is_end()) {
          chain.unknowns.push_back(arc.from);
        } else if (i + 1 == end && !graph_.nodes[index(arc.to)].is_end()) {
          chain.unknowns.push_back(arc.to);
        } else if (i == begin ||
                   i + 1 == end) {  // a free end, perhaps cut back: its node is here now
          const int node = i == begin ? arc.from : arc.to;
          voxels[index(node)] = arc.voxels[i];
          chain.unknowns.push_back(node);
        } else {
          chain.unknowns.push_back(static_cast<int>(voxels.size()));
          voxels.push_back(arc.voxels[i]);
        }
      }
      points_.chains.push_back(std::move(chain));
    }
    const auto n = static_cast<Eigen::Index>(voxels.size());
    points_.voxels_mm.resize(3, n);
    points_.inscribed_mm.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      points_.voxels_mm.col(i) = graph_.grid.world_mm(voxels[static_cast<std::size_t>(i)]);
      points_.inscribed_mm[i] = std::max(radii.at_mm(voxels[static_cast<std::size_t>(i)]),
                                         0.5 * graph_.grid.spacing_mm.minCoeff());
    }
    points_.at_mm = points_.voxels_mm;
    points_.radius_mm = Eigen::VectorXd::Zero(n);
    points_.in_junction.assign(static_cast<std::size_t>(n), false);
    mark_junctions(radii);
  }

  // The graph's voxels as labels know them, for their distances.
  SkeletonLabels label_of_graph() const {
    std::vector<std::size_t> offsets;
    for (const VesselNode& node : graph_.nodes)
      for (const Voxel& v : node.cluster) offsets.push_back(graph_.grid.offset(v));
    for (const VesselArc& arc : graph_.arcs)
      for (const Voxel& v : arc.voxels) offsets.push_back(graph_.grid.offset(v));
    std::sort(offsets.begin(), offsets.end());
    offsets.erase(std::unique(offsets.begin(), offsets.end()), offsets.end());
    return label_skeleton(mask_, std::move(offsets));
  }

  // The part [begin, end) of an arc's voxels without the tails that thinning may have bent into a
  // corner of a free end: a corner of a flat end is sqrt(2) radii from the nearest place that is a
  // radius away from all walls. At least a fifth of the arc is kept.
  std::pair<std::size_t, std::size_t> kept_part(const VesselArc& arc,
                                                const AxisRadii& radii) const {
    const std::size_t count = arc.voxels.size();
    if (options_.tips == TipRule::kSkeleton) return {0, count};
    const auto tail = [&](bool at_front, std::size_t most) {
      const auto voxel = [&](std::size_t i) { return arc.voxels[at_front ? i : count - 1 - i]; };
      const Vec3 tip = graph_.grid.world_mm(voxel(0));
      double radius = 0.0;
      std::size_t bent = 0;
      for (std::size_t i = 0; i <= most; ++i) {
        radius = std::max(radius, radii.at_mm(voxel(i)));
        const double distance = (graph_.grid.world_mm(voxel(i)) - tip).norm();
        if (distance < 1.5 * radius + 2.0 * voxel_mm()) bent = i;
        if (distance > 3.0 * radius + 3.0 * voxel_mm())
          break;  // in a corner the radius grows faster
      }
      return bent;
    };
    const bool free_from = graph_.nodes[index(arc.from)].is_end();
    const bool free_to = graph_.nodes[index(arc.to)].is_end();
    const std::size_t most = (count - 1) * 2 / (free_from && free_to ? 5 : 3);
    return {free_from ? tail(true, most) : 0, count - (free_to ? tail(false, most) : 0)};
  }

  void mark_junctions(const AxisRadii& radii) {
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      const VesselNode& node = graph_.nodes[n];
      if (node.arcs.size() < 3) continue;
      double lumen = 0.0;
      for (const Voxel& v : node.cluster) lumen = std::max(lumen, radii.at_mm(v));
      for (const int a : node.arcs)
        for (const int u : points_.chains[index(a)].unknowns)
          if ((points_.voxels_mm.col(u) - points_.voxels_mm.col(static_cast<int>(n))).norm() <
              lumen)
            points_.in_junction[index(u)] = true;
    }
  }

  // Chains for the solver: a branch that closes on itself bends across its node too.
  std::vector<SmoothingChain> solver_chains() const {
    std::vector<SmoothingChain> chains = points_.chains;
    for (std::size_t a = 0; a < chains.size(); ++a) {
      const VesselArc& arc = graph_.arcs[a];
      std::vector<int>& u = chains[a].unknowns;
      if (arc.from == arc.to && graph_.nodes[index(arc.from)].arcs.size() == 2 && u.size() > 3)
        u.push_back(u[1]);
    }
    return chains;
  }

  void smooth(double factor) {
    SmoothingData data;
    data.measured = points_.at_mm;
    const Eigen::Index n = points_.at_mm.cols();
    data.weight.resize(n);
    data.wavelength.resize(n);
    for (Eigen::Index i = 0; i < n; ++i) {
      data.weight[i] = points_.in_junction[static_cast<std::size_t>(i)] ? kOpenWeight : 1.0;
      if (measured_ && points_.radius_mm[i] == 0.0) data.weight[i] = kOpenWeight;
      data.wavelength[i] = factor * std::max(options_.smoothing_radii * points_.inscribed_mm[i],
                                             options_.smoothing_voxels * voxel_mm());
    }
    points_.at_mm = smooth_on_graph(solver_chains(), data);
    for (Eigen::Index i = 0; i < n; ++i) {
      const double most = std::max(options_.largest_move_radii * points_.inscribed_mm[i],
                                   graph_.grid.spacing_mm.norm());
      const Vec3 move = points_.at_mm.col(i) - points_.voxels_mm.col(i);
      if (move.norm() > most)
        points_.at_mm.col(i) = points_.voxels_mm.col(i) + most / move.norm() * move;
    }
  }

  // Directions along the chains at every inner point and free end.
  Points3 tangents() const {
    Points3 t = Points3::Zero(3, points_.at_mm.cols());
    for (const SmoothingChain& chain : solver_chains()) {
      const std::vector<int>& u = chain.unknowns;
      for (std::size_t i = 0; i < u.size(); ++i) {
        const int before = u[i == 0 ? 0 : i - 1];
        const int after = u[i + 1 == u.size() ? i : i + 1];
        const Vec3 d = points_.at_mm.col(after) - points_.at_mm.col(before);
        if (d.norm() > 0.0) t.col(u[i]) = d.normalized();
      }
    }
    return t;
  }

  LumenSection section_at(Eigen::Index i, const Vec3& tangent) const {
    if (points_.in_junction[static_cast<std::size_t>(i)] || tangent.isZero()) return {};
    return lumen_section(mask_, points_.at_mm.col(i), tangent,
                         kLongestRay * points_.inscribed_mm[i] + voxel_mm());
  }

  template <typename Use>
  void for_sections(const Points3& t, const Use& use) {
    tbb::parallel_for(tbb::blocked_range<Eigen::Index>(0, t.cols(), 16),
                      [&](const tbb::blocked_range<Eigen::Index>& range) {
                        for (Eigen::Index i = range.begin(); i < range.end(); ++i)
                          use(i, section_at(i, t.col(i)));
                      });
  }

  // The slab of voxels that are counted: long enough to level out slices. For radii it is a radius
  // long, so that counts scatter less; for centres no longer than needed, since bends shift them.
  double center_slab_mm() const { return 2.0 * voxel_mm(); }
  double radius_slab_mm(double radius_mm) const { return std::max(radius_mm, 2.0 * voxel_mm()); }

  void recenter() {
    const std::vector<bool> clear = clear_of_junctions([&](int) { return center_slab_mm(); });
    const Points3 t = tangents();
    for_sections(t, [&](Eigen::Index i, const LumenSection& s) {
      points_.radius_mm[i] = s.closed ? s.radius_mm : 0.0;
      if (!s.closed) return;
      points_.at_mm.col(i) =
          clear[static_cast<std::size_t>(i)]
              ? counted_section(mask_, s, points_.at_mm.col(i), t.col(i), center_slab_mm())
                    .center_mm
              : s.center_mm;
    });
    measured_ = true;
  }

  void measure() {
    const Points3 t = tangents();
    points_.counted = Eigen::VectorXd::Zero(t.cols());
    for_sections(t, [&](Eigen::Index i, const LumenSection& s) {
      points_.radius_mm[i] = s.closed ? s.radius_mm : 0.0;
      if (s.closed && s.radius_mm > 0.0)
        points_.counted[i] =
            counted_section(mask_, s, points_.at_mm.col(i), t.col(i), radius_slab_mm(s.radius_mm))
                .radius_mm /
            s.radius_mm;
    });
    const std::vector<bool> clear =
        clear_of_junctions([&](int i) { return radius_slab_mm(points_.radius_mm[i]); });
    for (Eigen::Index i = 0; i < t.cols(); ++i)
      if (!clear[static_cast<std::size_t>(i)]) points_.counted[i] = 0.0;
  }

  // Which points are farther along their branch from every junction's lumen than `reach_mm(point)`:
  // a slab that reaches into a junction holds more than its branch.
  template <typename Reach>
  std::vector<bool> clear_of_junctions(const Reach& reach_mm) const {
    std::vector<bool> clear(points_.in_junction.size(), true);
    for (const SmoothingChain& chain : points_.chains) {
      const std::vector<int>& u = chain.unknowns;
      for (const bool forward : {true, false}) {
        double since = std::numeric_limits<double>::infinity();
        for (std::size_t k = 0; k < u.size(); ++k) {
          const int i = u[forward ? k : u.size() - 1 - k];
          if (k > 0)
            since += (points_.at_mm.col(i) - points_.at_mm.col(u[forward ? k - 1 : u.size() - k]))
                         .norm();
          if (points_.in_junction[index(i)]) since = 0.0;
          if (since < reach_mm(i)) clear[index(i)] = false;
        }
      }
    }
    return clear;
  }

  // Along a chain, by how much the sections' radii fall short of what counting says: the mean over
  // two radii to both sides, since a single count scatters; 1 where nothing is known.
  std::vector<double> corrections_of(const std::vector<int>& u) const {
    std::vector<double> sum(u.size() + 1, 0.0), count(u.size() + 1, 0.0);
    for (std::size_t i = 0; i < u.size(); ++i) {
      sum[i + 1] = sum[i] + points_.counted[u[i]];
      count[i + 1] = count[i] + (points_.counted[u[i]] > 0.0 ? 1.0 : 0.0);
    }
    std::vector<double> correction(u.size(), 1.0);
    std::vector<bool> known(u.size());
    const double pace = graph_.grid.spacing_mm.minCoeff();
    for (std::size_t i = 0; i < u.size(); ++i) {
      const auto reach = static_cast<std::size_t>(
          std::lround(std::max(2.0 * points_.radius_mm[u[i]], 3.0 * voxel_mm()) / pace));
      const std::size_t from = i - std::min(i, reach), to = std::min(u.size(), i + reach + 1);
      known[i] = count[to] > count[from];
      if (known[i]) correction[i] = (sum[to] - sum[from]) / (count[to] - count[from]);
    }
    if (count.back() > 0.0) fill_unknown(correction, known);
    return correction;
  }

  // Radii along a chain: open sections take the value of the nearest closed ones, a median of
  // five removes single outliers, and a running mean over a radius the voxel noise.
  Eigen::VectorXd radii_of(const SmoothingChain& chain) const {
    const std::vector<int>& u = chain.unknowns;
    const auto n = static_cast<std::ptrdiff_t>(u.size());
    std::vector<double> r(u.size());
    std::vector<bool> known(u.size());
    bool any = false;
    for (std::size_t i = 0; i < u.size(); ++i) {
      // A node's section belongs to one branch only where it is a free end.
      const bool is_node = index(u[i]) < graph_.nodes.size() && !graph_.nodes[index(u[i])].is_end();
      known[i] = !is_node && points_.radius_mm[u[i]] > 0.0;
      r[i] = known[i] ? points_.radius_mm[u[i]] : points_.inscribed_mm[u[i]];
      any = any || known[i];
    }
    if (any) fill_unknown(r, known);
    const std::vector<double> correction = corrections_of(u);
    for (std::size_t i = 0; i < u.size(); ++i) r[i] *= correction[i];
    std::vector<double> clean(r);
    for (std::ptrdiff_t i = 0; i < n; ++i) {
      const std::ptrdiff_t w = std::min({std::ptrdiff_t{2}, i, n - 1 - i});
      clean[static_cast<std::size_t>(i)] = median({r.begin() + (i - w), r.begin() + (i + w + 1)});
    }
    Eigen::VectorXd smooth(n);
    for (std::ptrdiff_t i = 0; i < n; ++i) {
      const auto reach = static_cast<std::ptrdiff_t>(std::lround(
          0.5 * clean[static_cast<std::size_t>(i)] / graph_.grid.spacing_mm.minCoeff()));
      const std::ptrdiff_t w = std::min({std::max<std::ptrdiff_t>(1, reach), i, n - 1 - i});
      double sum = 0.0;
      for (std::ptrdiff_t k = i - w; k <= i + w; ++k) sum += clean[static_cast<std::size_t>(k)];
      smooth[i] = sum / static_cast<double>(2 * w + 1);
    }
    return smooth;
  }

  // Linear between known values, constant beyond them.
  static void fill_unknown(std::vector<double>& r, const std::vector<bool>& known) {
    std::optional<std::size_t> last;
    for (std::size_t i = 0; i < r.size(); ++i) {
      if (!known[i]) continue;
      for (std::size_t k = last ? *last + 1 : 0; k < i; ++k) {
        const double s =
            last ? static_cast<double>(k - *last) / static_cast<double>(i - *last) : 1.0;
        r[k] = last ? (1.0 - s) * r[*last] + s * r[i] : r[i];
      }
      last = i;
    }
    for (std::size_t k = *last + 1; k < r.size(); ++k) r[k] = r[*last];
  }

  CenterlineBranch branch_of(int a) const {
    const SmoothingChain& chain = points_.chains[index(a)];
    const Eigen::VectorXd radii = radii_of(chain);
    std::vector<Vec3> points;
    for (const int u : chain.unknowns) points.emplace_back(points_.at_mm.col(u));
    std::vector<double> r(radii.begin(), radii.end());
    const VesselArc& arc = graph_.arcs[index(a)];
    if (options_.tips == TipRule::kFlatCap) {
      if (graph_.nodes[index(arc.to)].is_end()) extend(points, r);
      if (graph_.nodes[index(arc.from)].is_end()) {
        std::reverse(points.begin(), points.end());
        std::reverse(r.begin(), r.end());
        extend(points, r);
        std::reverse(points.begin(), points.end());
        std::reverse(r.begin(), r.end());
      }
    }
    CenterlineBranch branch;
    branch.points_mm.resize(3, static_cast<Eigen::Index>(points.size()));
    for (std::size_t i = 0; i < points.size(); ++i)
      branch.points_mm.col(static_cast<Eigen::Index>(i)) = points[i];
    branch.radii_mm =
        Eigen::Map<const Eigen::VectorXd>(r.data(), static_cast<Eigen::Index>(r.size()));
    return branch;
  }

  // Direction of a polyline at its end, over a radius.
  Vec3 end_direction(const std::vector<Vec3>& points, double radius) const {
    std::size_t k = points.size() - 1;
    while (k > 0 && (points[k] - points.back()).norm() < std::max(radius, 3.0 * voxel_mm())) --k;
    const Vec3 chord = points.back() - points[k];
    return chord.norm() > 0.0 ? chord.normalized() : Vec3(Vec3::Zero());
  }

  // Follows the vessel from the last point on, section by section, while it stays as wide as it
  // was; then adds the mean way to the wall over the last section's disc, so that a flat cap keeps
  // the volume.
  void extend(std::vector<Vec3>& points, std::vector<double>& radii) const {
    const double radius = radii.back();
    const double pace = graph_.grid.spacing_mm.minCoeff();
    const double longest = 2.5 * radius + 2.0 * voxel_mm();
    Vec3 t = end_direction(points, radius);
    if (t.isZero()) return;
    const double most = 3.0 * radius + 3.0 * voxel_mm();  // a tail was cut by half of that at most
    for (double gone = 0.0; gone < most; gone += pace) {
      const Vec3 next = points.back() + pace * t;
      const LumenSection s = lumen_section(mask_, next, t, longest);
      if (!s.closed || s.radius_mm < kFullSection * radius || s.radius_mm * kFullSection > radius)
        break;
      const Vec3 shift = s.center_mm - next;
      points.push_back(
          next + std::min(1.0, kMostShift * pace / std::max(shift.norm(), 1e-3 * pace)) * shift);
      radii.push_back(radius);
      t = end_direction(points, radius);
    }
    const Vec3 tip = points.back();
    const double length = mean_way_to_wall_mm(tip, t, radius, longest);
    const int steps = static_cast<int>(std::ceil(length / pace));
    for (int i = 1; i <= steps; ++i) {
      points.push_back(tip + length * i / steps * t);
      radii.push_back(radius);
    }
  }

  // Rays that share a disc's area evenly (Vogel's spiral).
  double mean_way_to_wall_mm(const Vec3& center, const Vec3& t, double radius,
                             double longest) const {
    constexpr double kGoldenAngle = 2.399963229728653;
    const PlaneBasis basis = plane_basis(t);
    double sum = 0.0;
    for (int ray = 0; ray < kTipRays; ++ray) {
      const double rho = radius * std::sqrt((ray + 0.5) / kTipRays);
      const double angle = ray * kGoldenAngle;
      const Vec3 from = center + rho * (std::cos(angle) * basis.u + std::sin(angle) * basis.v);
      sum += distance_to_wall_mm(mask_, from, t, longest);
    }
    return sum / kTipRays;
  }

  const VesselGraph& graph_;
  const Mask& mask_;
  const CenterlineOptions& options_;
  Points points_;
  bool measured_ = false;
};

}  // namespace

Result<CenterlineTree> centerlines_from_graph(const VesselGraph& graph, const Mask& mask,
                                              const CenterlineOptions& options,
                                              const Progress& progress) {
  EXPECTS(graph.grid.size == mask.grid.size);
  if (graph.arcs.empty())
    return fail({ErrorKind::kBadInput, "the axis has no branch", "mask",
                 fmt::format("{} nodes", graph.nodes.size()),
                 "a vessel must be longer than one voxel"});
  Centerlines centerlines(graph, mask, options);
  if (!centerlines.run(progress)) return fail(cancelled("centerlines"));
  CenterlineTree tree = centerlines.tree();
  const auto lonely = std::count_if(graph.nodes.begin(), graph.nodes.end(),
                                    [](const VesselNode& n) { return n.arcs.empty(); });
  if (lonely > 0)
    tree.assumptions.push_back(
        fmt::format("{} components of a single axis voxel are left out", lonely));
  tree.assumptions.push_back(
      "radii are those of circles with the area of the mask's cross-section, which keep its "
      "volume");
  if (options.tips == TipRule::kFlatCap)
    tree.assumptions.push_back("free ends lie where a flat cap keeps the volume of the mask");
  return tree;
}

std::vector<int> thickest_ends(const VesselGraph& graph, const Mask& mask) {
  std::vector<std::size_t> offsets;               // outer halves of the branches at free ends
  std::vector<std::pair<int, std::size_t>> ends;  // node, where its voxels stop
  for (std::size_t n = 0; n < graph.nodes.size(); ++n) {
    const VesselNode& node = graph.nodes[n];
    if (node.arcs.size() != 1) continue;
    const VesselArc& arc = graph.arcs[index(node.arcs[0])];
    const std::size_t count = arc.voxels.size();
    const bool front = arc.from == static_cast<int>(n);
    for (std::size_t i = 0; i < (count + 1) / 2; ++i)
      offsets.push_back(graph.grid.offset(arc.voxels[front ? i : count - 1 - i]));
    ends.emplace_back(static_cast<int>(n), offsets.size());
  }
  const std::vector<double> distances = boundary_distances_mm(mask, offsets);
  std::map<int, std::pair<double, int>> best;  // by component
  std::size_t begin = 0;
  for (const auto& [n, end] : ends) {
    const double radius = median({distances.begin() + static_cast<std::ptrdiff_t>(begin),
                                  distances.begin() + static_cast<std::ptrdiff_t>(end)});
    begin = end;
    const auto [at, is_new] = best.try_emplace(graph.nodes[index(n)].component, radius, n);
    if (!is_new && radius > at->second.first) at->second = {radius, n};
  }
  std::vector<int> nodes;
  for (const auto& [component, choice] : best) nodes.push_back(choice.second);
  return nodes;
}

}  // namespace angiospline
