// How far a junction's patches are from their target: the quadratic model of each Gauss-Newton
// step.
#pragma once

#include <vector>

#include <Eigen/Core>

#include "modeling/junction/layout.h"
#include "modeling/junction/target.h"
#include "modeling/junction/topology.h"
#include "modeling/junction/unknowns.h"

namespace angiospline {

// Weights of the squared terms at each sample; lengths in local radii.
struct EnergyWeights {
  double distance = 10.0;    // from the target
  double tangent = 1.0;      // sines between Su, Sv and the target's tangent plane
  double anchor = 0.3;       // from the layout's node of the same parameters; less on long patches
  double roughness = 0.003;  // second differences of the control net
  double pole = 4.0;         // of samples beside a pole, against 1 elsewhere
};

// Weights for fitting the layout itself.
inline constexpr EnergyWeights kFitWeights{0.0, 0.1, 1.0, 0.001, 1.0};

// The unknowns a patch depends on, and its share of the Hessian (lower triangle) and gradient.
struct PatchModel {
  std::vector<int> unknowns;
  Eigen::MatrixXd hessian;
  Eigen::VectorXd gradient;
};

// The Gauss-Newton models of all patches: normals and tangent lengths are held at their current
// values. Where the weight of the distance is zero the normals are the layout's and the target is
// not evaluated; it may be null then.
class TargetEnergy {
 public:
  TargetEnergy(const JunctionTopology& topology, const JunctionTarget* target,
               const JunctionLayout& layout, const JunctionNet& net);

  int patches() const { return static_cast<int>(models_.size()); }
  const PatchModel& model(int patch) const { return models_[static_cast<std::size_t>(patch)]; }

  // Fills the models at the net's current points.
  void update(const JunctionNet& net, const EnergyWeights& weights);

 private:
  void update_patch(int patch, const JunctionNet& net, const EnergyWeights& weights);

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
