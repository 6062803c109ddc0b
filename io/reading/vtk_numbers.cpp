#include "io/reading/vtk_numbers.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace angiospline {
namespace {

constexpr ByteOrder kNative =
    std::endian::native == std::endian::little ? ByteOrder::kLittleEndian : ByteOrder::kBigEndian;

template <typename T>
T value_at(const char* bytes, ByteOrder order) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), bytes, sizeof(T));
  if (order != kNative) std::reverse(raw.begin(), raw.end());
  T value;
  std::memcpy(&value, raw.data(), sizeof(T));
  return value;
}

}  // namespace

std::size_t bytes_of(VtkNumber type) {
  switch (type) {
    case VtkNumber::kInt8:
    case VtkNumber::kUInt8:
      return 1;
    case VtkNumber::kInt16:
    case VtkNumber::kUInt16:
      return 2;
    case VtkNumber::kFloat32:
    case VtkNumber::kInt32:
    case VtkNumber::kUInt32:
      return 4;
    case VtkNumber::kFloat64:
    case VtkNumber::kInt64:
    case VtkNumber::kUInt64:
      break;
  }
  return 8;
}

template <typename Out>
Out number_at(const char* bytes, VtkNumber type, ByteOrder order) {
  switch (type) {
    case VtkNumber::kFloat32:
      return static_cast<Out>(value_at<float>(bytes, order));
    case VtkNumber::kFloat64:
      return static_cast<Out>(value_at<double>(bytes, order));
    case VtkNumber::kInt8:
      return static_cast<Out>(value_at<std::int8_t>(bytes, order));
    case VtkNumber::kUInt8:
      return static_cast<Out>(value_at<std::uint8_t>(bytes, order));
    case VtkNumber::kInt16:
      return static_cast<Out>(value_at<std::int16_t>(bytes, order));
    case VtkNumber::kUInt16:
      return static_cast<Out>(value_at<std::uint16_t>(bytes, order));
    case VtkNumber::kInt32:
      return static_cast<Out>(value_at<std::int32_t>(bytes, order));
    case VtkNumber::kUInt32:
      return static_cast<Out>(value_at<std::uint32_t>(bytes, order));
    case VtkNumber::kInt64:
      return static_cast<Out>(value_at<std::int64_t>(bytes, order));
    case VtkNumber::kUInt64:
      break;
  }
  return static_cast<Out>(value_at<std::uint64_t>(bytes, order));
}

template double number_at(const char*, VtkNumber, ByteOrder);
template long long number_at(const char*, VtkNumber, ByteOrder);
template unsigned long long number_at(const char*, VtkNumber, ByteOrder);

}  // namespace angiospline
