#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include <fmt/format.h>

#include "io/reading/vtk_polylines.h"
#include "io/reading/vtp_arrays.h"
#include "io/text/text_file.h"
#include "io/text/xml_reader.h"

namespace angiospline {
namespace {

struct TypeName {
  std::string_view name;
  VtkNumber type;
};

constexpr std::array kTypes = {
    TypeName{"Float32", VtkNumber::kFloat32}, TypeName{"Float64", VtkNumber::kFloat64},
    TypeName{"Int8", VtkNumber::kInt8},       TypeName{"UInt8", VtkNumber::kUInt8},
    TypeName{"Int16", VtkNumber::kInt16},     TypeName{"UInt16", VtkNumber::kUInt16},
    TypeName{"Int32", VtkNumber::kInt32},     TypeName{"UInt32", VtkNumber::kUInt32},
    TypeName{"Int64", VtkNumber::kInt64},     TypeName{"UInt64", VtkNumber::kUInt64}};

// Data are decoded when all of the file has been walked through: appended ones come last.
struct Piece {
  std::size_t points = 0;
  std::size_t lines = 0;
  std::optional<VtpArray> positions;
  std::optional<VtpArray> connectivity;
  std::optional<VtpArray> offsets;
  std::vector<VtpArray> scalars;
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

    // Comments before the data may name the frame; they are read for it and no further.
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
    encoding_.byte_order =
        attribute("byte_order") == "BigEndian" ? ByteOrder::kBigEndian : ByteOrder::kLittleEndian;
    encoding_.header_bytes = attribute("header_type") == "UInt64" ? 8 : 4;
    const std::string_view compressor = attribute("compressor");
    encoding_.is_compressed = !compressor.empty();
    if (encoding_.is_compressed && compressor != "vtkZLibDataCompressor") {
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
    VtpArray found;
    found.name = attribute("Name");
    found.line = xml_.line();
    const auto type = std::find_if(kTypes.begin(), kTypes.end(),
                                   [&](const TypeName& t) { return t.name == attribute("type"); });
    const bool known_type = type != kTypes.end();
    if (known_type) found.type = type->type;
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
    encoding_.appended_base64 = attribute("encoding") != "raw";
    const std::string_view rest = xml_.rest();
    const std::size_t mark = rest.find('_');
    if (mark == std::string_view::npos) {
      return xml_.bad("appended data without a start", {}, "they begin with _");
    }
    encoding_.appended = rest.substr(mark + 1);
    return {};
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
    const auto points = numbers_of(*piece.positions, 3 * piece.points, encoding_, name_);
    if (!points) return fail(points.error());
    if (auto added = add_lines(piece, first_point); !added) return added;
    lines_.points.insert(lines_.points.end(), points->begin(), points->end());

    for (const VtpArray& a : piece.scalars) {
      if (lower_case(a.name).find("rad") == std::string::npos) {  // only a radius is of use
        note_array(a.name);
        continue;
      }
      auto scalars = numbers_of(a, piece.points, encoding_, name_);
      if (!scalars) return fail(scalars.error());
      auto& all = array_named(a.name);
      all.resize(static_cast<std::size_t>(first_point), 0.0);
      all.insert(all.end(), scalars->begin(), scalars->end());
    }
    return {};
  }

  // Offsets say where each line ends in the connectivity; indices count the piece's own points.
  Result<void> add_lines(const Piece& piece, long long first_point) {
    const auto offsets = indices_of(*piece.offsets, piece.lines, encoding_, name_);
    if (!offsets) return fail(offsets.error());
    long long before = 0;
    for (const long long offset : *offsets) {
      if (offset < before || offset > static_cast<long long>(kZlibRatio * bytes_.size())) {
        return bad_array(*piece.offsets, name_, "the offset is out of range",
                         std::to_string(offset), "offsets grow");
      }
      before = offset;
    }

    const auto indices =
        indices_of(*piece.connectivity, static_cast<std::size_t>(before), encoding_, name_);
    if (!indices) return fail(indices.error());
    const auto first_index = static_cast<long long>(lines_.indices.size());
    for (const long long i : *indices) {
      if (i < 0 || i >= static_cast<long long>(piece.points)) {
        return bad_array(*piece.connectivity, name_, "the index is out of range", std::to_string(i),
                         fmt::format("the piece has {} points", piece.points));
      }
      lines_.indices.push_back(first_point + i);
    }
    for (const long long offset : *offsets) lines_.offsets.push_back(first_index + offset);
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
  VtpEncoding encoding_;
  std::vector<Piece> pieces_;
  VtkPolylines lines_;
};

}  // namespace

Result<VtkPolylines> parse_vtp(std::string_view bytes, std::string_view name) {
  return VtpReader(bytes, name).read();
}

}  // namespace angiospline
