// The patches around one opening or one body as rings of control points.
#pragma once

#include <utility>
#include <vector>

#include "base/result.h"
#include "modeling/network/surface_network.h"

namespace angiospline {

inline constexpr int kPerPatch = 5;  // control points of a quintic Bezier patch around a ring

// Patches side by side that close on themselves: kV1 of each meets kV0 of the next. Row i of the
// ring is control row i (along u) of all of them, five points a patch, cyclically. In a body rows
// go from end to end; in a junction, from the opening of one branch to its saddles.
struct StripRing {
  int region = -1;
  std::vector<int> patches;
  KnotVector u = KnotVector::bezier(5);
  Eigen::MatrixXi columns;  // of the pool: one row a control row, five columns a patch
  // Where patch k - 1 meets patch k, the derivative on the far side is so many times that on the
  // near side: in every row of a body, in the first row of a junction's ring.
  std::vector<double> seam_ratios;

  int rows() const { return static_cast<int>(columns.rows()); }
  int points() const { return static_cast<int>(columns.cols()); }

  // Weights (points() rows) of 4 numbers a patch that make every ring with these seams: the seam
  // point, its derivative, and the two points between.
  Eigen::MatrixXd basis() const;
};

// The functions along a ring that do not vanish at `place`, patch number + v: six, cyclically from
// the number that comes first.
std::pair<int, Eigen::Matrix<double, 6, 1>> ring_functions(double place, int patches);

// The ring's value there as a row over the numbers of `basis` (StripRing::basis).
Eigen::VectorXd ring_row(const StripRing& ring, const Eigen::MatrixXd& basis, double place);

// All rings of the network, in the order of their first patches. Patches that are not quintic and
// Bezier in v, or do not close into a ring, are in none.
std::vector<StripRing> strip_rings(const SurfaceNetwork& network);

// Gives the ring's patches these knots along u and rows of columns, numbered as in StripRing.
void set_rows(SurfaceNetwork& network, const StripRing& ring, const KnotVector& u,
              const Eigen::MatrixXi& columns);

// Without the pool columns that nothing uses; the others in the order of their use.
SurfaceNetwork compacted(SurfaceNetwork network);

// The same surfaces with knots added to the bodies by bisection until no span is longer than
// `radii` of its ring (mean distance from its centre). Pool columns are numbered anew.
SurfaceNetwork with_finer_bodies(const SurfaceNetwork& network, double radii);

// The same surfaces with more knots along u: `added[r]` for ring r of strip_rings(network), within
// its knots' domain. Only bodies may have any. Pool columns are numbered anew.
SurfaceNetwork with_knots_added(const SurfaceNetwork& network, const std::vector<StripRing>& rings,
                                const std::vector<std::vector<double>>& added);

}  // namespace angiospline
