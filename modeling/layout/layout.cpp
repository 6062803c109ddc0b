#include "modeling/layout/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/layout/rules.h"
#include "modeling/layout/start.h"

namespace angiospline {
namespace {

using namespace layout_rules;

constexpr double kTurn = 2 * std::numbers::pi;

class Relaxation {
 public:
  Relaxation(const JunctionTopology& topology, const JunctionTarget& target,
             const LayoutOptions& options, int size, std::vector<OpeningFrame> openings)
      : topology_(topology),
        target_(target),
        options_(options),
        grid_(topology, size),
        openings_(std::move(openings)),
        nodes_(3, grid_.count()),
        normals_(3, grid_.count()) {
    longest_ = 0;
    for (const OpeningFrame& f : openings_) {
      longest_ = std::max(longest_, f.center.norm() + f.radius);
    }

    connect();
    place_openings();
  }

  // Saddles run from pole to pole through their crossings, all lines between
  // them and the openings straight, and everything is moved along rays from the
  // centre onto the target.
  void start(const std::vector<Vec3>& poles, const std::vector<SaddleCrossing>& crossings) {
    const int last = grid_.size() - 1;
    for (int p = 0; p < patch_count(); ++p) {
      const JunctionPatch& patch = topology_.patches[index(p)];
      const JunctionSaddle& saddle = topology_.saddles[index(patch.saddle)];
      const bool is_a = saddle.patch_a == p;
      const Vec3 from = target_.on_ray(poles[index(saddle.from)], longest_);
      const Vec3 to = target_.on_ray(poles[index(saddle.to)], longest_);
      const Vec3 middle = target_.on_ray(crossings[index(patch.saddle)].direction, longest_);

      for (int j = 0; j <= last; ++j) {
        // The parabola through both poles and the crossing.
        const double s = static_cast<double>(is_a ? j : last - j) / last;
        const Vec3 on_arc =
            (1 - s) * (1 - 2 * s) * from + 4 * s * (1 - s) * middle + s * (2 * s - 1) * to;
        const Vec3 end = target_.on_ray(on_arc.normalized(), longest_);
        const Vec3 start = nodes_.col(grid_.at(p, 0, j));
        for (int i = 1; i <= last; ++i) {
          const double u = static_cast<double>(i) / last;
          const Vec3 chord = (1 - u) * start + u * end;
          set(grid_.at(p, i, j), target_.on_ray(chord.normalized(), longest_));
        }
      }
    }
  }

  // From a mesh of half as many quads a side.
  void start_from(const JunctionLayout& coarse) {
    const int last = grid_.size() - 1;
    for (int p = 0; p < patch_count(); ++p) {
      // Means of the coarse nodes around, put back on the target.
      for (int i = 1; i <= last; ++i) {
        for (int j = 0; j <= last; ++j) {
          Vec3 sum = Vec3::Zero();
          for (const int di : {0, i % 2}) {
            for (const int dj : {0, j % 2}) {
              sum += coarse.nodes.col(coarse.grid.at(p, i / 2 + di, j / 2 + dj)) / 4;
            }
          }
          step_back(grid_.at(p, i, j), sum);
        }
      }
    }
  }

  // Lengths of the quads' sides that the mesh aims at: those of its legs,
  // saddles and openings now, none shorter than half a radius, so that no patch
  // dwindles.
  void set_lengths() {
    const int last = grid_.size() - 1;
    const auto length = [&](int p, bool along_u, int line) {
      double sum = 0;
      for (int k = 0; k < last; ++k) {
        const int a = along_u ? grid_.at(p, k, line) : grid_.at(p, line, k);
        const int b = along_u ? grid_.at(p, k + 1, line) : grid_.at(p, line, k + 1);
        sum += (nodes_.col(b) - nodes_.col(a)).norm();
      }
      return sum;
    };

    for (Quad& quad : quads_) {
      const JunctionPatch& patch = topology_.patches[index(quad.patch)];
      const JunctionSaddle& saddle = topology_.saddles[index(patch.saddle)];
      const double least = kLeastSide * std::min(target_.branches()[index(saddle.branch_a)].radius,
                                                 target_.branches()[index(saddle.branch_b)].radius);

      // Between the sides of the patch by the quad's place, as in a ruled surface.
      const double u = (quad.i + 0.5) / last;
      const double v = (quad.j + 0.5) / last;
      const double along_u = (1 - v) * std::max(least, length(quad.patch, true, 0)) +
                             v * std::max(least, length(quad.patch, true, last));
      const double ridge = std::max(least, length(quad.patch, false, last));
      const double along_v = (1 - u) * length(quad.patch, false, 0) + u * ridge;
      quad.length_u = along_u / last;
      quad.length_v = along_v / last;
    }
  }

