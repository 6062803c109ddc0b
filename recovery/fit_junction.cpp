#include "recovery/fit_junction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "kernel/basis.h"
#include "modeling/junction_unknowns.h"
#include "modeling/kkt_system.h"
#include "modeling/tangent_plane_rows.h"

namespace angiospline {
namespace {

constexpr int kSize = 6;
constexpr int kPoints = kSize * kSize;
constexpr double kDistance = 10.0;  // weights of the squared terms at each sample, in radii
constexpr double kAnchor = 0.2;
constexpr double kTangent = 0.5;
// Second differences of the net's move: the first that passes every gate.
constexpr std::array<double, 3> kRoughness{0.002, 0.03, 0.5};
constexpr double kProximal = 0.01;
constexpr double kCoefficients = 1e-3;
constexpr double kShift = 1e-12;      // -eps in the corner of the KKT matrix
constexpr double kLongestStep = 0.3;  // of a control point, in local radii
constexpr int kSteps = 8;
constexpr int kPolish = 10;
constexpr double kSolved = 1e-13;
constexpr double kStartsSmooth = 1e-8;  // residual of a junction that is smooth to begin with
constexpr double kWorstAngleDeg = 0.005;
constexpr double kLeastJacobian = 0.03;
constexpr double kMostTurnedCos = 0.5;
constexpr int kGateSteps = 12;

std::size_t at(Eigen::Index i) { return static_cast<std::size_t>(i); }

// The junction with its own numbers, ready for the tangent plane rows.
struct LocalJunction {
  JunctionNet net{SharedGrid(JunctionTopology{}, kSize), {}, {}, {}, 0};
  std::vector<int> columns;                        // of the pool, for each point
  std::vector<int> patches;                        // of the network
  std::vector<std::array<int, kPoints>> controls;  // points of each patch
  SmoothEdges edges;

