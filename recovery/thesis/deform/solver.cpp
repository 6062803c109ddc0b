#include "recovery/thesis/deform/solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "kernel/numerics/sparse_cholesky.h"
#include "kernel/numerics/spectrum.h"
#include "recovery/thesis/deform/rules.h"

namespace angiospline {
namespace {

using namespace deform_rules;

constexpr std::pair<DeformMethod, std::string_view> kMethods[] = {
    {DeformMethod::kSparse, "sparse"},
    {DeformMethod::kEulerSvd, "euler-svd"},
    {DeformMethod::kEulerDft, "euler-dft"},
    {DeformMethod::kEulerDftPhantom, "euler-dft-phantom"},
    {DeformMethod::kCentral, "central"},
    {DeformMethod::kCentralDft, "central-dft"},
    {DeformMethod::kRungeKutta1, "runge-kutta-1"},
    {DeformMethod::kRungeKutta4, "runge-kutta-4"}};

// Positions and velocities, in voxels and voxels per unit of time.
struct State {
  Points3 nodes, velocity;
};

// One mesh among one set of edges.
class Motion {
 public:
  Motion(const DeformMesh& mesh, EdgePotentials potentials, double voxel_mm,
         const DeformOptions& options)
      : mesh_(mesh),
        voxel_mm_(voxel_mm),
        options_(options),
        system_(mesh, voxel_mm, options.elements),
        potentials_(std::move(potentials)) {
    state_.nodes = system_.rest();
    state_.velocity = Points3::Zero(3, state_.nodes.cols());
  }

  // Factorises what the method divides by.
  Result<void> prepare() {
    const double dt = options_.time_step, mass = options_.elements.mass;
    const ElementOptions& e = options_.elements;
    std::optional<PeriodicGrid> grid;
    if (is_circulant(options_.method) && !(grid = periodic_grid(mesh_)))
      return fail({ErrorKind::kBadInput, "mesh is not one tube or contour", "mesh",
                   std::string(to_string(options_.method)),
                   "circulant methods need rows of nodes around a tube"});

    // C = damping L + drag I (5.24); with mass M / dt^2 + C / 2 dt, the left side of (5.17).
    const double sides = mesh_.is_contour() ? 2 : 4;
    switch (options_.method) {
      case DeformMethod::kSparse:
        return prepare_implicit();
      case DeformMethod::kEulerSvd:
        division_ = divide_by_svd(system_.matrix({e.drag, e.damping, 0}));
        break;
      case DeformMethod::kEulerDft:
      case DeformMethod::kEulerDftPhantom:
        division_ = divide_by_circulant(*grid, sides * e.damping + e.drag, -e.damping,
                                        options_.method == DeformMethod::kEulerDft
                                            ? CirculantNodes::kPlain
                                            : CirculantNodes::kPhantom);
        break;
      case DeformMethod::kCentral:
        division_ = divide_by_svd(
            system_.matrix({mass / (dt * dt) + e.drag / (2 * dt), e.damping / (2 * dt), 0}));
        break;
      case DeformMethod::kCentralDft:
        division_ =
            divide_by_circulant(*grid, mass / (dt * dt) + (sides * e.damping + e.drag) / (2 * dt),
                                -e.damping / (2 * dt), CirculantNodes::kPlain);
        break;
      case DeformMethod::kRungeKutta1:
      case DeformMethod::kRungeKutta4:
        break;  // M is diagonal
    }
    return {};
  }

  // One time step of the method: (5.7) without mass, (5.17), (5.11) or (5.12) with it.
  void step() {
    const double dt = options_.time_step;

    switch (options_.method) {
      case DeformMethod::kSparse:
      case DeformMethod::kEulerSvd:
      case DeformMethod::kEulerDft:
      case DeformMethod::kEulerDftPhantom:
        state_.nodes += dt * (*division_)(forces(state_.nodes));
        break;
      case DeformMethod::kCentral:
      case DeformMethod::kCentralDft:
        central_difference();
        break;
      case DeformMethod::kRungeKutta1: {
        const State slope = slope_at(state_);
        state_ = {state_.nodes + dt * slope.nodes, state_.velocity + dt * slope.velocity};
        break;
      }
      case DeformMethod::kRungeKutta4:
        runge_kutta_4();
        break;
    }
  }

