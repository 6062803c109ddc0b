#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>

#include <fmt/format.h>
#include <zlib.h>

#include "io/centerlines/vtk_polylines.h"
#include "io/text/text_file.h"
#include "io/text/xml_reader.h"

namespace angiospline {
namespace {

// zlib expands at most by this (zlib.net, "Maximum Compression Factor").
constexpr std::size_t kZlibRatio = 1032;

enum class Type {
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

struct TypeName {
  std::string_view name;
  Type type;
  std::size_t bytes;
};

constexpr std::array kTypes = {
    TypeName{"Float32", Type::kFloat32, 4}, TypeName{"Float64", Type::kFloat64, 8},
    TypeName{"Int8", Type::kInt8, 1},       TypeName{"UInt8", Type::kUInt8, 1},
    TypeName{"Int16", Type::kInt16, 2},     TypeName{"UInt16", Type::kUInt16, 2},
    TypeName{"Int32", Type::kInt32, 4},     TypeName{"UInt32", Type::kUInt32, 4},
    TypeName{"Int64", Type::kInt64, 8},     TypeName{"UInt64", Type::kUInt64, 8}};

template <typename T>
T value_at(const char* bytes, bool swap) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), bytes, sizeof(T));
  if (swap) std::reverse(raw.begin(), raw.end());
  T value;
  std::memcpy(&value, raw.data(), sizeof(T));
  return value;
}

template <typename Out>
Out number_at(const char* p, Type type, bool swap) {
  switch (type) {
    case Type::kFloat32:
      return static_cast<Out>(value_at<float>(p, swap));
    case Type::kFloat64:
      return static_cast<Out>(value_at<double>(p, swap));
    case Type::kInt8:
      return static_cast<Out>(value_at<std::int8_t>(p, swap));
    case Type::kUInt8:
      return static_cast<Out>(value_at<std::uint8_t>(p, swap));
    case Type::kInt16:
      return static_cast<Out>(value_at<std::int16_t>(p, swap));
    case Type::kUInt16:
      return static_cast<Out>(value_at<std::uint16_t>(p, swap));
    case Type::kInt32:
      return static_cast<Out>(value_at<std::int32_t>(p, swap));
    case Type::kUInt32:
      return static_cast<Out>(value_at<std::uint32_t>(p, swap));
    case Type::kInt64:
      return static_cast<Out>(value_at<std::int64_t>(p, swap));
    case Type::kUInt64:
      return static_cast<Out>(value_at<std::uint64_t>(p, swap));
  }
  return Out{};
}

// Base64 from the front of `text`, blanks skipped; padding ends a group and the next goes on, as
// VTK writes header and data. Stops at the first other character or when `most` bytes are there.
std::string base64_decoded(std::string_view text, std::size_t most) {
  std::string out;
  unsigned group = 0;
  int bits = 0;
  for (const char c : text) {
    unsigned six = 0;
    if (c >= 'A' && c <= 'Z') {
      six = static_cast<unsigned>(c - 'A');
    } else if (c >= 'a' && c <= 'z') {
      six = static_cast<unsigned>(c - 'a' + 26);
    } else if (c >= '0' && c <= '9') {
      six = static_cast<unsigned>(c - '0' + 52);
    } else if (c == '+') {
      six = 62;
    } else if (c == '/') {
      six = 63;
    } else if (c == '=') {
      bits = 0;
      group = 0;
      continue;
    } else if (c == ' ' || c == '\n' || c == '\r' || c == '\t') {
      continue;
    } else {
      break;
    }
    group = (group << 6 | six) & 0xFFFFFF;
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      if (out.size() == most) break;
      out.push_back(static_cast<char>(group >> bits & 0xFF));
    }
  }
  return out;
}

// Where an array's data are: decoded when all of the file has been walked through.
struct DataArray {
  std::string name;
  Type type = Type::kFloat64;
  std::size_t bytes = 8;
  std::size_t components = 1;
  std::string format;
  std::string text;        // ascii or inline binary
  std::size_t offset = 0;  // appended
  int line = 0;
};

struct Piece {
  std::size_t points = 0;
  std::size_t lines = 0;
  std::optional<DataArray> positions;
  std::optional<DataArray> connectivity;
  std::optional<DataArray> offsets;
  std::vector<DataArray> scalars;
};

class VtpReader {
 public:
  VtpReader(std::string_view bytes, std::string_view name)
      : bytes_(bytes), xml_(bytes, name), name_(name) {}

