#include "recovery/thesis/smoothing/triple_smoothing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <nlopt.hpp>
#include <tbb/parallel_for.h>

#include "base/index.h"
#include "base/random.h"
#include "kernel/continuity/triple_curve.h"
#include "kernel/numerics/spectrum.h"
#include "kernel/refine/reshape.h"
#include "recovery/thesis/smoothing/rules.h"

namespace angiospline {
namespace {

using namespace thesis_smoothing_rules;

SurfaceSide surface_side(PatchSide side) {
  switch (side) {
    case PatchSide::kU0:
      return SurfaceSide::kU0;
    case PatchSide::kU1:
      return SurfaceSide::kU1;
    case PatchSide::kV0:
      return SurfaceSide::kV0;
    case PatchSide::kV1:
      break;
  }
  return SurfaceSide::kV1;
}

// Columns of a side's own row (depth 0) or of the row beside it (depth 1).
std::vector<int> side_columns(const Patch& patch, PatchSide side, int depth) {
  const int rows = patch.u.control_point_count();
  const int across = patch.v.control_point_count();
  std::vector<int> columns;
  const bool along_v = side == PatchSide::kU0 || side == PatchSide::kU1;
  for (int k = 0; k < (along_v ? across : rows); ++k) {
    const int i = side == PatchSide::kU0 ? depth : side == PatchSide::kU1 ? rows - 1 - depth : k;
    const int j = side == PatchSide::kV0 ? depth : side == PatchSide::kV1 ? across - 1 - depth : k;
    columns.push_back(patch.control[index(i * across + j)]);
  }
  return columns;
}

// Between the normals at share `s` of a join.
double join_angle_deg_at(const SurfaceNetwork& network, int j, double s) {
  const Join& join = network.joins[index(j)];
  const auto normal = [&](const Side& side, double along) {
    const Vec2 uv = side_parameters(network.patches[index(side.patch)], side.side, along);
    return normal_vector(patch_surface(network, side.patch), uv.x(), uv.y());
  };
  const Vec3 na = normal(join.a, join_parameter_a(join, s));
  const Vec3 nb = normal(join.b, join_parameter_b(join, s));
  return std::atan2(na.cross(nb).norm(), na.dot(nb)) * 180 / std::numbers::pi;
}

// One boundary: its triple curve, divided by the lengths of its factors at the start.
struct Boundary {
  int join;
  TripleCurve curve;
  double scale;
};

class TripleSystem {
 public:
  TripleSystem(const SurfaceNetwork& network, std::vector<int> joins,
               const TripleSmoothingOptions& options, const Progress& progress)
      : network_(network), joins_(std::move(joins)), options_(options), progress_(progress) {
    find_unknowns();

    // The triple curve Phi = F'.(G' x H') of each boundary (3.1), whose values at its nodes are the
    // constraints (3.5); divided by its factors' lengths they are sines.
    for (const int j : joins_) {
      const Join& join = network.joins[index(j)];
      const BSplineSurface<3> a = patch_surface(network, join.a.patch);
      const BSplineSurface<3> b = patch_surface(network, join.b.patch);
      const auto mean = [](const BSplineCurve<3>& c) {
        return c.control_points().colwise().norm().mean();
      };
      const double scale = mean(cross_derivative_curve(a, surface_side(join.a.side))) *
                           mean(cross_derivative_curve(b, surface_side(join.b.side))) *
                           mean(derivative(boundary_curve(a, surface_side(join.a.side))));
      boundaries_.push_back(
          {j,
           TripleCurve(a, surface_side(join.a.side), b, surface_side(join.b.side),
                       join.reversed ? SideDirection::kReversed : SideDirection::kSame),
           scale});
      constraints_ += static_cast<int>(boundaries_.back().curve.nodes().size());
    }

    // Lengths in units of the system's own size.
    double size = 0;
    for (const int c : columns_) size += (start().col(c) - start().col(columns_.front())).norm();
    size_ = columns_.empty() ? 1.0 : std::max(size / static_cast<double>(columns_.size()), 1e-300);
  }

  const std::vector<int>& columns() const { return columns_; }

  TripleSystemReport run() {
    const auto begin = std::chrono::steady_clock::now();
    TripleSystemReport report;
    report.boundaries = static_cast<int>(joins_.size());
    report.constraints = constraints_;
    report.unknowns = static_cast<int>(3 * columns_.size());
    report.distances = static_cast<int>(columns_.size());
    report.before_deg = report.after_deg = worst_angle();
    deadline_ = begin + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                            std::chrono::duration<double>(options_.most_seconds));

