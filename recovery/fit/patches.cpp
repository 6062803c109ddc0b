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
#include "kernel/spline/basis.h"
#include "modeling/junction/patch_solver.h"
#include "recovery/fit/rules.h"

namespace angiospline {
namespace {

using namespace fit_rules;

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

// The energy of one patch as a quadratic function of its 108 coordinates: 1/2 p'Hp - r'p.
struct Quadratic {
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(3 * kPatchPoints, 3 * kPatchPoints);
  Eigen::VectorXd r = Eigen::VectorXd::Zero(3 * kPatchPoints);

  // weight * (sum_k b_k n . p_k - value)^2 / 2
  void add(const PatchColumn& b, const Vec3& n, double value, double weight) {
    Eigen::VectorXd row(3 * kPatchPoints);
    for (int k = 0; k < kPatchPoints; ++k) row.segment<3>(3 * k) = b(k) * n;
    H.selfadjointView<Eigen::Lower>().rankUpdate(row, weight);
    r += weight * value * row;
  }
};

// The squares of a group's distances from its samples' planes, of its way from the samples, of its
// sines against the planes and of its move's roughness. Tangent lengths are held at those of the
// start, so that all of it is quadratic: its Hessian is formed once.
class SampleEnergy {
 public:
  SampleEnergy(const PatchGroup& group, const std::vector<PatchSample>& samples, double share,
               const PatchWeights& weights, double roughness)
      : group_(group), quadratics_(group.patches.size()), models_(group.patches.size()) {
    for (const PatchSample& s : samples) add_sample(s, share, weights);
    for (std::size_t p = 0; p < quadratics_.size(); ++p) {
      add_roughness(p, roughness);
      quadratics_[p].H = Eigen::MatrixXd(quadratics_[p].H.selfadjointView<Eigen::Lower>());
      project_on_unknowns(p);
    }
  }

  const std::vector<PatchModel>& models() const { return models_; }

  // g = H p - r, on the unknowns.
  const std::vector<PatchModel>& at(const JunctionNet& net) {
    for (std::size_t p = 0; p < quadratics_.size(); ++p) {
      const PatchNet P = patch_net(net, group_.controls[p]);
      const Eigen::VectorXd g =
          quadratics_[p].H * Eigen::Map<const Eigen::VectorXd>(P.data(), 3 * kPatchPoints) -
          quadratics_[p].r;
      const auto directions = directions_of(p);
      for (std::size_t a = 0; a < directions.size(); ++a) {
        const auto& [k, da] = directions[a];
        models_[p].gradient(static_cast<Eigen::Index>(a)) = da.dot(g.segment<3>(3 * k));
      }
    }
    return models_;
  }

 private:
  void add_sample(const PatchSample& s, double share, const PatchWeights& weights) {
    const int p = group_.index_of(s.patch);
    if (p < 0) return;
    const std::array<int, kPatchPoints>& control = group_.controls[index(p)];
    const PatchBasis b = patch_basis(s.uv);
    const PatchNet P = patch_net(group_.net, control);

    // Lengths count in local radii, so that thin branches weigh as much as thick ones.
    double scale = 0;
    for (int k = 0; k < kPatchPoints; ++k) {
      scale += b.value(k) * group_.net.scale[index(control[index(k)])];
    }
    const double per_area = s.weight / (scale * scale);

    Quadratic& q = quadratics_[index(p)];
    const Vec3 target = s.point_mm + share * s.move_mm;
    const Vec3 normal = ((1 - share) * s.normal + share * s.moved_normal).normalized();
    q.add(b.value, normal, normal.dot(target), weights.distance * per_area);
    for (int d = 0; d < 3; ++d) {
      q.add(b.value, Vec3::Unit(d), target(d), weights.anchor * per_area);
    }
    q.add(b.u, normal, 0.0, weights.tangent * s.weight / (P * b.u).squaredNorm());
    q.add(b.v, normal, 0.0, weights.tangent * s.weight / (P * b.v).squaredNorm());
  }

  // Second differences of the move from where the net is now, along both rows.
  void add_roughness(std::size_t p, double roughness) {
    const PatchNet P = patch_net(group_.net, group_.controls[p]);
    for (int i = 0; i < kPatchSize; ++i) {
      for (int j = 1; j + 1 < kPatchSize; ++j) {
        for (const auto& [middle, step] :
             {std::pair{i * kPatchSize + j, 1}, std::pair{j * kPatchSize + i, kPatchSize}}) {
          const double scale = group_.net.scale[index(group_.controls[p][index(middle)])];
          PatchColumn b = PatchColumn::Zero();
          b(middle - step) = b(middle + step) = 1;
          b(middle) = -2;
          const Vec3 now = P * b;
          for (int d = 0; d < 3; ++d) {
            quadratics_[p].add(b, Vec3::Unit(d), now(d), roughness / (scale * scale));
          }
        }
      }
    }
  }

