#include <cmath>

#include <Eigen/SparseCore>

#include "base/index.h"
#include "kernel/numerics/sparse_cholesky.h"
#include "kernel/refine/refinement.h"
#include "recovery/thesis/deform/mesh.h"

namespace angiospline {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;

// A with fine = A coarse for all pool columns: the tensor product of each patch's refinements along
// u and v; what patches share is taken once, from the first of them.
SparseMatrix refinement_of_pool(const SurfaceNetwork& fine, const SurfaceNetwork& coarse) {
  std::vector<Eigen::Triplet<double>> entries;
  std::vector<char> done(index(fine.control_points_mm.cols()), 0);
  for (std::size_t p = 0; p < fine.patches.size(); ++p) {
    const Patch &f = fine.patches[p], &c = coarse.patches[p];
    const CompactRows U = refinement_matrix(c.u, f.u), V = refinement_matrix(c.v, f.v);
    const int nv = f.v.control_point_count(), coarse_nv = c.v.control_point_count();
    for (int i = 0; i < f.u.control_point_count(); ++i)
      for (int j = 0; j < nv; ++j) {
        const int row = f.control[index(i) * nv + index(j)];
        if (done[index(row)]++ != 0) continue;
        for (int a = 0; a < U.width(); ++a)
          for (int b = 0; b < V.width(); ++b)
            entries.emplace_back(
                row, c.control[index(U.first(i) + a) * coarse_nv + index(V.first(j) + b)],
                U.row(i)[a] * V.row(j)[b]);
      }
  }

  SparseMatrix A(fine.control_points_mm.cols(), coarse.control_points_mm.cols());
  A.setFromTriplets(entries.begin(), entries.end());
  return A;
}

}  // namespace

RefinedNetwork coarsen_network(const SurfaceNetwork& fine, const SurfaceNetwork& coarse) {
  EXPECTS(fine.patches.size() == coarse.patches.size());
  const SparseMatrix A = refinement_of_pool(fine, coarse);
  const Eigen::MatrixX3d rest =
      (fine.control_points_mm - coarse.control_points_mm * A.transpose()).transpose();

  // Normal equations of the step that leaves least of what is not yet reached: A'A x = A' rest.
  const SparseCholesky normal(A.transpose() * A);
  const Eigen::MatrixX3d step = normal.solve(A.transpose() * rest);

  RefinedNetwork out{coarse, 0.0};
  out.network.control_points_mm += step.transpose();
  const Eigen::MatrixX3d left = rest - A * step;
  out.distance_mm = std::sqrt(left.rowwise().squaredNorm().maxCoeff());
  return out;
}

}  // namespace angiospline
