#include "modeling/junction/layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kCoarse = 5;
constexpr int kFine = 9;
constexpr double kLongestMove = 0.5;    // of a node in one sweep, in sides of the quads around it
constexpr double kSettled = 0.01;       // moves in one sweep that are not worth another
constexpr double kLeastEpsilon = 0.02;  // of area that distortion tells from none

double wrapped(double angle) { return angle - kTurn * std::round(angle / kTurn); }

// Seams near the wanted azimuths whose sectors keep between half and twice
// their equal share.
std::vector<double> bounded_seams(const std::vector<double>& wanted) {
  const std::size_t count = wanted.size();
  const double share = kTurn / static_cast<double>(count);
  const double least = count == 2 ? share : share / 2;
  const double most = count == 2 ? share : std::min(2 * share, std::numbers::pi);
  std::vector<double> sector(count);
  for (std::size_t k = 0; k < count; ++k) {
    const double angle = wrapped(wanted[(k + 1) % count] - wanted[k]);
    sector[k] = angle > 0 ? angle : angle + kTurn;
  }
  for (int pass = 0; pass < 60; ++pass) {
    double sum = 0;
    for (double& s : sector) sum += s = std::clamp(s, least, most);
    for (double& s : sector) s += (kTurn - sum) / static_cast<double>(count);
  }
  std::vector<double> seams(count, 0.0);
  for (std::size_t k = 1; k < count; ++k) seams[k] = seams[k - 1] + sector[k - 1];
  double sine = 0;
  double cosine = 0;
  for (std::size_t k = 0; k < count; ++k) {
    sine += std::sin(wanted[k] - seams[k]);
    cosine += std::cos(wanted[k] - seams[k]);
  }
  const double turn = std::atan2(sine, cosine);
  for (double& s : seams) s += turn;
  return seams;
}

double azimuth(const OpeningFrame& frame, const Vec3& x) {
  const Vec3 arm = x - frame.center;
  return std::atan2(frame.y.dot(arm), frame.x.dot(arm));
}

std::vector<OpeningFrame> start_openings(const JunctionTopology& topology,
                                         const JunctionTarget& target,
                                         const std::vector<Vec3>& poles,
                                         const std::vector<double>& distances) {
  std::vector<OpeningFrame> frames;
  for (std::size_t b = 0; b < topology.sectors.size(); ++b) {
    const TargetBranch& branch = target.branches()[b];
    OpeningFrame frame;
    frame.axis = branch.direction;
    frame.center = branch.start + distances[b] * branch.direction;
    frame.radius = branch.radius;
    // Far enough out that a branch beside the centre sees it on the right side.
    const double reach = branch.radius + branch.start.norm();
    const auto pole = [&](int patch) -> Vec3 {
      return reach * poles[index(topology.patches[index(patch)].from)];
    };
    const Vec3 first = pole(topology.sectors[b].front()) - frame.center;
    const Vec3 across = first - first.dot(frame.axis) * frame.axis;
    frame.x = across.norm() > 1e-6 * reach ? across.normalized() : frame.axis.unitOrthogonal();
    frame.y = frame.axis.cross(frame.x);
    std::vector<double> wanted;
    for (const int patch : topology.sectors[b]) wanted.push_back(azimuth(frame, pole(patch)));
    frame.seams_rad = bounded_seams(wanted);
    frames.push_back(std::move(frame));
  }
  return frames;
}

// Where a saddle crosses between its branches.
struct Crossing {
  Vec3 direction;
  double distance;  // of the crotch of the two cylinders, at most that of the
                    // nearer opening
};

// The ray from the origin to a branch's opening, with its length.
TargetBranch seen_from_origin(const JunctionTarget& target, int branch,
                              const std::vector<double>& distances) {
  TargetBranch seen = target.branches()[index(branch)];
  seen.length = distances[index(branch)];
  if (seen.start.isZero(0)) return seen;
  const Vec3 opening = seen.start + seen.length * seen.direction;
  seen.length = opening.norm();
  seen.direction = opening / seen.length;
  seen.start.setZero();
  return seen;
}

