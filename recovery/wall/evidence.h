// What says where a wall lies. A fit asks nothing else, whatever the wall is known from.
#pragma once

#include <vector>

#include "recovery/wall/wall_mesh.h"

namespace angiospline {

// What evidence asks for at each node of a mesh, along its normal, measured from where
// displacements have taken it.
struct WallOffsets {
  Eigen::VectorXd mm;
  Eigen::VectorXd weight;  // 0: nothing was measured there; 1 on a clear wall
};

// One source of evidence: an image's greys (recovery/wall/evidence_of_greys.h). Another one, say of
// a probability map or of a surface, derives from this and gives itself to wall_displacement().
// Displacements are in mm along the nodes' normals, one a node.
class Evidence {
 public:
  virtual ~Evidence() = default;

  // Looks at the wall as a whole, where displacements have taken it: levels, noise, what else
  // offsets rest on. Comes before offsets are asked for, and again as the wall comes nearer.
  virtual void look(const FitMesh& mesh, MeshSmoother& smoother,
                    const Eigen::VectorXd& displacement_mm) = 0;

  // Whether there was anything to go by. Without it offsets mean nothing.
  virtual bool found() const = 0;

  // The length that windows are counted in: how finely the evidence is known.
  virtual double voxel_mm() const = 0;

  // How far the evidence stands out of its noise: contrast over the deviation of a voxel.
  virtual double snr() const = 0;

  // By profiles of so many voxels to either side of the wall. O(nodes).
  virtual WallOffsets offsets(const FitMesh& mesh, const Eigen::VectorXd& displacement_mm,
                              double half_window_vox) const = 0;

  // Variance of such an offset, times the area over which offsets are alike (mm^4): what the mean
  // over an area A still varies by is this over A.
  virtual double noise_density(double half_window_vox, const MeshSmoother& smoother) const = 0;

  // How clear the wall of each region is: near 1 on a wall, near 0 away from any. O(nodes).
  virtual std::vector<double> support(const FitMesh& mesh,
                                      const Eigen::VectorXd& displacement_mm) const = 0;
};

}  // namespace angiospline