  // The farthest that a node moved, in sides of the quads around it.
  double sweep(double epsilon) {
    double farthest = 0;
    for (const int node : movable_) farthest = std::max(farthest, improve(node, epsilon));
    return farthest;
  }

  // Part of the way to where the legs arrive.
  void follow_legs() {
    for (std::size_t b = 0; b < openings_.size(); ++b) {
      OpeningFrame& frame = openings_[b];
      std::vector<double> wanted;
      for (std::size_t k = 0; k < frame.seams_rad.size(); ++k) {
        const int leg = grid_.at(topology_.sectors[b][k], 1, 0);
        const double turn =
            wrapped_angle(opening_azimuth(frame, nodes_.col(leg)) - frame.seams_rad[k]);
        wanted.push_back(frame.seams_rad[k] + options_.follow * turn);
      }
      frame.seams_rad = bounded_seams(wanted);
    }
    place_openings();
  }

  JunctionLayout result() && {
    return {grid_, std::move(nodes_), std::move(normals_), std::move(openings_)};
  }

 private:
  int patch_count() const { return static_cast<int>(topology_.patches.size()); }

  void set(int node, const Vec3& x) {
    nodes_.col(node) = x;
    normals_.col(node) = target_.foot(x).normal;
  }

  void step_back(int node, const Vec3& x) {
    const JunctionTarget::Foot foot = target_.foot(x);
    nodes_.col(node) = x - foot.distance * foot.normal;
    normals_.col(node) = foot.normal;
  }

  void place_openings() {
    const int last = grid_.size() - 1;
    for (std::size_t b = 0; b < openings_.size(); ++b) {
      const OpeningFrame& frame = openings_[b];
      const std::size_t count = frame.seams_rad.size();

      // From seam to seam; the last sector closes the turn.
      for (std::size_t k = 0; k < count; ++k) {
        const double from = frame.seams_rad[k];
        const double to = k + 1 < count ? frame.seams_rad[k + 1] : frame.seams_rad[0] + kTurn;
        for (int j = 0; j < last; ++j) {
          const Vec3 out = frame.direction(from + (to - from) * j / last);
          const int node = grid_.at(topology_.sectors[b][k], 0, j);
          nodes_.col(node) = frame.center + frame.radius * out;
          normals_.col(node) = out;
        }
      }
    }
  }

  struct Quad {
    std::array<int, 4> nodes;  // (i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)
    int patch, i, j;
    double length_u = 1, length_v = 1;
  };

  void connect() {
    std::vector<char> fixed(index(grid_.count()), 0);
    const int last = grid_.size() - 1;
    quads_at_.resize(index(grid_.count()));
    for (int p = 0; p < patch_count(); ++p) {
      for (int j = 0; j <= last; ++j) fixed[index(grid_.at(p, 0, j))] = 1;
      for (int i = 0; i < last; ++i) {
        for (int j = 0; j < last; ++j) {
          const Quad quad{{grid_.at(p, i, j), grid_.at(p, i + 1, j), grid_.at(p, i + 1, j + 1),
                           grid_.at(p, i, j + 1)},
                          p,
                          i,
                          j};
          for (const int node : quad.nodes)
            quads_at_[index(node)].push_back(static_cast<int>(quads_.size()));
          quads_.push_back(quad);
        }
      }
    }

    for (int node = 0; node < grid_.count(); ++node) {
      if (!fixed[index(node)]) movable_.push_back(node);
    }
  }