    // Each round chooses its independent constraints anew and solves for them.
    if (columns_.empty()) report.ending = TripleEnding::kInfeasible;
    for (int round = 0; round < kMostRestarts && !columns_.empty(); ++round) {
      if (report.after_deg <= options_.wanted_deg) {
        report.ending = TripleEnding::kSmooth;
        break;
      }
      if (is_over()) {
        report.ending = TripleEnding::kOutOfTime;
        break;
      }
      choose_constraints();
      if (round == 0) report.independent = static_cast<int>(chosen_.cols());
      const Points3 before = network_.control_points_mm;
      solve();
      const double now = worst_angle();
      if (!(now < kWorthwhile * report.after_deg)) {
        network_.control_points_mm = before;
        report.ending = is_over() ? TripleEnding::kOutOfTime : TripleEnding::kStalled;
        break;
      }
      report.after_deg = now;
      if (now <= options_.wanted_deg) report.ending = TripleEnding::kSmooth;
    }

    if (!options_.floating || report.ending != TripleEnding::kSmooth) find_fixed(report);
    report.evaluations = evaluations_;
    report.seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    return report;
  }

  // Where the system's unknowns came to lie.
  void write(Points3& points) const {
    for (const int c : columns_) points.col(c) = network_.control_points_mm.col(c);
  }

 private:
  const Points3& start() const { return network_.control_points_mm; }

  // The points of the boundaries, if these float, and of the rows beside them (7.2.4), but for what
  // other joins, rims and dependencies hold.
  void find_unknowns() {
    std::set<int> held;
    for (int j = 0; j < static_cast<int>(network_.joins.size()); ++j) {
      if (std::find(joins_.begin(), joins_.end(), j) != joins_.end() && options_.floating) continue;
      hold(network_.joins[index(j)].a, held);
      hold(network_.joins[index(j)].b, held);
    }
    for (const Rim& rim : network_.rims) {
      for (const Side& side : rim.sides) hold(side, held);
    }
    for (const Dependency& dependency : network_.dependencies) {
      held.insert(dependency.point);
      for (const auto& [master, weight] : dependency.masters) held.insert(master);
    }

    std::set<int> free;
    for (const int j : joins_) {
      for (const Side& side : {network_.joins[index(j)].a, network_.joins[index(j)].b}) {
        for (const int depth : {0, 1}) {
          for (const int c : side_columns(network_.patches[index(side.patch)], side.side, depth)) {
            if (!held.contains(c)) free.insert(c);
          }
        }
      }
    }

    columns_.assign(free.begin(), free.end());
    unknown_.assign(static_cast<std::size_t>(network_.control_points_mm.cols()), -1);
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      unknown_[index(columns_[k])] = static_cast<int>(3 * k);
    }
  }

  void hold(const Side& side, std::set<int>& held) const {
    const auto columns = side_columns(network_.patches[index(side.patch)], side.side, 0);
    held.insert(columns.begin(), columns.end());
  }

  double worst_angle() const {
    double worst = 0;
    for (const int j : joins_) worst = std::max(worst, join_angle_deg(network_, j));
    return worst;
  }

  bool is_over() const {
    return evaluations_ >= options_.most_evaluations || progress_.should_stop() ||
           std::chrono::steady_clock::now() > deadline_;
  }

  // Phi at all nodes and its Jacobian (constraints x unknowns), lengths in units of size_.
  void evaluate(Eigen::VectorXd& values, Eigen::MatrixXd* jacobian) const {
    values.resize(constraints_);
    if (jacobian != nullptr) {
      *jacobian =
          Eigen::MatrixXd::Zero(constraints_, static_cast<Eigen::Index>(3 * columns_.size()));
    }

    Eigen::Index row = 0;
    for (const Boundary& boundary : boundaries_) {
      const Join& join = network_.joins[index(boundary.join)];
      const TripleValues triple = boundary.curve.evaluate(patch_surface(network_, join.a.patch),
                                                          patch_surface(network_, join.b.patch));
      values.segment(row, triple.values.size()) = triple.values / boundary.scale;
      if (jacobian != nullptr) {
        for (const TripleGradient& g : triple.gradient) {
          const int patch = g.surface == 0 ? join.a.patch : join.b.patch;
          const int column = network_.patches[index(patch)].control[index(g.point)];
          const int unknown = unknown_[index(column)];
          if (unknown < 0) continue;
          jacobian->block<1, 3>(row + g.node, unknown) +=
              g.gradient.transpose() * (size_ / boundary.scale);
        }
      }
      row += triple.values.size();
    }
  }