// The crotch of two cylinders lies at the angle beta from a with r_a /
// sin(beta) = r_b / sin(angle
// - beta); a saddle that does not pass between its branches crosses in the
// middle of its Voronoi arc.
Crossing crossing(const JunctionTopology& topology, const JunctionTarget& target,
                  const JunctionSaddle& saddle, const std::vector<double>& distances) {
  const TargetBranch a = seen_from_origin(target, saddle.branch_a, distances);
  const TargetBranch b = seen_from_origin(target, saddle.branch_b, distances);
  const Vec3& from = topology.poles[index(saddle.from)].direction;
  const Vec3& to = topology.poles[index(saddle.to)].direction;
  const Vec3 edge = (b.direction - a.direction).normalized();
  const Vec3 side = -edge.cross(from);  // the arc turns from `from` towards it
  const double arc = std::acos(std::clamp(from.dot(to), -1.0, 1.0));
  const Vec3 sum = a.direction + b.direction;
  const double angle = std::acos(std::clamp(a.direction.dot(b.direction), -1.0, 1.0));
  const double turn = std::atan2(side.dot(sum), from.dot(sum));
  const double nearest = std::min(a.length, b.length);
  if (sum.norm() > 0.5 && turn > 0 && turn < arc) {
    const double raw =
        std::atan2(a.radius * std::sin(angle), b.radius + a.radius * std::cos(angle));
    const double keep =
        angle < std::numbers::pi / 2 ? 0.05 : 0.05 + 0.8 * (angle / std::numbers::pi - 0.5);
    const double beta = std::clamp(raw, keep * angle, (1 - keep) * angle);
    const Vec3 across = (b.direction - std::cos(angle) * a.direction).normalized();
    const double distance = (a.radius + b.radius) / (2 * std::sin(angle / 2));
    return {std::cos(beta) * a.direction + std::sin(beta) * across, std::min(distance, nearest)};
  }
  const Vec3 middle = std::cos(arc / 2) * from + std::sin(arc / 2) * side;
  return {middle, std::min(a.radius, b.radius)};
}