  int patch_index(int patch) const {
    const auto found = std::find(patches.begin(), patches.end(), patch);
    return found == patches.end() ? -1 : static_cast<int>(found - patches.begin());
  }
};

void number_points(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                   LocalJunction& local) {
  std::map<int, int> number;
  for (const StripRing& ring : rings) {
    for (const int p : ring.patches) {
      local.patches.push_back(p);
      std::array<int, kPoints> control;
      for (int k = 0; k < kPoints; ++k) {
        const int column = network.patches[at(p)].control[at(k)];
        const auto [found, added] = number.try_emplace(column, static_cast<int>(number.size()));
        if (added) local.columns.push_back(column);
        control[at(k)] = found->second;
      }
      local.controls.push_back(control);
    }
  }
  local.net.points.resize(3, static_cast<Eigen::Index>(local.columns.size()));
  for (std::size_t k = 0; k < local.columns.size(); ++k) {
    local.net.points.col(static_cast<Eigen::Index>(k)) =
        network.control_points_mm.col(local.columns[k]);
  }
}

// Slots of all points; the axis of each ring, or nothing if its second row does not follow one.
std::optional<std::vector<Vec3>> free_points(const SurfaceNetwork& network,
                                             const std::vector<StripRing>& rings,
                                             LocalJunction& local) {
  JunctionNet& net = local.net;
  net.slots.assign(local.columns.size(), {-1, 3, Vec3::Zero()});
  net.scale.assign(local.columns.size(), std::numeric_limits<double>::infinity());
  std::vector<Vec3> axes;
  std::size_t first = 0;
  for (const StripRing& ring : rings) {
    Vec3 axis = Vec3::Zero(), center = Vec3::Zero();
    for (int c = 0; c < ring.points(); ++c) {
      const Vec3 rim = network.control_points_mm.col(ring.columns(0, c));
      axis += rim - network.control_points_mm.col(ring.columns(1, c));
      center += rim / ring.points();
    }
    axis.normalize();
    double radius = 0;
    for (int c = 0; c < ring.points(); ++c) {
      const Vec3 rim = network.control_points_mm.col(ring.columns(0, c));
      const Vec3 step = rim - network.control_points_mm.col(ring.columns(1, c));
      if (step.cross(axis).norm() > 1e-7 * step.norm() || step.dot(axis) <= 0) return {};
      radius += (rim - center).norm() / ring.points();
    }
    for (std::size_t k = 0; k < ring.patches.size(); ++k) {
      const std::array<int, kPoints>& control = local.controls[first + k];
      for (int i = 0; i < kSize; ++i) {
        for (int j = 0; j < kSize; ++j) {
          const std::size_t id = at(control[at(i * kSize + j)]);
          net.scale[id] = std::min(net.scale[id], radius);
          if (i <= 1) net.slots[id] = {-1, i, -axis};
        }
      }
      axes.push_back(axis);  // one for each patch, in the order of local.patches
    }
    first += ring.patches.size();
  }
  for (ControlSlot& slot : net.slots) {
    slot.first = net.unknowns;
    net.unknowns += slot.count;
  }
  return axes;
}

// The points of a side and of the row next to it, along the side's growing parameter.
using SideRows = std::pair<std::array<int, kSize>, std::array<int, kSize>>;
SideRows side_rows(const std::array<int, kPoints>& control, PatchSide side) {
  SideRows rows;
  for (int k = 0; k < kSize; ++k) {
    const auto point = [&](int i, int j) { return control[at(i * kSize + j)]; };
    switch (side) {
      case PatchSide::kU0:
        rows.first[at(k)] = point(0, k), rows.second[at(k)] = point(1, k);
        break;
      case PatchSide::kU1:
        rows.first[at(k)] = point(5, k), rows.second[at(k)] = point(4, k);
        break;
      case PatchSide::kV0:
        rows.first[at(k)] = point(k, 0), rows.second[at(k)] = point(k, 1);
        break;
      case PatchSide::kV1:
        rows.first[at(k)] = point(k, 5), rows.second[at(k)] = point(k, 4);
        break;
    }
  }
  return rows;
}

// The equations of all inner edges; false if one is not a leg or a saddle.
bool make_edges(const SurfaceNetwork& network, const std::vector<Vec3>& axes,
                LocalJunction& local) {
  const EdgeDegrees degrees;
  for (const Join& join : network.joins) {
    const int a = local.patch_index(join.a.patch);
    const int b = local.patch_index(join.b.patch);
    if (a < 0 || b < 0) continue;
    const bool leg = (join.a.side == PatchSide::kV0 && join.b.side == PatchSide::kV1) ||
                     (join.a.side == PatchSide::kV1 && join.b.side == PatchSide::kV0);
    const bool saddle = join.a.side == PatchSide::kU1 && join.b.side == PatchSide::kU1;
    if (!leg && !saddle) return false;
    SmoothEdge edge;
    const SideRows one = side_rows(local.controls[at(a)], join.a.side);
    SideRows other = side_rows(local.controls[at(b)], join.b.side);
    if (join.reversed) std::reverse(other.second.begin(), other.second.end());
    edge.h = one.first;
    edge.f = one.second;
    edge.g = other.second;
    edge.from_opening = leg;
    edge.ratio_degree = leg ? degrees.leg : degrees.saddle;
    if (leg) edge.axis = axes[at(a)];
    double scale = 0;
    for (const int id : edge.h) scale += local.net.scale[at(id)] / kSize;
    edge.scale = scale;
    edge.first_coefficient = local.edges.coefficients;
    edge.first_row = local.edges.rows;
    local.edges.coefficients += edge.coefficient_count();
    local.edges.rows += edge.row_count();
    local.edges.edges.push_back(edge);
  }
  return !local.edges.edges.empty();
}

// Values and first derivatives of the 36 functions at (u, v).
struct PatchBasis {
  Eigen::Matrix<double, kPoints, 1> value, u, v;
};
PatchBasis patch_basis(const Vec2& uv) {
  static const KnotVector knots = KnotVector::bezier(kSize - 1);
  const BasisValues bu = basis_at(knots, uv.x(), 1);
  const BasisValues bv = basis_at(knots, uv.y(), 1);
  PatchBasis b;
  for (int i = 0; i < kSize; ++i) {
    for (int j = 0; j < kSize; ++j) {
      b.value(i * kSize + j) = bu.values(0, i) * bv.values(0, j);
      b.u(i * kSize + j) = bu.values(1, i) * bv.values(0, j);
      b.v(i * kSize + j) = bu.values(0, i) * bv.values(1, j);
    }
  }
  return b;
}

using PatchNet = Eigen::Matrix<double, 3, kPoints>;
PatchNet patch_net(const JunctionNet& net, const std::array<int, kPoints>& control) {
  PatchNet P;
  for (int k = 0; k < kPoints; ++k) P.col(k) = net.points.col(control[at(k)]);
  return P;
}

// The energy of one patch as a quadratic function of its 108 coordinates: 1/2 p'Hp - r'p.
struct PatchEnergy {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * kPoints, 3 * kPoints);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(3 * kPoints);
  std::vector<std::pair<int, Vec3>> unknowns;  // point of the patch and direction
  std::vector<int> numbers;                    // of the unknowns

