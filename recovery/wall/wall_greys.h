// Grey values on both sides of a wall, and the noise.
#pragma once

#include "recovery/wall/rician_noise.h"
#include "recovery/wall/wall_mesh.h"

namespace angiospline {

// Grey values on both sides of the wall at each node, and the noise.
struct WallGreys {
  Eigen::VectorXd inside;
  Eigen::VectorXd outside;
  double contrast = 0.0;  // median of inside - outside
  double noise = 0.0;     // standard deviation of a voxel; of Rician noise, that of its two parts
  NoiseKind kind = NoiseKind::kWhite;
  double snr() const;  // contrast over noise, at most 20

  // Variance of a profile's sum of this half window, times the area over which sums are alike
  // (mm^4): what the mean over an area A still varies by is this over A.
  double noise_density(const GreyField& field, double half_window_vox,
                       const MeshSmoother& smoother) const;
};

// Robust and local: means of what lies one to three voxels from the wall, smooth over some five
// radii outside (so that a background may rise across a vessel) and some eight inside; a vessel too
// thin to have an inside takes its level from its neighbours. Other vessels beside it are left out.
// Which noise the image has is judged from the voxels that levels are taken from
// (recovery/wall/rician_noise.h).
WallGreys wall_greys(const GreyField& field, const FitMesh& mesh, MeshSmoother& smoother,
                     const Eigen::VectorXd& displacement_mm);

// Values far from the smooth ones count less: weights are those of `base`, over the square of the
// residual where it is more than three robust standard deviations (at least `floor`).
void weigh_outliers(const Eigen::VectorXd& residual, const Eigen::VectorXd& base, double floor,
                    Eigen::VectorXd& weights);

// What Rician noise adds to the sum of a profile beyond what it adds to the levels. Greys in the
// middle of a blurred wall rise by less than those outside, so that the normalised profile sags.
class ProfileSag {
 public:
  ProfileSag() = default;  // none

  // Measured: the mean profile over all nodes, `half_window_vox` to either side, and the amplitudes
  // that have its means.
  ProfileSag(const GreyField& field, const FitMesh& mesh, const WallGreys& greys,
             const Eigen::VectorXd& displacement_mm, double half_window_vox);

  // Of a sum along the normal at this place, in mm; negative: the sum has too little.
  double offset_mm(const GreyField& field, const WallPoint& at) const;

 private:
  // Integrals of the sag times s^0, s^1, s^2, s in voxel widths.
  Vec3 moments_ = Vec3::Zero();
};

}  // namespace angiospline
