#include <algorithm>
#include <array>
#include <limits>

#include <fmt/format.h>

#include "io/reading/vtk_numbers.h"
#include "io/reading/vtk_polylines.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

struct TypeName {
  std::string_view name;
  VtkNumber type;
};

constexpr std::array kTypes = {TypeName{"float", VtkNumber::kFloat32},
                               TypeName{"double", VtkNumber::kFloat64},
                               TypeName{"char", VtkNumber::kInt8},
                               TypeName{"signed_char", VtkNumber::kInt8},
                               TypeName{"unsigned_char", VtkNumber::kUInt8},
                               TypeName{"short", VtkNumber::kInt16},
                               TypeName{"unsigned_short", VtkNumber::kUInt16},
                               TypeName{"int", VtkNumber::kInt32},
                               TypeName{"unsigned_int", VtkNumber::kUInt32},
                               TypeName{"long", VtkNumber::kInt64},
                               TypeName{"unsigned_long", VtkNumber::kUInt64},
                               TypeName{"vtktypeint64", VtkNumber::kInt64},
                               TypeName{"vtktypeint32", VtkNumber::kInt32},
                               TypeName{"vtkidtype", VtkNumber::kInt32}};

class LegacyReader {
 public:
  LegacyReader(std::string_view bytes, std::string_view name) : bytes_(bytes), name_(name) {}

  Result<VtkPolylines> read() {
    if (bytes_.substr(0, 14) != "# vtk DataFile") {
      return bad("is not a legacy VTK file", {}, "it begins with # vtk DataFile Version");
    }
    skip_line();
    lines_.header = std::string(rest_line().substr(0, 256));
    skip_line();
    const std::string mode = lower_case(trimmed_lines(rest_line()));
    skip_line();
    if (mode != "ascii" && mode != "binary")
      return bad("the format is not known", mode, "ASCII or BINARY");
    binary_ = mode == "binary";

    // The three lines of the head are behind; what follows is told by its keyword.
    while (true) {
      const std::string keyword = lower_case(word());
      if (keyword.empty()) break;
      Result<void> taken = section(keyword);
      if (!taken) return fail(taken.error());
    }
    return std::move(lines_);
  }

 private:
  tl::unexpected<Error> bad(std::string what, std::string_view value, std::string rule) const {
    const auto end = bytes_.begin() + static_cast<std::ptrdiff_t>(std::min(at_, bytes_.size()));
    const auto line = 1 + std::count(bytes_.begin(), end, '\n');
    return fail({ErrorKind::kBadInput, std::move(what), at_line(name_, static_cast<int>(line)),
                 value.empty() ? std::string() : fmt::format("'{}'", quoted_value(value)),
                 std::move(rule)});
  }

  std::string_view rest_line() const {
    return bytes_.substr(std::min(at_, bytes_.size()), bytes_.find('\n', at_) - at_);
  }
  void skip_line() {
    const std::size_t end = bytes_.find('\n', at_);
    at_ = end == std::string_view::npos ? bytes_.size() : end + 1;
  }
  std::string_view word() {
    at_ = std::min(bytes_.find_first_not_of(" \t\r\n", at_), bytes_.size());
    const std::size_t end = std::min(bytes_.find_first_of(" \t\r\n", at_), bytes_.size());
    const std::string_view found = bytes_.substr(at_, end - at_);
    at_ = end;
    return found;
  }

  Result<std::size_t> count(std::size_t bytes_each) {
    const std::string_view text = word();
    const auto number = parse_whole_number(text);
    // Each number takes at least its bytes, or a digit and a blank.
    const std::size_t least = binary_ ? bytes_each : 2;
    if (!number || *number < 0 ||
        static_cast<unsigned long long>(*number) >
            bytes_.size() / std::max<std::size_t>(least, 1)) {
      return bad("the count cannot be true", text, "the file is too small for it");
    }
    return static_cast<std::size_t>(*number);
  }

  Result<VtkNumber> number_type(std::string_view text) const {
    const std::string lower = lower_case(text);
    const auto* const found = std::find_if(kTypes.begin(), kTypes.end(),
                                           [&](const TypeName& t) { return t.name == lower; });
    if (found == kTypes.end()) return bad("the type is not known", text, "a numeric type of VTK");
    return found->type;
  }