  const Points3& nodes() const { return state_.nodes; }
  const ElementSystem& system() const { return system_; }
  EdgePotentials& potentials() { return potentials_; }

  Points3 pull(const Points3& nodes) {
    Points3 normals;
    if (options_.potential.most_angle_deg) {
      mesh_.nodes_mm = nodes * voxel_mm_;
      normals = node_normals(mesh_);
    }
    return potentials_.forces(nodes, normals);
  }

 private:
  static bool is_circulant(DeformMethod method) {
    return method == DeformMethod::kEulerDft || method == DeformMethod::kEulerDftPhantom ||
           method == DeformMethod::kCentralDft;
  }

  // C + dt (K + s I): iteratively where a factor would fill in and the matrix allows it.
  Result<void> prepare_implicit() {
    const auto p = implicit_step(options_.elements, options_.time_step, potentials_.steepness());
    const bool large = mesh_.node_count() > kMostFactorised;
    if (large && system_.condition(p) <= kMostCondition) {
      division_ = divide_by_gradients(system_.matrix(p), kGradientError);
      return {};
    }
    auto division = divide_by_sparse(system_.matrix(p));
    if (!division) return fail(division.error());
    division_ = std::move(*division);
    return {};
  }

  // External and internal ones, f_ext - K q (5.18).
  Points3 forces(const Points3& nodes) {
    return pull(nodes) + system_.internal(nodes, options_.form);
  }

  // The state's derivative, (5.10).
  State slope_at(const State& s) {
    return {s.velocity, (forces(s.nodes) + system_.damping(s.velocity, options_.form)) /
                            options_.elements.mass};
  }

  // The classical rule; (5.12) but for its k4, which is printed without dt.
  void runge_kutta_4() {
    const double dt = options_.time_step;
    const auto ahead = [&](const State& slope, double t) {
      return State{state_.nodes + t * slope.nodes, state_.velocity + t * slope.velocity};
    };
    const State k1 = slope_at(state_);
    const State k2 = slope_at(ahead(k1, dt / 2));
    const State k3 = slope_at(ahead(k2, dt / 2));
    const State k4 = slope_at(ahead(k3, dt));
    state_.nodes += dt / 6 * (k1.nodes + 2 * k2.nodes + 2 * k3.nodes + k4.nodes);
    state_.velocity += dt / 6 * (k1.velocity + 2 * k2.velocity + 2 * k3.velocity + k4.velocity);
  }

  void central_difference() {
    const double dt = options_.time_step, mass = options_.elements.mass;
    if (before_.cols() == 0) {  // a first-order Runge-Kutta step starts it
      before_ = state_.nodes;
      const State slope = slope_at(state_);
      state_.nodes += dt * (state_.velocity + dt * slope.velocity);
      return;
    }

    // (5.17): (M / dt^2 + C / 2dt) q+ = f - (M / dt^2) (q- - 2 q) + (C / 2dt) q-, written for
    // q+ - q so that the pseudo-inverse of displacements does not meet positions.
    const Points3 last = state_.nodes - before_;
    const Points3 b = forces(state_.nodes) + mass / (dt * dt) * last +
                      system_.damping(last, options_.form) / (2 * dt);
    before_ = state_.nodes;
    state_.nodes += (*division_)(b);
  }

