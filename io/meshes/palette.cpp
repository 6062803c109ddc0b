#include "io/meshes/palette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "modeling/solid/solid.h"

namespace angiospline {
namespace {

constexpr std::array<unsigned, 11> kViridis{0x440154, 0x482475, 0x414487, 0x355f8d,
                                            0x2a788e, 0x21918c, 0x22a884, 0x44bf70,
                                            0x7ad151, 0xbddf26, 0xfde725};
constexpr std::array<unsigned, 7> kBlueRed{0x2166ac, 0x67a9cf, 0xd1e5f0, 0xf7f7f7,
                                           0xfddbc7, 0xef8a62, 0xb2182b};

Vec3 from_hex(unsigned rgb) {
  return Vec3(rgb >> 16U & 255U, rgb >> 8U & 255U, rgb & 255U) / 255.0;
}

template <std::size_t N>
Vec3 interpolate(const std::array<unsigned, N>& stops, double t) {
  if (std::isnan(t)) return from_hex(0xb0b0b0);
  const double at = std::clamp(t, 0.0, 1.0) * static_cast<double>(N - 1);
  const auto k = std::min(static_cast<std::size_t>(at), N - 2);
  const double s = at - static_cast<double>(k);
  return (1 - s) * from_hex(stops[k]) + s * from_hex(stops[k + 1]);
}

}  // namespace

Vec3 part_colour(const MeshPart& part) {
  switch (part.kind) {
    case PartKind::kInlet:
      return face_colour(FaceKind::kInlet, part.name);
    case PartKind::kOutlet:
      return face_colour(FaceKind::kOutlet, part.name);
    case PartKind::kCap:
      return face_colour(FaceKind::kCap, part.name);
    case PartKind::kBody:
    case PartKind::kJunction:
      break;
  }
  return face_colour(FaceKind::kWall, part.name);
}

Vec3 sequential_colour(double t) { return interpolate(kViridis, t); }
Vec3 diverging_colour(double t) { return interpolate(kBlueRed, t); }

Vec3 ColourScale::colour(double value) const {
  const double t = high > low ? (value - low) / (high - low) : (std::isnan(value) ? value : 0.5);
  return diverging ? diverging_colour(t) : sequential_colour(t);
}

ColourScale scale_of(const MeshField& field) {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  for (const double v : field.values) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (!(low <= high)) return {};
  if (low >= 0 || high <= 0) return {low, high, false};
  const double most = std::max(-low, high);
  return {-most, most, true};
}

Vec3 linear_from_srgb(const Vec3& srgb) {
  return srgb.unaryExpr(
      [](double c) { return c <= 0.04045 ? c / 12.92 : std::pow((c + 0.055) / 1.055, 2.4); });
}

std::string css(const Vec3& srgb) {
  const auto byte = [](double c) { return std::lround(255 * std::clamp(c, 0.0, 1.0)); };
  return fmt::format("#{:02x}{:02x}{:02x}", byte(srgb.x()), byte(srgb.y()), byte(srgb.z()));
}

}  // namespace angiospline
