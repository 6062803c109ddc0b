// Numbers as VTK's files store them in binary.
#pragma once

#include <cstddef>

namespace angiospline {

enum class VtkNumber {
  kFloat32,
  kFloat64,
  kInt8,
  kUInt8,
  kInt16,
  kUInt16,
  kInt32,
  kUInt32,
  kInt64,
  kUInt64
};

std::size_t bytes_of(VtkNumber type);

inline bool is_floating(VtkNumber type) {
  return type == VtkNumber::kFloat32 || type == VtkNumber::kFloat64;
}

enum class ByteOrder { kLittleEndian, kBigEndian };

// The number of this type whose bytes_of(type) bytes begin at `bytes`, which may be unaligned.
// Defined for double, long long and unsigned long long.
template <typename Out>
Out number_at(const char* bytes, VtkNumber type, ByteOrder order);

}  // namespace angiospline
