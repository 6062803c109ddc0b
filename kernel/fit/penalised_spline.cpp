#include "kernel/fit/penalised_spline.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

// Gauss-Legendre with 4 points on [0, 1]: exact for the square of a quintic's second derivative.
constexpr std::array<double, 4> kGaussPoints = {0.06943184420297371, 0.33000947820757187,
                                                0.66999052179242813, 0.93056815579702629};
constexpr std::array<double, 4> kGaussWeights = {0.17392742256872693, 0.32607257743127307,
                                                 0.32607257743127307, 0.17392742256872693};

// Adds scale * v v' at the columns first, first + 1, ...
template <typename Row>
void add_outer(SymmetricBand& A, int first, const Row& v, double scale) {
  for (Eigen::Index a = 0; a < v.size(); ++a) {
    for (Eigen::Index b = a; b < v.size(); ++b) A(b - a, first + a) += scale * v(a) * v(b);
  }
}

}  // namespace

PenalisedSpline::PenalisedSpline(const KnotVector& knots, const Eigen::VectorXd& parameters,
                                 const Eigen::MatrixXd& values, const Eigen::VectorXd& weights,
                                 int order)
    : order_(order), knots_(knots), breaks_(knots.breakpoints()), values_(values) {
  EXPECTS(order == 2 || order == 3);
  EXPECTS(parameters.size() == values.rows());
  EXPECTS(parameters.size() > order_ && knots.degree() > order_);

  basis_.resize(parameters.size(), knots.order());
  first_.resize(static_cast<std::size_t>(parameters.size()));
  int span = -1;
  for (Eigen::Index i = 0; i < parameters.size(); ++i) {
    span = knots.span(parameters(i), span);
    const BasisValues b = basis_at(knots, parameters(i), 0, span);
    first_[static_cast<std::size_t>(i)] = b.first;
    basis_.row(i) = b.values.row(0);
  }

  const int points = static_cast<int>(kGaussPoints.size());
  bending_.resize(span_count() * points, knots.order());
  for (int k = 0; k < span_count(); ++k) {
    const double a = breaks_[static_cast<std::size_t>(k)];
    const double width = breaks_[static_cast<std::size_t>(k) + 1] - a;
    for (int g = 0; g < points; ++g) {
      const double t = a + width * kGaussPoints[static_cast<std::size_t>(g)];
      bending_.row(k * points + g) = basis_at(knots, t, order_).values.row(order_);
    }
  }

  set_weights(weights);
  set_stiffness(Eigen::VectorXd::Ones(span_count()));
}

void PenalisedSpline::set_weights(const Eigen::VectorXd& weights) {
  EXPECTS(weights.size() == values_.rows());
  weights_ = weights;
  const Eigen::Index order = basis_.cols();
  const Eigen::Index n = knots_.control_point_count();
  data_ = SymmetricBand::Zero(order, n);
  for (Eigen::Index i = 0; i < weights.size(); ++i) {
    add_outer(data_, first_[static_cast<std::size_t>(i)], basis_.row(i), weights(i));
  }
  collect_right();
}

void PenalisedSpline::set_values(const Eigen::MatrixXd& values) {
  EXPECTS(values.rows() == values_.rows() && values.cols() == values_.cols());
  values_ = values;
  collect_right();
}

void PenalisedSpline::collect_right() {
  right_ = Eigen::MatrixXd::Zero(knots_.control_point_count(), values_.cols());
  for (Eigen::Index i = 0; i < weights_.size(); ++i) {
    const int first = first_[static_cast<std::size_t>(i)];
    for (Eigen::Index k = 0; k < basis_.cols(); ++k) {
      right_.row(first + k) += weights_(i) * basis_(i, k) * values_.row(i);
    }
  }
}

void PenalisedSpline::set_stiffness(const Eigen::VectorXd& stiffness) {
  EXPECTS(stiffness.size() == span_count());
  const int points = static_cast<int>(kGaussPoints.size());
  penalty_ = SymmetricBand::Zero(basis_.cols(), knots_.control_point_count());
  for (int k = 0; k < span_count(); ++k) {  // clamped, simple or multiple inner knots
    const double a = breaks_[static_cast<std::size_t>(k)];
    const double width = breaks_[static_cast<std::size_t>(k) + 1] - a;
    const int first = knots_.span(a + 0.5 * width) - knots_.degree();
    for (int g = 0; g < points; ++g) {
      add_outer(penalty_, first, bending_.row(k * points + g),
                stiffness(k) * width * kGaussWeights[static_cast<std::size_t>(g)]);
    }
  }
}