  // Orthonormal combinations of the constraints whose gradients are independent here.
  void choose_constraints() {
    Eigen::VectorXd values;
    Eigen::MatrixXd J;
    evaluate(values, &J);
    const auto [U, s, V] = singular_values(J, SingularVectors::kThinLeft);
    Eigen::Index rank = 0;
    while (rank < s.size() && s(rank) > kDependent * s(0)) ++rank;
    // Divided by their singular values: all of one size.
    chosen_ = U.leftCols(rank) * s.head(rank).cwiseInverse().asDiagonal();
  }

  // Combinations whose gradient vanishes at several places in general position: these are
  // polynomials in the unknowns, so it vanishes everywhere and their values are constants.
  void find_fixed(TripleSystemReport& report) {
    Eigen::VectorXd values;
    Eigen::MatrixXd J;
    evaluate(values, &J);
    Eigen::MatrixXd all(J.rows(), kPlaces * J.cols());
    const Points3 here = network_.control_points_mm;
    Random random(static_cast<std::uint64_t>(constraints_));
    for (int k = 0; k < kPlaces; ++k) {
      for (const int c : columns_) {
        for (int d = 0; d < 3; ++d) {
          network_.control_points_mm(d, c) = here(d, c) + kApart * size_ * random.gaussian();
        }
      }
      Eigen::VectorXd there;
      evaluate(there, &J);
      all.middleCols(k * J.cols(), J.cols()) = J;
    }
    network_.control_points_mm = here;

    // Left singular vectors beyond the rank: combinations without a gradient at all the places.
    const auto [U, s, V] = singular_values(all, SingularVectors::kFullLeft);
    const auto changing = (s.array() > kUnchanging * s(0)).count();
    report.fixed = static_cast<int>(all.rows() - changing);
    report.fixed_residual = (U.rightCols(report.fixed).transpose() * values).norm();
    report.fixed_angle_deg = fixed_end_angle(all);
  }

  double fixed_end_angle(const Eigen::MatrixXd& gradients) const {
    const double largest = gradients.rowwise().norm().maxCoeff();
    double worst = 0;
    Eigen::Index row = 0;
    for (const Boundary& boundary : boundaries_) {
      const auto nodes = static_cast<Eigen::Index>(boundary.curve.nodes().size());
      for (const bool last : {false, true}) {
        const Eigen::Index end = last ? row + nodes - 1 : row;
        if (gradients.row(end).norm() > kUnchanging * largest) continue;
        worst = std::max(worst, join_angle_deg_at(network_, boundary.join, last ? 1.0 : 0.0));
      }
      row += nodes;
    }
    return worst;
  }

  void place(const double* x) {
    for (std::size_t k = 0; k < columns_.size(); ++k) {
      network_.control_points_mm.col(columns_[k]) =
          origin_.col(static_cast<Eigen::Index>(k)) + size_ * Eigen::Map<const Vec3>(x + 3 * k);
    }
  }

  // Half the squared moves.
  static double objective(unsigned n, const double* x, double* gradient, void*) {
    const Eigen::Map<const Eigen::VectorXd> at_x(x, n);
    if (gradient != nullptr) Eigen::Map<Eigen::VectorXd>(gradient, n) = at_x;
    return at_x.squaredNorm() / 2;
  }

  static void constraint(unsigned m, double* result, unsigned n, const double* x, double* gradient,
                         void* data) {
    TripleSystem& self = *static_cast<TripleSystem*>(data);
    if (self.is_over()) throw nlopt::forced_stop();
    ++self.evaluations_;
    self.place(x);
    Eigen::VectorXd values;
    Eigen::MatrixXd J;
    self.evaluate(values, gradient != nullptr ? &J : nullptr);
    Eigen::Map<Eigen::VectorXd>(result, m) = self.chosen_.transpose() * values;
    if (gradient != nullptr) {
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      Eigen::Map<RowMajor>(gradient, m, n) = self.chosen_.transpose() * J;
    }
  }

