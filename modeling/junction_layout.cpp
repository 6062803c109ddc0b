#include "modeling/junction_layout.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>

#include "base/contract.h"

namespace angiospline {
namespace {

constexpr double kTurn = 2 * std::numbers::pi;
constexpr int kCoarse = 5;
constexpr int kFine = 9;

std::size_t at(int i) { return static_cast<std::size_t>(i); }

double wrapped(double angle) { return angle - kTurn * std::round(angle / kTurn); }

// Seams near the wanted azimuths whose sectors keep between half and twice their equal share.
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
  return std::atan2(frame.y.dot(x), frame.x.dot(x));
}

std::vector<OpeningFrame> start_openings(const JunctionTopology& topology,
                                         const JunctionTarget& target,
                                         const std::vector<double>& distances) {
  std::vector<OpeningFrame> frames;
  for (std::size_t b = 0; b < topology.sectors.size(); ++b) {
    const TargetBranch& branch = target.branches()[b];
    OpeningFrame frame;
    frame.axis = branch.direction;
    frame.center = distances[b] * branch.direction;
    frame.radius = branch.radius;
    const auto pole = [&](int patch) {
      return topology.poles[at(topology.patches[at(patch)].from)].direction;
    };
    const Vec3 first = pole(topology.sectors[b].front());
    const Vec3 across = first - first.dot(frame.axis) * frame.axis;
    frame.x = across.norm() > 1e-6 ? across.normalized() : frame.axis.unitOrthogonal();
    frame.y = frame.axis.cross(frame.x);
    std::vector<double> wanted;
    for (const int patch : topology.sectors[b]) wanted.push_back(azimuth(frame, pole(patch)));
    frame.seams_rad = bounded_seams(wanted);
    frames.push_back(std::move(frame));
  }
  return frames;
}

// The direction at fraction s of a saddle: the arc of points equally far from both branches.
Vec3 saddle_direction(const JunctionTopology& topology, const JunctionTarget& target,
                      const JunctionSaddle& saddle, double s) {
  const Vec3& from = topology.poles[at(saddle.from)].direction;
  const Vec3& to = topology.poles[at(saddle.to)].direction;
  const Vec3 edge = (target.branches()[at(saddle.branch_b)].direction -
                     target.branches()[at(saddle.branch_a)].direction)
                        .normalized();
  const double angle = std::acos(std::clamp(from.dot(to), -1.0, 1.0));
  return (std::cos(s * angle) * from - std::sin(s * angle) * edge.cross(from)).normalized();
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

  void start_from_directions() {
    const int last = grid_.size() - 1;
    for (int p = 0; p < patch_count(); ++p) {
      const JunctionPatch& patch = topology_.patches[at(p)];
      const JunctionSaddle& saddle = topology_.saddles[at(patch.saddle)];
      const bool is_a = saddle.patch_a == p;
      for (int j = 0; j <= last; ++j) {
        const double s = static_cast<double>(is_a ? j : last - j) / last;
        const Vec3 end = target_.on_ray(saddle_direction(topology_, target_, saddle, s), longest_);
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

  void sweep() {
    for (const int node : movable_) {
      const Vec3 x = nodes_.col(node);
      Vec3 sum = Vec3::Zero();
      double weights = 0;
      for (int k = first_[at(node)]; k < first_[at(node + 1)]; ++k) {
        const Vec3 edge = nodes_.col(neighbour_[at(k)]) - x;
        double weight = edge.squaredNorm();
        for (int root = 0; root < options_.sqrt_count; ++root) weight = std::sqrt(weight);
        sum += weight * edge;
        weights += weight;
      }
      if (!(weights > 0)) continue;
      const Vec3 normal = normals_.col(node);
      Vec3 move = sum / weights;
      move -= normal.dot(move) * normal;
      step_back(node, x + move);
    }
  }

  // Half of the way to where the legs arrive.
  void follow_legs() {
    for (std::size_t b = 0; b < openings_.size(); ++b) {
      OpeningFrame& frame = openings_[b];
      std::vector<double> wanted;
      for (std::size_t k = 0; k < frame.seams_rad.size(); ++k) {
        const int leg = grid_.at(topology_.sectors[b][k], 1, 0);
        const double turn = wrapped(azimuth(frame, nodes_.col(leg)) - frame.seams_rad[k]);
        wanted.push_back(frame.seams_rad[k] + turn / 2);
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

  void connect() {
    std::vector<std::pair<int, int>> edges;
    std::vector<char> fixed(at(grid_.count()), 0);
    const int last = grid_.size() - 1;
    for (int p = 0; p < patch_count(); ++p) {
      for (int i = 0; i <= last; ++i) {
        for (int j = 0; j <= last; ++j) {
          const int node = grid_.at(p, i, j);
          if (i == 0) fixed[at(node)] = 1;
          if (i < last) edges.emplace_back(node, grid_.at(p, i + 1, j));
          if (j < last) edges.emplace_back(node, grid_.at(p, i, j + 1));
        }
      }
    }
    const std::size_t half = edges.size();
    for (std::size_t e = 0; e < half; ++e) edges.emplace_back(edges[e].second, edges[e].first);
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    first_.assign(at(grid_.count() + 1), 0);
    for (const auto& [a, b] : edges) {
      ++first_[at(a + 1)];
      neighbour_.push_back(b);
    }
    for (std::size_t k = 1; k < first_.size(); ++k) first_[k] += first_[k - 1];
    for (int node = 0; node < grid_.count(); ++node) {
      if (!fixed[at(node)]) movable_.push_back(node);
    }
  }

  const JunctionTopology& topology_;
  const JunctionTarget& target_;
  const LayoutOptions& options_;
  SharedGrid grid_;
  std::vector<OpeningFrame> openings_;
  Points3 nodes_;
  Points3 normals_;
  double longest_;
  std::vector<int> first_;
  std::vector<int> neighbour_;
  std::vector<int> movable_;
};

}  // namespace

JunctionLayout relaxed_layout(const JunctionTopology& topology, const JunctionTarget& target,
                              const std::vector<double>& distances, const LayoutOptions& options) {
  EXPECTS(distances.size() == topology.sectors.size());
  static_assert(kFine == 2 * kCoarse - 1);
  Relaxation coarse(topology, target, options, kCoarse,
                    start_openings(topology, target, distances));
  coarse.start_from_directions();
  for (int k = 0; k < options.coarse_sweeps; ++k) {
    coarse.sweep();
    if (k % 6 == 5) coarse.follow_legs();
  }
  const JunctionLayout start = std::move(coarse).result();
  Relaxation fine(topology, target, options, kFine, start.openings);
  fine.start_from(start);
  for (int k = 0; k < options.fine_sweeps; ++k) fine.sweep();
  return std::move(fine).result();
}

}  // namespace angiospline
