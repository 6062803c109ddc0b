#include "kernel/refine/control_mesh.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "base/contract.h"
#include "kernel/refine/periodic.h"
#include "kernel/refine/refinement.h"
#include "kernel/refine/reshape.h"

namespace angiospline {
namespace {

// Rows of a net as curves side by side: `lines` points of D doubles for each control point.
struct Lines {
  const double* points;
  int lines;
  int dimension;

  const double* at(int i, int line) const {
    return points + (static_cast<std::ptrdiff_t>(i) * lines + line) * dimension;
  }
};

// For each span (by its index among all knots) the largest distance, over the lines, of a control
// point alive there from the prolonged legs of the polygon that meet the span.
std::vector<double> span_distances(const KnotVector& knots, const Lines& net) {
  const int p = knots.degree();
  const int n = knots.control_point_count();
  const std::vector<double> nodes = knots.greville();
  const auto node = [&](int i) { return nodes[static_cast<std::size_t>(i)]; };
  std::vector<double> distance(static_cast<std::size_t>(n), 0.0);
  if (p < 2) return distance;  // the polygon is the curve

  // On each span the curve is a mean of the control points alive there, so it is no farther from a
  // leg of the polygon than they are from the line through it (the header has the proof).
  for (int span = p; span < n; ++span) {
    if (!(knots[span] < knots[span + 1])) continue;
    double largest = 0;
    for (int leg = span - p; leg < span; ++leg) {
      if (node(leg + 1) <= knots[span] || node(leg) >= knots[span + 1]) continue;
      const double length = node(leg + 1) - node(leg);
      if (!(length > 0)) continue;

      for (int line = 0; line < net.lines; ++line) {
        const double* a = net.at(leg, line);
        const double* b = net.at(leg + 1, line);
        for (int i = span - p; i <= span; ++i) {
          const double s = (node(i) - node(leg)) / length;
          const double* c = net.at(i, line);
          double squared = 0;
          for (int d = 0; d < net.dimension; ++d) {
            const double off = c[d] - a[d] - s * (b[d] - a[d]);
            squared += off * off;
          }
          largest = std::max(largest, squared);
        }
      }
    }
    distance[static_cast<std::size_t>(span)] = std::sqrt(largest);
  }
  return distance;
}

double largest(const std::vector<double>& values) {
  return values.empty() ? 0.0 : *std::max_element(values.begin(), values.end());
}

// New knots that cut every span above the tolerance into the pieces that quadratic convergence asks
// for; at most four at a time, so that a far first estimate does not overshoot. The bound is larger
// where long spans meet short ones, so a border may wander through a region span by span: `border`
// spans on either side, those no shorter, are halved with it.

std::vector<double> cuts(const KnotVector& knots, const std::vector<double>& distance,
                         double tolerance, int border) {
  const int first = knots.degree();
  const int last = knots.control_point_count() - 1;
  const auto length = [&](int span) { return knots[span + 1] - knots[span]; };

  std::vector<int> pieces(distance.size(), 1);
  for (int span = first; span <= last; ++span) {
    const double ratio = distance[static_cast<std::size_t>(span)] / tolerance;
    if (!(ratio > 1)) continue;
    for (int k = std::max(first, span - border); k <= std::min(last, span + border); ++k) {
      int& count = pieces[static_cast<std::size_t>(k)];
      if (length(k) >= length(span)) count = std::max(count, 2);
    }
    pieces[static_cast<std::size_t>(span)] =
        std::clamp(static_cast<int>(std::ceil(0.8 * std::sqrt(ratio))), 2, 4);
  }

  std::vector<double> added;
  for (int span = first; span <= last; ++span) {
    const int count = pieces[static_cast<std::size_t>(span)];
    for (int k = 1; k < count; ++k) {
      const double t = knots[span] + length(span) * k / count;
      if (t > knots[span] && t < knots[span + 1]) added.push_back(t);
    }
  }
  return added;
}

// None while estimates settle, then twice as far with every round.
int border_width(int round) {
  constexpr int kSettled = 8;
  return round < kSettled ? 0 : 1 << std::min(round - kSettled, 20);
}

std::optional<Error> mesh_error(const KnotVector& knots, const MeshOptions& options,
                                const char* where) {
  if (!(options.tolerance > 0)) {
    return Error{ErrorKind::kBadInput, "tolerance is not positive", where,
                 std::to_string(options.tolerance), "must be above 0"};
  }
  for (const double t : knots.breakpoints()) {
    if (t > knots.first() && t < knots.last() && knots.multiplicity(t) > knots.degree()) {
      return Error{ErrorKind::kBadInput, "spline may jump", std::string(where) + ", knot",
                   std::to_string(t), "multiplicity must be at most the degree"};
    }
  }
  return std::nullopt;
}

Error too_many(Eigen::Index count, int most) {
  return Error{ErrorKind::kFailed, "tolerance needs too many control points", "control mesh",
               std::to_string(count), "at most " + std::to_string(most) + " are allowed"};
}

constexpr int kMostRounds = 64;

template <int D>
Result<BSplineSurface<D>> insert_u(const BSplineSurface<D>& surface, std::vector<double> added) {
  const Result<KnotVector> u = with_knots(surface.u(), std::move(added));
  if (!u) return fail(u.error());
  return refine(surface, *u, surface.v());
}

template <int D>
Result<BSplineSurface<D>> insert_v(const BSplineSurface<D>& surface, std::vector<double> added) {
  const Result<KnotVector> v = with_knots(surface.v(), std::move(added));
  if (!v) return fail(v.error());
  return refine(surface, surface.u(), *v);
}

// Every span in as many equal pieces.
std::vector<double> even_cuts(const KnotVector& knots, int pieces) {
  const std::vector<double> breaks = knots.breakpoints();
  std::vector<double> added;
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    for (int k = 1; k < pieces; ++k) {
      const double t = breaks[i] + (breaks[i + 1] - breaks[i]) * k / pieces;
      if (t > breaks[i] && t < breaks[i + 1]) added.push_back(t);
    }
  }
  return added;
}

// What even cuts come to where that is fewer control points than `fewer`: the bound has no borders
// between long spans and short ones then, and bends that are alike everywhere want nothing else.
// cut(pieces) makes the spline, bound(spline) says whether it does.
template <typename Spline, typename Cut, typename Does>
std::optional<Spline> cut_evenly(const KnotVector& knots, double ratio, int fewer, const Cut& cut,
                                 const Does& does) {
  const int spans = static_cast<int>(knots.breakpoints().size()) - 1;
  const double law = 0.8 * std::sqrt(ratio);  // a little below what quadratic convergence asks for
  if (!(law < fewer)) return std::nullopt;
  for (int pieces = std::max(1, static_cast<int>(law));
       knots.control_point_count() + spans * (pieces - 1) < fewer; ++pieces) {
    Result<Spline> finer = cut(even_cuts(knots, pieces));
    if (!finer) return std::nullopt;
    if (does(*finer)) return *std::move(finer);
  }
  return std::nullopt;
}

template <int D>
std::optional<BSplineSurface<D>> cut_evenly_u(const BSplineSurface<D>& surface, int fewer,
                                              double tolerance) {
  const BSplineSurface<D> swapped = swap_uv(surface);
  const double along_u =
      largest(span_distances(surface.u(), {surface.control_points().data(), surface.v_count(), D}));
  const double along_v =
      largest(span_distances(surface.v(), {swapped.control_points().data(), surface.u_count(), D}));
  if (!(along_v < tolerance)) return std::nullopt;
  const bool closed = is_periodic_u(surface);
  return cut_evenly<BSplineSurface<D>>(
      surface.u(), along_u / (tolerance - along_v), fewer,
      [&](std::vector<double> added) {
        return closed ? insert_knots_periodic_u(surface, std::move(added))
                      : insert_u(surface, std::move(added));
      },
      [&](const BSplineSurface<D>& finer) { return control_mesh_distance(finer) <= tolerance; });
}

// The surface over finer knots along u; a closed direction stays closed.
template <int D>
BSplineSurface<D> over_u(const BSplineSurface<D>& surface, const KnotVector& u) {
  const BSplineSurface<D> finer = transform_u(surface, rewriting_matrix(surface.u(), u), u);
  return is_periodic_u(surface) ? closed_up_u(finer) : finer;
}

}  // namespace

