// Tangent-plane continuity in cofactor form: F' + rho G' = nu H' along every inner edge.
#pragma once

#include <array>
#include <vector>

#include "base/vector.h"
#include "modeling/junction/unknowns.h"
#include "modeling/layout/topology.h"

namespace angiospline {

// One edge of bi-quintic patches: its own control points h and the rows next to it on either side.
// With F', G' the derivatives away from the edge and H' the one along it, both patches share their
// tangent planes when polynomials rho > 0 and nu exist with F' + rho G' = nu H'. rho has degree
// `ratio_degree`, nu one more, both in Bernstein form with coefficients that are unknowns of their
// own; the equation is then one of degree ratio_degree + 5, written coefficient by coefficient.
//
// An edge that starts in a fixed opening keeps rho(0) = 1, rho'(0) = 0 and nu(0) = 0: there the
// first coefficient holds by itself and the second has a component along the branch's axis only.
struct SmoothEdge {
  std::array<int, 6> h;
  std::array<int, 6> f;
  std::array<int, 6> g;
  int ratio_degree = 1;
  bool from_opening = false;
  Vec3 axis = Vec3::Zero();   // of the opening
  int first_coefficient = 0;  // in the vector of coefficients: rho's unknowns, then nu's
  int first_row = 0;          // in the vector of equations
  double scale = 1.0;         // length the equations are divided by

  int ratio_unknowns() const { return ratio_degree + 1 - (from_opening ? 2 : 0); }
  int shift_unknowns() const { return ratio_degree + 2 - (from_opening ? 1 : 0); }
  int coefficient_count() const { return ratio_unknowns() + shift_unknowns(); }
  int row_count() const {
    return from_opening ? 1 + 3 * (ratio_degree + 4) : 3 * (ratio_degree + 6);
  }
};

struct SmoothEdges {
  std::vector<SmoothEdge> edges;
  int coefficients = 0;
  int rows = 0;
};

struct EdgeDegrees {
  int leg = 2;  // 0: legs stay as they are
  int saddle = 1;
};

// All legs, then all saddles.
SmoothEdges smooth_edges(const JunctionTopology& topology, const JunctionLayout& layout,
                         const JunctionNet& net, const EdgeDegrees& degrees);

// The coefficients that satisfy each edge best in the least squares sense.
Eigen::VectorXd best_coefficients(const SmoothEdges& edges, const JunctionNet& net);

// The left-hand sides minus the right-hand sides, each divided by its edge's scale.
Eigen::VectorXd tangent_plane_residual(const SmoothEdges& edges, const JunctionNet& net,
                                       const Eigen::VectorXd& coefficients);

// An entry of the residual's Jacobian; columns: the net's unknowns, then the coefficients.
struct JacobianEntry {
  int row;
  int column;
  double value;
};

// All entries that can differ from zero, in an order that depends on the edges alone.
void tangent_plane_jacobian(const SmoothEdges& edges, const JunctionNet& net,
                            const Eigen::VectorXd& coefficients,
                            std::vector<JacobianEntry>& entries);

}  // namespace angiospline