  // Indices below 2^53 pass through a double unchanged; larger ones are out of range anyway.
  Result<std::vector<double>> numbers(std::size_t wanted, VtkNumber type) {
    std::vector<double> out;
    if (binary_) {
      skip_line();  // the data begin behind the line's end
      const std::size_t size = bytes_of(type);
      if (at_ > bytes_.size() || wanted > (bytes_.size() - at_) / size) {
        return bad("the data are cut short", {}, fmt::format("{} numbers are needed", wanted));
      }
      out.reserve(wanted);
      for (std::size_t i = 0; i < wanted; ++i, at_ += size) {
        out.push_back(number_at<double>(bytes_.data() + at_, type, ByteOrder::kBigEndian));
      }
      return out;
    }

    if (wanted > bytes_.size() - at_) {
      return bad("the data are cut short", {}, fmt::format("{} numbers are needed", wanted));
    }
    out.reserve(wanted);
    for (std::size_t i = 0; i < wanted; ++i) {
      const std::string_view text = word();
      if (text.empty())
        return bad("the data are cut short", {}, fmt::format("{} numbers are needed", wanted));
      out.push_back(parse_number(text).value_or(std::numeric_limits<double>::quiet_NaN()));
    }
    return out;
  }

  Result<void> section(const std::string& keyword) {
    if (keyword == "dataset") {
      const std::string type = lower_case(word());
      if (type != "polydata") return bad("the data set has no lines of its own", type, "POLYDATA");
      return {};
    }

    if (keyword == "points") return points();
    if (keyword == "lines" || keyword == "vertices" || keyword == "polygons" ||
        keyword == "triangle_strips") {
      return cells(keyword == "lines");
    }
    if (keyword == "point_data" || keyword == "cell_data") {
      const auto tuples = count(0);
      if (!tuples) return fail(tuples.error());
      tuples_ = *tuples;
      in_points_ = keyword == "point_data";
      return {};
    }
    if (keyword == "scalars") return scalars();
    if (keyword == "vectors" || keyword == "normals") {
      word();
      return skip_numbers(3);
    }
    if (keyword == "field") return field();

    if (keyword == "metadata") {
      skip_line();
      while (at_ < bytes_.size() && !trimmed_lines(rest_line()).empty()) skip_line();
      return {};
    }
    if (keyword == "lookup_table") {
      word();
      const auto entries = count(4);
      if (!entries) return fail(entries.error());
      auto skipped = numbers(4 * *entries, VtkNumber::kUInt8);
      return skipped ? Result<void>{} : fail(skipped.error());
    }
    return bad("the section is not known", keyword,
               "POINTS, LINES, POINT_DATA, SCALARS, FIELD ...");
  }

  Result<void> points() {
    const auto number = count(3);
    if (!number) return fail(number.error());
    const auto type = number_type(word());
    if (!type) return fail(type.error());
    auto found = numbers(3 * *number, *type);
    if (!found) return fail(found.error());
    lines_.points = std::move(*found);
    return {};
  }

  Result<void> cells(bool wanted) {
    const auto number = count(1);
    if (!number) return fail(number.error());
    const auto size = count(1);
    if (!size) return fail(size.error());
    const std::size_t before = at_;
    if (lower_case(word()) == "offsets") return new_cells(*number, *size, wanted);
    at_ = before;
    const auto found = numbers(*size, VtkNumber::kInt32);
    if (!found) return fail(found.error());
    if (!wanted) return {};

    // Each line's number of points stands before its indices.
    std::size_t i = 0;
    for (std::size_t line = 0; line < *number; ++line) {
      const double length = i < found->size() ? (*found)[i] : -1.0;
      if (!(length >= 0) || length > static_cast<double>(found->size() - i - 1)) {
        return bad("a line's number of points is wrong", std::to_string(length),
                   "it fits the section");
      }
      for (std::size_t k = 1; k <= static_cast<std::size_t>(length); ++k) {
        if (auto added = add_index((*found)[i + k]); !added) return added;
      }
      i += 1 + static_cast<std::size_t>(length);
      lines_.offsets.push_back(static_cast<long long>(lines_.indices.size()));
    }
    return {};
  }