  // Points of a patch with the directions in which they may move, one for each unknown.
  std::vector<std::pair<int, Vec3>> directions_of(std::size_t p) const {
    std::vector<std::pair<int, Vec3>> all;
    for (int k = 0; k < kPatchPoints; ++k) {
      const ControlSlot& slot = group_.net.slots[index(group_.controls[p][index(k)])];
      for (int d = 0; d < slot.count; ++d) {
        all.emplace_back(k, slot.count == 1 ? slot.along : Vec3(Vec3::Unit(d)));
      }
    }
    return all;
  }

  void project_on_unknowns(std::size_t p) {
    PatchModel& model = models_[p];
    for (const int id : group_.controls[p]) {
      const ControlSlot& slot = group_.net.slots[index(id)];
      for (int d = 0; d < slot.count; ++d) model.unknowns.push_back(slot.first + d);
    }

    const auto directions = directions_of(p);
    const Eigen::Index count = std::ssize(directions);
    model.gradient = Eigen::VectorXd::Zero(count);
    model.hessian = Eigen::MatrixXd::Zero(count, count);
    for (Eigen::Index a = 0; a < count; ++a) {
      const auto& [k, da] = directions[index(a)];
      for (Eigen::Index b = 0; b <= a; ++b) {
        const auto& [l, db] = directions[index(b)];
        model.hessian(a, b) = da.dot(quadratics_[p].H.block<3, 3>(3 * k, 3 * l) * db);
      }
    }
  }

  const PatchGroup& group_;
  std::vector<Quadratic> quadratics_;
  std::vector<PatchModel> models_;
};

double worst_angle_deg(const PatchGroup& group) {
  static const KnotVector knots = KnotVector::bezier(kPatchSize - 1);
  double worst = 0;
  for (const SmoothEdge& edge : group.edges.edges) {
    for (int s = 0; s <= kGroupGates.edge_steps; ++s) {
      const BasisValues b = basis_at(knots, static_cast<double>(s) / kGroupGates.edge_steps, 1);

      // H', and F and G up to a factor: the derivatives across are five times the first rows.
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
  SampleEnergy energy(group, samples, share, weights, roughness);
  PatchSolver solver(group.net, group.edges, energy.models(), kPatchSteps);
  const auto at_net = [&](const JunctionNet& net) -> const std::vector<PatchModel>& {
    return energy.at(net);
  };
  const ConstrainedSolution solution =
      solve_constrained(solver, group.net, at_net, kConstrainedSteps);
  return solution.solved ? std::string() : "its equations could not be solved";
}

// Normals (not normalised) of every patch on a grid.
using PatchNormals = std::vector<std::vector<Vec3>>;
PatchNormals normals_of(const PatchGroup& group) {
  PatchNormals all;
  for (const std::array<int, kPatchPoints>& control : group.controls) {
    const PatchNet P = patch_net(group.net, control);
    std::vector<Vec3> normals;
    for (int i = 0; i <= kGroupGates.steps; ++i) {
      for (int j = 0; j <= kGroupGates.steps; ++j) {
        const PatchBasis b = patch_basis(Vec2(i, j) / kGroupGates.steps);
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

  if (!(figures.worst_angle_deg <= kGroupGates.worst_angle_deg)) {
    return fmt::format("normals of neighbouring patches would differ by {:.2g} degrees",
                       figures.worst_angle_deg);
  }
  if (!(figures.jacobian_ratio >= least_jacobian)) {
    return fmt::format("it would fold (Jacobian ratio {:.2g})", figures.jacobian_ratio);
  }
  if (!(least_cos >= kGroupGates.most_turned_cos))
    return "a normal would turn by more than 60 degrees";
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

  // The group's own numbers for the pool's columns, in the order in which patches come to them.
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
  return tangent_plane_residual(group.edges, group.net, c).cwiseAbs().maxCoeff() <
         kGroupGates.starts_smooth;
}

double jacobian_ratio(const PatchGroup& group) { return jacobian_ratio(normals_of(group)); }

MovedGroup move_group(PatchGroup& group, const std::vector<PatchSample>& samples,
                      const Points3& start, const PatchWeights& weights,
                      std::span<const double> roughness, double least_jacobian) {
  const PatchNormals before = normals_of(group);
  MovedGroup result;
  Points3 sound = group.net.points;

  // The whole way first; then half of what is left whenever a part fails its gates.
  for (double step = 1.0; result.share < 1 && step >= kGroupGates.least_share;) {
    const double share = std::min(1.0, result.share + step);
    MovedGroup tried;

    // The least roughness that passes follows the samples best.
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
