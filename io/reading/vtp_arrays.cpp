#include "io/reading/vtp_arrays.h"

#include <cstdint>
#include <limits>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "io/text/text_encoding.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

constexpr std::string_view kBlank = " \t\r\n";

// The bytes of one array, as they stand in the file ("VTK XML file formats": an inline binary
// array and each appended one begin with a header of sizes).
class ArrayBytes {
 public:
  ArrayBytes(const VtpArray& array, const VtpEncoding& encoding, std::string_view file)
      : array_(array), encoding_(encoding), file_(file) {}

  // The `wanted` bytes behind the header.
  Result<std::string> read(std::size_t wanted) {
    if (array_.format == "appended") {
      if (array_.offset >= encoding_.appended.size())
        return bad("the data are missing", {}, "the offset lies in the file");
      source_ = encoding_.appended.substr(array_.offset);
      base64_ = encoding_.appended_base64;
    } else {
      source_ = array_.text;
    }
    return encoding_.is_compressed ? compressed(wanted) : plain(wanted);
  }

 private:
  tl::unexpected<Error> bad(std::string what, std::string value, std::string rule) const {
    return bad_array(array_, file_, std::move(what), std::move(value), std::move(rule));
  }
  tl::unexpected<Error> cut_short(std::size_t wanted) const {
    return bad("the data are cut short", {}, fmt::format("{} bytes are needed", wanted));
  }

  // At most so many bytes from the front.
  std::string bytes(std::size_t most) const {
    return base64_ ? base64_decoded(source_, most) : std::string(source_.substr(0, most));
  }

  // One number stands before the data: how many bytes they are.
  Result<std::string> plain(std::size_t wanted) const {
    std::string all = bytes(encoding_.header_bytes + wanted);
    if (all.size() < encoding_.header_bytes + wanted) return cut_short(wanted);
    return all.substr(encoding_.header_bytes);
  }

  std::uint64_t header(const std::string& from, std::size_t k) const {
    const VtkNumber type = encoding_.header_bytes == 8 ? VtkNumber::kUInt64 : VtkNumber::kUInt32;
    return number_at<unsigned long long>(&from[encoding_.header_bytes * k], type,
                                         encoding_.byte_order);
  }

  // Before compressed data stand the number of blocks, their plain size, that of the last one (0:
  // as the others), and the packed size of each. Nothing is taken on trust: a size that the file
  // cannot hold is an error before memory is asked for.
  Result<std::string> compressed(std::size_t wanted) const {
    const std::string start = bytes(3 * encoding_.header_bytes);
    if (start.size() < 3 * encoding_.header_bytes) return cut_short(wanted);
    const std::uint64_t blocks = header(start, 0);
    if (blocks > source_.size() / encoding_.header_bytes)
      return bad("the number of blocks cannot be true", std::to_string(blocks),
                 "the file is too small for it");
    const std::size_t header_size = (3 + static_cast<std::size_t>(blocks)) * encoding_.header_bytes;
    const std::string sizes = bytes(header_size);
    if (sizes.size() < header_size) return cut_short(wanted);

    std::size_t packed_size = 0;
    for (std::size_t k = 0; k < blocks; ++k) {
      const std::uint64_t size = header(sizes, 3 + k);
      if (size > source_.size()) return cut_short(wanted);
      packed_size += static_cast<std::size_t>(size);
    }
    if (packed_size > source_.size()) return cut_short(wanted);
    const std::string packed = bytes(header_size + packed_size);
    if (packed.size() < header_size + packed_size) return cut_short(wanted);
    return uncompressed(sizes, std::string_view(packed).substr(header_size), wanted);
  }

