#include "recovery/fit/patches.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "kernel/numerics/kkt_system.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

constexpr double kProximal = 0.01;
constexpr double kCoefficients = 1e-3;
constexpr double kShift = 1e-12;      // -eps in the corner of the KKT matrix
constexpr double kLongestStep = 0.3;  // of a control point, in local radii
constexpr int kSteps = 8;
constexpr int kPolish = 10;
constexpr double kSolved = 1e-13;
constexpr double kStartsSmooth = 1e-8;  // residual of a group that is smooth to begin with
constexpr double kWorstAngleDeg = 0.005;
constexpr double kMostTurnedCos = 0.5;
constexpr int kGateSteps = 12;
constexpr double kLeastShare = 0.125;  // of the way, at a time

// The points of a side and of the row next to it, along the side's growing parameter.
using SideRows = std::pair<std::array<int, kPatchSize>, std::array<int, kPatchSize>>;
SideRows side_rows(const std::array<int, kPatchPoints>& control, PatchSide side) {
  SideRows rows;
  for (int k = 0; k < kPatchSize; ++k) {
    const auto point = [&](int i, int j) { return control[index(i * kPatchSize + j)]; };
    switch (side) {
      case PatchSide::kU0:
        rows.first[index(k)] = point(0, k), rows.second[index(k)] = point(1, k);
        break;
      case PatchSide::kU1:
        rows.first[index(k)] = point(5, k), rows.second[index(k)] = point(4, k);
        break;
      case PatchSide::kV0:
        rows.first[index(k)] = point(k, 0), rows.second[index(k)] = point(k, 1);
        break;
      case PatchSide::kV1:
        rows.first[index(k)] = point(k, 5), rows.second[index(k)] = point(k, 4);
        break;
    }
  }
  return rows;
}

// Values and first derivatives of the 36 functions at (u, v).
struct PatchBasis {
  Eigen::Matrix<double, kPatchPoints, 1> value, u, v;
};
PatchBasis patch_basis(const Vec2& uv) {
  static const KnotVector knots = KnotVector::bezier(kPatchSize - 1);
  const BasisValues bu = basis_at(knots, uv.x(), 1);
  const BasisValues bv = basis_at(knots, uv.y(), 1);
  PatchBasis b;
  for (int i = 0; i < kPatchSize; ++i) {
    for (int j = 0; j < kPatchSize; ++j) {
      b.value(i * kPatchSize + j) = bu.values(0, i) * bv.values(0, j);
      b.u(i * kPatchSize + j) = bu.values(1, i) * bv.values(0, j);
      b.v(i * kPatchSize + j) = bu.values(0, i) * bv.values(1, j);
    }
  }
  return b;
}

using PatchNet = Eigen::Matrix<double, 3, kPatchPoints>;
PatchNet patch_net(const JunctionNet& net, const std::array<int, kPatchPoints>& control) {
  PatchNet P;
  for (int k = 0; k < kPatchPoints; ++k) P.col(k) = net.points.col(control[index(k)]);
  return P;
}

// The energy of one patch as a quadratic function of its 108 coordinates: 1/2 p'Hp - r'p.
struct PatchEnergy {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * kPatchPoints, 3 * kPatchPoints);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(3 * kPatchPoints);
  std::vector<std::pair<int, Vec3>> unknowns;  // point of the patch and direction
  std::vector<int> numbers;                    // of the unknowns

  // weight * (sum_k b_k n . p_k - value)^2 / 2
  void add(const Eigen::Matrix<double, kPatchPoints, 1>& b, const Vec3& n, double value,
           double weight) {
    Eigen::VectorXd row(3 * kPatchPoints);
    for (int k = 0; k < kPatchPoints; ++k) row.segment<3>(3 * k) = b(k) * n;
    H.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    r += weight * value * row;
  }
};