template <int D>
double control_polygon_distance(const BSplineCurve<D>& curve) {
  return largest(span_distances(curve.knots(), {curve.control_points().data(), 1, D}));
}

template <int D>
double control_mesh_distance(const BSplineSurface<D>& surface) {
  const BSplineSurface<D> swapped = swap_uv(surface);
  return largest(
             span_distances(surface.u(), {surface.control_points().data(), surface.v_count(), D})) +
         largest(
             span_distances(surface.v(), {swapped.control_points().data(), surface.u_count(), D}));
}

template <int D>
Result<RefinedCurve<D>> refine_to_tolerance(const BSplineCurve<D>& curve,
                                            const MeshOptions& options) {
  if (auto error = mesh_error(curve.knots(), options, "curve")) return fail(*error);
  const bool closed = is_periodic(curve);
  RefinedCurve<D> result{curve, 0};

  for (int round = 0; round < kMostRounds; ++round) {
    const BSplineCurve<D>& at = result.curve;
    const std::vector<double> distance =
        span_distances(at.knots(), {at.control_points().data(), 1, D});
    result.distance = largest(distance);

    const std::vector<double> added =
        cuts(at.knots(), distance, options.tolerance, border_width(round));
    // Good enough: even cuts may come to fewer control points.
    if (added.empty()) {
      const auto even = cut_evenly<BSplineCurve<D>>(
          curve.knots(), control_polygon_distance(curve) / options.tolerance,
          at.knots().control_point_count(),
          [&](std::vector<double> cut) {
            return closed ? insert_knots_periodic(curve, std::move(cut))
                          : insert_knots(curve, std::move(cut));
          },
          [&](const BSplineCurve<D>& finer) {
            return control_polygon_distance(finer) <= options.tolerance;
          });
      if (even) result = {*even, control_polygon_distance(*even)};
      return result;
    }

    const Eigen::Index count = at.control_points().cols() + static_cast<Eigen::Index>(added.size());
    if (count > options.most_control_points) {
      return fail(too_many(count, options.most_control_points));
    }
    Result<BSplineCurve<D>> finer =
        closed ? insert_knots_periodic(at, added) : insert_knots(at, added);
    if (!finer) return fail(finer.error());
    result.curve = std::move(*finer);
  }
  return fail(too_many(result.curve.control_points().cols(), options.most_control_points));
}

