#include "recovery/thesis/deform/system.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>

#include <Eigen/IterativeLinearSolvers>
#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <unsupported/Eigen/FFT>

#include "kernel/numerics/sparse_cholesky.h"
#include "kernel/numerics/spectrum.h"
#include "recovery/thesis/deform/rules.h"

namespace angiospline {
namespace {

using namespace deform_rules;

// By a pseudo-inverse: O(n^2) for each right side.
class DenseDivision : public Division {
 public:
  explicit DenseDivision(Eigen::MatrixXd inverse) : inverse_(std::move(inverse)) {}
  Points3 operator()(const Points3& b) const override { return b * inverse_; }

 private:
  Eigen::MatrixXd inverse_;  // symmetric
};

// By a sparse factor.
class SparseDivision : public Division {
 public:
  explicit SparseDivision(const Eigen::SparseMatrix<double>& A) : factors_(A) {}
  bool sound() const { return factors_.is_positive_definite(); }
  Points3 operator()(const Points3& b) const override {
    const Eigen::MatrixX3d columns = b.transpose();
    return factors_.solve(columns).transpose();
  }

 private:
  SparseCholesky factors_;
};

// By conjugate gradients, to a relative error.
class GradientDivision : public Division {
 public:
  GradientDivision(Eigen::SparseMatrix<double> A, double error) : A_(std::move(A)) {
    A_.makeCompressed();
    for (auto& solver : solvers_) {
      solver.setTolerance(error);
      solver.compute(A_);
    }
  }
  Points3 operator()(const Points3& b) const override {
    Eigen::MatrixX3d x(b.cols(), 3);
    tbb::parallel_for(0, 3, [&](int k) {
      const Eigen::VectorXd side = b.row(k).transpose();
      x.col(k) = solvers_[static_cast<std::size_t>(k)].solve(side);
    });
    return x.transpose();
  }

 private:
  Eigen::SparseMatrix<double> A_;
  // One a coordinate: each keeps count of its own steps. All refer to A_.
  std::array<Eigen::ConjugateGradient<Eigen::SparseMatrix<double>, Eigen::Lower | Eigen::Upper>, 3>
      solvers_;
};

// By the eigenvalues of a circulant matrix, which are the transform of its first row (5.28
// to 5.30).
class CirculantDivision : public Division {
 public:
  CirculantDivision(const PeriodicGrid& grid, double centre, double side, bool phantom)
      : grid_(grid), phantom_(phantom && grid.rows > 1) {
    const int rim = phantom_ ? 1 : 0;
    rows_ = grid.rows + 2 * rim;
    columns_ = grid.columns + 2 * rim;

    // Of the first row (5.26): c0, then a `side` for each neighbour, wrapped around.
    std::vector<std::complex<double>> c(static_cast<std::size_t>(rows_) * columns_);
    const auto n = static_cast<int>(c.size());
    c[0] += centre;
    for (const int step : {1, columns_})
      if (step == 1 || rows_ > 1)
        for (const int at : {step % n, (n - step % n) % n}) c[static_cast<std::size_t>(at)] += side;

    // Eigenvalues near 0 are those of a mesh moving as a whole: as in a pseudo-inverse they give 0.
    std::vector<std::complex<double>> transformed;
    fft_.fwd(transformed, c);
    double largest = 0;
    for (const auto& x : transformed) largest = std::max(largest, std::abs(x.real()));
    for (const auto& x : transformed)
      inverse_.push_back(std::abs(x.real()) <= kSingular * largest ? 0.0 : 1 / x.real());
  }

