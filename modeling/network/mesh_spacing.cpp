#include "modeling/network/mesh_spacing.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/index.h"
#include "kernel/evaluate/grid.h"
#include "modeling/network/rules.h"

namespace angiospline {
namespace {

using namespace network_rules;

std::vector<double> samples_of_spans(const KnotVector& knots) {
  std::vector<double> samples;
  const std::vector<double> breaks = knots.breakpoints();
  for (std::size_t i = 0; i + 1 < breaks.size(); ++i) {
    for (int k = 0; k < kSpacingSamples; ++k) {
      samples.push_back(breaks[i] + (breaks[i + 1] - breaks[i]) * k / kSpacingSamples);
    }
  }
  samples.push_back(breaks.back());
  return samples;
}

// Segments wanted (Filip, Magedson, Markot 1986, with the second derivatives of this one point)
// for each unit of u and of v at one point with these derivatives.
Vec2 wanted(const Vec3& su, const Vec3& sv, const Vec3& suu, const Vec3& suv, const Vec3& svv,
            double radius_mm, const TessellationOptions& options) {
  const Vec3 cross = su.cross(sv);
  const double lu = su.norm();
  const double lv = sv.norm();
  // Where the patch is singular the whole second derivative stands in for its normal part.
  const bool regular = cross.norm() > kSingularNormal * lu * lv;
  const Vec3 n = regular ? Vec3(cross.normalized()) : Vec3::Zero();
  const auto normal_part = [&](const Vec3& d) { return regular ? std::abs(n.dot(d)) : d.norm(); };

  // The twist is shared out by 2 hu hv <= hu^2 lu / lv + hv^2 lv / lu.
  const double twist = normal_part(suv);
  const double uu = normal_part(suu) + (lv > 0 ? twist * lu / lv : 0);
  const double vv = normal_part(svv) + (lu > 0 ? twist * lv / lu : 0);

  // What counts as local: the vessel's radius, or the surface's own where it is flatter.
  double local_mm = radius_mm;
  if (lu > 0 && lv > 0) {
    const double curvature = std::max(uu / (lu * lu), vv / (lv * lv));
    if (curvature * radius_mm < 1) {
      local_mm = std::min(1 / curvature, kMostRadii * radius_mm);
    }
  }
  const double tolerance_mm =
      std::min(options.chord_tolerance * local_mm, options.chord_tolerance_mm);
  const double longest_mm = options.longest_edge * local_mm;

  // Each direction may spend half the tolerance, and what the longest edge keeps the other from
  // spending: a straight tube needs it all for its round.
  const auto spent = [&](double second, double speed) {
    if (!(speed > 0)) return 0.5 * tolerance_mm;
    const double step = longest_mm / speed;
    return std::min(0.5 * tolerance_mm, second * step * step / 8);
  };
  return {std::max(std::sqrt(uu / (8 * (tolerance_mm - spent(vv, lv)))), lu / longest_mm),
          std::max(std::sqrt(vv / (8 * (tolerance_mm - spent(uu, lu)))), lv / longest_mm)};
}

}  // namespace

double Density::operator()(double t) const {
  const auto above = std::upper_bound(parameters.begin(), parameters.end(), t);
  if (above == parameters.begin()) return values.front();
  if (above == parameters.end()) return values.back();
  const auto k = static_cast<std::size_t>(above - parameters.begin());
  const double s = (t - parameters[k - 1]) / (parameters[k] - parameters[k - 1]);
  return (1 - s) * values[k - 1] + s * values[k];
}

double Density::integral() const {
  double sum = 0;
  for (std::size_t k = 1; k < values.size(); ++k) {
    sum += 0.5 * (values[k] + values[k - 1]) * (parameters[k] - parameters[k - 1]);
  }
  return sum;
}

std::vector<double> equidistribute(const std::vector<double>& density, int least) {
  const std::size_t steps = density.size() - 1;
  std::vector<double> sum(density.size(), 0.0);
  for (std::size_t i = 1; i <= steps; ++i) {
    sum[i] = sum[i - 1] + 0.5 * (density[i - 1] + density[i]) / static_cast<double>(steps);
  }
  // The hair taken off keeps a count from depending on the last bit of a symmetric shape.
  const int count = std::max(least, static_cast<int>(std::ceil(sum.back() - kSegmentHair)));

  // Where the integral reaches k / count of all, linear between two sums.
  std::vector<double> samples{0.0};
  std::size_t i = 1;
  for (int k = 1; k < count; ++k) {
    const double goal = sum.back() * k / count;
    while (i < steps && sum[i] < goal) ++i;
    const double width = sum[i] - sum[i - 1];
    const double inside = width > 0 ? (goal - sum[i - 1]) / width : 0.5;
    samples.push_back((static_cast<double>(i - 1) + inside) / static_cast<double>(steps));
  }
  samples.push_back(1.0);
  return samples;
}

PatchSpacing spacing_of(const BSplineSurface<3>& surface, double radius_mm,
                        const TessellationOptions& options) {
  PatchSpacing spacing{{samples_of_spans(surface.u()), {}}, {samples_of_spans(surface.v()), {}}};
  const std::vector<double>& us = spacing.u.parameters;
  const std::vector<double>& vs = spacing.v.parameters;
  spacing.u.values.assign(us.size(), 0.0);
  spacing.v.values.assign(vs.size(), 0.0);

  // A grid line is as dense as its most demanding point.
  const SurfaceGrid<3> grid = evaluate_grid(surface, us, vs, 2);
  for (std::size_t i = 0; i < us.size(); ++i) {
    for (std::size_t j = 0; j < vs.size(); ++j) {
      const auto c = static_cast<Eigen::Index>(i * vs.size() + j);
      const Vec2 here =
          wanted(grid.partial(1, 0).col(c), grid.partial(0, 1).col(c), grid.partial(2, 0).col(c),
                 grid.partial(1, 1).col(c), grid.partial(0, 2).col(c), radius_mm, options);
      spacing.u.values[i] = std::max(spacing.u.values[i], here[0]);
      spacing.v.values[j] = std::max(spacing.v.values[j], here[1]);
    }
  }
  return spacing;
}

namespace {

// To kToleranceDigits.
double rounded_up(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) + 1 - kToleranceDigits);
  return std::ceil(value / unit) * unit;
}

