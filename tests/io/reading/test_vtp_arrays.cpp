#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#include <gtest/gtest.h>
#include <zlib.h>

#include "io/reading/vtk_numbers.h"
#include "io/reading/vtp_arrays.h"
#include "io/text/text_encoding.h"

namespace angiospline {
namespace {

template <typename T>
std::string bytes_of_values(const std::vector<T>& values, bool big_endian) {
  std::string bytes;
  for (const T value : values) {
    std::array<char, sizeof(T)> raw{};
    std::memcpy(raw.data(), &value, sizeof(T));
    if (big_endian == (std::endian::native == std::endian::little)) {
      std::reverse(raw.begin(), raw.end());
    }
    for (const char c : raw) bytes.push_back(c);
  }
  return bytes;
}

TEST(VtkNumbers, ReadEveryTypeInBothByteOrders) {
  const auto check = [](auto value, VtkNumber type) {
    EXPECT_EQ(bytes_of(type), sizeof(value));
    for (const bool big : {false, true}) {
      std::string bytes("x");  // so that the number is unaligned
      bytes += bytes_of_values(std::vector{value}, big);
      const ByteOrder order = big ? ByteOrder::kBigEndian : ByteOrder::kLittleEndian;
      EXPECT_EQ(number_at<double>(bytes.data() + 1, type, order), static_cast<double>(value));
    }
  };
  check(1.5F, VtkNumber::kFloat32);
  check(-0.1, VtkNumber::kFloat64);
  check(std::int8_t{-3}, VtkNumber::kInt8);
  check(std::uint8_t{200}, VtkNumber::kUInt8);
  check(std::int16_t{-300}, VtkNumber::kInt16);
  check(std::uint16_t{60000}, VtkNumber::kUInt16);
  check(std::int32_t{-70000}, VtkNumber::kInt32);
  check(std::uint32_t{4000000000U}, VtkNumber::kUInt32);
  check(std::int64_t{-5000000000}, VtkNumber::kInt64);
  check(std::uint64_t{1} << 52, VtkNumber::kUInt64);
  EXPECT_TRUE(is_floating(VtkNumber::kFloat32));
  EXPECT_FALSE(is_floating(VtkNumber::kInt64));
}

// One array of doubles in each way a file may hold it.
struct Stored {
  VtpArray array;
  VtpEncoding encoding;
  std::string appended;  // what the encoding refers to
};

std::string zlib_packed(const std::string& plain) {
  std::string packed(compressBound(plain.size()), '\0');
  auto size = static_cast<uLongf>(packed.size());
  EXPECT_EQ(compress(reinterpret_cast<Bytef*>(packed.data()), &size,
                     reinterpret_cast<const Bytef*>(plain.data()), plain.size()),
            Z_OK);
  packed.resize(size);
  return packed;
}

Stored stored(const std::vector<double>& values, bool big, bool compressed, bool appended,
              bool base64_text) {
  Stored s;
  s.encoding.byte_order = big ? ByteOrder::kBigEndian : ByteOrder::kLittleEndian;
  s.encoding.header_bytes = 8;
  s.encoding.is_compressed = compressed;
  s.encoding.appended_base64 = base64_text;
  const std::string plain = bytes_of_values(values, big);
  std::string header, data = plain;
  if (compressed) {  // two blocks, the second shorter
    const std::size_t first = plain.size() * 2 / 3 / 8 * 8;
    const std::string a = zlib_packed(plain.substr(0, first));
    const std::string b = zlib_packed(plain.substr(first));
    header =
        bytes_of_values<std::uint64_t>({2, first, plain.size() - first, a.size(), b.size()}, big);
    data = a + b;
  } else {
    header = bytes_of_values<std::uint64_t>({plain.size()}, big);
  }
  const std::string text = base64_text ? base64(header) + base64(data) : header + data;
  s.array.name = "Radius";
  s.array.line = 4;
  if (appended) {
    s.array.format = "appended";
    s.array.offset = 3;
    s.appended = std::string("xyz");
    s.appended += text;
  } else {
    s.array.format = "binary";
    s.array.text = text;
  }
  return s;
}

TEST(VtpArrays, GiveTheSameNumbersHoweverTheyAreStored) {
  std::vector<double> values;
  for (int k = 0; k < 100; ++k) values.push_back(std::sin(k));
  int ways = 0;
  for (const bool big : {false, true}) {
    for (const bool compressed : {false, true}) {
      for (const bool appended : {false, true}) {
        for (const bool base64_text : {true, false}) {
          if (!appended && !base64_text) continue;  // inline data are always text
          Stored s = stored(values, big, compressed, appended, base64_text);
          s.encoding.appended = s.appended;
          const auto numbers = numbers_of(s.array, values.size(), s.encoding, "f");
          ASSERT_TRUE(numbers.has_value()) << numbers.error().message();
          EXPECT_EQ(*numbers, values);
          EXPECT_EQ(numbers_of(s.array, 7, s.encoding, "f")->size(), 7u);
          EXPECT_FALSE(numbers_of(s.array, values.size() + 1, s.encoding, "f"));
          EXPECT_FALSE(indices_of(s.array, 1, s.encoding, "f")) << "they are of a floating type";
          ++ways;
        }
      }
    }
  }
  EXPECT_EQ(ways, 12);
}

TEST(VtpArrays, ABlockThatClaimsMoreThanZlibCanPackIsRefusedBeforeMemoryIsTaken) {
  Stored s;
  s.encoding.is_compressed = true;
  s.encoding.header_bytes = 8;
  s.array.format = "binary";
  s.array.name = "Radius";
  const std::string data = zlib_packed("abcdefgh");
  const std::uint64_t huge = std::uint64_t{1} << 45;
  s.array.text = base64(bytes_of_values<std::uint64_t>({1, huge, huge, data.size()}, false) + data);
  const auto numbers = numbers_of(s.array, 1, s.encoding, "f");
  ASSERT_FALSE(numbers);
  EXPECT_EQ(numbers.error().what, "a block's size cannot be true");
  EXPECT_EQ(numbers.error().where, "f:0: array Radius");
}

TEST(VtpArrays, TextHoldsNumbersWithNaNForWhatIsNone) {
  VtpArray array;
  array.format = "ascii";
  array.text = " 1\n2.5 nan 4 ";
  const auto numbers = numbers_of(array, 4, {}, "f");
  ASSERT_TRUE(numbers);
  EXPECT_EQ((*numbers)[1], 2.5);
  EXPECT_TRUE(std::isnan((*numbers)[2]));
  EXPECT_FALSE(numbers_of(array, 5, {}, "f"));
  EXPECT_FALSE(indices_of(array, 4, {}, "f"));
  EXPECT_EQ(indices_of(array, 1, {}, "f").value(), std::vector<long long>{1});
  array.format = "hex";
  EXPECT_EQ(numbers_of(array, 1, {}, "f").error().what, "the format is not known");
}

}  // namespace
}  // namespace angiospline
