#include "io/centerline_file.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include <fmt/format.h>

#include "io/csv_centerline.h"
#include "io/graphml_file.h"
#include "io/gxl_file.h"
#include "io/network_tables.h"
#include "io/simvascular_file.h"
#include "io/swc_file.h"
#include "io/text_file.h"
#include "io/tree_definition.h"
#include "io/vtk_centerline.h"

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

}  // namespace

Result<double> parse_unit_mm(std::string_view text) {
  const std::string_view whole = trimmed(text.substr(0, 64));
  std::size_t split = whole.size();
  std::optional<double> count;
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
  const double unit_mm = options.unit_mm.value_or(facts.unit_mm);
  const bool diameters = options.radius_is_diameter || facts.has_diameters;
  const CoordinateFrame frame =
      options.frame ? *options.frame : facts.frame.value_or(CoordinateFrame::kLps);
  const Vec3 scale =
      frame == CoordinateFrame::kRas ? Vec3(-unit_mm, -unit_mm, unit_mm) : Vec3::Constant(unit_mm);
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
  Result<CenterlineTree> tree = tree_from_points(graph);
  if (!tree) {
    Error error = tree.error();
    error.where = std::string(name);
    return fail(std::move(error));
  }
  std::vector<std::string> said;
  if (!options.unit_mm) {
    said.push_back(
        facts.unit_stated
            ? fmt::format("unit: {}, as the file says", facts.unit_name)
            : fmt::format("unit: {} (the file does not say; --unit overrides)", facts.unit_name));
  } else {
    said.push_back(fmt::format("unit: {:g} mm, as given", unit_mm));
  }
  said.push_back(options.radius_is_diameter ? "radius column: diameters, as given"
                 : facts.has_diameters      ? "radius column: diameters, as the file says"
                                       : "radius column: radii (--radius-is-diameter overrides)");
  const char* frame_name = frame == CoordinateFrame::kRas ? "RAS, turned into LPS" : "LPS";
  said.push_back(options.frame ? fmt::format("frame: {}, as given", frame_name)
                 : facts.frame ? fmt::format("frame: {}, as the file says", frame_name)
                               : fmt::format("frame: {} (the file does not say; --frame overrides)",
                                             frame_name));
  said.insert(said.end(), facts.notes.begin(), facts.notes.end());
  said.insert(said.end(), tree->assumptions.begin(), tree->assumptions.end());
  tree->assumptions = std::move(said);
  tree->source = std::string(name);
  return tree;
}