  // The distortion of the quads around a node, were it at x: at each corner the mean of the squared
  // sides over their aimed lengths, plus an area term, over the signed area, which is kept from
  // zero by epsilon (Garanzha et al. 2021).
  struct Distortion {
    double value = 0;
    Vec3 gradient = Vec3::Zero();
    Mat3 hessian = Mat3::Zero();
  };

  // One corner of a quad: its sides e_u and e_v, and by how much of the node's move they grow.
  struct Corner {
    Vec3 eu, ev;
    int su, sv;
    double per_u, per_v;  // 1 over the squares of the aimed lengths
  };

  template <bool kWithDerivatives>
  Distortion distortion(int node, const Vec3& x, double epsilon) const {
    static constexpr std::array<std::array<int, 4>, 4> kCorners{
        {{0, 1, 0, 3}, {0, 1, 1, 2}, {3, 2, 1, 2}, {3, 2, 0, 3}}};
    Distortion sum;
    for (const int number : quads_at_[index(node)]) {
      const Quad& quad = quads_[index(number)];

      // Areas are those seen along the mean of the target's normals, over what is aimed at.
      std::array<Vec3, 4> corner;
      Vec3 normal = Vec3::Zero();
      int mine = 0;
      for (std::size_t k = 0; k < 4; ++k) {
        corner[k] = nodes_.col(quad.nodes[k]);
        normal += normals_.col(quad.nodes[k]);
        if (quad.nodes[k] == node) mine = static_cast<int>(k);
      }
      corner[index(mine)] = x;
      normal /= normal.norm() * quad.length_u * quad.length_v;

      const double per_u = 1 / (quad.length_u * quad.length_u);
      const double per_v = 1 / (quad.length_v * quad.length_v);
      for (const auto& [u0, u1, v0, v1] : kCorners) {
        const int su = (u1 == mine) - (u0 == mine);
        const int sv = (v1 == mine) - (v0 == mine);
        if (su == 0 && sv == 0) continue;
        const Vec3 eu = corner[index(u1)] - corner[index(u0)];
        const Vec3 ev = corner[index(v1)] - corner[index(v0)];
        add_corner<kWithDerivatives>({eu, ev, su, sv, per_u, per_v}, normal, epsilon, sum);
      }
    }
    return sum;
  }

  // top / chi, chi(a) = (a + sqrt(epsilon^2 + a^2)) / 2 in place of the area a: positive even where
  // the quad is turned over, so that a fold has a finite value and a way out.
  template <bool kWithDerivatives>
  void add_corner(const Corner& c, const Vec3& normal, double epsilon, Distortion& sum) const {
    const double area = normal.dot(c.eu.cross(c.ev));
    const double root = std::sqrt(epsilon * epsilon + area * area);
    const double chi = area > 0 ? (area + root) / 2 : epsilon * epsilon / (root - area) / 2;
    const double top = (c.eu.squaredNorm() * c.per_u + c.ev.squaredNorm() * c.per_v) / 2 +
                       options_.area_weight * (area * area + 1) / 2;
    sum.value += top / chi;
    if constexpr (!kWithDerivatives) return;

    const double chi1 = (1 + area / root) / 2;
    const double chi2 = epsilon * epsilon / (2 * root * root * root);
    const Vec3 d_area = c.su * c.ev.cross(normal) + c.sv * normal.cross(c.eu);
    const Vec3 d_sides = c.su * c.per_u * c.eu + c.sv * c.per_v * c.ev;
    const Vec3 d_top = d_sides + options_.area_weight * area * d_area;
    sum.gradient += d_top / chi - top * chi1 / (chi * chi) * d_area;

    const double mixed = -chi1 / (chi * chi);
    const double square =
        options_.area_weight / chi + top * (2 * chi1 * chi1 / chi - chi2) / (chi * chi);
    sum.hessian += square * d_area * d_area.transpose() +
                   mixed * (d_top * d_area.transpose() + d_area * d_top.transpose());
    sum.hessian.diagonal().array() += (c.su * c.su * c.per_u + c.sv * c.sv * c.per_v) / chi;
  }