class GroupMover {
 public:
  GroupMover(PatchGroup& group, const std::vector<PatchSample>& samples, double share,
             const PatchWeights& weights, double roughness)
      : group_(group),
        share_(share),
        weights_(weights),
        roughness_(roughness),
        coefficients_(best_coefficients(group.edges, group.net)),
        energies_(make_energies(samples)),
        system_(make_system()) {}

  double residual() const {
    return tangent_plane_residual(group_.edges, group_.net, coefficients_).cwiseAbs().maxCoeff();
  }

  // The largest move in local radii; -1: the system could not be solved.
  double step(bool with_energy) {
    system_.clear();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size() + group_.edges.rows);
    std::size_t place = 0;
    for (std::size_t p = 0; p < energies_.size(); ++p) {
      const PatchEnergy& e = energies_[p];
      const PatchNet P = patch_net(group_.net, group_.controls[p]);
      const Eigen::VectorXd g =
          e.H * Eigen::Map<const Eigen::VectorXd>(P.data(), 3 * kPatchPoints) - e.r;
      for (std::size_t a = 0; a < e.unknowns.size(); ++a) {
        const auto& [k, da] = e.unknowns[a];
        if (with_energy) right(e.numbers[a]) -= da.dot(g.segment<3>(3 * k));
        for (std::size_t b = 0; b <= a; ++b) {
          const auto& [l, db] = e.unknowns[b];
          system_.add_hessian(place++, da.dot(e.H.block<3, 3>(3 * k, 3 * l) * db));
        }
      }
    }
    for (std::size_t k = 0; k < group_.net.slots.size(); ++k) {
      const ControlSlot& slot = group_.net.slots[k];
      const double weight = kProximal / (group_.net.scale[k] * group_.net.scale[k]);
      for (int d = 0; d < slot.count; ++d) system_.add_diagonal(slot.first + d, weight);
    }
    for (int k = group_.net.unknowns; k < size(); ++k) system_.add_diagonal(k, kCoefficients);
    system_.clear_jacobian();
    tangent_plane_jacobian(group_.edges, group_.net, coefficients_, entries_);
    for (std::size_t e = 0; e < entries_.size(); ++e) system_.add_jacobian(e, entries_[e].value);
    right.tail(group_.edges.rows) =
        -tangent_plane_residual(group_.edges, group_.net, coefficients_);
    if (!system_.factor(kShift)) return -1;
    const Eigen::VectorXd x = system_.solve(right);
    return x.allFinite() ? move(x) : -1;
  }

 private:
  int size() const { return group_.net.unknowns + group_.edges.coefficients; }

  double move(const Eigen::VectorXd& x) {
    double longest = 0;
    for (std::size_t k = 0; k < group_.net.slots.size(); ++k) {
      const ControlSlot& slot = group_.net.slots[k];
      if (slot.count == 0) continue;
      longest = std::max(longest, x.segment(slot.first, slot.count).norm() / group_.net.scale[k]);
    }
    const double part = std::min(1.0, kLongestStep / std::max(longest, 1e-300));
    group_.net.apply(part * x.head(group_.net.unknowns));
    coefficients_ += part * x.segment(group_.net.unknowns, group_.edges.coefficients);
    return longest;
  }

  std::vector<PatchEnergy> make_energies(const std::vector<PatchSample>& samples) const {
    std::vector<PatchEnergy> energies(group_.patches.size());
    for (const PatchSample& s : samples) {
      const int p = group_.index_of(s.patch);
      if (p < 0) continue;
      const std::array<int, kPatchPoints>& control = group_.controls[index(p)];
      const PatchBasis b = patch_basis(s.uv);
      const PatchNet P = patch_net(group_.net, control);
      double scale = 0;
      for (int k = 0; k < kPatchPoints; ++k) {
        scale += b.value(k) * group_.net.scale[index(control[index(k)])];
      }
      const double per_area = s.weight / (scale * scale);
      PatchEnergy& e = energies[index(p)];
      const Vec3 target = s.point_mm + share_ * s.move_mm;
      const Vec3 normal = ((1 - share_) * s.normal + share_ * s.moved_normal).normalized();
      e.add(b.value, normal, normal.dot(target), weights_.distance * per_area);
      for (int d = 0; d < 3; ++d) {
        e.add(b.value, Vec3::Unit(d), target(d), weights_.anchor * per_area);
      }
      e.add(b.u, normal, 0.0, weights_.tangent * s.weight / (P * b.u).squaredNorm());
      e.add(b.v, normal, 0.0, weights_.tangent * s.weight / (P * b.v).squaredNorm());
    }
    for (std::size_t p = 0; p < energies.size(); ++p) {
      PatchEnergy& e = energies[p];
      add_roughness(p, e);
      e.H = Eigen::MatrixXd(e.H.selfadjointView<Eigen::Lower>());
      for (int k = 0; k < kPatchPoints; ++k) {
        const ControlSlot& slot = group_.net.slots[index(group_.controls[p][index(k)])];
        for (int d = 0; d < slot.count; ++d) {
          e.unknowns.emplace_back(k, slot.count == 1 ? slot.along : Vec3(Vec3::Unit(d)));
          e.numbers.push_back(slot.first + d);
        }
      }
    }
    return energies;
  }

  // Second differences of the move from where the net is now, along both rows.
  void add_roughness(std::size_t p, PatchEnergy& energy) const {
    const PatchNet P = patch_net(group_.net, group_.controls[p]);
    for (int i = 0; i < kPatchSize; ++i) {
      for (int j = 1; j + 1 < kPatchSize; ++j) {
        for (const auto& [middle, step] :
             {std::pair{i * kPatchSize + j, 1}, std::pair{j * kPatchSize + i, kPatchSize}}) {
          const double scale = group_.net.scale[index(group_.controls[p][index(middle)])];
          Eigen::Matrix<double, kPatchPoints, 1> b = Eigen::Matrix<double, kPatchPoints, 1>::Zero();
          b(middle - step) = b(middle + step) = 1;
          b(middle) = -2;
          const Vec3 now = P * b;
          for (int d = 0; d < 3; ++d) {
            energy.add(b, Vec3::Unit(d), now(d), roughness_ / (scale * scale));
          }
        }
      }
    }
  }

  KktSystem make_system() {
    std::vector<KktSystem::Place> hessian, jacobian;
    for (const PatchEnergy& e : energies_) {
      for (std::size_t a = 0; a < e.numbers.size(); ++a) {
        for (std::size_t b = 0; b <= a; ++b) {
          hessian.emplace_back(std::max(e.numbers[a], e.numbers[b]),
                               std::min(e.numbers[a], e.numbers[b]));
        }
      }
    }
    tangent_plane_jacobian(group_.edges, group_.net, coefficients_, entries_);
    for (const JacobianEntry& e : entries_) jacobian.emplace_back(e.row, e.column);
    return KktSystem(size(), group_.edges.rows, hessian, jacobian);
  }

  PatchGroup& group_;
  double share_;  // of the way
  PatchWeights weights_;
  double roughness_;
  Eigen::VectorXd coefficients_;
  std::vector<PatchEnergy> energies_;
  std::vector<JacobianEntry> entries_;
  KktSystem system_;
};

