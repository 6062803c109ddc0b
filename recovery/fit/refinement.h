// Where a fitted wall still is too far from the image's, and a network with more freedom there.
#pragma once

#include <string>
#include <vector>

#include "modeling/network/surface_network.h"
#include "recovery/wall/evidence.h"

namespace angiospline {

struct ResidualOptions {
  double mean_vox = 1.5;    // how far around a node residuals are averaged
  double deviations = 5.0;  // of what noise leaves of such a mean: more is no noise
  double least_vox = 0.1;   // and at least so far from the wall
  double half_window_vox = 0.75;
};

// Nodes whose wall lies significantly elsewhere.
struct LargeResiduals {
  Eigen::VectorXd mean_mm;          // residual along the normal, averaged
  std::vector<char> large;          // of each node
  std::vector<char> regions;        // of the network: has any
  std::vector<double> amounts_mm3;  // of each region: their sizes times their areas

  bool any() const;
  // From now on nothing of the region is large.
  void leave_out(const FitMesh& mesh, int region);
};

// Measures the wall from where the mesh is, by evidence that has looked at it. Regions with
// `excluded` set are not looked at.
LargeResiduals large_residuals(const Evidence& evidence, const SurfaceNetwork& network,
                               const FitMesh& mesh, MeshSmoother& smoother,
                               const std::vector<char>& excluded,
                               const ResidualOptions& options = {});

// How far what marks stand for moves nodes around: 1 at marks, falling to 0 within some four times
// `around_mm`.
Eigen::VectorXd share_around(const std::vector<char>& marks, MeshSmoother& smoother,
                             double around_mm);

// More freedom where residuals are large: spans of bodies are halved, down to `shortest_mm`;
// closed surfaces get four patches for each, unless patches would be shorter than four times that;
// junctions get none. The surfaces are the same; patches keep their numbers. The names of the
// regions that got any. `share` is that of each node's move that is to be taken.
struct LocallyRefinedNetwork {
  SurfaceNetwork network;
  std::vector<std::string> regions;
};
LocallyRefinedNetwork refined_where_large(const SurfaceNetwork& network, const FitMesh& mesh,
                                          const LargeResiduals& residuals,
                                          const Eigen::VectorXd& share, double shortest_mm);

}  // namespace angiospline