namespace {

using Parser = Result<CenterlineTree> (*)(std::string_view, std::string_view,
                                          const CenterlineFileOptions&);

struct Format {
  std::string_view suffix;
  Parser parse;
  bool is_text;
};

constexpr std::array kFormats = {Format{".swc", parse_swc, true},
                                 Format{".eswc", parse_swc, true},
                                 Format{".csv", parse_csv_centerline, true},
                                 Format{".tsv", parse_csv_centerline, true},
                                 Format{".txt", parse_csv_centerline, true},
                                 Format{".tree", parse_tree_definition, true},
                                 Format{".vtp", parse_vtp_centerline, false},
                                 Format{".vtk", parse_vtk_centerline, false},
                                 Format{".gxl", parse_gxl, true},
                                 Format{".xml", parse_gxl, true},
                                 Format{".graphml", parse_graphml, true}};

bool is_simvascular(const std::filesystem::path& path) {
  const std::string suffix = lower_case(path.extension().string());
  return suffix == ".ctgr" || suffix == ".pth";
}

Result<CenterlineTree> read_tables(const std::filesystem::path& vertices,
                                   const std::filesystem::path& edges,
                                   const CenterlineFileOptions& options) {
  const Result<std::string> vertex_text = read_text_file(vertices);
  if (!vertex_text) return fail(vertex_text.error());
  const Result<std::string> edge_text = read_text_file(edges);
  if (!edge_text) return fail(edge_text.error());
  return parse_network_tables(*vertex_text, vertices.string(), *edge_text, edges.string(), options);
}

// The other table of a pair: vertices.csv for edges.csv, a_nodes.csv for a_edges.csv and so on.
std::optional<std::filesystem::path> partner_of(const std::filesystem::path& path,
                                                std::span<const std::string_view> own,
                                                std::span<const std::string_view> others) {
  const std::string file = path.filename().string();
  const std::string lower = lower_case(file);
  for (const std::string_view word : own) {
    const std::size_t at = lower.find(word);
    if (at == std::string::npos) continue;
    for (const std::string_view other : others) {
      std::string partner = file;
      partner.replace(at, word.size(), other);
      const std::filesystem::path found = path.parent_path() / partner;
      if (std::filesystem::exists(found)) return found;
    }
  }
  return std::nullopt;
}

constexpr std::array<std::string_view, 4> kVertexWords = {"vertices", "nodes", "vertex", "node"};
constexpr std::array<std::string_view, 2> kEdgeWords = {"edges", "edge"};

Result<CenterlineTree> read_folder(const std::filesystem::path& path,
                                   const CenterlineFileOptions& options) {
  std::vector<std::filesystem::path> simvascular;
  std::vector<std::filesystem::path> edges;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(path, code)) {
    if (is_simvascular(entry.path())) simvascular.push_back(entry.path());
    const std::string file = lower_case(entry.path().filename().string());
    if (file.find("edge") != std::string::npos && file.ends_with(".csv"))
      edges.push_back(entry.path());
  }
  std::sort(simvascular.begin(), simvascular.end());
  if (edges.size() == 1 && simvascular.empty()) {
    if (const auto vertices = partner_of(edges[0], kEdgeWords, kVertexWords)) {
      return read_tables(*vertices, edges[0], options);
    }
  }
  if (!simvascular.empty() && edges.empty()) return read_simvascular(simvascular, options);
  return fail({ErrorKind::kBadInput,
               "the folder is not one vessel tree",
               path.string(),
               {},
               "a folder holds vertices.csv and edges.csv, or .ctgr and .pth files"});
}

}  // namespace

Result<CenterlineTree> read_centerline_file(const std::filesystem::path& path,
                                            const CenterlineFileOptions& options) {
  if (std::filesystem::is_directory(path)) return read_folder(path, options);
  if (is_simvascular(path)) return read_simvascular({path}, options);
  const std::string suffix = lower_case(path.extension().string());
  const auto* const format = std::find_if(kFormats.begin(), kFormats.end(),
                                          [&](const Format& f) { return f.suffix == suffix; });
  if (format == kFormats.end()) {
    std::string known = ".ctgr .pth";
    for (const Format& f : kFormats) known += fmt::format(" {}", f.suffix);
    return fail({ErrorKind::kBadInput, "not a known format of centerlines", path.string(),
                 fmt::format("'{}'", suffix), "the suffix is one of " + known});
  }
  const Result<std::string> text = format->is_text ? read_text_file(path) : read_bytes(path);
  if (!text) return fail(text.error());
  if (suffix == ".csv") {
    const bool vertices = is_vertex_table(*text);
    if (vertices || is_edge_table(*text)) {
      const auto partner = vertices ? partner_of(path, kVertexWords, kEdgeWords)
                                    : partner_of(path, kEdgeWords, kVertexWords);
      if (partner)
        return read_tables(vertices ? path : *partner, vertices ? *partner : path, options);
      return fail({ErrorKind::kBadInput,
                   "the other table of the network is missing",
                   path.string(),
                   {},
                   "vertices.csv and edges.csv stand beside each other"});
    }
  }
  return format->parse(*text, path.string(), options);
}

Result<CenterlineTree> read_centerline_files(const std::vector<std::filesystem::path>& paths,
                                             const CenterlineFileOptions& options) {
  if (paths.size() == 1) return read_centerline_file(paths.front(), options);
  if (!paths.empty() && std::all_of(paths.begin(), paths.end(), is_simvascular)) {
    return read_simvascular(paths, options);
  }
  return fail({ErrorKind::kBadInput,
               "several files are not one tree",
               paths.empty() ? std::string() : paths.front().string(),
               {},
               "only SimVascular's .ctgr and .pth files are read together"});
}

}  // namespace angiospline
