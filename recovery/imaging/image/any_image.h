// An image whose pixel type is known at run time: what a file holds, without conversion.
#pragma once

#include <cstddef>
#include <string_view>
#include <variant>

#include "recovery/imaging/image/image.h"

namespace angiospline {

using AnyImage =
    std::variant<Image<std::uint8_t>, Image<std::int8_t>, Image<std::uint16_t>, Image<std::int16_t>,
                 Image<std::uint32_t>, Image<std::int32_t>, Image<float>, Image<double>>;

inline const ImageGrid& grid_of(const AnyImage& image) {
  return std::visit([](const auto& i) -> const ImageGrid& { return i.grid; }, image);
}

// "uint8", "int16", ..., "float", "double".
inline std::string_view pixel_type_name(const AnyImage& image) {
  constexpr std::string_view kNames[] = {"uint8",  "int8",  "uint16", "int16",
                                         "uint32", "int32", "float",  "double"};
  return kNames[image.index()];
}

// The value of one voxel; NaN stays NaN.
inline double value_at(const AnyImage& image, const Voxel& v) {
  return std::visit([&](const auto& i) { return static_cast<double>(i[v]); }, image);
}

}  // namespace angiospline
