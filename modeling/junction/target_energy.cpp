#include "modeling/junction/target_energy.h"

#include <algorithm>
#include <cmath>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

constexpr int kSize = 6;
constexpr int kPoints = kSize * kSize;

// Sum over rows and columns of the squared second differences, as a 36 x 36 matrix.
Eigen::MatrixXd second_difference_matrix() {
  Eigen::MatrixXd R = Eigen::MatrixXd::Zero(kPoints, kPoints);
  const auto add = [&](int a, int b, int c) {
    Eigen::VectorXd d = Eigen::VectorXd::Zero(kPoints);
    d(a) = d(c) = 1;
    d(b) = -2;
    R += d * d.transpose();
  };
  for (int i = 0; i < kSize; ++i) {
    for (int j = 1; j + 1 < kSize; ++j) {
      add(i * kSize + j - 1, i * kSize + j, i * kSize + j + 1);
      add((j - 1) * kSize + i, j * kSize + i, (j + 1) * kSize + i);
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

TargetEnergy::TargetEnergy(const JunctionTopology& topology, const JunctionTarget* target,
                           const JunctionLayout& layout, const JunctionNet& net)
    : target_(target),
      layout_(layout),
      models_(topology.patches.size()),
      roughness_(second_difference_matrix()) {
  const int last = layout.grid.size() - 1;
  const int samples = last * (last + 1);  // the opening's own row is fixed
  const KnotVector knots = KnotVector::bezier(kSize - 1);
  b_.resize(kPoints, samples);
  bu_.resize(kPoints, samples);
  bv_.resize(kPoints, samples);
  sample_weights_.resize(samples);
  for (int i = 1, s = 0; i <= last; ++i) {
    const BasisValues u = basis_at(knots, static_cast<double>(i) / last, 1);
    for (int j = 0; j <= last; ++j, ++s) {
      const BasisValues v = basis_at(knots, static_cast<double>(j) / last, 1);
      for (int a = 0; a < kSize; ++a) {
        for (int c = 0; c < kSize; ++c) {
          b_(a * kSize + c, s) = u.values(0, a) * v.values(0, c);
          bu_(a * kSize + c, s) = u.values(1, a) * v.values(0, c);
          bv_(a * kSize + c, s) = u.values(0, a) * v.values(1, c);
        }
      }
      // Samples on edges belong to two patches.
      beside_pole_.push_back((last - i) + std::min(j, last - j) <= 1);
      sample_weights_(s) = (i == last ? 0.5 : 1.0) * (j == 0 || j == last ? 0.5 : 1.0);
    }
  }
  for (int p = 0; p < patches(); ++p) {
    const JunctionPatch& patch = topology.patches[index(p)];
    const JunctionSaddle& saddle = topology.saddles[index(patch.saddle)];
    const double own = layout.openings[index(patch.branch)].radius;
    const int neighbour = saddle.patch_a == p ? saddle.branch_b : saddle.branch_a;
    const double least = std::min(own, layout.openings[index(neighbour)].radius);
    Eigen::VectorXd scale(samples);
    for (int i = 1, s = 0; i <= last; ++i) {
      for (int j = 0; j <= last; ++j, ++s) {
        const double u = static_cast<double>(i) / last;
        scale(s) = (1 - u) * own + u * least;
      }
    }
    // A long patch's parameters are looser: its anchor gives way with the fourth power of its
    // extent.
    const double extent = patch_extent(layout, p);
    anchor_scales_.push_back(scale.unaryExpr([extent](double r) {
      const double longer = std::max(1.0, extent / r);
      return r * longer * longer;
    }));
    scales_.push_back(std::move(scale));
    PatchModel& model = models_[index(p)];
    for (int k = 0; k < kPoints; ++k) {
      const ControlSlot& slot = net.slots[index(net.grid.at(p, k / kSize, k % kSize))];
      for (int d = 0; d < slot.count; ++d) model.unknowns.push_back(slot.first + d);
    }
  }
}

void TargetEnergy::update(const JunctionNet& net, const EnergyWeights& weights) {
  EXPECTS(weights.distance == 0 || target_ != nullptr);
  for (int p = 0; p < patches(); ++p) update_patch(p, net, weights);
}

void TargetEnergy::update_patch(int p, const JunctionNet& net, const EnergyWeights& weights) {
  PatchModel& model = models_[index(p)];
  const Eigen::Index count = static_cast<Eigen::Index>(model.unknowns.size());
  const Eigen::Index samples = b_.cols();
  Eigen::Matrix<double, 3, kPoints> P;
  for (int k = 0; k < kPoints; ++k) P.col(k) = net.points.col(net.grid.at(p, k / kSize, k % kSize));
  const Eigen::Matrix3Xd S = P * b_;
  const Eigen::Matrix3Xd Su = P * bu_;
  const Eigen::Matrix3Xd Sv = P * bv_;

  // Rows along the target's normals: residuals and, scaled alike, their basis functions.
  const int last = layout_.grid.size() - 1;
  const Eigen::VectorXd& scale = scales_[index(p)];
  Eigen::MatrixXd basis(kPoints, 3 * samples);
  Eigen::Matrix3Xd normals(3, samples);
  Eigen::Matrix3Xd anchors(3, samples);
  Eigen::VectorXd residual(3 * samples);
  Eigen::VectorXd anchor_weight(samples);
  for (int s = 0; s < samples; ++s) {
    const int node = layout_.grid.at(p, 1 + s / (last + 1), s % (last + 1));
    anchors.col(s) = layout_.nodes.col(node);
    const double pole = beside_pole_[index(s)] ? weights.pole : 1.0;
    const double w = std::sqrt(pole * sample_weights_(s));
    JunctionTarget::Foot foot{0, layout_.normals.col(node)};
    if (weights.distance > 0) foot = target_->foot(S.col(s));
    normals.col(s) = foot.normal;
    const double on_distance = w * std::sqrt(weights.distance) / scale(s);
    const double shortest = 0.05 * scale(s);
    const double on_u = w * std::sqrt(weights.tangent) / std::max(Su.col(s).norm(), shortest);
    const double on_v = w * std::sqrt(weights.tangent) / std::max(Sv.col(s).norm(), shortest);
    basis.col(3 * s) = on_distance * b_.col(s);
    basis.col(3 * s + 1) = on_u * bu_.col(s);
    basis.col(3 * s + 2) = on_v * bv_.col(s);
    residual(3 * s) = on_distance * foot.distance;
    residual(3 * s + 1) = on_u * foot.normal.dot(Su.col(s));
    residual(3 * s + 2) = on_v * foot.normal.dot(Sv.col(s));
    anchor_weight(s) = weights.anchor * sample_weights_(s) / std::pow(anchor_scales_[index(p)](s), 2);
  }
  Eigen::MatrixXd J(count, 3 * samples);
  Eigen::Index row = 0;
  std::array<Eigen::Index, kPoints> first{};
  for (int k = 0; k < kPoints; ++k) {
    const ControlSlot& slot = net.slots[index(net.grid.at(p, k / kSize, k % kSize))];
    first[index(k)] = row;
    for (int d = 0; d < slot.count; ++d, ++row) {
      for (Eigen::Index s = 0; s < samples; ++s) {
        const double n = slot.count == 3 ? normals(d, s) : normals.col(s).dot(slot.along);
        J.block<1, 3>(row, 3 * s) = n * basis.block<1, 3>(k, 3 * s);
      }
    }
  }
  model.hessian.setZero(count, count);
  model.hessian.selfadjointView<Eigen::Lower>().rankUpdate(J);
  model.gradient = J * residual;

  // The isotropic terms.
  const double least = scale.minCoeff();
  const Eigen::MatrixXd K = b_ * anchor_weight.asDiagonal() * b_.transpose() +
                            weights.roughness / (least * least) * roughness_;
  const Eigen::Matrix3Xd G = P * K - anchors * anchor_weight.asDiagonal() * b_.transpose();
  for (int k = 0; k < kPoints; ++k) {
    const ControlSlot& a = net.slots[index(net.grid.at(p, k / kSize, k % kSize))];
    for (int d = 0; d < a.count; ++d) {
      model.gradient(first[index(k)] + d) += a.count == 3 ? G(d, k) : a.along.dot(G.col(k));
    }
    for (int l = 0; l <= k; ++l) {
      const ControlSlot& b = net.slots[index(net.grid.at(p, l / kSize, l % kSize))];
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
