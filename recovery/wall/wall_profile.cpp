#include "recovery/wall/wall_profile.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/contract.h"
#include "base/index.h"
#include "recovery/wall/rules.h"

namespace angiospline {
namespace {

using namespace wall_rules;

// Weights of the four voxels around a place t in [0, 1] between the middle two (Keys: Cubic
// convolution interpolation for digital image processing, IEEE Trans. ASSP 29, 1981; a = -1/2).
std::array<double, 4> cubic_weights(double t) {
  const double u = 1 - t;
  return {-0.5 * t * u * u, 1 + t * t * (1.5 * t - 2.5), 1 + u * u * (1.5 * u - 2.5),
          -0.5 * u * t * t};
}

// How a strip of the surface grows with the way s along its normals: 1 + 2 H s + K s^2.
struct Growth {
  double twice_mean;
  double gauss;

  double at(double s) const { return 1 + s * (twice_mean + s * gauss); }
  double integral(double s) const { return s * (1 + s * (twice_mean / 2 + s * gauss / 3)); }
};

using Profile = std::array<double, kProfileSteps + 1>;

// Holds the profile beyond the place where it turns by more than `turn`, going from the middle to
// the end; `sign` 1 for a rise, -1 for a fall.
void hold_beyond_turn(Profile& f, int middle, int step, double sign, double turn) {
  double least = sign * f[index(middle)];
  for (int k = middle; k >= 0 && k <= kProfileSteps; k += step) {
    double& value = f[index(k)];
    if (sign * value > least + turn) {
      for (int j = k; j >= 0 && j <= kProfileSteps; j += step) f[index(j)] = sign * least;
      return;
    }
    least = std::min(least, sign * value);
  }
}

}  // namespace

GreyField::GreyField(const Image<float>& image)
    : image_(image), voxel_mm_(std::cbrt(image.grid.spacing_mm.prod())) {
  for (const int n : image.grid.size) EXPECTS(n >= 2);
  to_index_ = image.grid.spacing_mm.cwiseInverse().asDiagonal() * image.grid.direction.transpose();
  shift_ = to_index_ * image.grid.origin_mm;
}

bool GreyField::covers(const Vec3& p) const {
  const Vec3 x = to_index_ * p - shift_;
  for (int i = 0; i < 3; ++i) {
    const double last = image_.grid.size[index(i)] - 1;
    if (!(x(i) >= -0.5 && x(i) <= last + 0.5)) return false;
  }
  return true;
}

double GreyField::at(const Vec3& p) const {
  const Vec3 x = to_index_ * p - shift_;
  std::array<std::array<double, 4>, 3> weights;
  std::array<std::array<std::ptrdiff_t, 4>, 3> offsets;
  std::ptrdiff_t stride = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    const int last = image_.grid.size[i] - 1;
    const double c = std::clamp(x(static_cast<Eigen::Index>(i)), 0.0, static_cast<double>(last));
    const int low = std::min(static_cast<int>(c), last - 1);
    weights[i] = cubic_weights(c - low);
    for (int k = 0; k < 4; ++k) {
      offsets[i][index(k)] = std::clamp(low - 1 + k, 0, last) * stride;
    }
    stride *= image_.grid.size[i];
  }

  // Separable: lines, then slices.
  const float* voxels = image_.voxels.data();
  double sum = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    double slice = 0;
    for (std::size_t j = 0; j < 4; ++j) {
      const float* row = voxels + offsets[2][k] + offsets[1][j];
      double line = 0;
      for (std::size_t i = 0; i < 4; ++i) {
        line += weights[0][i] * static_cast<double>(row[offsets[0][i]]);
      }
      slice += weights[1][j] * line;
    }
    sum += weights[2][k] * slice;
  }
  return sum;
}

double GreyField::width_mm(const Vec3& n) const {
  return (image_.grid.direction.transpose() * n).cwiseProduct(image_.grid.spacing_mm).norm();
}

WallPoint parallel_point(const WallPoint& at, double offset) {
  WallPoint p = at;
  p.point_mm += offset * at.normal;
  const auto parallel = [&](double curvature) {
    return curvature / std::max(kLeastGrowth, 1 + curvature * offset);
  };
  p.largest_curvature = parallel(at.largest_curvature);
  p.smallest_curvature = parallel(at.smallest_curvature);
  return p;
}

