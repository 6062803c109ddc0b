// Cutting all patches of a network alike, so that they still meet control point by control point.
#pragma once

#include <cstddef>
#include <vector>

#include "base/result.h"
#include "modeling/network/surface_network.h"
#include "recovery/thesis/deform/mesh.h"

namespace angiospline {

// Parameter directions of patches (2 * patch + 0 for u, + 1 for v) that shared boundaries force to
// be cut alike, each with whether it runs against the first of its class.
class PatchDirections {
 public:
  // The classes that the network's joins make.
  explicit PatchDirections(const SurfaceNetwork& network);

  struct Root {
    std::size_t of;
    bool against;
  };
  Root find(std::size_t direction) const;
  // A class that meets itself in reverse must be cut symmetrically.
  std::vector<std::size_t> folded() const;

 private:
  // Directions a and b are one, run against each other or not.
  void join(std::size_t a, std::size_t b, bool reversed);

  std::vector<std::size_t> parent_;
  std::vector<char> against_;
  std::vector<std::size_t> folded_;
};

// Into how many equal pieces each knot span is cut.
using SpanPieces = std::vector<int>;

// The knots of a patch along v, or along u.
const KnotVector& knots_along(const Patch& patch, bool v);
// Whether a side of a patch runs along v.
bool runs_with_v(PatchSide side);

// The same surfaces with every direction cut into its class's pieces (at the class's root; others
// are not looked at), what joins make one being one pool column, numbered by first occurrence; and
// the bound on the distance of the control meshes. Error: more nodes than allowed.
Result<RefinedNetwork> cut_network(const SurfaceNetwork& network, const PatchDirections& directions,
                                   const std::vector<SpanPieces>& pieces, int most_nodes);

}  // namespace angiospline
