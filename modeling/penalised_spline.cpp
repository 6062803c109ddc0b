#include "modeling/penalised_spline.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.h"
#include "kernel/basis.h"

namespace angiospline {
namespace {

constexpr int kPenaltyOrder = 2;  // the penalty's null space: straight lines

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

bool factorise_band(SymmetricBand& A) {
  const Eigen::Index n = A.cols();
  const Eigen::Index p = A.rows() - 1;
  for (Eigen::Index j = 0; j < n; ++j) {
    if (!(A(0, j) > 0)) return false;
    const double pivot = std::sqrt(A(0, j));
    const Eigen::Index below = std::min(p, n - 1 - j);
    A(0, j) = pivot;
    for (Eigen::Index k = 1; k <= below; ++k) A(k, j) /= pivot;
    for (Eigen::Index a = 1; a <= below; ++a) {
      for (Eigen::Index b = a; b <= below; ++b) A(b - a, j + a) -= A(a, j) * A(b, j);
    }
  }
  return true;
}

void solve_band(const SymmetricBand& L, Eigen::MatrixXd& B) {
  const Eigen::Index n = L.cols();
  const Eigen::Index p = L.rows() - 1;
  for (Eigen::Index j = 0; j < n; ++j) {
    B.row(j) /= L(0, j);
    for (Eigen::Index k = 1; k <= std::min(p, n - 1 - j); ++k) B.row(j + k) -= L(k, j) * B.row(j);
  }
  for (Eigen::Index j = n; j-- > 0;) {
    for (Eigen::Index k = 1; k <= std::min(p, n - 1 - j); ++k) B.row(j) -= L(k, j) * B.row(j + k);
    B.row(j) /= L(0, j);
  }
}

PenalisedSpline::PenalisedSpline(const KnotVector& knots, const Eigen::VectorXd& parameters,
                                 const Eigen::MatrixXd& values, const Eigen::VectorXd& weights)
    : knots_(knots),
      breaks_(knots.breakpoints()),
      parameters_(parameters),
      values_(values),
      weights_(weights) {
  EXPECTS(parameters.size() == values.rows() && weights.size() == values.rows());
  EXPECTS(parameters.size() > kPenaltyOrder && knots.degree() > kPenaltyOrder);
  const int p = knots.degree();
  const Eigen::Index n = knots.control_point_count();
  basis_.resize(parameters.size(), p + 1);
  first_.resize(static_cast<std::size_t>(parameters.size()));
  data_ = SymmetricBand::Zero(p + 1, n);
  right_ = Eigen::MatrixXd::Zero(n, values.cols());
  for (Eigen::Index i = 0; i < parameters.size(); ++i) {
    const BasisValues b = basis_at(knots, parameters(i));
    first_[static_cast<std::size_t>(i)] = b.first;
    basis_.row(i) = b.values.row(0);
    add_outer(data_, b.first, b.values.row(0), weights(i));
    right_.middleRows(b.first, p + 1) += weights(i) * b.values.row(0).transpose() * values.row(i);
  }
  set_stiffness(Eigen::VectorXd::Ones(span_count()));
}

void PenalisedSpline::set_stiffness(const Eigen::VectorXd& stiffness) {
  EXPECTS(stiffness.size() == span_count());
  penalty_ = SymmetricBand::Zero(data_.rows(), data_.cols());
  for (int k = 0; k < span_count(); ++k) {
    const double a = breaks_[static_cast<std::size_t>(k)];
    const double width = breaks_[static_cast<std::size_t>(k) + 1] - a;
    for (std::size_t g = 0; g < kGaussPoints.size(); ++g) {
      const BasisValues b = basis_at(knots_, a + width * kGaussPoints[g], kPenaltyOrder);
      add_outer(penalty_, b.first, b.values.row(kPenaltyOrder),
                stiffness(k) * width * kGaussWeights[g]);
    }
  }
}

SymmetricBand PenalisedSpline::system(double strength) const { return data_ + strength * penalty_; }

double PenalisedSpline::criterion(double strength, double least_noise) const {
  SymmetricBand L = system(strength);
  if (!factorise_band(L)) return std::numeric_limits<double>::infinity();
  Eigen::MatrixXd C = right_;
  solve_band(L, C);
  const double dimensions = static_cast<double>(values_.cols());
  const double samples = static_cast<double>((weights_.array() > 0).count());
  const double count = static_cast<double>(L.cols());
  double residual = samples * dimensions * least_noise * least_noise;
  for (Eigen::Index i = 0; i < parameters_.size(); ++i) {
    const auto here = C.middleRows(first_[static_cast<std::size_t>(i)], basis_.cols());
    residual += weights_(i) * (values_.row(i) - basis_.row(i) * here).squaredNorm();
  }
  double bending = 0;
  for (Eigen::Index j = 0; j < penalty_.cols(); ++j) {
    bending += penalty_(0, j) * C.row(j).squaredNorm();
    for (Eigen::Index k = 1; k < penalty_.rows() && j + k < penalty_.cols(); ++k) {
      bending += 2 * penalty_(k, j) * C.row(j).dot(C.row(j + k));
    }
  }
  const double log_det = 2 * L.row(0).array().log().sum();
  return dimensions * ((samples - kPenaltyOrder) * std::log(residual + strength * bending) +
                       log_det - (count - kPenaltyOrder) * std::log(strength));
}

double PenalisedSpline::best_strength(double least_noise) const {
  // The scale on which data and penalty weigh the same; smoothing lengths from well below a span to
  // well above the curve lie inside ten decades to either side.
  const double unit = data_.row(0).sum() / penalty_.row(0).sum();
  const auto value = [&](double e) { return criterion(unit * std::pow(10.0, e), least_noise); };
  double best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int e = -8; e <= 12; ++e) {
    const double v = value(e);
    if (v < least) {
      least = v;
      best = e;
    }
  }
  constexpr double kGolden = 0.6180339887498949;
  double a = best - 1;
  double b = best + 1;
  double x = b - kGolden * (b - a);
  double y = a + kGolden * (b - a);
  double fx = value(x);
  double fy = value(y);
  while (b - a > 0.02) {  // 5 % of the strength: its effect on the curve is a fourth of that
    if (fx <= fy) {
      b = y;
      y = x;
      fy = fx;
      x = b - kGolden * (b - a);
      fx = value(x);
    } else {
      a = x;
      x = y;
      fx = fy;
      y = a + kGolden * (b - a);
      fy = value(y);
    }
  }
  return unit * std::pow(10.0, 0.5 * (a + b));
}

Eigen::MatrixXd PenalisedSpline::solve(double strength, const Eigen::MatrixXd& ends) const {
  SymmetricBand A = system(strength);
  Eigen::MatrixXd C = right_;
  const Eigen::Index n = A.cols();
  const Eigen::Index p = A.rows() - 1;
  if (ends.rows() ==
      2) {  // clamped: the end coefficients are the end values; move them to the right
    for (Eigen::Index k = 1; k <= std::min(p, n - 1); ++k) {
      C.row(k) -= A(k, 0) * ends.row(0);
      A(k, 0) = 0;
      C.row(n - 1 - k) -= A(k, n - 1 - k) * ends.row(1);
      A(k, n - 1 - k) = 0;
    }
    A(0, 0) = A(0, n - 1) = 1;
    C.row(0) = ends.row(0);
    C.row(n - 1) = ends.row(1);
  }
  const bool positive = factorise_band(A);
  EXPECTS(positive);
  solve_band(A, C);
  if (ends.rows() == 2) {
    C.row(0) = ends.row(0);
    C.row(n - 1) = ends.row(1);
  }
  return C;
}

}  // namespace angiospline