  DeformMesh mesh_;
  double voxel_mm_;
  DeformOptions options_;
  ElementSystem system_;
  EdgePotentials potentials_;
  std::unique_ptr<Division> division_;
  State state_;
  Points3 before_;
};

Result<void> check(const DeformMesh& start, double voxel_mm, const DeformOptions& options) {
  const auto bad = [](const char* what, double value, const char* rule) {
    return fail({ErrorKind::kBadInput, what, "deformation", fmt::format("{}", value), rule});
  };
  if (start.node_count() < 3)
    return bad("mesh is too small", start.node_count(), "3 nodes or more");
  if (!start.nodes_mm.allFinite()) return bad("mesh is not finite", NAN, "coordinates are numbers");
  if (!(voxel_mm > 0)) return bad("voxel is not usable", voxel_mm, "mm, above 0");
  if (!(options.time_step > 0) || !std::isfinite(options.time_step))
    return bad("time step is not usable", options.time_step, "above 0");
  if (options.most_iterations < 1)
    return bad("number of iterations is not usable", options.most_iterations, "at least 1");
  if (!(options.rest_speed > 0))
    return bad("speed of rest is not usable", options.rest_speed, "above 0");
  if (options.window < 1) return bad("window is not usable", options.window, "at least 1");
  if (has_mass(options.method) && !(options.elements.mass > 0))
    return bad("mass is not usable", options.elements.mass, "above 0 for a method with mass");
  return options.elements.check();
}

}  // namespace

std::string_view to_string(DeformMethod method) {
  for (const auto& [m, name] : kMethods)
    if (m == method) return name;
  return "?";
}

std::optional<DeformMethod> deform_method(std::string_view name) {
  for (const auto& [m, n] : kMethods)
    if (n == name) return m;
  return std::nullopt;
}

bool has_mass(DeformMethod method) {
  return method == DeformMethod::kCentral || method == DeformMethod::kCentralDft ||
         method == DeformMethod::kRungeKutta1 || method == DeformMethod::kRungeKutta4;
}

namespace {

// The least eigenvalue of the damping that is not that of a translation.
double least_eigenvalue(const Eigen::SparseMatrix<double>& L) {
  if (L.rows() <= kMostDenseNodes) {
    return symmetric_eigenvalues(Eigen::MatrixXd(L))[1];  // [0] is the translation's, 0
  }

  // Inverse iteration, kept clear of the translation by taking the mean off.
  Eigen::SparseMatrix<double> shifted = L;
  shifted.diagonal().array() += kEigenvalueShift;
  const SparseCholesky inverse(shifted);
  Eigen::VectorXd x = Eigen::VectorXd::LinSpaced(L.rows(), -1, 1);
  for (int k = 0; k < kInverseIterations; ++k) {
    x.array() -= x.mean();
    x = inverse.solve(x.normalized());
  }

  x.array() -= x.mean();
  x.normalize();
  return x.dot(L * x);
}

}  // namespace

DeformOptions steady_options(DeformMethod method, const DeformMesh& mesh, PotentialKind kind,
                             double strength, double reach_vox) {
  DeformOptions o = method == DeformMethod::kSparse ? DeformOptions() : thesis_options(method);
  o.potential.kind = kind;
  o.potential.strength = strength;
  o.potential.reach_vox = reach_vox;
  // Other methods bear their step; what cannot be used is for deform() to name.
  if (method == DeformMethod::kSparse || has_mass(method)) return o;
  if (!(strength > 0) || !(reach_vox > 0) || mesh.node_count() < 3) return o;

  // The potentials' steepness s over the least eigenvalue l of the damping bounds an explicit step.
  const ElementSystem system(mesh, 1.0, o.elements);
  const double steepness = kind == PotentialKind::kGravity ? strength / 2 : strength / reach_vox;
  o.time_step =
      std::min(kLongestStep, kStableStep * least_eigenvalue(system.laplacian()) / steepness);
  return o;
}

std::string_view to_string(Termination termination) {
  switch (termination) {
    case Termination::kAtRest:
      return "at rest";
    case Termination::kIterationLimit:
      return "iteration limit";
    case Termination::kUnstable:
      return "unstable";
  }
  return "?";
}

DeformOptions thesis_options(DeformMethod method) {
  const ThesisSteps& steps = has_mass(method) ? kWithMass : kMassless;
  DeformOptions o;
  o.method = method;
  o.elements = {};
  o.elements.drag = steps.drag;
  o.potential = {};
  o.time_step = steps.time_step;
  o.rest_speed = kThesisRestSpeed;
  o.window = steps.window;
  return o;
}

namespace {

// Whether a mesh has come to rest, by the mean places of its nodes over windows of iterations.
class RestRule {
 public:
  RestRule(const DeformOptions& options, Eigen::Index nodes)
      : window_(options.window),
        way_(options.rest_speed * options.window * options.time_step),
        sum_(Points3::Zero(3, nodes)) {}