// The error of a direction falls with the square of its number of spans, so for shares x and 1 - x
// of the tolerance the count goes like sqrt(a / x) sqrt(b / (1 - x)): least at one half, whatever a
// and b. A direction that needs less than its half leaves the rest to the other.
template <int D>
Result<RefinedSurface<D>> refine_to_tolerance(const BSplineSurface<D>& surface,
                                              const MeshOptions& options) {
  if (auto error = mesh_error(surface.u(), options, "u direction")) return fail(*error);
  if (auto error = mesh_error(surface.v(), options, "v direction")) return fail(*error);
  const bool closed_u = is_periodic_u(surface);
  const bool closed_v = is_periodic_v(surface);
  RefinedSurface<D> result{surface, 0};

  for (int round = 0; round < kMostRounds; ++round) {
    const BSplineSurface<D>& at = result.surface;
    const BSplineSurface<D> swapped = swap_uv(at);
    const std::vector<double> along_u =
        span_distances(at.u(), {at.control_points().data(), at.v_count(), D});
    const std::vector<double> along_v =
        span_distances(at.v(), {swapped.control_points().data(), at.u_count(), D});
    const double worst_u = largest(along_u);
    const double worst_v = largest(along_v);

    result.distance = worst_u + worst_v;
    if (result.distance <= options.tolerance) {
      const auto even_v =
          cut_evenly_u(swap_uv(over_u(surface, at.u())), at.v_count(), options.tolerance);
      if (even_v) result.surface = swap_uv(*even_v);
      const auto even_u = cut_evenly_u(swap_uv(over_u(swap_uv(surface), result.surface.v())),
                                       result.surface.u_count(), options.tolerance);
      if (even_u) result.surface = *even_u;
      result.distance = control_mesh_distance(result.surface);
      return result;
    }

    const double half = 0.5 * options.tolerance;
    const std::vector<double> added_u =
        cuts(at.u(), along_u, std::max(half, options.tolerance - worst_v), border_width(round));
    const std::vector<double> added_v =
        cuts(at.v(), along_v, std::max(half, options.tolerance - worst_u), border_width(round));
    const Eigen::Index count = (at.u_count() + static_cast<Eigen::Index>(added_u.size())) *
                               (at.v_count() + static_cast<Eigen::Index>(added_v.size()));
    if (count > options.most_control_points) {
      return fail(too_many(count, options.most_control_points));
    }

    const auto finer_u = closed_u ? insert_knots_periodic_u(at, added_u) : insert_u(at, added_u);
    if (!finer_u) return fail(finer_u.error());
    auto finer =
        closed_v ? insert_knots_periodic_v(*finer_u, added_v) : insert_v(*finer_u, added_v);
    if (!finer) return fail(finer.error());
    result.surface = std::move(*finer);
  }
  return fail(too_many(result.surface.control_points().cols(), options.most_control_points));
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                 \
  template double control_polygon_distance(const BSplineCurve<D>&);                \
  template double control_mesh_distance(const BSplineSurface<D>&);                 \
  template Result<RefinedCurve<D>> refine_to_tolerance(const BSplineCurve<D>&,     \
                                                       const MeshOptions&);        \
  template Result<RefinedSurface<D>> refine_to_tolerance(const BSplineSurface<D>&, \
                                                         const MeshOptions&);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
