// Evidence of a wall in the grey values of an image.
#pragma once

#include <optional>

#include "recovery/wall/evidence.h"
#include "recovery/wall/wall_greys.h"

namespace angiospline {

// Offsets by wall_offset() (recovery/wall/wall_profile.h) between the levels of wall_greys(), what
// Rician noise takes from profiles added; nodes near open ends and with less than a quarter of the
// contrast say nothing. The field must outlive it.
class EvidenceOfGreys : public Evidence {
 public:
  explicit EvidenceOfGreys(const GreyField& field) : field_(field) {}

  // With levels at the nodes of the mesh that is asked about, known from elsewhere: looking does
  // not measure them again.
  EvidenceOfGreys(const GreyField& field, WallGreys known)
      : field_(field), greys_(std::move(known)), levels_are_known_(true) {}

  // Of the last look. Empty before any.
  const WallGreys& greys() const { return greys_; }

  void look(const FitMesh& mesh, MeshSmoother& smoother,
            const Eigen::VectorXd& displacement_mm) override;
  bool found() const override { return greys_.contrast > 0; }
  double voxel_mm() const override { return field_.voxel_mm(); }
  double snr() const override { return greys_.snr(); }
  WallOffsets offsets(const FitMesh& mesh, const Eigen::VectorXd& displacement_mm,
                      double half_window_vox) const override;
  double noise_density(double half_window_vox, const MeshSmoother& smoother) const override {
    return greys_.noise_density(field_, half_window_vox, smoother);
  }

  // Grey just inside minus grey just outside, over the contrast of all, in the mean.
  std::vector<double> support(const FitMesh& mesh,
                              const Eigen::VectorXd& displacement_mm) const override;

 private:
  const GreyField& field_;
  WallGreys greys_;
  bool levels_are_known_ = false;
};

}  // namespace angiospline
