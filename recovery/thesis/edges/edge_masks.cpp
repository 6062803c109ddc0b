#include "recovery/thesis/edges/edge_masks.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "recovery/thesis/edges/rules.h"

namespace angiospline {
namespace {

using namespace edge_rules;

constexpr int kReach = 2;  // of 5 x 5 x 5 voxels

bool comes_first(const Voxel& v) {  // one of each pair of opposite offsets
  if (v[2] != 0) return v[2] > 0;
  if (v[1] != 0) return v[1] > 0;
  return v[0] > 0;
}

template <typename F>
void for_each_offset(bool flat, F&& f) {
  const int depth = flat ? 0 : kReach;
  for (int z = -depth; z <= depth; ++z)
    for (int y = -kReach; y <= kReach; ++y)
      for (int x = -kReach; x <= kReach; ++x) f(Voxel{x, y, z});
}

}  // namespace

double share_beyond_plane(const Vec3& centre, const Vec3& edges, const Vec3& normal) {
  EXPECTS(edges.minCoeff() > 0 && normal.squaredNorm() > 0);
  const Vec3 width = normal.cwiseProduct(edges).cwiseAbs();
  // n . x over the box is top - sum of width_i u_i with u uniform in the unit cube: the share is
  // the volume of the cube's corner where that sum is below `top`.
  const double top = normal.dot(centre) + 0.5 * width.sum();
  if (top <= 0) return 0;
  if (top >= width.sum()) return 1;

  // That volume is the sum over the cube's corners of (-1)^|corner| max(0, top - width . corner)^n
  // / (n! product of widths), over the n directions that have a width.
  std::array<double, 3> used{};
  std::size_t count = 0;
  for (int i = 0; i < 3; ++i)
    if (width[i] > kNoWidth * width.maxCoeff()) used[count++] = width[i];
  double volume = 0;
  for (unsigned corner = 0; corner < 1U << count; ++corner) {
    double at = top;
    int sign = 1;
    for (std::size_t i = 0; i < count; ++i)
      if (corner >> i & 1U) at -= used[i], sign = -sign;
    if (at > 0) volume += sign * std::pow(at, static_cast<double>(count));
  }
  for (std::size_t i = 0; i < count; ++i) volume /= used[i] * static_cast<double>(i + 1);
  return std::clamp(volume, 0.0, 1.0);
}

EdgeMask edge_mask(const Vec3& normal, const Vec3& spacing_mm, bool flat) {
  EdgeMask mask;
  mask.normal = normal.normalized();
  const auto slot = [](const Voxel& v) {
    return static_cast<std::size_t>((v[2] + 2) * 25 + (v[1] + 2) * 5 + v[0] + 2);
  };
  for_each_offset(flat, [&](const Voxel& v) {
    if (!comes_first(v)) return;
    const Vec3 centre = spacing_mm.cwiseProduct(Vec3(v[0], v[1], v[2]));
    const double w = 2 * share_beyond_plane(centre, spacing_mm, mask.normal) - 1;
    mask.weights[slot(v)] = w;
    mask.weights[slot({-v[0], -v[1], -v[2]})] = -w;
  });
  return mask;
}

std::vector<Vec3> edge_directions(bool flat) {
  const auto turn = [](int steps) { return steps * std::numbers::pi / 6; };
  std::vector<Vec3> directions;
  for (int theta = 0; theta < 6; ++theta) {
    // theta and phi from 0 to 150 hold one of each pair; at theta 0 phi does nothing.
    const int turns = flat || theta == 0 ? 1 : 6;
    for (int phi = 0; phi < turns; ++phi) {
      const double c = std::cos(turn(theta)), s = std::sin(turn(theta));
      directions.emplace_back(c, s * std::cos(turn(phi)), s * std::sin(turn(phi)));
    }
  }
  // Components that are 0 but for rounding are made 0, so that symmetric masks are symmetric.
  for (Vec3& d : directions)
    d = d.unaryExpr([](double x) { return std::abs(x) < kNoComponent ? 0.0 : x; });
  return directions;
}

EdgeMaskBank::EdgeMaskBank(const ImageGrid& grid)
    : flat(grid.size[2] == 1), normals(edge_directions(flat)) {
  for_each_offset(flat, [&](const Voxel& v) {
    if (comes_first(v)) offsets.push_back(v);
  });
  weights.assign(offsets.size() * kLanes, 0.0F);
  for (const Voxel& v : offsets) moment += v[0] * v[0];

  // A mask over the sum of its squares answers a step of its own direction with the step's height;
  // its linear part and the rest bound all answers (edge_masks.h).
  for (int m = 0; m < pairs(); ++m) {
    const EdgeMask mask = edge_mask(normals[static_cast<std::size_t>(m)], grid.spacing_mm, flat);
    double squares = 0;
    Vec3 first = Vec3::Zero();
    for (const Voxel& v : offsets) {
      squares += mask.weight(v) * mask.weight(v);
      first += mask.weight(v) * Vec3(v[0], v[1], v[2]);
    }
    for (std::size_t k = 0; k < offsets.size(); ++k)
      weights[k * kLanes + static_cast<std::size_t>(m)] =
          static_cast<float>(mask.weight(offsets[k]) / squares);
    gradient_gain = std::max(gradient_gain, first.norm() / moment / squares);
    const double rest = std::max(0.0, squares - first.squaredNorm() / moment);
    rest_gain = std::max(rest_gain, std::sqrt(rest) / squares);
  }
}

}  // namespace angiospline