  // weight * (sum_k b_k n . p_k - value)^2 / 2
  void add(const Eigen::Matrix<double, kPoints, 1>& b, const Vec3& n, double value, double weight) {
    Eigen::VectorXd row(3 * kPoints);
    for (int k = 0; k < kPoints; ++k) row.segment<3>(3 * k) = b(k) * n;
    H.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    r += weight * value * row;
  }
};

class JunctionMover {
 public:
  JunctionMover(LocalJunction& local, const std::vector<JunctionSample>& samples, double roughness)
      : local_(local),
        roughness_(roughness),
        coefficients_(best_coefficients(local.edges, local.net)),
        energies_(make_energies(samples)),
        system_(make_system()) {}

  double residual() const {
    return tangent_plane_residual(local_.edges, local_.net, coefficients_).cwiseAbs().maxCoeff();
  }

  // The largest move in local radii; -1: the system could not be solved.
  double step(bool with_energy) {
    system_.clear();
    Eigen::VectorXd right = Eigen::VectorXd::Zero(size() + local_.edges.rows);
    std::size_t place = 0;
    for (std::size_t p = 0; p < energies_.size(); ++p) {
      const PatchEnergy& e = energies_[p];
      const PatchNet P = patch_net(local_.net, local_.controls[p]);
      const Eigen::VectorXd g =
          e.H * Eigen::Map<const Eigen::VectorXd>(P.data(), 3 * kPoints) - e.r;
      for (std::size_t a = 0; a < e.unknowns.size(); ++a) {
        const auto& [k, da] = e.unknowns[a];
        if (with_energy) right(e.numbers[a]) -= da.dot(g.segment<3>(3 * k));
        for (std::size_t b = 0; b <= a; ++b) {
          const auto& [l, db] = e.unknowns[b];
          system_.add_hessian(place++, da.dot(e.H.block<3, 3>(3 * k, 3 * l) * db));
        }
      }
    }
    for (std::size_t k = 0; k < local_.net.slots.size(); ++k) {
      const ControlSlot& slot = local_.net.slots[k];
      const double weight = kProximal / (local_.net.scale[k] * local_.net.scale[k]);
      for (int d = 0; d < slot.count; ++d) system_.add_diagonal(slot.first + d, weight);
    }
    for (int k = local_.net.unknowns; k < size(); ++k) system_.add_diagonal(k, kCoefficients);
    system_.clear_jacobian();
    tangent_plane_jacobian(local_.edges, local_.net, coefficients_, entries_);
    for (std::size_t e = 0; e < entries_.size(); ++e) system_.add_jacobian(e, entries_[e].value);
    right.tail(local_.edges.rows) =
        -tangent_plane_residual(local_.edges, local_.net, coefficients_);
    if (!system_.factor(kShift)) return -1;
    const Eigen::VectorXd x = system_.solve(right);
    return x.allFinite() ? move(x) : -1;
  }