  // Transform, product with 1 / eigenvalue, and back (5.30); phantom nodes repeat the other end of
  // their row, and the rows beyond both ends stay 0 (5.33).
  Points3 operator()(const Points3& b) const override {
    Points3 out(3, b.cols());
    for (int coordinate = 0; coordinate < 3; ++coordinate) {
      std::vector<std::complex<double>> field(inverse_.size()), transformed;
      for (int r = 0; r < grid_.rows; ++r)
        for (int k = -rim(); k < grid_.columns + rim(); ++k) {
          const int column = (k + grid_.columns) % grid_.columns;
          field[slot(r, k)] = b(coordinate, node(r, column));
        }

      fft_.fwd(transformed, field);
      for (std::size_t k = 0; k < transformed.size(); ++k) transformed[k] *= inverse_[k];
      fft_.inv(field, transformed);

      for (int r = 0; r < grid_.rows; ++r)
        for (int k = 0; k < grid_.columns; ++k)
          out(coordinate, node(r, k)) = field[slot(r, k)].real();
    }
    return out;
  }

 private:
  int rim() const { return phantom_ ? 1 : 0; }
  std::size_t slot(int row, int column) const {
    return static_cast<std::size_t>(row + rim()) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column + rim());
  }
  int node(int row, int column) const {
    return grid_.order[static_cast<std::size_t>(row * grid_.columns + column)];
  }

  PeriodicGrid grid_;
  bool phantom_;
  int rows_ = 0, columns_ = 0;
  std::vector<double> inverse_;
  mutable Eigen::FFT<double> fft_;
};

}  // namespace

Result<void> ElementOptions::check() const {
  const std::pair<const char*, double> all[] = {{"spring", spring},   {"membrane", membrane},
                                                {"bending", bending}, {"damping", damping},
                                                {"drag", drag},       {"mass", mass}};
  for (const auto& [name, value] : all)
    if (!(value >= 0) || !std::isfinite(value))
      return fail({ErrorKind::kBadInput, "coefficient of the elements is not usable", name,
                   fmt::format("{}", value), "at least 0"});
  return {};
}

LaplacianPolynomial stiffness(const ElementOptions& e) {
  return {0.0, e.spring + e.membrane, e.bending};
}

LaplacianPolynomial implicit_step(const ElementOptions& e, double dt, double steepness) {
  const LaplacianPolynomial K = stiffness(e);
  return {e.drag + dt * (K.constant + steepness), e.damping + dt * K.linear, dt * K.square};
}

ElementSystem::ElementSystem(const DeformMesh& mesh, double voxel_mm, const ElementOptions& options)
    : springs_(mesh.springs), options_(options), rest_(mesh.nodes_mm / voxel_mm) {
  rest_length_.resize(springs_.cols());

  // Superposition of the elements (5.2): L has 1 and -1 for each spring. Zeros on the diagonal keep
  // nodes without one.
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(static_cast<std::size_t>(4 * springs_.cols() + rest_.cols()));
  for (int k = 0; k < rest_.cols(); ++k) entries.emplace_back(k, k, 0.0);
  for (Eigen::Index s = 0; s < springs_.cols(); ++s) {
    const int a = springs_(0, s), b = springs_(1, s);
    rest_length_[s] = (rest_.col(b) - rest_.col(a)).norm();
    entries.emplace_back(a, a, 1);
    entries.emplace_back(b, b, 1);
    entries.emplace_back(a, b, -1);
    entries.emplace_back(b, a, -1);
  }
  laplacian_.resize(rest_.cols(), rest_.cols());
  laplacian_.setFromTriplets(entries.begin(), entries.end());
}

Points3 ElementSystem::sum_over_springs(const Points3& field) const {
  Points3 sum = Points3::Zero(3, field.cols());
  for (Eigen::Index s = 0; s < springs_.cols(); ++s) {
    const Vec3 difference = field.col(springs_(1, s)) - field.col(springs_(0, s));
    sum.col(springs_(0, s)) += difference;
    sum.col(springs_(1, s)) -= difference;
  }
  return sum;
}