double worst_angle_deg(const PatchGroup& group) {
  static const KnotVector knots = KnotVector::bezier(kPatchSize - 1);
  double worst = 0;
  constexpr int kSamples = 24;
  for (const SmoothEdge& edge : group.edges.edges) {
    for (int s = 0; s <= kSamples; ++s) {
      const BasisValues b = basis_at(knots, static_cast<double>(s) / kSamples, 1);
      Vec3 along = Vec3::Zero(), f = Vec3::Zero(), g = Vec3::Zero();
      for (int k = 0; k < kPatchSize; ++k) {
        const Vec3 h = group.net.points.col(edge.h[index(k)]);
        along += b.values(1, k) * h;
        f += b.values(0, k) * (group.net.points.col(edge.f[index(k)]) - h);
        g += b.values(0, k) * (group.net.points.col(edge.g[index(k)]) - h);
      }
      const Vec3 one = along.cross(f), other = g.cross(along);
      worst = std::max(worst, std::atan2(one.cross(other).norm(), one.dot(other)));
    }
  }
  return worst * 180 / std::numbers::pi;
}

// The edge without its kind.
SmoothEdge edge_of(const PatchGroup& group, const Join& join, int ratio_degree) {
  const auto a = index(group.index_of(join.a.patch)), b = index(group.index_of(join.b.patch));
  SmoothEdge edge;
  edge.scale = 0;
  const SideRows one = side_rows(group.controls[a], join.a.side);
  SideRows other = side_rows(group.controls[b], join.b.side);
  if (join.reversed) std::reverse(other.second.begin(), other.second.end());
  edge.h = one.first;
  edge.f = one.second;
  edge.g = other.second;
  edge.ratio_degree = ratio_degree;
  for (const int id : edge.h) edge.scale += group.net.scale[index(id)] / kPatchSize;
  return edge;
}

