#include "modeling/junction/patch_basis.h"

#include "base/index.h"
#include "kernel/spline/basis.h"

namespace angiospline {

PatchBasis patch_basis(const Vec2& uv) {
  static const KnotVector knots = KnotVector::bezier(kPatchSize - 1);
  const BasisValues bu = basis_at(knots, uv.x(), 1);
  const BasisValues bv = basis_at(knots, uv.y(), 1);
  PatchBasis b;
  for (int i = 0; i < kPatchSize; ++i) {
    for (int j = 0; j < kPatchSize; ++j) {
      b.value(i * kPatchSize + j) = bu.values(0, i) * bv.values(0, j);
      b.u(i * kPatchSize + j) = bu.values(1, i) * bv.values(0, j);
      b.v(i * kPatchSize + j) = bu.values(0, i) * bv.values(1, j);
    }
  }
  return b;
}

PatchNet patch_net(const JunctionNet& net, int patch) {
  PatchNet P;
  for (int k = 0; k < kPatchPoints; ++k) {
    P.col(k) = net.points.col(net.grid.at(patch, k / kPatchSize, k % kPatchSize));
  }
  return P;
}

PatchNet patch_net(const JunctionNet& net, const std::array<int, kPatchPoints>& points) {
  PatchNet P;
  for (int k = 0; k < kPatchPoints; ++k) P.col(k) = net.points.col(points[index(k)]);
  return P;
}

}  // namespace angiospline
