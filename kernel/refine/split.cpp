#include "kernel/refine/split.h"

#include <algorithm>

#include "base/contract.h"
#include "kernel/refine/refinement.h"

namespace angiospline {
namespace {

// Fine knots in which each cut has multiplicity degree + 1. Every piece between neighbouring cuts
// is then a run of control points of its own.
KnotVector cut_knots(const KnotVector& knots, const std::vector<double>& cuts) {
  std::vector<double> added;
  for (const double t : cuts) {
    added.insert(added.end(), static_cast<std::size_t>(knots.order() - knots.multiplicity(t)), t);
  }
  Result<KnotVector> fine = with_knots(knots, std::move(added));
  EXPECTS(fine.has_value());
  return std::move(*fine);
}

// A piece of cut knots: its clamped knot vector and its first control point.
struct Piece {
  KnotVector knots;
  int first;
};

Piece piece_between(const KnotVector& fine, double from, double to) {
  const std::vector<double>& U = fine.knots();
  const auto begin = std::lower_bound(U.begin(), U.end(), from);
  const auto end = std::upper_bound(U.begin(), U.end(), to);
  Result<KnotVector> knots = KnotVector::make(fine.degree(), std::vector<double>(begin, end));
  EXPECTS(knots.has_value());
  return Piece{std::move(*knots), static_cast<int>(begin - U.begin())};
}

template <int D>
BSplineCurve<D> extract(const BSplineCurve<D>& fine, double from, double to) {
  Piece piece = piece_between(fine.knots(), from, to);
  const int count = piece.knots.control_point_count();
  return BSplineCurve<D>(std::move(piece.knots),
                         fine.control_points().middleCols(piece.first, count));
}

template <int D>
BSplineSurface<D> extract_u(const BSplineSurface<D>& fine, double from, double to) {
  Piece piece = piece_between(fine.u(), from, to);
  const Eigen::Index count = static_cast<Eigen::Index>(piece.knots.control_point_count());
  return BSplineSurface<D>(
      std::move(piece.knots), fine.v(),
      fine.control_points().middleCols(fine.index(piece.first, 0), count * fine.v_count()));
}

template <int D>
BSplineSurface<D> extract_v(const BSplineSurface<D>& fine, double from, double to) {
  Piece piece = piece_between(fine.v(), from, to);
  const Eigen::Index count = piece.knots.control_point_count();
  typename BSplineSurface<D>::ControlPoints points(D, fine.u_count() * count);
  for (int i = 0; i < fine.u_count(); ++i) {
    points.middleCols(i * count, count) =
        fine.control_points().middleCols(fine.index(i, piece.first), count);
  }
  return BSplineSurface<D>(fine.u(), std::move(piece.knots), std::move(points));
}

bool is_interval(const KnotVector& knots, double from, double to) {
  return knots.first() <= from && from < to && to <= knots.last();
}

}  // namespace

template <int D>
BSplineCurve<D> restrict_to(const BSplineCurve<D>& curve, double from, double to) {
  EXPECTS(is_interval(curve.knots(), from, to));
  return extract(refine(curve, cut_knots(curve.knots(), {from, to})), from, to);
}

template <int D>
BSplineSurface<D> restrict_u(const BSplineSurface<D>& surface, double from, double to) {
  EXPECTS(is_interval(surface.u(), from, to));
  return extract_u(refine(surface, cut_knots(surface.u(), {from, to}), surface.v()), from, to);
}

template <int D>
BSplineSurface<D> restrict_v(const BSplineSurface<D>& surface, double from, double to) {
  EXPECTS(is_interval(surface.v(), from, to));
  return extract_v(refine(surface, surface.u(), cut_knots(surface.v(), {from, to})), from, to);
}

template <int D>
std::pair<BSplineCurve<D>, BSplineCurve<D>> split(const BSplineCurve<D>& curve, double t) {
  const double first = curve.knots().first();
  const double last = curve.knots().last();
  EXPECTS(first < t && t < last);
  const BSplineCurve<D> fine = refine(curve, cut_knots(curve.knots(), {first, t, last}));
  return {extract(fine, first, t), extract(fine, t, last)};
}

template <int D>
std::pair<BSplineSurface<D>, BSplineSurface<D>> split_u(const BSplineSurface<D>& surface,
                                                        double u) {
  const double first = surface.u().first();
  const double last = surface.u().last();
  EXPECTS(first < u && u < last);
  const BSplineSurface<D> fine =
      refine(surface, cut_knots(surface.u(), {first, u, last}), surface.v());
  return {extract_u(fine, first, u), extract_u(fine, u, last)};
}

template <int D>
std::pair<BSplineSurface<D>, BSplineSurface<D>> split_v(const BSplineSurface<D>& surface,
                                                        double v) {
  const double first = surface.v().first();
  const double last = surface.v().last();
  EXPECTS(first < v && v < last);
  const BSplineSurface<D> fine =
      refine(surface, surface.u(), cut_knots(surface.v(), {first, v, last}));
  return {extract_v(fine, first, v), extract_v(fine, v, last)};
}

template <int D>
std::vector<BSplineCurve<D>> bezier_pieces(const BSplineCurve<D>& curve) {
  const std::vector<double> cuts = curve.knots().breakpoints();
  const BSplineCurve<D> fine = refine(curve, cut_knots(curve.knots(), cuts));
  std::vector<BSplineCurve<D>> pieces;
  for (std::size_t k = 0; k + 1 < cuts.size(); ++k) {
    pieces.push_back(extract(fine, cuts[k], cuts[k + 1]));
  }
  return pieces;
}

template <int D>
std::vector<BSplineSurface<D>> bezier_pieces(const BSplineSurface<D>& surface) {
  const std::vector<double> cuts_u = surface.u().breakpoints();
  const std::vector<double> cuts_v = surface.v().breakpoints();
  const BSplineSurface<D> fine =
      refine(surface, cut_knots(surface.u(), cuts_u), cut_knots(surface.v(), cuts_v));
  std::vector<BSplineSurface<D>> pieces;
  for (std::size_t k = 0; k + 1 < cuts_u.size(); ++k) {
    const BSplineSurface<D> strip = extract_u(fine, cuts_u[k], cuts_u[k + 1]);
    for (std::size_t l = 0; l + 1 < cuts_v.size(); ++l) {
      pieces.push_back(extract_v(strip, cuts_v[l], cuts_v[l + 1]));
    }
  }
  return pieces;
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                            \
  template BSplineCurve<D> restrict_to(const BSplineCurve<D>&, double, double);               \
  template BSplineSurface<D> restrict_u(const BSplineSurface<D>&, double, double);            \
  template BSplineSurface<D> restrict_v(const BSplineSurface<D>&, double, double);            \
  template std::pair<BSplineCurve<D>, BSplineCurve<D>> split(const BSplineCurve<D>&, double); \
  template std::pair<BSplineSurface<D>, BSplineSurface<D>> split_u(const BSplineSurface<D>&,  \
                                                                   double);                   \
  template std::pair<BSplineSurface<D>, BSplineSurface<D>> split_v(const BSplineSurface<D>&,  \
                                                                   double);                   \
  template std::vector<BSplineCurve<D>> bezier_pieces(const BSplineCurve<D>&);                \
  template std::vector<BSplineSurface<D>> bezier_pieces(const BSplineSurface<D>&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
