#include "modeling/junction/target_energy.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/junction/rules.h"

namespace angiospline {
namespace {

// Sum over rows and columns of the squared second differences, as a 36 x 36 matrix.
Eigen::MatrixXd second_difference_matrix() {
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(kPatchPoints, kPatchPoints);
  const auto add = [&](int a, int b, int c) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(kPatchPoints);
    d(a) = d(c) = 1;
    d(b) = -2;
    R += d * d.transpose();
  };

  for (int i = 0; i < kPatchSize; ++i) {
    for (int j = 1; j + 1 < kPatchSize; ++j) {
      add(i * kPatchSize + j - 1, i * kPatchSize + j, i * kPatchSize + j + 1);
      add((j - 1) * kPatchSize + i, j * kPatchSize + i, (j + 1) * kPatchSize + i);
    }
  }
  return R;
}

// Half the mean length of the layout's lines across a patch, in the direction where they are
// longer.
double patch_extent(const JunctionLayout& layout, int patch) {
  const int last = layout.grid.size() - 1;
  const auto node = [&](int i, int j) -> Vec3 {
    return layout.nodes.col(layout.grid.at(patch, i, j));
  };

  double along_u = 0;
  double along_v = 0;
  for (int line = 0; line <= last; ++line) {
    for (int k = 0; k < last; ++k) {
      along_u += (node(k + 1, line) - node(k, line)).norm();
      along_v += (node(line, k + 1) - node(line, k)).norm();
    }
  }
  return std::max(along_u, along_v) / (2 * (last + 1));
}

}  // namespace

using namespace junction_rules;

TargetEnergy::TargetEnergy(const JunctionTopology& topology, const JunctionTarget* target,
                           const JunctionLayout& layout, const JunctionNet& net)
    : target_(target),
      layout_(layout),
      models_(topology.patches.size()),
      roughness_(second_difference_matrix()) {
  tabulate_samples();
  for (int p = 0; p < static_cast<int>(models_.size()); ++p) {
    set_scales(topology, p);
    set_unknowns(net, p);
  }
}

// Samples lie at the layout's nodes of the same parameters.
void TargetEnergy::tabulate_samples() {
  const int last = layout_.grid.size() - 1;
  const int samples = last * (last + 1);  // the opening's own row is fixed
  b_.resize(kPatchPoints, samples);
  bu_.resize(kPatchPoints, samples);
  bv_.resize(kPatchPoints, samples);
  sample_weights_.resize(samples);

  for (int i = 1, s = 0; i <= last; ++i) {
    for (int j = 0; j <= last; ++j, ++s) {
      const PatchBasis basis =
          patch_basis({static_cast<double>(i) / last, static_cast<double>(j) / last});
      b_.col(s) = basis.value;
      bu_.col(s) = basis.u;
      bv_.col(s) = basis.v;

      // Samples on edges belong to two patches.
      beside_pole_.push_back((last - i) + std::min(j, last - j) <= 1);
      sample_weights_(s) = (i == last ? 0.5 : 1.0) * (j == 0 || j == last ? 0.5 : 1.0);
    }
  }
}

// Lengths count in radii: the branch's own at its opening, the smaller of both branches' at the
// saddle.
void TargetEnergy::set_scales(const JunctionTopology& topology, int p) {
  const JunctionPatch& patch = topology.patches[index(p)];
  const JunctionSaddle& saddle = topology.saddles[index(patch.saddle)];
  const double own = layout_.openings[index(patch.branch)].radius;
  const int neighbour = saddle.patch_a == p ? saddle.branch_b : saddle.branch_a;
  const double least = std::min(own, layout_.openings[index(neighbour)].radius);

  const int last = layout_.grid.size() - 1;
  Eigen::VectorXd scale(b_.cols());
  for (int i = 1, s = 0; i <= last; ++i) {
    for (int j = 0; j <= last; ++j, ++s) {
      const double u = static_cast<double>(i) / last;
      scale(s) = (1 - u) * own + u * least;
    }
  }

  // A long patch's parameters are looser: its anchor gives way with the fourth power of its
  // extent.
  const double extent = patch_extent(layout_, p);
  anchor_scales_.push_back(scale.unaryExpr([extent](double r) {
    const double longer = std::max(1.0, extent / r);
    return r * longer * longer;
  }));
  scales_.push_back(std::move(scale));
}

void TargetEnergy::set_unknowns(const JunctionNet& net, int p) {
  PatchModel& model = models_[index(p)];
  for (int k = 0; k < kPatchPoints; ++k) {
    const ControlSlot& slot = net.slots[index(net.grid.at(p, k / kPatchSize, k % kPatchSize))];
    for (int d = 0; d < slot.count; ++d) model.unknowns.push_back(slot.first + d);
  }
}

const std::vector<PatchModel>& TargetEnergy::updated(const JunctionNet& net,
                                                     const EnergyWeights& weights) {
  EXPECTS(weights.distance == 0 || target_ != nullptr);
  for (int p = 0; p < static_cast<int>(models_.size()); ++p) {
    const PatchNet P = patch_net(net, p);
    const SampleRows rows = sample_rows(p, P, weights);
    project_on_unknowns(p, net, rows);
    add_isotropic(p, net, P, rows, weights.roughness);
  }
  return models_;
}