TessellationOptions coarser(TessellationOptions options, double factor) {
  options.chord_tolerance *= factor;
  options.chord_tolerance_mm *= factor;
  options.longest_edge *= std::sqrt(factor);
  return options;
}

// Of regions that know no radius of their own.
double fallback_radius_mm(const SurfaceNetwork& network) {
  double radius = 0;
  for (const Rim& rim : network.rims) radius = std::max(radius, rim.radius_mm);
  for (const Region& region : network.regions) radius = std::max(radius, region.radius_mm);
  if (radius > 0) return radius;
  const Points3& p = network.control_points_mm;
  return kFallbackRadius * (p.rowwise().maxCoeff() - p.rowwise().minCoeff()).norm();
}

std::vector<PatchSpacing> spacings_of(const SurfaceNetwork& network,
                                      const std::vector<BSplineSurface<3>>& surfaces,
                                      const TessellationOptions& options) {
  const double fallback = fallback_radius_mm(network);
  std::vector<PatchSpacing> spacings;
  spacings.reserve(surfaces.size());
  for (std::size_t p = 0; p < surfaces.size(); ++p) {
    const double known = network.regions[index(network.patches[p].region)].radius_mm;
    spacings.push_back(spacing_of(surfaces[p], known > 0 ? known : fallback, options));
  }
  return spacings;
}

double triangle_estimate(const SurfaceNetwork& network, const std::vector<PatchSpacing>& spacings) {
  double sum = 0;
  for (const PatchSpacing& d : spacings) sum += 2 * (d.u.integral() + 3) * (d.v.integral() + 3);
  for (const Rim& rim : network.rims) {
    double segments = 0;
    for (const Side& side : rim.sides) {
      const Density& density = density_along(spacings[index(side.patch)], side.side);
      const double width = density.parameters.back() - density.parameters.front();
      segments += density.integral() * (side.to - side.from) / width + 1;
    }
    sum += segments + segments * segments / (2 * std::numbers::pi);  // rings that get shorter
  }
  return sum;
}

Error too_many(double estimate, const TessellationOptions& used, bool fits) {
  std::string rule = fmt::format("at most {:.0f}", used.most_triangles);
  if (fits) {
    rule += fmt::format(", as with a tolerance of {:.6g} local radii and edges of up to {:.6g}",
                        used.chord_tolerance, used.longest_edge);
  }
  return {ErrorKind::kBadInput, "the tolerance asks for too many triangles", "tessellate",
          fmt::format("{:.0f}", estimate), std::move(rule)};
}

}  // namespace

const Density& density_along(const PatchSpacing& spacing, PatchSide side) {
  return side == PatchSide::kU0 || side == PatchSide::kU1 ? spacing.v : spacing.u;
}

Result<NetworkSpacing> spacing_of(const SurfaceNetwork& network,
                                  const std::vector<BSplineSurface<3>>& surfaces,
                                  const TessellationOptions& options, const Progress& progress) {
  NetworkSpacing result{spacings_of(network, surfaces, options), options};
  const double asked = triangle_estimate(network, result.patches);
  double estimate = asked;
  double factor = 1;

  // Triangles fall no faster than the tolerance grows, so no step goes too far; three lines a patch
  // stay whatever the tolerance is.
  for (int k = 0; k < kCoarseningTries && !(estimate <= options.most_triangles); ++k) {
    if (progress.should_stop()) return fail(cancelled("tessellate"));
    factor *= std::max(estimate / options.most_triangles, kLeastCoarsening);
    factor = rounded_up(options.chord_tolerance * factor) / options.chord_tolerance;
    result.used = coarser(options, factor);
    result.patches = spacings_of(network, surfaces, result.used);
    estimate = triangle_estimate(network, result.patches);
  }

  const bool fits = estimate <= options.most_triangles;
  if (asked <= options.most_triangles || (fits && options.coarsen)) return result;
  return fail(too_many(asked, result.used, fits));
}

}  // namespace angiospline
