#include "kernel/evaluate/rational.h"

#include "base/contract.h"
#include "kernel/spline/binomial.h"

namespace angiospline {
namespace {

int column(int a, int b) { return (a + b) * (a + b + 1) / 2 + b; }

}  // namespace

// A = w C, so A^(k) = sum binom(k, i) w^(i) C^(k - i): solved for C^(k).
template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> rational_derivatives(const BSplineCurve<D + 1>& curve,
                                                              double t, int derivatives) {
  EXPECTS(derivatives >= 0);
  const int span = curve.knots().span(t);
  Eigen::Matrix<double, D + 1, Eigen::Dynamic> A(D + 1, derivatives + 1);
  for (int k = 0; k <= derivatives; ++k) A.col(k) = curve.at(t, k, span);
  Eigen::Matrix<double, D, Eigen::Dynamic> C(D, derivatives + 1);
  const double w = A(D, 0);
  EXPECTS(w > 0);
  for (int k = 0; k <= derivatives; ++k) {
    Eigen::Matrix<double, D, 1> rest = A.col(k).template head<D>();
    for (int i = 1; i <= k; ++i) rest -= binomial(k, i) * A(D, i) * C.col(k - i);
    C.col(k) = rest / w;
  }
  return C;
}

namespace {

// The same for surfaces, A and S by column(a, b).
template <int D>
void project_partials(const Eigen::Matrix<double, D + 1, Eigen::Dynamic>& A, int derivatives,
                      Eigen::Matrix<double, D, Eigen::Dynamic>& S) {
  const double w = A(D, 0);
  EXPECTS(w > 0);
  for (int order = 0; order <= derivatives; ++order) {
    for (int b = 0; b <= order; ++b) {
      const int a = order - b;
      Eigen::Matrix<double, D, 1> rest = A.col(column(a, b)).template head<D>();
      for (int i = 0; i <= a; ++i) {
        for (int j = 0; j <= b; ++j) {
          if (i + j == 0) continue;
          rest -=
              binomial(a, i) * binomial(b, j) * A(D, column(i, j)) * S.col(column(a - i, b - j));
        }
      }
      S.col(column(a, b)) = rest / w;
    }
  }
}

}  // namespace

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> rational_derivatives(const BSplineSurface<D + 1>& surface,
                                                              double u, double v, int derivatives) {
  EXPECTS(derivatives >= 0);
  const int count = column(0, derivatives) + 1;
  Eigen::Matrix<double, D + 1, Eigen::Dynamic> A(D + 1, count);
  for (int order = 0; order <= derivatives; ++order) {
    for (int b = 0; b <= order; ++b) A.col(column(order - b, b)) = surface.at(u, v, order - b, b);
  }
  Eigen::Matrix<double, D, Eigen::Dynamic> S(D, count);
  project_partials<D>(A, derivatives, S);
  return S;
}

template <int D>
SurfaceGrid<D> projected(const SurfaceGrid<D + 1>& grid) {
  SurfaceGrid<D> result;
  result.u_count = grid.u_count;
  result.v_count = grid.v_count;
  result.derivatives = grid.derivatives;
  const Eigen::Index points = grid.points().cols();
  const Eigen::Index count = static_cast<Eigen::Index>(grid.partials.size());
  for (Eigen::Index k = 0; k < count; ++k) result.partials.emplace_back(D, points);
  Eigen::Matrix<double, D + 1, Eigen::Dynamic> A(D + 1, count);
  Eigen::Matrix<double, D, Eigen::Dynamic> S(D, count);
  for (Eigen::Index p = 0; p < points; ++p) {
    for (Eigen::Index k = 0; k < count; ++k) {
      A.col(k) = grid.partials[static_cast<std::size_t>(k)].col(p);
    }
    project_partials<D>(A, grid.derivatives, S);
    for (Eigen::Index k = 0; k < count; ++k) {
      result.partials[static_cast<std::size_t>(k)].col(p) = S.col(k);
    }
  }
  return result;
}

template <int D>
Eigen::Matrix<double, D + 1, Eigen::Dynamic> homogeneous(
    const Eigen::Matrix<double, D, Eigen::Dynamic>& points, const Eigen::VectorXd& weights) {
  EXPECTS(points.cols() == weights.size());
  Eigen::Matrix<double, D + 1, Eigen::Dynamic> result(D + 1, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    EXPECTS(weights(i) > 0);
    result.col(i) << weights(i) * points.col(i), weights(i);
  }
  return result;
}

template <int D>
Eigen::Matrix<double, D, Eigen::Dynamic> projected(
    const Eigen::Matrix<double, D + 1, Eigen::Dynamic>& points) {
  Eigen::Matrix<double, D, Eigen::Dynamic> result(D, points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) {
    result.col(i) = points.col(i).template head<D>() / points(D, i);
  }
  return result;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                              \
  template Eigen::Matrix<double, D, Eigen::Dynamic> rational_derivatives<D>(    \
      const BSplineCurve<D + 1>&, double, int);                                 \
  template Eigen::Matrix<double, D + 1, Eigen::Dynamic> homogeneous<D>(         \
      const Eigen::Matrix<double, D, Eigen::Dynamic>&, const Eigen::VectorXd&); \
  template Eigen::Matrix<double, D, Eigen::Dynamic> projected<D>(               \
      const Eigen::Matrix<double, D + 1, Eigen::Dynamic>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
#undef ANGIOSPLINE_INSTANTIATE
template Eigen::Matrix<double, 2, Eigen::Dynamic> rational_derivatives<2>(const BSplineSurface<3>&,
                                                                          double, double, int);
template Eigen::Matrix<double, 3, Eigen::Dynamic> rational_derivatives<3>(const BSplineSurface<4>&,
                                                                          double, double, int);
template SurfaceGrid<2> projected<2>(const SurfaceGrid<3>&);
template SurfaceGrid<3> projected<3>(const SurfaceGrid<4>&);

}  // namespace angiospline