// Residuals along the target's normals n: the distance, and n . Su and n . Sv over the lengths of
// the tangents, which are their sines. With n and the lengths held these are linear in P.
TargetEnergy::SampleRows TargetEnergy::sample_rows(int p, const PatchNet& P,
                                                   const EnergyWeights& weights) const {
  const Eigen::Matrix3Xd S = P * b_;
  const Eigen::Matrix3Xd Su = P * bu_;
  const Eigen::Matrix3Xd Sv = P * bv_;

  const int last = layout_.grid.size() - 1;
  const Eigen::Index samples = b_.cols();
  const Eigen::VectorXd& scale = scales_[index(p)];
  SampleRows rows{Eigen::MatrixXd(kPatchPoints, 3 * samples), Eigen::VectorXd(3 * samples),
                  Eigen::Matrix3Xd(3, samples), Eigen::Matrix3Xd(3, samples),
                  Eigen::VectorXd(samples)};
  for (int s = 0; s < samples; ++s) {
    const int node = layout_.grid.at(p, 1 + s / (last + 1), s % (last + 1));
    JunctionTarget::Foot foot{0, layout_.normals.col(node)};
    if (weights.distance > 0) foot = target_->foot(S.col(s));
    rows.normals.col(s) = foot.normal;

    // Square roots of the weights, and the lengths that make residuals free of the unit.
    const double pole = beside_pole_[index(s)] ? weights.pole : 1.0;
    const double w = std::sqrt(pole * sample_weights_(s));
    const double on_distance = w * std::sqrt(weights.distance) / scale(s);
    const double shortest = kShortestTangent * scale(s);
    const double on_u = w * std::sqrt(weights.tangent) / std::max(Su.col(s).norm(), shortest);
    const double on_v = w * std::sqrt(weights.tangent) / std::max(Sv.col(s).norm(), shortest);

    rows.basis.col(3 * s) = on_distance * b_.col(s);
    rows.basis.col(3 * s + 1) = on_u * bu_.col(s);
    rows.basis.col(3 * s + 2) = on_v * bv_.col(s);
    rows.residual(3 * s) = on_distance * foot.distance;
    rows.residual(3 * s + 1) = on_u * foot.normal.dot(Su.col(s));
    rows.residual(3 * s + 2) = on_v * foot.normal.dot(Sv.col(s));

    rows.anchors.col(s) = layout_.nodes.col(node);
    rows.on_anchor(s) =
        weights.anchor * sample_weights_(s) / std::pow(anchor_scales_[index(p)](s), 2);
  }
  return rows;
}

// H = J J' and g = J r (Gauss-Newton), J a row an unknown: a free point's three directions see the
// three components of n, a sliding point sees n along its axis.
void TargetEnergy::project_on_unknowns(int p, const JunctionNet& net, const SampleRows& rows) {
  PatchModel& model = models_[index(p)];
  const Eigen::Index count = std::ssize(model.unknowns);
  const Eigen::Index samples = b_.cols();

  Eigen::MatrixXd J(count, 3 * samples);
  Eigen::Index row = 0;
  for (int k = 0; k < kPatchPoints; ++k) {
    const ControlSlot& slot = net.slots[index(net.grid.at(p, k / kPatchSize, k % kPatchSize))];
    for (int d = 0; d < slot.count; ++d, ++row) {
      for (Eigen::Index s = 0; s < samples; ++s) {
        const double n = slot.count == 3 ? rows.normals(d, s) : rows.normals.col(s).dot(slot.along);
        J.block<1, 3>(row, 3 * s) = n * rows.basis.block<1, 3>(k, 3 * s);
      }
    }
  }

  model.hessian.setZero(count, count);
  model.hessian.selfadjointView<Eigen::Lower>().rankUpdate(J);
  model.gradient = J * rows.residual;
}

// Anchor and roughness treat all three coordinates alike: with A the anchors and W their weights,
//   K = B W B' + roughness R,   G = P K - A W B',
// the gradient of each control point is a column of G, and the Hessian of a pair of points is K(k,
// l) times the product of their directions.
void TargetEnergy::add_isotropic(int p, const JunctionNet& net, const PatchNet& P,
                                 const SampleRows& rows, double roughness) {
  PatchModel& model = models_[index(p)];
  const double least = scales_[index(p)].minCoeff();
  const Eigen::MatrixXd K =
      b_ * rows.on_anchor.asDiagonal() * b_.transpose() + roughness / (least * least) * roughness_;
  const Eigen::Matrix3Xd G = P * K - rows.anchors * rows.on_anchor.asDiagonal() * b_.transpose();

  // Where each point's unknowns begin in the model.
  const auto slot_of = [&](int k) -> const ControlSlot& {
    return net.slots[index(net.grid.at(p, k / kPatchSize, k % kPatchSize))];
  };
  std::array<Eigen::Index, kPatchPoints> first{};
  for (int k = 1; k < kPatchPoints; ++k) {
    first[index(k)] = first[index(k - 1)] + slot_of(k - 1).count;
  }

  for (int k = 0; k < kPatchPoints; ++k) {
    const ControlSlot& a = slot_of(k);
    for (int d = 0; d < a.count; ++d) {
      model.gradient(first[index(k)] + d) += a.count == 3 ? G(d, k) : a.along.dot(G.col(k));
    }
    for (int l = 0; l <= k; ++l) {
      const ControlSlot& b = slot_of(l);
      for (int d = 0; d < a.count; ++d) {
        const Vec3 da = a.count == 3 ? Vec3::Unit(d) : a.along;
        for (int e = 0; e < b.count; ++e) {
          const Vec3 db = b.count == 3 ? Vec3::Unit(e) : b.along;
          if (first[index(l)] + e <= first[index(k)] + d) {
            model.hessian(first[index(k)] + d, first[index(l)] + e) += K(k, l) * da.dot(db);
          }
        }
      }
    }
  }
}

}  // namespace angiospline