  Result<std::string> uncompressed(const std::string& sizes, std::string_view packed,
                                   std::size_t wanted) const {
    const std::uint64_t blocks = header(sizes, 0);
    std::string out;
    for (std::size_t k = 0; k < blocks && (k == 0 || out.size() < wanted); ++k) {
      const auto size = static_cast<std::size_t>(header(sizes, 3 + k));
      const std::uint64_t last = header(sizes, 2);
      const std::uint64_t plain = k + 1 == blocks && last != 0 ? last : header(sizes, 1);
      if (plain > kZlibRatio * size + 64)
        return bad("a block's size cannot be true", std::to_string(plain),
                   "zlib packs no tighter than 1032 to 1");

      const std::size_t before = out.size();
      out.resize(before + static_cast<std::size_t>(plain));
      auto got = static_cast<uLongf>(plain);
      const int code =
          uncompress(reinterpret_cast<Bytef*>(out.data() + before), &got,
                     reinterpret_cast<const Bytef*>(packed.data()), static_cast<uLong>(size));
      if (code != Z_OK || got != plain)
        return bad("a block cannot be uncompressed", {}, "it is zlib data of the stated size");
      packed.remove_prefix(size);
    }
    if (out.size() < wanted) return cut_short(wanted);
    return out;
  }

  const VtpArray& array_;
  const VtpEncoding& encoding_;
  std::string_view file_;
  std::string_view source_;
  bool base64_ = true;
};

template <typename Out>
Result<std::vector<Out>> numbers_in_text(const VtpArray& a, std::size_t count,
                                         std::string_view file) {
  const auto cut_short = [&] {
    return bad_array(a, file, "the data are cut short", {},
                     fmt::format("{} numbers are needed", count));
  };
  if (count > a.text.size()) return cut_short();

  std::vector<Out> out;
  out.reserve(count);
  std::string_view rest = a.text;
  while (out.size() < count) {
    const std::size_t first = rest.find_first_not_of(kBlank);
    if (first == std::string_view::npos) return cut_short();
    rest.remove_prefix(first);
    const std::string_view word = rest.substr(0, rest.find_first_of(kBlank));
    rest.remove_prefix(word.size());
    if constexpr (std::is_integral_v<Out>) {
      const auto number = parse_whole_number(word);
      if (!number)
        return bad_array(a, file, "is not a whole number", quoted_value(word), "indices are whole");
      out.push_back(*number);
    } else {
      out.push_back(parse_number(word).value_or(std::numeric_limits<double>::quiet_NaN()));
    }
  }
  return out;
}

template <typename Out>
Result<std::vector<Out>> values(const VtpArray& a, std::size_t count, const VtpEncoding& encoding,
                                std::string_view file) {
  if (a.format == "ascii" || a.format.empty()) return numbers_in_text<Out>(a, count, file);
  if (a.format != "binary" && a.format != "appended")
    return bad_array(a, file, "the format is not known", quoted_value(a.format),
                     "ascii, binary or appended");

  const std::size_t size = bytes_of(a.type);
  const Result<std::string> bytes = ArrayBytes(a, encoding, file).read(count * size);
  if (!bytes) return fail(bytes.error());
  if (std::is_integral_v<Out> && count > 0 && is_floating(a.type))
    return bad_array(a, file, "indices are not whole numbers", {}, "an integer type");
  std::vector<Out> out;
  out.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    out.push_back(number_at<Out>(bytes->data() + i * size, a.type, encoding.byte_order));
  }
  return out;
}

}  // namespace

Result<std::vector<double>> numbers_of(const VtpArray& array, std::size_t count,
                                       const VtpEncoding& encoding, std::string_view file) {
  return values<double>(array, count, encoding, file);
}

Result<std::vector<long long>> indices_of(const VtpArray& array, std::size_t count,
                                          const VtpEncoding& encoding, std::string_view file) {
  return values<long long>(array, count, encoding, file);
}

tl::unexpected<Error> bad_array(const VtpArray& array, std::string_view file, std::string what,
                                std::string value, std::string rule) {
  return fail({ErrorKind::kBadInput, std::move(what),
               fmt::format("{}:{}: array {}", file, array.line, quoted_value(array.name)),
               std::move(value), std::move(rule)});
}

}  // namespace angiospline
