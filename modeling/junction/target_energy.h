// How far a junction's patches are from their target: the quadratic model of each Gauss-Newton
// step.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modeling/junction/patch_basis.h"
#include "modeling/junction/patch_solver.h"
#include "modeling/junction/unknowns.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

// Weights of the squared terms at each sample; lengths in local radii.
struct EnergyWeights {
  double distance = 10.0;    // from the target
  double tangent = 1.0;      // sines between Su, Sv and the target's tangent plane
  double anchor = 0.3;       // from the layout's node of the same parameters; less on long patches
  double roughness = 0.003;  // second differences of the control net
  double pole = 4.0;         // of samples beside a pole, against 1 elsewhere
};

// The Gauss-Newton models of all patches (Nocedal & Wright: Numerical Optimization, 10.3): normals
// and tangent lengths are held at their current values, so that every term is the square of a
// function linear in the control points. Where the weight of the distance is zero the normals are
// the layout's and the target is not evaluated; it may be null then. Target and layout must outlive
// it.
class TargetEnergy {
 public:
  TargetEnergy(const JunctionTopology& topology, const JunctionTarget* target,
               const JunctionLayout& layout, const JunctionNet& net);

  // One a patch; empty but for their unknowns before the first update.
  const std::vector<PatchModel>& models() const { return models_; }

  // The models at the net's current points. O(patches * samples).
  const std::vector<PatchModel>& updated(const JunctionNet& net, const EnergyWeights& weights);

 private:
  // What one patch is asked for at its samples: rows of a linear least squares problem along the
  // target's normals, and what it is anchored to.
  struct SampleRows {
    Eigen::MatrixXd basis;      // 36 x 3 samples: of distance, Su and Sv, scaled as the residuals
    Eigen::VectorXd residual;   // 3 samples
    Eigen::Matrix3Xd normals;   // the direction of all three rows of a sample
    Eigen::Matrix3Xd anchors;   // the layout's nodes
    Eigen::VectorXd on_anchor;  // weights of the squared distances from them
  };

  void tabulate_samples();
  void set_scales(const JunctionTopology& topology, int patch);
  void set_unknowns(const JunctionNet& net, int patch);

  SampleRows sample_rows(int patch, const PatchNet& P, const EnergyWeights& weights) const;
  void project_on_unknowns(int patch, const JunctionNet& net, const SampleRows& rows);
  void add_isotropic(int patch, const JunctionNet& net, const PatchNet& P, const SampleRows& rows,
                     double roughness);

  const JunctionTarget* target_;
  const JunctionLayout& layout_;
  std::vector<PatchModel> models_;
  std::vector<Eigen::VectorXd> scales_;         // local radius at each sample of a patch
  std::vector<Eigen::VectorXd> anchor_scales_;  // and what distances from the anchor are divided by
  Eigen::MatrixXd b_, bu_, bv_;                 // 36 x samples
  Eigen::VectorXd sample_weights_;
  std::vector<char> beside_pole_;  // whether a sample is a pole or next to one
  Eigen::MatrixXd roughness_;      // 36 x 36
};

}  // namespace angiospline