 private:
  int size() const { return local_.net.unknowns + local_.edges.coefficients; }

  double move(const Eigen::VectorXd& x) {
    double longest = 0;
    for (std::size_t k = 0; k < local_.net.slots.size(); ++k) {
      const ControlSlot& slot = local_.net.slots[k];
      if (slot.count == 0) continue;
      longest = std::max(longest, x.segment(slot.first, slot.count).norm() / local_.net.scale[k]);
    }
    const double part = std::min(1.0, kLongestStep / std::max(longest, 1e-300));
    local_.net.apply(part * x.head(local_.net.unknowns));
    coefficients_ += part * x.segment(local_.net.unknowns, local_.edges.coefficients);
    return longest;
  }

  std::vector<PatchEnergy> make_energies(const std::vector<JunctionSample>& samples) const {
    std::vector<PatchEnergy> energies(local_.patches.size());
    for (const JunctionSample& s : samples) {
      const int p = local_.patch_index(s.patch);
      if (p < 0) continue;
      const std::array<int, kPoints>& control = local_.controls[at(p)];
      const PatchBasis b = patch_basis(s.uv);
      const PatchNet P = patch_net(local_.net, control);
      double scale = 0;
      for (int k = 0; k < kPoints; ++k) {
        scale += b.value(k) * local_.net.scale[at(control[at(k)])];
      }
      const double per_area = s.weight / (scale * scale);
      PatchEnergy& e = energies[at(p)];
      e.add(b.value, s.normal, s.normal.dot(s.target_mm), kDistance * per_area);
      for (int d = 0; d < 3; ++d) {
        e.add(b.value, Vec3::Unit(d), s.target_mm(d), kAnchor * per_area);
      }
      e.add(b.u, s.normal, 0.0, kTangent * s.weight / (P * b.u).squaredNorm());
      e.add(b.v, s.normal, 0.0, kTangent * s.weight / (P * b.v).squaredNorm());
    }
    for (std::size_t p = 0; p < energies.size(); ++p) {
      PatchEnergy& e = energies[p];
      add_roughness(p, e);
      e.H = Eigen::MatrixXd(e.H.selfadjointView<Eigen::Lower>());
      for (int k = 0; k < kPoints; ++k) {
        const ControlSlot& slot = local_.net.slots[at(local_.controls[p][at(k)])];
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
    const PatchNet P = patch_net(local_.net, local_.controls[p]);
    for (int i = 0; i < kSize; ++i) {
      for (int j = 1; j + 1 < kSize; ++j) {
        for (const auto& [middle, step] :
             {std::pair{i * kSize + j, 1}, std::pair{j * kSize + i, kSize}}) {
          const double scale = local_.net.scale[at(local_.controls[p][at(middle)])];
          Eigen::Matrix<double, kPoints, 1> b = Eigen::Matrix<double, kPoints, 1>::Zero();
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
    tangent_plane_jacobian(local_.edges, local_.net, coefficients_, entries_);
    for (const JacobianEntry& e : entries_) jacobian.emplace_back(e.row, e.column);
    return KktSystem(size(), local_.edges.rows, hessian, jacobian);
  }

  LocalJunction& local_;
  double roughness_;
  Eigen::VectorXd coefficients_;
  std::vector<PatchEnergy> energies_;
  std::vector<JacobianEntry> entries_;
  KktSystem system_;
};

// Normals (not normalised) of every patch on a grid.
std::vector<std::vector<Vec3>> normals_of(const LocalJunction& local) {
  std::vector<std::vector<Vec3>> all;
  for (const std::array<int, kPoints>& control : local.controls) {
    const PatchNet P = patch_net(local.net, control);
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

double jacobian_ratio(const std::vector<std::vector<Vec3>>& normals) {
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

double worst_angle_deg(const LocalJunction& local) {
  static const KnotVector knots = KnotVector::bezier(kSize - 1);
  double worst = 0;
  constexpr int kSamples = 24;
  for (const SmoothEdge& edge : local.edges.edges) {
    for (int s = 0; s <= kSamples; ++s) {
      const BasisValues b = basis_at(knots, static_cast<double>(s) / kSamples, 1);
      Vec3 along = Vec3::Zero(), f = Vec3::Zero(), g = Vec3::Zero();
      for (int k = 0; k < kSize; ++k) {
        const Vec3 h = local.net.points.col(edge.h[at(k)]);
        along += b.values(1, k) * h;
        f += b.values(0, k) * (local.net.points.col(edge.f[at(k)]) - h);
        g += b.values(0, k) * (local.net.points.col(edge.g[at(k)]) - h);
      }
      const Vec3 one = along.cross(f), other = g.cross(along);
      worst = std::max(worst, std::atan2(one.cross(other).norm(), one.dot(other)));
    }
  }
  return worst * 180 / std::numbers::pi;
}

// Whether the junction satisfies the equations as it is.
bool is_smooth(const LocalJunction& local) {
  const Eigen::VectorXd c = best_coefficients(local.edges, local.net);
  return tangent_plane_residual(local.edges, local.net, c).cwiseAbs().maxCoeff() < kStartsSmooth;
}

// Moves the net to its samples; what went wrong, or nothing.
std::string solve(LocalJunction& local, const std::vector<JunctionSample>& samples,
                  double roughness) {
  JunctionMover mover(local, samples, roughness);
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

// The first gate that the net does not pass, or nothing.
std::string judge(const LocalJunction& local, const std::vector<std::vector<Vec3>>& old_normals,
                  double least_jacobian, MovedJunction& figures) {
  const auto normals = normals_of(local);
  figures.jacobian_ratio = jacobian_ratio(normals);
  figures.worst_angle_deg = worst_angle_deg(local);
  double least_cos = 1;
  for (std::size_t p = 0; p < normals.size(); ++p) {
    for (std::size_t k = 0; k < normals[p].size(); ++k) {
      least_cos =
          std::min(least_cos, normals[p][k].normalized().dot(old_normals[p][k].normalized()));
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

MovedJunction move_junction(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                            const std::map<int, Vec3>& openings,
                            const std::vector<JunctionSample>& samples) {
  MovedJunction result;
  LocalJunction local;
  for (const StripRing& ring : rings) {
    if (ring.rows() != kSize) return {{}, "its patches are not bi-quintic Bezier patches", 0, 0};
  }
  number_points(network, rings, local);
  const auto axes = free_points(network, rings, local);
  if (!axes) return {{}, "its tangent planes do not contain the axes of its branches", 0, 0};
  if (!make_edges(network, *axes, local) || !is_smooth(local)) {
    return {{}, "it is not smooth to begin with", 0, 0};
  }

  const auto old_normals = normals_of(local);
  // The openings take the rows next to them along.
  std::map<int, Vec3> shift;
  for (const StripRing& ring : rings) {
    for (int c = 0; c < ring.points(); ++c) {
      const auto found = openings.find(ring.columns(0, c));
      if (found == openings.end()) continue;
      const Vec3 by = found->second - network.control_points_mm.col(ring.columns(0, c));
      shift[ring.columns(0, c)] = by;
      shift[ring.columns(1, c)] = by;
    }
  }
  for (std::size_t k = 0; k < local.columns.size(); ++k) {
    const auto found = shift.find(local.columns[k]);
    if (found != shift.end()) local.net.points.col(static_cast<Eigen::Index>(k)) += found->second;
  }

  const double wanted = std::max(kLeastJacobian, 0.5 * jacobian_ratio(old_normals));
  const JunctionNet start = local.net;
  for (const double roughness : kRoughness) {
    local.net = start;
    result.failure = solve(local, samples, roughness);
    if (result.failure.empty()) result.failure = judge(local, old_normals, wanted, result);
    if (result.failure.empty()) break;
  }
  for (std::size_t k = 0; k < local.columns.size(); ++k) {
    result.points[local.columns[k]] = local.net.points.col(static_cast<Eigen::Index>(k));
  }
  return result;
}

}  // namespace angiospline