// A pole starts above the mean of the crossings around it.
std::vector<Vec3> start_poles(const JunctionTopology& topology, const JunctionTarget& target,
                              const std::vector<Crossing>& crossings) {
  std::vector<Vec3> sums(topology.poles.size(), Vec3::Zero());
  std::vector<double> lifts(topology.poles.size(), 0.0);
  for (std::size_t s = 0; s < crossings.size(); ++s) {
    const JunctionSaddle& saddle = topology.saddles[s];
    for (const int pole : {saddle.from, saddle.to}) {
      const double count = static_cast<double>(topology.poles[index(pole)].branches.size());
      sums[index(pole)] += crossings[s].distance * crossings[s].direction / count;
      lifts[index(pole)] += (target.branches()[index(saddle.branch_a)].radius +
                          target.branches()[index(saddle.branch_b)].radius) /
                         (2 * count);
    }
  }
  std::vector<Vec3> directions;
  for (std::size_t k = 0; k < sums.size(); ++k) {
    const Vec3& n = topology.poles[k].direction;
    const double up = n.dot(sums[k]);
    const Vec3 along = sums[k] - up * n;
    // A pole on the far side of branches that lean away from it stays there.
    const double share = std::clamp(1 + 2 * up / lifts[k], 0.0, 1.0);
    directions.push_back((share * along + std::max(up, lifts[k]) * n).normalized());
  }
  return directions;
}

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
    for (const OpeningFrame& f : openings_)
      longest_ = std::max(longest_, f.center.norm() + f.radius);
    connect();
    place_openings();
  }

  // Saddles run from pole to pole through their crossings, all lines between
  // them and the openings straight, and everything is moved along rays from the
  // centre onto the target.
  void start(const std::vector<Vec3>& poles, const std::vector<Crossing>& crossings) {
    const int last = grid_.size() - 1;
    for (int p = 0; p < patch_count(); ++p) {
      const JunctionPatch& patch = topology_.patches[index(p)];
      const JunctionSaddle& saddle = topology_.saddles[index(patch.saddle)];
      const bool is_a = saddle.patch_a == p;
      const Vec3 from = target_.on_ray(poles[index(saddle.from)], longest_);
      const Vec3 to = target_.on_ray(poles[index(saddle.to)], longest_);
      const Vec3 middle = target_.on_ray(crossings[index(patch.saddle)].direction, longest_);
      for (int j = 0; j <= last; ++j) {
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
      const double least = 0.5 * std::min(target_.branches()[index(saddle.branch_a)].radius,
                                          target_.branches()[index(saddle.branch_b)].radius);
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
        const double turn = wrapped(azimuth(frame, nodes_.col(leg)) - frame.seams_rad[k]);
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

  // The distortion of the quads around a node, were it at x: at each corner the
  // mean of the squared sides over their aimed lengths, plus an area term, over
  // the signed area, which is kept from zero by epsilon (Garanzha et al. 2021,
  // "Foldover-free maps in 50 lines of code").
  struct Distortion {
    double value = 0;
    Vec3 gradient = Vec3::Zero();
    Mat3 hessian = Mat3::Zero();
  };

  template <bool kWithDerivatives>
  Distortion distortion(int node, const Vec3& x, double epsilon) const {
    static constexpr std::array<std::array<int, 4>, 4> kCorners{
        {{0, 1, 0, 3}, {0, 1, 1, 2}, {3, 2, 1, 2}, {3, 2, 0, 3}}};
    Distortion sum;
    for (const int number : quads_at_[index(node)]) {
      const Quad& quad = quads_[index(number)];
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
        const double area = normal.dot(eu.cross(ev));
        const double root = std::sqrt(epsilon * epsilon + area * area);
        const double chi = area > 0 ? (area + root) / 2 : epsilon * epsilon / (root - area) / 2;
        const double top = (eu.squaredNorm() * per_u + ev.squaredNorm() * per_v) / 2 +
                           options_.area_weight * (area * area + 1) / 2;
        sum.value += top / chi;
        if constexpr (kWithDerivatives) {
          const double chi1 = (1 + area / root) / 2;
          const double chi2 = epsilon * epsilon / (2 * root * root * root);
          const Vec3 d_area = su * ev.cross(normal) + sv * normal.cross(eu);
          const Vec3 d_sides = su * per_u * eu + sv * per_v * ev;
          const Vec3 d_top = d_sides + options_.area_weight * area * d_area;
          sum.gradient += d_top / chi - top * chi1 / (chi * chi) * d_area;
          const double mixed = -chi1 / (chi * chi);
          const double square =
              options_.area_weight / chi + top * (2 * chi1 * chi1 / chi - chi2) / (chi * chi);
          sum.hessian += square * d_area * d_area.transpose() +
                         mixed * (d_top * d_area.transpose() + d_area * d_top.transpose());
          sum.hessian.diagonal().array() += (su * su * per_u + sv * sv * per_v) / chi;
        }
      }
    }
    return sum;
  }

  // One Newton step in the tangent plane, shortened until it helps; its length
  // in sides.
  double improve(int node, double epsilon) {
    const Vec3 x = nodes_.col(node);
    const Vec3 n = normals_.col(node);
    const Distortion now = distortion<true>(node, x, epsilon);
    Eigen::Matrix<double, 3, 2> plane;
    plane.col(0) = n.unitOrthogonal();
    plane.col(1) = n.cross(plane.col(0));
    const Vec2 g = plane.transpose() * now.gradient;
    Eigen::Matrix2d H = plane.transpose() * now.hessian * plane;
    // The least shift that makes H safely positive definite.
    const double middle = H.trace() / 2;
    const double apart = std::hypot((H(0, 0) - H(1, 1)) / 2, H(0, 1));
    const double shift = std::max(0.0, 0.05 * (std::abs(middle) + apart) - (middle - apart));
    H.diagonal().array() += shift;
    Vec3 move = -(plane * H.inverse() * g);
    const double side = shortest_side(node);
    double length = move.norm() / side;
    if (!(length > 0)) return 0;
    if (length > kLongestMove) {
      move *= kLongestMove / length;
      length = kLongestMove;
    }
    for (int attempt = 0; attempt < 4; ++attempt, move /= 3, length /= 3) {
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
  std::vector<Crossing> crossings;
  for (const JunctionSaddle& saddle : topology.saddles) {
    crossings.push_back(crossing(topology, target, saddle, distances));
  }
  const std::vector<Vec3> poles = start_poles(topology, target, crossings);
  Relaxation coarse(topology, target, options, kCoarse,
                    start_openings(topology, target, poles, distances));
  coarse.start(poles, crossings);
  coarse.set_lengths();
  double epsilon = 0.5;
  for (int k = 0; k < options.coarse_sweeps; ++k) {
    coarse.sweep(epsilon);
    epsilon = std::max(kLeastEpsilon, 0.85 * epsilon);
    if (k % 8 == 7 && options.follow > 0) coarse.follow_legs();
    if (k % 10 == 9) coarse.set_lengths();
  }
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