Eigen::MatrixXd PenalisedSpline::values_at_samples(const Eigen::MatrixXd& coefficients) const {
  Eigen::MatrixXd values(values_.rows(), coefficients.cols());
  for (Eigen::Index i = 0; i < values.rows(); ++i) {
    values.row(i) =
        basis_.row(i) * coefficients.middleRows(first_[static_cast<std::size_t>(i)], basis_.cols());
  }
  return values;
}

double PenalisedSpline::criterion(double strength, double least_noise) const {
  SymmetricBand L = system(strength);
  if (!factorise_band(L)) return std::numeric_limits<double>::infinity();
  Eigen::MatrixXd C = right_;
  solve_band(L, C);

  const double dimensions = static_cast<double>(values_.cols());
  const double samples = static_cast<double>((weights_.array() > 0).count());
  const double count = static_cast<double>(L.cols());
  const double misfit =
      weights_.dot((values_ - values_at_samples(C)).rowwise().squaredNorm().matrix());
  double bending = 0;
  for (Eigen::Index j = 0; j < penalty_.cols(); ++j) {
    bending += penalty_(0, j) * C.row(j).squaredNorm();
    for (Eigen::Index k = 1; k < penalty_.rows() && j + k < penalty_.cols(); ++k) {
      bending += 2 * penalty_(k, j) * C.row(j).dot(C.row(j + k));
    }
  }

  // The restricted likelihood of Wood 2011 with the noise profiled out; the penalty has rank count
  // - order.
  const double least = samples * dimensions * least_noise * least_noise;
  const double log_det = 2 * L.row(0).array().log().sum();
  return dimensions * ((samples - order_) * std::log(misfit + strength * bending + least) +
                       log_det - (count - order_) * std::log(strength));
}

namespace {

// The factor of A; where rounding makes weights of very different sizes indefinite, a diagonal at
// the size of the rounding is added.
SymmetricBand factor_of(const SymmetricBand& A) {
  double shift = std::numeric_limits<double>::epsilon() * A.row(0).maxCoeff();
  SymmetricBand L = A;
  for (; !factorise_band(L); shift *= 16) {
    EXPECTS(std::isfinite(shift));
    L = A;
    L.row(0).array() += shift;
  }
  return L;
}

// Makes the first and last unknown known: their columns go to the right-hand side.
void fix_ends(SymmetricBand& A, Eigen::MatrixXd& B, const Eigen::MatrixXd& ends) {
  const Eigen::Index n = A.cols();
  for (Eigen::Index k = 1; k <= std::min(A.rows() - 1, n - 1); ++k) {
    B.row(k) -= A(k, 0) * ends.row(0);
    A(k, 0) = 0;
    B.row(n - 1 - k) -= A(k, n - 1 - k) * ends.row(1);
    A(k, n - 1 - k) = 0;
  }
  A(0, 0) = A(0, n - 1) = 1;
  B.row(0) = ends.row(0);
  B.row(n - 1) = ends.row(1);
}

}  // namespace

Eigen::MatrixXd PenalisedSpline::solve(double strength, const Eigen::MatrixXd& ends) const {
  SymmetricBand A = system(strength);
  Eigen::MatrixXd C = right_;
  if (ends.rows() == 2) fix_ends(A, C, ends);
  solve_band(factor_of(A), C);
  return C;
}

CondensedEnds PenalisedSpline::condensed_ends(double strength) const {
  const SymmetricBand A = system(strength);
  const Eigen::Index n = A.cols();
  const Eigen::Index p = A.rows() - 1;
  const Eigen::Index dimensions = right_.cols();
  // Columns: the response to a unit first value, to a unit last value, and to the data.
  Eigen::MatrixXd X(n, 2 + dimensions);
  X << Eigen::MatrixXd::Zero(n, 2), right_;
  Eigen::MatrixXd ends = Eigen::MatrixXd::Zero(2, 2 + dimensions);
  ends(0, 0) = ends(1, 1) = 1;
  SymmetricBand L = A;
  fix_ends(L, X, ends);
  solve_band(factor_of(L), X);

  CondensedEnds condensed;
  condensed.right.resize(2, dimensions);
  // Rows 0 and n - 1 of A X are what is left of the equations that the fixed ends took the place
  // of.
  Eigen::MatrixXd rows = Eigen::MatrixXd::Zero(2, X.cols());  // the end rows of A times X
  for (Eigen::Index k = 0; k <= std::min(p, n - 1); ++k) {
    rows.row(0) += A(k, 0) * X.row(k);
    rows.row(1) += A(k, n - 1 - k) * X.row(n - 1 - k);
  }
  condensed.matrix = rows.leftCols<2>();
  condensed.right.row(0) = right_.row(0) - rows.row(0).tail(dimensions);
  condensed.right.row(1) = right_.row(n - 1) - rows.row(1).tail(dimensions);
  return condensed;
}

}  // namespace angiospline
