#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>

#include "modeling/solid/solid.h"

namespace angiospline {
namespace {

bool starts_with(std::string_view name, std::string_view lower_case) {
  if (name.size() < lower_case.size()) return false;
  for (std::size_t i = 0; i < lower_case.size(); ++i) {
    if (std::tolower(static_cast<unsigned char>(name[i])) != lower_case[i]) return false;
  }
  return true;
}

// FNV-1a: the same on every machine, unlike std::hash.
std::uint32_t hash(std::string_view text) {
  std::uint32_t h = 2166136261U;
  for (const char c : text) h = (h ^ static_cast<unsigned char>(c)) * 16777619U;
  return h;
}

Vec3 from_hue(double hue, double saturation, double value) {
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + 6 * hue, 6.0);
    return value * (1 - saturation * std::clamp(std::min(k, 4 - k), 0.0, 1.0));
  };
  return {channel(5), channel(3), channel(1)};
}

}  // namespace

std::string_view to_string(FaceKind kind) {
  switch (kind) {
    case FaceKind::kInlet:
      return "inlet";
    case FaceKind::kOutlet:
      return "outlet";
    case FaceKind::kCap:
      return "cap";
    case FaceKind::kWall:
      break;
  }
  return "wall";
}

FaceKind kind_of_name(std::string_view name) {
  if (starts_with(name, "inlet")) return FaceKind::kInlet;
  if (starts_with(name, "outlet")) return FaceKind::kOutlet;
  if (starts_with(name, "cap")) return FaceKind::kCap;
  return FaceKind::kWall;
}

FaceKind kind_of_rim(RimKind kind) {
  switch (kind) {
    case RimKind::kInlet:
      return FaceKind::kInlet;
    case RimKind::kOutlet:
      return FaceKind::kOutlet;
    case RimKind::kCap:
      break;
  }
  return FaceKind::kCap;
}

Vec3 face_colour(FaceKind kind, std::string_view name) {
  switch (kind) {
    case FaceKind::kInlet:
      return {0.80, 0.15, 0.15};
    case FaceKind::kOutlet:
      return {0.15, 0.30, 0.80};
    case FaceKind::kCap:
      return {0.55, 0.55, 0.55};
    case FaceKind::kWall:
      break;
  }
  // Finalise the hash, so that names that differ in their last digit get hues far apart.
  std::uint32_t h = hash(name);
  h = (h ^ (h >> 16)) * 0x45d9f3bU;
  h ^= h >> 16;
  return from_hue(static_cast<double>(h % 360U) / 360.0, 0.35, 0.90);
}

}  // namespace angiospline
