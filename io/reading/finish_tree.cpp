#include "io/reading/finish_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "io/text/text_file.h"

namespace angiospline {
namespace {

struct UnitName {
  std::string_view name;
  double mm;
};

constexpr std::array kUnits = {
    UnitName{"mm", 1.0},      UnitName{"millimetre", 1.0},  UnitName{"millimeter", 1.0},
    UnitName{"cm", 10.0},     UnitName{"centimetre", 10.0}, UnitName{"centimeter", 10.0},
    UnitName{"m", 1000.0},    UnitName{"metre", 1000.0},    UnitName{"meter", 1000.0},
    UnitName{"um", 1e-3},     UnitName{"\xC2\xB5m", 1e-3},  UnitName{"\xCE\xBCm", 1e-3},
    UnitName{"micron", 1e-3}, UnitName{"micrometre", 1e-3}, UnitName{"micrometer", 1e-3},
    UnitName{"nm", 1e-6},     UnitName{"nanometre", 1e-6},  UnitName{"nanometer", 1e-6},
    UnitName{"inch", 25.4}};

std::string without_plural(std::string text) {
  if (text.size() > 3 && text.back() == 's') text.pop_back();
  return text;
}

Result<double> bad_number(std::string_view field, std::string_view name, int line,
                          std::string_view what) {
  return fail({ErrorKind::kBadInput, fmt::format("the {} is not a finite number", what),
               at_line(name, line), fmt::format("'{}'", quoted_value(field)),
               "numbers are written like -1.5 or 2e-3"});
}

double unit_of(const FileFacts& facts, const CenterlineFileOptions& options) {
  return options.unit_mm.value_or(facts.unit_mm);
}

CoordinateFrame frame_of(const FileFacts& facts, const CenterlineFileOptions& options) {
  return options.frame ? *options.frame : facts.frame.value_or(CoordinateFrame::kLps);
}

Result<void> scale_to_world(PointGraph& graph, const FileFacts& facts, std::string_view name,
                            const CenterlineFileOptions& options) {
  // RAS and LPS differ in the signs of the first two axes.
  const double unit_mm = unit_of(facts, options);
  const bool diameters = options.radius_is_diameter || facts.has_diameters;
  const Vec3 scale = frame_of(facts, options) == CoordinateFrame::kRas
                         ? Vec3(-unit_mm, -unit_mm, unit_mm)
                         : Vec3::Constant(unit_mm);

  // Fields were bounded in the file's unit; a unit of a kilometre can still push them out of range.
  double largest = 0;
  for (GraphPoint& p : graph.points) {
    p.position_mm = p.position_mm.cwiseProduct(scale);
    p.radius_mm *= unit_mm * (diameters ? 0.5 : 1.0);
    largest = std::max({largest, p.position_mm.cwiseAbs().maxCoeff(), p.radius_mm});
    if (!(p.radius_mm > 0) || !(largest <= 1e3 * kLargestFileCoordinate)) {
      return fail({ErrorKind::kBadInput, "a length leaves the range of numbers", std::string(name),
                   fmt::format("point {} in a unit of {:g} mm", p.name, unit_mm),
                   "check the unit (--unit)"});
    }
  }
  for (double& r : graph.edge_radii_mm) r *= unit_mm * (diameters ? 0.5 : 1.0);
  return {};
}

// What was taken for the unit, the radius column and the frame, and on whose word.
std::vector<std::string> conventions(const FileFacts& facts, const CenterlineFileOptions& options) {
  std::vector<std::string> said;
  if (options.unit_mm) {
    said.push_back(fmt::format("unit: {:g} mm, as given", *options.unit_mm));
  } else {
    said.push_back(
        facts.unit_stated
            ? fmt::format("unit: {}, as the file says", facts.unit_name)
            : fmt::format("unit: {} (the file does not say; --unit overrides)", facts.unit_name));
  }

  said.push_back(options.radius_is_diameter ? "radius column: diameters, as given"
                 : facts.has_diameters      ? "radius column: diameters, as the file says"
                                       : "radius column: radii (--radius-is-diameter overrides)");

  const bool is_ras = frame_of(facts, options) == CoordinateFrame::kRas;
  const char* frame = is_ras ? "RAS, turned into LPS" : "LPS";
  said.push_back(options.frame ? fmt::format("frame: {}, as given", frame)
                 : facts.frame
                     ? fmt::format("frame: {}, as the file says", frame)
                     : fmt::format("frame: {} (the file does not say; --frame overrides)", frame));
  return said;
}

}  // namespace

void FileFacts::state_unit(double mm, std::string_view name) {
  unit_mm = mm;
  unit_name = std::string(name);
  unit_stated = true;
}

Result<double> parse_unit_mm(std::string_view text) {
  const std::string_view whole = trimmed(text.substr(0, 64));
  std::size_t split = whole.size();
  std::optional<double> count;

  // The longest beginning that is a number is the count; the rest must be a unit's name.
  for (; split > 0 && !count; split -= count ? 0 : 1)
    count = parse_number(trimmed(whole.substr(0, split)));
  const std::string unit = without_plural(lower_case(trimmed(whole.substr(count ? split : 0))));

  for (const UnitName& known : kUnits) {
    if (unit != known.name && !(unit.empty() && count && known.name == "mm")) continue;
    const double mm = count.value_or(1.0) * known.mm;
    if (mm >= kSmallestFileRadius && mm <= kLargestFileCoordinate) return mm;
  }
  return fail({ErrorKind::kBadInput,
               "not a unit of length",
               {},
               fmt::format("'{}'", quoted_value(text)),
               "m, cm, mm, um, nm, inch or a positive number of them, like 0.04mm"});
}

Result<double> parse_coordinate(std::string_view field, std::string_view name, int line) {
  const std::optional<double> value = parse_number(field);
  if (!value) return bad_number(field, name, line, "coordinate");
  if (std::abs(*value) > kLargestFileCoordinate) {
    return fail({ErrorKind::kBadInput, "the coordinate is absurdly large", at_line(name, line),
                 quoted_value(field), fmt::format("at most {:g}", kLargestFileCoordinate)});
  }
  return *value;
}

Result<double> parse_radius(std::string_view field, std::string_view name, int line) {
  const std::optional<double> value = parse_number(field);
  if (!value) return bad_number(field, name, line, "radius");
  if (*value < kSmallestFileRadius || *value > kLargestFileCoordinate) {
    const char* what = *value < 0 ? "negative" : *value == 0 ? "zero" : "out of range";
    return fail({ErrorKind::kBadInput, fmt::format("the radius is {}", what), at_line(name, line),
                 quoted_value(field),
                 fmt::format("radii are positive, from {:g} to {:g}", kSmallestFileRadius,
                             kLargestFileCoordinate)});
  }
  return *value;
}

Result<CenterlineTree> finish_tree(PointGraph graph, const FileFacts& facts, std::string_view name,
                                   const CenterlineFileOptions& options) {
  if (auto scaled = scale_to_world(graph, facts, name, options); !scaled)
    return fail(scaled.error());

  Result<CenterlineTree> tree = tree_from_points(graph);
  if (!tree) {
    Error error = tree.error();
    error.where = std::string(name);
    return fail(std::move(error));
  }

  std::vector<std::string> said = conventions(facts, options);
  said.insert(said.end(), facts.notes.begin(), facts.notes.end());
  said.insert(said.end(), tree->assumptions.begin(), tree->assumptions.end());
  tree->assumptions = std::move(said);
  tree->source = std::string(name);
  return tree;
}

}  // namespace angiospline