void append_edge(PatchGroup& group, SmoothEdge edge) {
  edge.first_coefficient = group.edges.coefficients;
  edge.first_row = group.edges.rows;
  group.edges.coefficients += edge.coefficient_count();
  group.edges.rows += edge.row_count();
  group.edges.edges.push_back(edge);
}

// Moves the net to its samples; what went wrong, or nothing.
std::string move_to_samples(PatchGroup& group, const std::vector<PatchSample>& samples,
                            double share, const PatchWeights& weights, double roughness) {
  GroupMover mover(group, samples, share, weights, roughness);
  for (int k = 0; k < kSteps; ++k) {
    const double moved = mover.step(true);
    if (moved < 0) return "its equations could not be solved";
    if (moved < 1e-3) break;
  }
  double left = mover.residual();
  for (int k = 0; k < kPolish && left > kSolved; ++k) {
    if (mover.step(false) < 0) return "its equations could not be solved";
    const double now = mover.residual();
    if (now > 0.5 * left && now < 1e-10) break;
    left = now;
  }
  return {};
}

// Normals (not normalised) of every patch on a grid.
using PatchNormals = std::vector<std::vector<Vec3>>;
PatchNormals normals_of(const PatchGroup& group) {
  PatchNormals all;
  for (const std::array<int, kPatchPoints>& control : group.controls) {
    const PatchNet P = patch_net(group.net, control);
    std::vector<Vec3> normals;
    for (int i = 0; i <= kGateSteps; ++i) {
      for (int j = 0; j <= kGateSteps; ++j) {
        const PatchBasis b = patch_basis(Vec2(i, j) / kGateSteps);
        normals.push_back((P * b.u).cross(P * b.v));
      }
    }
    all.push_back(std::move(normals));
  }
  return all;
}

double jacobian_ratio(const PatchNormals& normals) {
  double least = std::numeric_limits<double>::infinity();
  for (const std::vector<Vec3>& patch : normals) {
    double smallest = std::numeric_limits<double>::infinity(), sum = 0;
    for (const Vec3& n : patch) {
      smallest = std::min(smallest, n.norm());
      sum += n.norm();
    }
    least = std::min(least, smallest * static_cast<double>(patch.size()) / sum);
  }
  return least;
}

// The first gate that the net does not pass, or nothing.
std::string first_gate_failed(const PatchGroup& group, const PatchNormals& before,
                              double least_jacobian, MovedGroup& figures) {
  const auto normals = normals_of(group);
  figures.jacobian_ratio = jacobian_ratio(normals);
  figures.worst_angle_deg = worst_angle_deg(group);
  double least_cos = 1;
  for (std::size_t p = 0; p < normals.size(); ++p) {
    for (std::size_t k = 0; k < normals[p].size(); ++k) {
      least_cos = std::min(least_cos, normals[p][k].normalized().dot(before[p][k].normalized()));
    }
  }
  if (!(figures.worst_angle_deg <= kWorstAngleDeg)) {
    return fmt::format("normals of neighbouring patches would differ by {:.2g} degrees",
                       figures.worst_angle_deg);
  }
  if (!(figures.jacobian_ratio >= least_jacobian)) {
    return fmt::format("it would fold (Jacobian ratio {:.2g})", figures.jacobian_ratio);
  }
  if (!(least_cos >= kMostTurnedCos)) return "a normal would turn by more than 60 degrees";
  return {};
}

}  // namespace

