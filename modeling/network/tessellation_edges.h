// The points that patches share: where they meet and where the surface ends.
#pragma once

#include <array>
#include <vector>

#include "kernel/spline/surface.h"
#include "modeling/network/mesh_spacing.h"
#include "modeling/network/surface_network.h"
#include "modeling/network/tessellation_draft.h"

namespace angiospline {

// The curves of a network, divided. Both sides of a join use the same points, so no gap can open.
class TessellationEdges {
 public:
  // Adds the points of all edges to `draft`: first corners, then, edge by edge (joins, then rims'
  // sides), the larger demand of the two sides. Requires a network without defect, one surface and
  // one spacing for each patch.
  TessellationEdges(const SurfaceNetwork& network, const std::vector<BSplineSurface<3>>& surfaces,
                    const std::vector<PatchSpacing>& spacings, TessellationDraft& draft);

  // All points along one side of a patch, by the side's own parameter.
  MeshChain side_chain(int patch, PatchSide side) const;

  // The points around each rim, once, with the cap on the left.
  std::vector<std::vector<int>> rim_loops() const;

 private:
  // A curve where patches meet or the surface ends: side a, and side b unless it lies on a rim.
  struct Edge {
    Join join;
    int rim = -1;               // index of the rim, or -1 for a join
    std::vector<double> along;  // samples in [0, 1] of the join
    std::vector<int> points;    // of the mesh, one for each sample
  };
  // A use of an edge by a patch's side.
  struct Use {
    int edge;
    bool is_b;
    double from;
  };

  void use(const Side& side, int edge, bool is_b);
  void collect();
  void number_corners();
  void sample(Edge& edge);
  int add_point(const Side& side, double t);

  const SurfaceNetwork& network_;
  const std::vector<BSplineSurface<3>>& surfaces_;
  const std::vector<PatchSpacing>& spacings_;
  TessellationDraft& draft_;
  std::vector<Edge> edges_;
  std::vector<std::array<std::vector<Use>, 4>> uses_;  // of each patch, by side, in growing order
};

}  // namespace angiospline
