#include "kernel/numerics/spectrum.h"

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

namespace angiospline {

SingularDecomposition singular_values(const Eigen::MatrixXd& A, SingularVectors vectors) {
  unsigned wanted = Eigen::ComputeThinU;
  if (vectors == SingularVectors::kThin) wanted = Eigen::ComputeThinU | Eigen::ComputeThinV;
  if (vectors == SingularVectors::kFullLeft) wanted = Eigen::ComputeFullU;
  const Eigen::BDCSVD<Eigen::MatrixXd> svd(A, wanted);

  SingularDecomposition out{svd.matrixU(), svd.singularValues(), {}};
  if (vectors == SingularVectors::kThin) out.V = svd.matrixV();
  return out;
}

Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& A) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(A, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace angiospline