WallOffset wall_offset(const GreyField& field, const WallPoint& at, const WallLevels& levels,
                       const ProfileOptions& options) {
  WallOffset result;
  const double contrast = levels.contrast();

  // The window, shortened on the side of a centre of curvature.
  const double half = options.half_window_vox * field.width_mm(at.normal);
  double in = half, out = half;
  if (at.largest_curvature * half > kBend) in = kBend / at.largest_curvature;
  if (-at.smallest_curvature * half > kBend) out = -kBend / at.smallest_curvature;
  result.window_mm = in + out;
  if (contrast == 0 || !field.covers(at.point_mm - in * at.normal) ||
      !field.covers(at.point_mm + out * at.normal)) {
    return result;
  }

  // Grey from level to level, held where another vessel or a hole begins.
  const double step = (in + out) / kProfileSteps;
  Profile f;
  for (int k = 0; k <= kProfileSteps; ++k) {
    const double grey = field.at(at.point_mm + (k * step - in) * at.normal);
    f[index(k)] = (grey - levels.outside) / contrast;
  }
  const double turn = std::max(kTurn, kTurnNoise * options.noise / std::abs(contrast));
  const int middle = std::clamp(static_cast<int>(std::lround(in / step)), 0, kProfileSteps);
  hold_beyond_turn(f, middle, 1, 1.0, turn);
  hold_beyond_turn(f, middle, -1, -1.0, turn);

  // int f w ds by Simpson's rule.
  const Growth growth{at.largest_curvature + at.smallest_curvature,
                      at.largest_curvature * at.smallest_curvature};
  double sum = 0;
  for (int k = 0; k <= kProfileSteps; ++k) {
    const double simpson = k == 0 || k == kProfileSteps ? 1.0 : k % 2 == 1 ? 4.0 : 2.0;
    sum += simpson * f[index(k)] * growth.at(k * step - in);
  }

  // To first order d is the sum itself: solved exactly it would turn noise into a bias of H times
  // the noise's variance, and where the wall is found it is zero either way.
  const double wanted = sum * step / 3 + growth.integral(-in);
  const double inmost = at.largest_curvature > 0 ? -kBend / at.largest_curvature : -2 * half;
  const double outmost = at.smallest_curvature < 0 ? -kBend / at.smallest_curvature : 2 * half;
  result.offset_mm = std::clamp(wanted, std::max(inmost, -2 * half), std::min(outmost, 2 * half));
  result.measured = true;
  return result;
}

WallSides wall_sides(const GreyField& field, const WallPoint& at, double gate) {
  WallSides sides;
  const double width = field.width_mm(at.normal);
  const double center =
      at.largest_curvature > 0 ? kBend / at.largest_curvature : 1e9 * field.voxel_mm();
  const double from = kSideFrom * width;
  double least = 0;
  for (double s = from; s <= kSideTo * width; s += kSideStep * width) {
    const Vec3 inner = at.point_mm - s * at.normal;
    if (s <= center && field.covers(inner)) {
      // Rings nearer to the axis hold less of the vessel.
      const double weight = std::max(kLeastRingWeight, 1 - s * at.largest_curvature);
      sides.inside += weight * field.at(inner);
      sides.inside_weight += weight;
    }
  }

  // Outwards until another vessel begins: what rises above the least grey on the way.
  for (double s = from; s <= kSideTo * width; s += kSideStep * width) {
    const Vec3 outer = at.point_mm + s * at.normal;
    if (!field.covers(outer)) break;
    const double grey = field.at(outer);
    if (sides.outside_weight > 0 && grey > least + gate) break;
    least = sides.outside_weight > 0 ? std::min(least, grey) : grey;
    sides.outside += grey;
    sides.outside_weight += 1;
  }

  if (sides.inside_weight > 0) sides.inside /= sides.inside_weight;
  if (sides.outside_weight > 0) sides.outside /= sides.outside_weight;
  return sides;
}

}  // namespace angiospline