int PatchGroup::index_of(int patch) const {
  const auto found = std::find(patches.begin(), patches.end(), patch);
  return found == patches.end() ? -1 : static_cast<int>(found - patches.begin());
}

PatchGroup patch_group(const SurfaceNetwork& network, const std::vector<int>& patches) {
  PatchGroup group;
  group.patches = patches;
  std::map<int, int> number;
  for (const int p : patches) {
    std::array<int, kPatchPoints> control;
    for (int k = 0; k < kPatchPoints; ++k) {
      const int column = network.patches[index(p)].control[index(k)];
      const auto [found, added] = number.try_emplace(column, static_cast<int>(number.size()));
      if (added) group.columns.push_back(column);
      control[index(k)] = found->second;
    }
    group.controls.push_back(control);
  }
  group.net.points.resize(3, static_cast<Eigen::Index>(group.columns.size()));
  for (std::size_t k = 0; k < group.columns.size(); ++k) {
    group.net.points.col(static_cast<Eigen::Index>(k)) =
        network.control_points_mm.col(group.columns[k]);
  }
  group.net.slots.assign(group.columns.size(), {-1, 3, Vec3::Zero()});
  group.net.scale.assign(group.columns.size(), std::numeric_limits<double>::infinity());
  return group;
}

void number_unknowns(PatchGroup& group) {
  group.net.unknowns = 0;
  for (ControlSlot& slot : group.net.slots) {
    slot.first = group.net.unknowns;
    group.net.unknowns += slot.count;
  }
}

void add_edge(PatchGroup& group, const Join& join, int ratio_degree) {
  append_edge(group, edge_of(group, join, ratio_degree));
}

void add_leg(PatchGroup& group, const Join& join, int ratio_degree, const Vec3& axis) {
  SmoothEdge edge = edge_of(group, join, ratio_degree);
  edge.from_opening = true;
  edge.axis = axis;
  append_edge(group, edge);
}

bool is_smooth(const PatchGroup& group) {
  const Eigen::VectorXd c = best_coefficients(group.edges, group.net);
  return tangent_plane_residual(group.edges, group.net, c).cwiseAbs().maxCoeff() < kStartsSmooth;
}

double jacobian_ratio(const PatchGroup& group) { return jacobian_ratio(normals_of(group)); }

MovedGroup move_group(PatchGroup& group, const std::vector<PatchSample>& samples,
                      const Points3& start, const PatchWeights& weights,
                      const std::vector<double>& roughness, double least_jacobian) {
  const PatchNormals before = normals_of(group);
  MovedGroup result;
  Points3 sound = group.net.points;
  for (double step = 1.0; result.share < 1 && step >= kLeastShare;) {
    const double share = std::min(1.0, result.share + step);
    MovedGroup tried;
    for (const double r : roughness) {
      group.net.points = sound + (share - result.share) * start;
      tried.failure = move_to_samples(group, samples, share, weights, r);
      if (tried.failure.empty()) {
        tried.failure = first_gate_failed(group, before, least_jacobian, tried);
      }
      if (tried.failure.empty()) break;
    }
    if (tried.failure.empty()) {
      sound = group.net.points;
      tried.share = share;
      tried.failure = result.failure;
      result = tried;
    } else {
      result.failure = tried.failure;
      step /= 2;
    }
  }
  if (result.share >= 1) result.failure.clear();
  group.net.points = sound;
  return result;
}

}  // namespace angiospline