  // Takes in the places after one more iteration. The mean place over this window, where it ends
  // here and lies near enough to the last one's.
  std::optional<Points3> add(const Points3& nodes) {
    sum_ += nodes;
    if (++count_ % window_ != 0) return std::nullopt;
    Points3 mean = sum_ / window_;
    sum_.setZero();
    if (before_.cols() > 0 && (mean - before_).colwise().norm().maxCoeff() <= way_) return mean;
    before_ = std::move(mean);
    return std::nullopt;
  }

 private:
  int window_;
  double way_;  // voxels in one window
  Points3 sum_;
  Points3 before_;
  int count_ = 0;
};

}  // namespace

Result<Deformation> deform(const DeformMesh& start, const EdgePoints& edges, double voxel_mm,
                           const DeformOptions& options, const Progress& progress) {
  if (const auto ok = check(start, voxel_mm, options); !ok) return fail(ok.error());
  auto potentials = EdgePotentials::make(edges, voxel_mm, options.potential);
  if (!potentials) return fail(potentials.error());
  Motion motion(start, std::move(*potentials), voxel_mm, options);
  if (const auto ok = motion.prepare(); !ok) return fail(ok.error());

  Deformation out{start, {}};
  DeformReport& report = out.report;
  const Points3 rest = motion.system().rest();
  const double diagonal = (rest.rowwise().maxCoeff() - rest.rowwise().minCoeff()).norm();
  RestRule at_rest(options, rest.cols());
  Points3 last = rest;
  while (report.iterations < options.most_iterations) {
    if (progress.should_stop()) return fail(cancelled("deforming"));
    motion.step();
    ++report.iterations;

    // A step too long for the potentials throws nodes out of all bounds.
    const Points3& now = motion.nodes();
    if (!now.allFinite() || (now - rest).colwise().norm().maxCoeff() > diagonal) {
      report.termination = Termination::kUnstable;
      break;
    }
    last = now;

    if (auto mean = at_rest.add(now)) {
      report.termination = Termination::kAtRest;
      last = std::move(*mean);
      break;
    }
    if (report.iterations % options.window == 0)
      progress.at("deforming", static_cast<double>(report.iterations) / options.most_iterations);
  }

  // Residual forces as thesis 7.3.5 draws them: what potentials still pull at the place of rest.
  out.mesh.nodes_mm = last * voxel_mm;
  report.residual_force = motion.pull(last).colwise().norm().transpose();
  report.edges_per_node = motion.potentials().pulls_per_node();
  report.nearest_asked = motion.potentials().asked();
  const Eigen::VectorXd moved = (out.mesh.nodes_mm - start.nodes_mm).colwise().norm();
  report.moved_mean_mm = moved.mean();
  report.moved_most_mm = moved.maxCoeff();
  return out;
}

MeshField residual_field(const DeformReport& report, const TriangleMesh& mesh) {
  MeshField field{"residual_force", Eigen::VectorXd::Zero(mesh.points_mm.cols())};
  field.values.head(report.residual_force.size()) = report.residual_force;
  return field;
}

}  // namespace angiospline
