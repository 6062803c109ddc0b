// The data arrays of VTK's XML files: text or bytes, inline or appended, compressed or not.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "io/reading/vtk_numbers.h"

namespace angiospline {

// zlib expands at most by this (zlib.net, "Maximum Compression Factor").
inline constexpr std::size_t kZlibRatio = 1032;

// What a DataArray element says of its data, which may lie elsewhere in the file.
struct VtpArray {
  std::string name;
  VtkNumber type = VtkNumber::kFloat64;
  std::size_t components = 1;
  std::string format;      // ascii (or empty), binary, appended
  std::string text;        // of the element, where the data are inline
  std::size_t offset = 0;  // into the appended data
  int line = 0;
};

// How all arrays of a file are stored.
struct VtpEncoding {
  ByteOrder byte_order = ByteOrder::kLittleEndian;
  std::size_t header_bytes = 4;  // of each number in the headers of binary data
  bool is_compressed = false;    // by zlib
  bool appended_base64 = true;   // else raw
  std::string_view appended;     // what follows the mark `_`
};

// The first `count` numbers of an array. In text, a number that is not finite becomes a NaN: it
// matters only where it is used. Errors name `file`, line and array: data cut short or missing, an
// unknown format, blocks that cannot be true or not be uncompressed. Memory is bounded by
// kZlibRatio times the file.
Result<std::vector<double>> numbers_of(const VtpArray& array, std::size_t count,
                                       const VtpEncoding& encoding, std::string_view file);

// The same for indices. Errors also: not whole numbers, or of a floating-point type.
Result<std::vector<long long>> indices_of(const VtpArray& array, std::size_t count,
                                          const VtpEncoding& encoding, std::string_view file);

// An error of an array.
tl::unexpected<Error> bad_array(const VtpArray& array, std::string_view file, std::string what,
                                std::string value, std::string rule);

}  // namespace angiospline