  Result<VtkPolylines> read() {
    if (auto walked = walk(); !walked) return fail(walked.error());
    if (!is_polydata_) {
      return fail({ErrorKind::kBadInput,
                   "is not VTK polydata",
                   std::string(name_),
                   {},
                   "a VTKFile of type PolyData"});
    }
    const std::size_t header_end = bytes_.find("<PolyData");
    lines_.header = std::string(bytes_.substr(0, std::min<std::size_t>(header_end, 4096)));
    for (const Piece& piece : pieces_) {
      if (auto added = add(piece); !added) return fail(added.error());
    }
    return std::move(lines_);
  }

 private:
  std::string_view attribute(std::string_view key) const {
    return xml_.attribute(key).value_or(std::string_view());
  }

  Result<void> walk() {
    std::string section;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) return {};
      if (*event == XmlReader::Event::kText) continue;
      const std::string tag(xml_.tag());
      if (*event == XmlReader::Event::kEnd) {
        if (tag == section) section.clear();
        continue;
      }
      Result<void> taken;
      if (tag == "VTKFile") taken = file();
      if (tag == "Piece") taken = piece();
      if (tag == "Points" || tag == "Lines" || tag == "PointData" || tag == "Verts" ||
          tag == "Strips" || tag == "Polys" || tag == "CellData" || tag == "FieldData") {
        section = tag;
      }
      if (tag == "DataArray") taken = array(section);
      if (tag == "AppendedData") taken = appended();
      if (!taken) return taken;
      if (tag == "AppendedData") return {};  // what follows is not needed, and may not be XML
    }
  }

  Result<void> file() {
    is_polydata_ = attribute("type") == "PolyData";
    const bool big = attribute("byte_order") == "BigEndian";
    swap_ = big == (std::endian::native == std::endian::little);
    header_bytes_ = attribute("header_type") == "UInt64" ? 8 : 4;
    const std::string_view compressor = attribute("compressor");
    compressed_ = !compressor.empty();
    if (compressed_ && compressor != "vtkZLibDataCompressor") {
      return xml_.bad("the compressor is not supported", compressor,
                      "vtkZLibDataCompressor or none");
    }
    return {};
  }

  Result<void> piece() {
    Piece piece;
    const auto points = parse_whole_number(attribute("NumberOfPoints"));
    const auto lines = parse_whole_number(attribute("NumberOfLines"));
    const auto most = static_cast<long long>(bytes_.size() * kZlibRatio);
    if (!points || *points < 0 || *points > most) {
      return xml_.bad("the number of points cannot be true", attribute("NumberOfPoints"),
                      "the file is too small for it");
    }
    if (!lines || *lines < 0 || *lines > most) {
      return xml_.bad("the number of lines cannot be true", attribute("NumberOfLines"),
                      "the file is too small for it");
    }
    piece.points = static_cast<std::size_t>(*points);
    piece.lines = static_cast<std::size_t>(*lines);
    pieces_.push_back(std::move(piece));
    return {};
  }

  Result<void> array(const std::string& section) {
    DataArray found;
    found.name = attribute("Name");
    found.line = xml_.line();
    const auto type = std::find_if(kTypes.begin(), kTypes.end(),
                                   [&](const TypeName& t) { return t.name == attribute("type"); });
    const bool known_type = type != kTypes.end();
    if (known_type) {
      found.type = type->type;
      found.bytes = type->bytes;
    }
    const auto components = parse_whole_number(attribute("NumberOfComponents"));
    found.components = components && *components > 0 && *components < 1000
                           ? static_cast<std::size_t>(*components)
                           : 1;
    found.format = attribute("format");
    const auto offset = parse_whole_number(attribute("offset"));
    found.offset = offset && *offset >= 0 ? static_cast<std::size_t>(*offset) : bytes_.size();
    const bool wanted = !pieces_.empty() && (section == "Points" || section == "Lines" ||
                                             (section == "PointData" && found.components == 1));
    if (!wanted || !known_type) return {};  // its text is passed over
    if (found.format != "appended") {
      Result<std::string> text = data_text();
      if (!text) return fail(text.error());
      found.text = std::move(*text);
    }
    Piece& piece = pieces_.back();
    if (section == "Points") piece.positions = std::move(found);
    if (section == "Lines" && found.name == "connectivity") {
      piece.connectivity = std::move(found);
    } else if (section == "Lines" && found.name == "offsets") {
      piece.offsets = std::move(found);
    } else if (section == "PointData") {
      piece.scalars.push_back(std::move(found));
    }
    return {};
  }

  // The text of a DataArray; newer files put InformationKey elements before it.
  Result<std::string> data_text() {
    std::string text;
    const std::size_t depth = xml_.depth();
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) return text;
      if (*event == XmlReader::Event::kEnd && xml_.depth() < depth) return text;
      if (*event == XmlReader::Event::kText && xml_.depth() == depth) text += xml_.content();
    }
  }

  Result<void> appended() {
    appended_base64_ = attribute("encoding") != "raw";
    const std::string_view rest = xml_.rest();
    const std::size_t mark = rest.find('_');
    if (mark == std::string_view::npos) {
      return xml_.bad("appended data without a start", {}, "they begin with _");
    }
    appended_ = rest.substr(mark + 1);
    return {};
  }

  tl::unexpected<Error> bad(const DataArray& a, std::string what, std::string value,
                            std::string rule) const {
    return fail({ErrorKind::kBadInput, std::move(what),
                 fmt::format("{}:{}: array {}", name_, a.line, quoted_value(a.name)),
                 std::move(value), std::move(rule)});
  }

  // The bytes of an array: header, then plain or compressed data.
  Result<std::string> decoded(const DataArray& a, std::size_t wanted) const {
    std::string_view source = a.text;
    bool base64 = true;
    if (a.format == "appended") {
      if (a.offset >= appended_.size())
        return bad(a, "the data are missing", {}, "the offset lies in the file");
      source = appended_.substr(a.offset);
      base64 = appended_base64_;
    }
    const auto bytes = [&](std::size_t most) {
      return base64 ? base64_decoded(source, most) : std::string(source.substr(0, most));
    };
    const auto cut = [&] {
      return bad(a, "the data are cut short", {}, fmt::format("{} bytes are needed", wanted));
    };
    if (!compressed_) {
      std::string all = bytes(header_bytes_ + wanted);
      if (all.size() < header_bytes_ + wanted) return cut();
      return all.substr(header_bytes_);
    }
    const std::string start = bytes(3 * header_bytes_);
    if (start.size() < 3 * header_bytes_) return cut();
    const auto header = [&](const std::string& from, std::size_t k) {
      return header_bytes_ == 8 ? number_at<std::uint64_t>(&from[8 * k], Type::kUInt64, swap_)
                                : number_at<std::uint64_t>(&from[4 * k], Type::kUInt32, swap_);
    };
    const std::uint64_t blocks = header(start, 0);
    if (blocks > source.size() / header_bytes_)
      return bad(a, "the number of blocks cannot be true", std::to_string(blocks),
                 "the file is too small for it");
    const std::size_t header_size = (3 + static_cast<std::size_t>(blocks)) * header_bytes_;
    const std::string sizes = bytes(header_size);
    if (sizes.size() < header_size) return cut();
    std::size_t packed_size = 0;
    for (std::size_t k = 0; k < blocks; ++k) {
      const std::uint64_t size = header(sizes, 3 + k);
      if (size > source.size()) return cut();
      packed_size += static_cast<std::size_t>(size);
    }
    if (packed_size > source.size()) return cut();
    const std::string packed = bytes(header_size + packed_size);
    if (packed.size() < header_size + packed_size) return cut();
    std::string out;
    std::size_t at = header_size;
    for (std::size_t k = 0; k < blocks; ++k) {
      const auto size = static_cast<std::size_t>(header(sizes, 3 + k));
      const std::uint64_t last = header(sizes, 2);
      const std::uint64_t plain = k + 1 == blocks && last != 0 ? last : header(sizes, 1);
      if (plain > kZlibRatio * size + 64)
        return bad(a, "a block's size cannot be true", std::to_string(plain),
                   "zlib packs no tighter than 1032 to 1");
      const std::size_t before = out.size();
      out.resize(before + static_cast<std::size_t>(plain));
      auto got = static_cast<uLongf>(plain);
      const int code =
          uncompress(reinterpret_cast<Bytef*>(out.data() + before), &got,
                     reinterpret_cast<const Bytef*>(packed.data() + at), static_cast<uLong>(size));
      if (code != Z_OK || got != plain)
        return bad(a, "a block cannot be uncompressed", {}, "it is zlib data of the stated size");
      at += size;
      if (out.size() >= wanted) break;
    }
    if (out.size() < wanted) return cut();
    return out;
  }

  template <typename Out>
  Result<std::vector<Out>> values(const DataArray& a, std::size_t count) const {
    std::vector<Out> out;
    if (a.format == "ascii" || a.format.empty()) {
      if (count > a.text.size())
        return bad(a, "the data are cut short", {}, fmt::format("{} numbers are needed", count));
      out.reserve(count);
      std::string_view rest = a.text;
      while (out.size() < count) {
        const std::size_t first = rest.find_first_not_of(" \t\r\n");
        if (first == std::string_view::npos)
          return bad(a, "the data are cut short", {}, fmt::format("{} numbers are needed", count));
        rest.remove_prefix(first);
        const std::string_view word = rest.substr(0, rest.find_first_of(" \t\r\n"));
        rest.remove_prefix(word.size());
        if constexpr (std::is_integral_v<Out>) {
          const auto number = parse_whole_number(word);
          if (!number)
            return bad(a, "is not a whole number", quoted_value(word), "indices are whole");
          out.push_back(*number);
        } else {
          // A number that is not finite matters only where it is used.
          out.push_back(parse_number(word).value_or(std::numeric_limits<double>::quiet_NaN()));
        }
      }
      return out;
    }
    if (a.format != "binary" && a.format != "appended")
      return bad(a, "the format is not known", quoted_value(a.format), "ascii, binary or appended");
    const Result<std::string> bytes = decoded(a, count * a.bytes);
    if (!bytes) return fail(bytes.error());
    out.reserve(count);
    for (std::size_t i = 0; i < count; ++i) {
      if constexpr (std::is_integral_v<Out>) {
        const double limit = a.type == Type::kFloat32 || a.type == Type::kFloat64 ? 1.0 : 0.0;
        if (limit > 0) return bad(a, "indices are not whole numbers", {}, "an integer type");
      }
      out.push_back(number_at<Out>(bytes->data() + i * a.bytes, a.type, swap_));
    }
    return out;
  }

  Result<void> add(const Piece& piece) {
    if (piece.points == 0 || piece.lines == 0) return {};
    if (!piece.positions || piece.positions->components != 3 || !piece.connectivity ||
        !piece.offsets) {
      return fail({ErrorKind::kBadInput,
                   "a piece lacks its points or lines",
                   std::string(name_),
                   {},
                   "Points with 3 components, Lines with connectivity and offsets"});
    }
    const auto first_point = static_cast<long long>(lines_.points.size() / 3);
    const auto points = values<double>(*piece.positions, 3 * piece.points);
    if (!points) return fail(points.error());
    const auto offsets = values<long long>(*piece.offsets, piece.lines);
    if (!offsets) return fail(offsets.error());
    long long before = 0;
    for (const long long offset : *offsets) {
      if (offset < before || offset > static_cast<long long>(kZlibRatio * bytes_.size())) {
        return bad(*piece.offsets, "the offset is out of range", std::to_string(offset),
                   "offsets grow");
      }
      before = offset;
    }
    const auto indices = values<long long>(*piece.connectivity, static_cast<std::size_t>(before));
    if (!indices) return fail(indices.error());
    const auto first_index = static_cast<long long>(lines_.indices.size());
    for (const long long i : *indices) {
      if (i < 0 || i >= static_cast<long long>(piece.points)) {
        return bad(*piece.connectivity, "the index is out of range", std::to_string(i),
                   fmt::format("the piece has {} points", piece.points));
      }
      lines_.indices.push_back(first_point + i);
    }
    for (const long long offset : *offsets) lines_.offsets.push_back(first_index + offset);
    lines_.points.insert(lines_.points.end(), points->begin(), points->end());
    for (const DataArray& a : piece.scalars) {
      if (lower_case(a.name).find("rad") == std::string::npos) {  // only a radius is of use
        note_array(a.name);
        continue;
      }
      auto scalars = values<double>(a, piece.points);
      if (!scalars) return fail(scalars.error());
      auto& all = array_named(a.name);
      all.resize(static_cast<std::size_t>(first_point), 0.0);
      all.insert(all.end(), scalars->begin(), scalars->end());
    }
    return {};
  }

  std::vector<double>& array_named(const std::string& array_name) {
    note_array(array_name);
    return std::find_if(lines_.scalars.begin(), lines_.scalars.end(),
                        [&](const auto& s) { return s.first == array_name; })
        ->second;
  }

  void note_array(const std::string& array_name) {
    const bool known = std::any_of(lines_.scalars.begin(), lines_.scalars.end(),
                                   [&](const auto& s) { return s.first == array_name; });
    if (!known) lines_.scalars.emplace_back(array_name, std::vector<double>{});
  }

  std::string_view bytes_;
  XmlReader xml_;
  std::string_view name_;
  bool is_polydata_ = false;
  bool swap_ = false;
  bool compressed_ = false;
  bool appended_base64_ = true;
  std::size_t header_bytes_ = 4;
  std::string_view appended_;
  std::vector<Piece> pieces_;
  VtkPolylines lines_;
};

}  // namespace

Result<VtkPolylines> parse_vtp(std::string_view bytes, std::string_view name) {
  return VtpReader(bytes, name).read();
}

}  // namespace angiospline