// -K(q) q, thesis 5.1.1: springs pull along their axes, so that their stiffness turns with them;
// membranes and plates are linear in the displacement.
Points3 ElementSystem::internal(const Points3& nodes, SystemForm form) const {
  const Points3 moved = nodes - rest_;
  const auto stretch = [&](Eigen::Index s) {  // of a spring, per length: its weight in K(x) x
    const double length = (nodes.col(springs_(1, s)) - nodes.col(springs_(0, s))).norm();
    return length > 0 ? options_.spring * (1 - rest_length_[s] / length) : 0.0;
  };

  // Assembled anew in every step (5.2): the matrix the thesis finds costly.
  if (form == SystemForm::kAssembled) {
    const LaplacianPolynomial bent{0, options_.membrane, options_.bending};
    const Eigen::SparseMatrix<double> K = matrix(bent);
    std::vector<Eigen::Triplet<double>> entries;
    for (Eigen::Index s = 0; s < springs_.cols(); ++s) {
      const int a = springs_(0, s), b = springs_(1, s);
      const double w = stretch(s);
      entries.emplace_back(a, a, w);
      entries.emplace_back(b, b, w);
      entries.emplace_back(a, b, -w);
      entries.emplace_back(b, a, -w);
    }
    Eigen::SparseMatrix<double> axial(K.rows(), K.cols());
    axial.setFromTriplets(entries.begin(), entries.end());
    return -(moved * K + nodes * axial);
  }

  // Element by element (5.18).
  Points3 force = Points3::Zero(3, nodes.cols());
  if (options_.spring > 0)
    for (Eigen::Index s = 0; s < springs_.cols(); ++s) {
      const int a = springs_(0, s), b = springs_(1, s);
      const Vec3 pull = stretch(s) * (nodes.col(b) - nodes.col(a));
      force.col(a) += pull;
      force.col(b) -= pull;
    }
  if (options_.membrane > 0 || options_.bending > 0) {
    const Points3 bent = sum_over_springs(moved);
    force += options_.membrane * bent;
    if (options_.bending > 0) force -= options_.bending * sum_over_springs(bent);
  }
  return force;
}

Points3 ElementSystem::damping(const Points3& velocity, SystemForm form) const {
  if (form == SystemForm::kAssembled)
    return -options_.damping * (velocity * laplacian_) - options_.drag * velocity;
  return options_.damping * sum_over_springs(velocity) - options_.drag * velocity;
}

Eigen::SparseMatrix<double> ElementSystem::matrix(const LaplacianPolynomial& p) const {
  Eigen::SparseMatrix<double> A = p.linear * laplacian_;
  if (p.square > 0) {
    Eigen::SparseMatrix<double> squared = laplacian_ * laplacian_;
    A += p.square * squared;
  }
  A.diagonal().array() += p.constant;
  return A;
}

double ElementSystem::condition(const LaplacianPolynomial& p) const {
  // No eigenvalue of L is above twice the most neighbours, by its circles of Gershgorin.
  const double most = 2 * laplacian_.diagonal().maxCoeff();
  return 1 + (p.linear + p.square * most) * most / p.constant;
}

std::unique_ptr<Division> divide_by_svd(const Eigen::SparseMatrix<double>& A) {
  const auto [U, values, V] = singular_values(Eigen::MatrixXd(A), SingularVectors::kThin);
  Eigen::VectorXd inverse(values.size());
  for (Eigen::Index k = 0; k < values.size(); ++k)
    inverse[k] = values[k] <= kSingular * values[0] ? 0.0 : 1 / values[k];
  return std::make_unique<DenseDivision>(V * inverse.asDiagonal() * U.transpose());
}

std::unique_ptr<Division> divide_by_circulant(const PeriodicGrid& grid, double centre, double side,
                                              CirculantNodes nodes) {
  return std::make_unique<CirculantDivision>(grid, centre, side, nodes == CirculantNodes::kPhantom);
}

Result<std::unique_ptr<Division>> divide_by_sparse(const Eigen::SparseMatrix<double>& A) {
  auto division = std::make_unique<SparseDivision>(A);
  if (!division->sound())
    return fail({ErrorKind::kBadInput,
                 "system of the mesh is not positive definite",
                 "mesh",
                 {},
                 "needs damping against the ground or stiff potentials"});
  return division;
}

std::unique_ptr<Division> divide_by_gradients(Eigen::SparseMatrix<double> A, double error) {
  EXPECTS(error > 0);
  return std::make_unique<GradientDivision>(std::move(A), error);
}

}  // namespace angiospline