  void solve() {
    const auto n = static_cast<unsigned>(3 * columns_.size());
    origin_ = start()(Eigen::all, columns_);

    // The thesis minimises the points' moves under the constraints by a quasi-Newton method
    // (3.2.2); sequential quadratic programming (Kraft 1988) is its successor.
    nlopt::opt solver(nlopt::LD_SLSQP, n);
    solver.set_min_objective(objective, nullptr);
    solver.add_equality_mconstraint(
        constraint, this,
        std::vector<double>(static_cast<std::size_t>(chosen_.cols()), kConstraintTolerance));
    solver.set_xtol_rel(kStepTolerance);
    solver.set_maxeval(std::max(1, options_.most_evaluations - evaluations_));

    std::vector<double> x(n, 0.0);
    double least = 0;
    try {
      solver.optimize(x, least);
    } catch (const std::exception&) {
      // Roundoff, or the time is over: x is the last point, which the caller judges.
    }
    place(x.data());
  }

  SurfaceNetwork network_;  // a copy of its own: systems run side by side
  std::vector<int> joins_;
  TripleSmoothingOptions options_;
  const Progress& progress_;
  std::vector<Boundary> boundaries_;
  std::vector<int> columns_;
  std::vector<int> unknown_;  // of each pool column, or -1
  int constraints_ = 0;
  double size_ = 1.0;
  Points3 origin_;
  Eigen::MatrixXd chosen_;  // constraints x independent ones
  int evaluations_ = 0;
  std::chrono::steady_clock::time_point deadline_;
};

std::optional<Error> find_bad_join(const SurfaceNetwork& network, int j) {
  const auto bad = [&](const char* rule) {
    return Error{
        ErrorKind::kBadInput, "boundary cannot be smoothed", fmt::format("join {}", j), {}, rule};
  };
  if (j < 0 || j >= static_cast<int>(network.joins.size())) return bad("there is no such join");
  for (const Side& side : {network.joins[index(j)].a, network.joins[index(j)].b}) {
    const Patch& patch = network.patches[index(side.patch)];
    const bool along_v = side.side == PatchSide::kU0 || side.side == PatchSide::kU1;
    const KnotVector& knots = along_v ? patch.v : patch.u;
    if (side.from != knots.first() || side.to != knots.last()) return bad("whole sides are wanted");
  }
  return std::nullopt;
}

}  // namespace

double join_angle_deg(const SurfaceNetwork& network, int j) {
  double worst = 0;
  for (int k = 0; k <= kAngleSamples; ++k) {
    worst = std::max(worst, join_angle_deg_at(network, j, static_cast<double>(k) / kAngleSamples));
  }
  return worst;
}

Result<std::vector<TripleSystemReport>> smooth_by_triple_curves(
    SurfaceNetwork& network, const std::vector<std::vector<int>>& systems,
    const TripleSmoothingOptions& options, const Progress& progress) {
  if (auto error = find_defect(network)) return fail(*error);
  for (const std::vector<int>& joins : systems) {
    for (const int j : joins) {
      if (auto error = find_bad_join(network, j)) return fail(*error);
    }
  }

  // Systems that share no control point are independent: the thesis's "parallel" processes (7.2.4).
  std::vector<TripleSystem> work;
  std::set<int> taken;
  for (const std::vector<int>& joins : systems) {
    work.emplace_back(network, joins, options, progress);
    for (const int c : work.back().columns()) {
      if (!taken.insert(c).second) {
        return fail({ErrorKind::kBadInput, "two systems share a control point",
                     fmt::format("system {}", work.size() - 1), fmt::format("point {}", c),
                     "systems that are solved in parallel are independent"});
      }
    }
  }

  std::vector<TripleSystemReport> reports(work.size());
  tbb::parallel_for(std::size_t{0}, work.size(),
                    [&](std::size_t k) { reports[k] = work[k].run(); });
  if (progress.should_stop()) return fail(cancelled("smooth by triple curves"));

  const Points3 before = network.control_points_mm;
  for (std::size_t k = 0; k < work.size(); ++k) {
    work[k].write(network.control_points_mm);
    for (const int c : work[k].columns()) {
      reports[k].moved_mm =
          std::max(reports[k].moved_mm, (network.control_points_mm.col(c) - before.col(c)).norm());
    }
  }
  return reports;
}

}  // namespace angiospline