  // One Newton step in the tangent plane, shortened until it helps; its length
  // in sides.
  double improve(int node, double epsilon) {
    const Vec3 x = nodes_.col(node);
    const Vec3 n = normals_.col(node);
    const Distortion now = distortion<true>(node, x, epsilon);

    // The node stays on the target to first order: a problem in two unknowns.
    Eigen::Matrix<double, 3, 2> plane;
    plane.col(0) = n.unitOrthogonal();
    plane.col(1) = n.cross(plane.col(0));
    const Vec2 g = plane.transpose() * now.gradient;
    Eigen::Matrix2d H = plane.transpose() * now.hessian * plane;

    // The least shift that makes H safely positive definite.
    const double middle = H.trace() / 2;
    const double apart = std::hypot((H(0, 0) - H(1, 1)) / 2, H(0, 1));
    const double shift =
        std::max(0.0, kLeastEigenvalue * (std::abs(middle) + apart) - (middle - apart));
    H.diagonal().array() += shift;

    Vec3 move = -(plane * H.inverse() * g);
    const double side = shortest_side(node);
    double length = move.norm() / side;
    if (!(length > 0)) return 0;
    if (length > kLongestMove) {
      move *= kLongestMove / length;
      length = kLongestMove;
    }

    for (int attempt = 0; attempt < kShortenings; ++attempt, move /= 3, length /= 3) {
      if (distortion<false>(node, x + move, epsilon).value < now.value) {
        step_back(node, x + move);
        return length;
      }
    }
    return 0;
  }

  // Of the aimed lengths around a node.
  double shortest_side(int node) const {
    double least = std::numeric_limits<double>::infinity();
    for (const int number : quads_at_[index(node)]) {
      least = std::min({least, quads_[index(number)].length_u, quads_[index(number)].length_v});
    }
    return least;
  }

  const JunctionTopology& topology_;
  const JunctionTarget& target_;
  const LayoutOptions& options_;
  SharedGrid grid_;
  std::vector<OpeningFrame> openings_;
  Points3 nodes_;
  Points3 normals_;
  double longest_;
  std::vector<Quad> quads_;
  std::vector<std::vector<int>> quads_at_;
  std::vector<int> movable_;
};

}  // namespace

JunctionLayout relaxed_layout(const JunctionTopology& topology, const JunctionTarget& target,
                              const std::vector<double>& distances, const LayoutOptions& options) {
  EXPECTS(distances.size() == topology.sectors.size());
  static_assert(kFine == 2 * kCoarse - 1);
  const LayoutStart begin = layout_start(topology, target, distances);

  // On few nodes, where moves go far: folds come undone while epsilon is large, and as it falls
  // distortion counts more and more for what it is.
  Relaxation coarse(topology, target, options, kCoarse, begin.openings);
  coarse.start(begin.poles, begin.crossings);
  coarse.set_lengths();
  double epsilon = kFirstEpsilon;
  for (int k = 0; k < options.coarse_sweeps; ++k) {
    coarse.sweep(epsilon);
    epsilon = std::max(kLeastEpsilon, kEpsilonFall * epsilon);
    if (k % kFollowEvery == kFollowEvery - 1 && options.follow > 0) coarse.follow_legs();
    if (k % kLengthsEvery == kLengthsEvery - 1) coarse.set_lengths();
  }

  // On the nodes that the net is fitted to; openings stay as they are now.
  const JunctionLayout start = std::move(coarse).result();
  Relaxation fine(topology, target, options, kFine, start.openings);
  fine.start_from(start);
  fine.set_lengths();
  for (int k = 0; k < options.fine_sweeps; ++k) {
    if (fine.sweep(kLeastEpsilon) < kSettled) break;
  }
  return std::move(fine).result();
}

}  // namespace angiospline
