#include "kernel/evaluate/bernstein_box.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernel/spline/binomial.h"
#include "kernel/spline/blossom.h"

namespace angiospline {
namespace {

using Coefficients = BernsteinBox::Coefficients;

// Row j: how Bezier point j of the span comes from the order() control points alive there.
Coefficients bezier_rows(const KnotVector& knots, int span) {
  const int p = knots.degree();
  Coefficients rows(p + 1, p + 1);
  std::vector<double> args(static_cast<std::size_t>(p) + 1, knots[span]);
  for (int j = 0; j <= p; ++j) {
    if (j > 0) args[static_cast<std::size_t>(j) - 1] = knots[span + 1];
    blossom_row(knots, span, args.data(), rows.row(j).data());
  }
  return rows;
}

// The square of a polynomial with Bernstein coefficients B, added to the Bernstein coefficients of
// a sum of squares: both scaled by their binomials, in which form products are convolutions.
void add_square(const Coefficients& scaled, Coefficients& sum) {
  for (Eigen::Index i = 0; i < scaled.rows(); ++i) {
    for (Eigen::Index j = 0; j < scaled.cols(); ++j) {
      sum.block(i, j, scaled.rows(), scaled.cols()) += scaled(i, j) * scaled;
    }
  }
}

Coefficients binomial_scale(Eigen::Index rows, Eigen::Index columns) {
  const int p = static_cast<int>(rows) - 1;
  const int q = static_cast<int>(columns) - 1;
  Coefficients scale(rows, columns);
  for (int i = 0; i <= p; ++i) {
    for (int j = 0; j <= q; ++j) scale(i, j) = binomial(p, i) * binomial(q, j);
  }
  return scale;
}

// From the Bezier points of the box, coordinate by coordinate.
template <int D, int H>
BernsteinBox box_of(std::array<Coefficients, H> bezier, const Eigen::Matrix<double, D, 1>& target) {
  static_assert(H == D || H == D + 1);
  const Eigen::Index rows = bezier[0].rows();
  const Eigen::Index columns = bezier[0].cols();
  const Coefficients own = binomial_scale(rows, columns);
  const Coefficients squared = binomial_scale(2 * rows - 1, 2 * columns - 1);

  // The squared distance, over the squared weight where the spline is rational.
  BernsteinBox box;
  box.F = Coefficients::Zero(2 * rows - 1, 2 * columns - 1);
  for (std::size_t c = 0; c < D; ++c) {
    if constexpr (H > D) {
      bezier[c] -= target(static_cast<Eigen::Index>(c)) * bezier[D];
    } else {
      bezier[c].array() -= target(static_cast<Eigen::Index>(c));
    }
    add_square(bezier[c].cwiseProduct(own), box.F);
  }

  box.F = box.F.cwiseQuotient(squared).eval();
  if constexpr (H > D) {
    box.W = Coefficients::Zero(2 * rows - 1, 2 * columns - 1);
    add_square(bezier[D].cwiseProduct(own), box.W);
    box.W = box.W.cwiseQuotient(squared).eval();
  }
  return box;
}

// De Casteljau at one half, over the rows: `lower` becomes the upper half.
Coefficients split_rows(Coefficients& lower) {
  Coefficients first = lower;
  const Eigen::Index last = lower.rows() - 1;
  for (Eigen::Index r = 1; r <= last; ++r) {
    for (Eigen::Index i = 0; i <= last - r; ++i) {
      lower.row(i) = 0.5 * (lower.row(i) + lower.row(i + 1));
    }
    first.row(r) = lower.row(0);
  }
  return first;
}

// The same over the columns.
Coefficients split_columns(Coefficients& lower) {
  Coefficients first = lower;
  const Eigen::Index last = lower.cols() - 1;
  for (Eigen::Index r = 1; r <= last; ++r) {
    for (Eigen::Index i = 0; i <= last - r; ++i) {
      lower.col(i) = 0.5 * (lower.col(i) + lower.col(i + 1));
    }
    first.col(r) = lower.col(0);
  }
  return first;
}

// Second differences along the rows and the columns, times degree (degree - 1).
Coefficients bend_u(const Coefficients& G) {
  const Eigen::Index n = G.rows() - 2;
  if (n < 1) return Coefficients::Zero(1, G.cols());
  const double factor = static_cast<double>((n + 1) * n);
  return factor * (G.topRows(n) - 2 * G.middleRows(1, n) + G.bottomRows(n));
}
Coefficients bend_v(const Coefficients& G) {
  const Eigen::Index n = G.cols() - 2;
  if (n < 1) return Coefficients::Zero(G.rows(), 1);
  const double factor = static_cast<double>((n + 1) * n);
  return factor * (G.leftCols(n) - 2 * G.middleCols(1, n) + G.rightCols(n));
}

}  // namespace

double BernsteinBox::lower_bound() const {
  return W.size() == 0 ? F.minCoeff() : F.cwiseQuotient(W).minCoeff();
}

// A surface: the Hessian is positive where both bends are and their product is above the square of
// the twist, bounded by the largest and smallest coefficients of each.
bool BernsteinBox::is_convex(double squared) const {
  const Coefficients G = W.size() == 0 ? F : Coefficients(F - squared * W);
  const double u = bend_u(G).minCoeff();
  if (G.cols() == 1) return u >= 0;
  const double v = bend_v(G).minCoeff();
  if (!(u >= 0 && v >= 0)) return false;
  const Eigen::Index m = G.rows() - 1;
  const Eigen::Index n = G.cols() - 1;
  if (m < 1) return true;
  const double twist =
      static_cast<double>(m * n) * (G.bottomRightCorner(m, n) - G.bottomLeftCorner(m, n) -
                                    G.topRightCorner(m, n) + G.topLeftCorner(m, n))
                                       .cwiseAbs()
                                       .maxCoeff();
  return u * v >= twist * twist;
}

std::array<double, 2> BernsteinBox::lowest() const {
  Eigen::Index i = 0;
  Eigen::Index j = 0;
  if (W.size() == 0) {
    F.minCoeff(&i, &j);
  } else {
    F.cwiseQuotient(W).minCoeff(&i, &j);
  }
  const auto place = [](double from, double to, Eigen::Index k, Eigen::Index count) {
    if (k == 0 || count < 2) return from;
    return k == count - 1
               ? to
               : from + (to - from) * static_cast<double>(k) / static_cast<double>(count - 1);
  };
  return {place(low[0], high[0], i, F.rows()), place(low[1], high[1], j, F.cols())};
}

std::pair<BernsteinBox, BernsteinBox> BernsteinBox::halves() const {
  const bool across_u =
      F.cols() == 1 || bend_u(F).cwiseAbs().maxCoeff() >= bend_v(F).cwiseAbs().maxCoeff();
  const auto split = across_u ? split_rows : split_columns;
  BernsteinBox first = *this;
  BernsteinBox second = *this;
  first.F = split(second.F);
  if (W.size() > 0) first.W = split(second.W);
  const std::size_t axis = across_u ? 0 : 1;
  const double middle = low[axis] + 0.5 * (high[axis] - low[axis]);
  first.high[axis] = middle;
  second.low[axis] = middle;
  return {std::move(first), std::move(second)};
}

template <int D, int H>
BernsteinBox bernstein_box(const BSplineCurve<H>& curve, int span,
                           const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& knots = curve.knots();
  const Coefficients rows = bezier_rows(knots, span);
  const auto alive = curve.control_points().middleCols(span - knots.degree(), knots.order());
  std::array<Coefficients, H> bezier;
  for (std::size_t c = 0; c < H; ++c) {
    bezier[c] = rows * alive.row(static_cast<Eigen::Index>(c)).transpose();
  }
  BernsteinBox box = box_of<D, H>(std::move(bezier), target);
  box.low = {knots[span], 0};
  box.high = {knots[span + 1], 0};
  return box;
}

template <int D, int H>
BernsteinBox bernstein_box(const BSplineSurface<H>& surface, int u_span, int v_span,
                           const Eigen::Matrix<double, D, 1>& target) {
  const KnotVector& U = surface.u();
  const KnotVector& V = surface.v();
  const Coefficients rows = bezier_rows(U, u_span);
  const Coefficients columns = bezier_rows(V, v_span);
  std::array<Coefficients, H> bezier;
  Coefficients alive(U.order(), V.order());
  for (std::size_t c = 0; c < H; ++c) {
    for (int i = 0; i < U.order(); ++i) {
      const Eigen::Index first = surface.index(u_span - U.degree() + i, v_span - V.degree());
      alive.row(i) =
          surface.control_points().row(static_cast<Eigen::Index>(c)).segment(first, V.order());
    }
    bezier[c] = rows * alive * columns.transpose();
  }
  BernsteinBox box = box_of<D, H>(std::move(bezier), target);
  box.low = {U[u_span], V[v_span]};
  box.high = {U[u_span + 1], V[v_span + 1]};
  return box;
}

#define ANGIOSPLINE_INSTANTIATE(D, H)                                    \
  template BernsteinBox bernstein_box<D, H>(const BSplineCurve<H>&, int, \
                                            const Eigen::Matrix<double, D, 1>&);
ANGIOSPLINE_INSTANTIATE(1, 1)
ANGIOSPLINE_INSTANTIATE(2, 2)
ANGIOSPLINE_INSTANTIATE(3, 3)
ANGIOSPLINE_INSTANTIATE(4, 4)
ANGIOSPLINE_INSTANTIATE(1, 2)
ANGIOSPLINE_INSTANTIATE(2, 3)
ANGIOSPLINE_INSTANTIATE(3, 4)
#undef ANGIOSPLINE_INSTANTIATE
#define ANGIOSPLINE_INSTANTIATE(D, H)                                           \
  template BernsteinBox bernstein_box<D, H>(const BSplineSurface<H>&, int, int, \
                                            const Eigen::Matrix<double, D, 1>&);
ANGIOSPLINE_INSTANTIATE(2, 2)
ANGIOSPLINE_INSTANTIATE(3, 3)
ANGIOSPLINE_INSTANTIATE(4, 4)
ANGIOSPLINE_INSTANTIATE(2, 3)
ANGIOSPLINE_INSTANTIATE(3, 4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
