// What a user chooses of a deformation, and what it reports (thesis chapters 5 and 6).
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include <Eigen/Core>

namespace angiospline {

// How the equations of motion are solved. f_ext is the potentials' force, f_int the elements', C
// the damping, K the stiffness, M the mass, D = f_ext + f_int.
enum class DeformMethod {
  kSparse,    // no mass, implicit in the elements: (C + dt (K + s I)) dq = dt D, factorised once
  kEulerSvd,  // no mass: dq = dt C^+ D with the pseudo-inverse (5.7)
  kEulerDft,  // the same with C taken for a circulant matrix (5.30)
  kEulerDftPhantom,  // the same with phantom nodes (5.31 to 5.33)
  kCentral,          // mass, central differences (5.17), by singular values
  kCentralDft,       // the same with C taken for circulant: unstable in the thesis
  kRungeKutta1,      // mass, first order (5.11)
  kRungeKutta4,      // mass, fourth order (5.12)
};

// "sparse", "euler-svd", "euler-dft", "euler-dft-phantom", "central", "central-dft",
// "runge-kutta-1", "runge-kutta-4".
std::string_view to_string(DeformMethod method);
std::optional<DeformMethod> deform_method(std::string_view name);
bool has_mass(DeformMethod method);

enum class PotentialKind {
  kGravity,  // strength exp(-r^2 / reach^2), (6.1): strong near by, nothing far away
  kSpring,   // strength r / reach, (6.2): strong far away, nothing near by
};

enum class Termination {
  kAtRest,          // the rule of rest_speed held
  kIterationLimit,  // it did not within most_iterations
  kUnstable,        // a node is not finite, or farther from its start than the mesh's own diagonal
};
std::string_view to_string(Termination termination);

struct DeformReport {
  Termination termination = Termination::kIterationLimit;
  int iterations = 0;
  // Thesis 7.3.5: what the potentials still pull at each node, in the potentials' unit. Balanced by
  // the elements; large where the mesh would move on if it could.
  Eigen::VectorXd residual_force;
  std::vector<int> edges_per_node;  // that pull at it at the end; 0: nothing holds it there
  double moved_mean_mm = 0, moved_most_mm = 0;
  std::size_t nearest_asked = 0;  // look-ups of a nearest node; iterations * edges without reuse
};

}  // namespace angiospline