  // Files of version 5: offsets (one more than lines), then connectivity.
  Result<void> new_cells(std::size_t offset_count, std::size_t index_count, bool wanted) {
    const auto offset_type = number_type(word());
    if (!offset_type) return fail(offset_type.error());
    const auto offsets = numbers(offset_count, *offset_type);
    if (!offsets) return fail(offsets.error());
    if (lower_case(word()) != "connectivity")
      return bad("the connectivity is missing", {}, "it follows the offsets");
    const auto index_type = number_type(word());
    if (!index_type) return fail(index_type.error());
    const auto indices = numbers(index_count, *index_type);
    if (!indices) return fail(indices.error());
    if (!wanted) return {};

    const auto first = static_cast<long long>(lines_.indices.size());
    double before = 0;
    for (std::size_t k = 1; k < offsets->size(); ++k) {
      const double offset = (*offsets)[k];
      if (!(offset >= before) || offset > static_cast<double>(indices->size())) {
        return bad("the offset is out of range", std::to_string(offset), "offsets grow");
      }
      lines_.offsets.push_back(first + static_cast<long long>(offset));
      before = offset;
    }
    for (std::size_t k = 0; k < static_cast<std::size_t>(before); ++k) {
      if (auto added = add_index((*indices)[k]); !added) return added;
    }
    return {};
  }

  Result<void> add_index(double i) {
    if (!(i >= 0) || i >= static_cast<double>(lines_.points.size() / 3) ||
        i != static_cast<double>(static_cast<long long>(i))) {
      return bad("the index is out of range", fmt::format("{}", i),
                 fmt::format("there are {} points", lines_.points.size() / 3));
    }
    lines_.indices.push_back(static_cast<long long>(i));
    return {};
  }

  void keep(std::string_view array_name, std::size_t components, std::vector<double> found) {
    if (!in_points_ || components != 1) return;
    if (lower_case(array_name).find("rad") == std::string::npos)
      found = {};  // only a radius is of use
    lines_.scalars.emplace_back(std::string(array_name), std::move(found));
  }

  Result<void> scalars() {
    const std::string_view array_name = word();
    const auto type = number_type(word());
    if (!type) return fail(type.error());
    std::size_t components = 1;
    const std::size_t before = at_;
    if (const auto number = parse_whole_number(trimmed_lines(rest_line()));
        number && *number > 0 && *number < 5) {
      components = static_cast<std::size_t>(*number);
      word();
    }

    // The line of the lookup table may be missing.
    const std::size_t behind = at_;
    if (lower_case(word()) == "lookup_table") {
      word();
    } else {
      at_ = components == 1 ? before : behind;
    }
    auto found = numbers(components * tuples_, *type);
    if (!found) return fail(found.error());
    keep(array_name, components, std::move(*found));
    return {};
  }

  Result<void> skip_numbers(std::size_t components) {
    const auto type = number_type(word());
    if (!type) return fail(type.error());
    auto skipped = numbers(components * tuples_, *type);
    return skipped ? Result<void>{} : fail(skipped.error());
  }

  Result<void> field() {
    word();
    const auto arrays = count(0);
    if (!arrays) return fail(arrays.error());
    for (std::size_t k = 0; k < *arrays; ++k) {
      std::string array_name(word());
      if (lower_case(array_name) == "metadata") {  // stands between arrays
        skip_line();
        while (at_ < bytes_.size() && !trimmed_lines(rest_line()).empty()) skip_line();
        array_name = word();
      }

      const auto components = count(0);
      if (!components) return fail(components.error());
      const auto tuples = count(0);
      if (!tuples) return fail(tuples.error());
      const std::string_view type_word = word();
      if (lower_case(type_word) == "string") {
        for (std::size_t i = 0; i <= *tuples; ++i) skip_line();
        continue;
      }
      const auto type = number_type(type_word);
      if (!type) return fail(type.error());

      if (*components > 0 && *tuples > bytes_.size() / *components) {
        return bad("the count cannot be true", array_name, "the file is too small for it");
      }
      auto found = numbers(*components * *tuples, *type);
      if (!found) return fail(found.error());
      keep(array_name, *components, std::move(*found));
    }
    return {};
  }

  std::string_view bytes_;
  std::string_view name_;
  std::size_t at_ = 0;
  bool binary_ = false;
  bool in_points_ = false;
  std::size_t tuples_ = 0;
  VtkPolylines lines_;
};

}  // namespace

Result<VtkPolylines> parse_legacy_vtk(std::string_view bytes, std::string_view name) {
  return LegacyReader(bytes, name).read();
}

}  // namespace angiospline
