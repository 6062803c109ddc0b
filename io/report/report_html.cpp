#include "io/report/report_html.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/contract.h"
#include "base/index.h"
#include "base/version.h"
#include "io/meshes/palette.h"
#include "io/meshes/part_arrays.h"
#include "io/model/certificate_json.h"
#include "io/report/report_page.h"
#include "io/text/text_encoding.h"
#include "modeling/analysis/morphometry.h"

namespace angiospline {
namespace {

using Json = nlohmann::json;

constexpr Eigen::Index kMostSamples = 200;  // of a branch, in plots and lines

Json texts(const std::vector<std::string>& items) {
  Json list = Json::array();
  for (const std::string& item : items) list.push_back(valid_utf8(item));
  return list;
}

// For pictures: five decimals of a millimetre.
double rounded(double x) { return std::round(x * 1e5) / 1e5; }

Json vector_json(const Vec3& p) { return {rounded(p.x()), rounded(p.y()), rounded(p.z())}; }

double area_of(const TriangleMesh& mesh, const MeshMeasure& measured, const std::string& name) {
  for (std::size_t p = 0; p < mesh.parts.size(); ++p) {
    if (mesh.parts[p].name == name) return measured.part_area_mm2[p];
  }
  return 0.0;
}

Json branch_json(const CenterlineTree& tree, const CenterlineBranch& branch) {
  // Long branches are thinned for the page; their last point stays.
  const Eigen::Index count = branch.points_mm.cols();
  const Eigen::Index stride = std::max<Eigen::Index>(1, (count + kMostSamples - 1) / kMostSamples);
  const Eigen::VectorXd s = arc_lengths_mm(branch);
  Json s_mm = Json::array();
  Json radius_mm = Json::array();
  Json points_mm = Json::array();
  for (Eigen::Index k = 0; k < count; ++k) {
    if (k % stride != 0 && k + 1 != count) continue;
    s_mm.push_back(rounded(s[k]));
    radius_mm.push_back(rounded(branch.radii_mm[k]));
    points_mm.push_back(vector_json(branch.points_mm.col(k)));
  }

  const BranchMorphometry measured = morphometry(branch);
  const auto node = [&](int n) { return valid_utf8(tree.nodes[index(n)].name); };
  return {{"name", valid_utf8(branch.name)},
          {"from", node(branch.from)},
          {"to", node(branch.to)},
          {"length_mm", measured.length_mm},
          {"mean_radius_mm", measured.mean_radius_mm},
          {"min_radius_mm", measured.min_radius_mm},
          {"max_radius_mm", measured.max_radius_mm},
          {"s_mm", std::move(s_mm)},
          {"radius_mm", std::move(radius_mm)},
          {"points_mm", std::move(points_mm)}};
}

Json branches_json(const CenterlineTree& tree, const TriangleMesh& mesh, const MeshMeasure& m) {
  Json list = Json::array();
  for (const CenterlineBranch& branch : tree.branches) {
    list.push_back(branch_json(tree, branch));
    list.back()["area_mm2"] = area_of(mesh, m, "wall_" + branch.name);
  }
  return list;
}

Json junctions_json(const CenterlineTree& tree, const TriangleMesh& mesh, const MeshMeasure& m) {
  Json list = Json::array();
  const std::vector<std::vector<int>> at = branches_at_nodes(tree);
  for (std::size_t n = 0; n < at.size(); ++n) {
    if (at[n].size() < 3) continue;
    Json names = Json::array();
    for (const int b : at[n]) {
      names.push_back(valid_utf8(tree.branches[index(b)].name));
    }
    list.push_back({{"name", valid_utf8(tree.nodes[n].name)},
                    {"position_mm", vector_json(tree.nodes[n].position_mm)},
                    {"degree", at[n].size()},
                    {"branches", std::move(names)},
                    {"area_mm2", area_of(mesh, m, "junction_" + tree.nodes[n].name)}});
  }
  return list;
}

Json faces_json(const TriangleMesh& mesh, const MeshMeasure& measured) {
  std::vector<int> triangles(mesh.parts.size(), 0);
  for (const int part : mesh.part_of) ++triangles[index(part)];
  Json list = Json::array();
  for (std::size_t p = 0; p < mesh.parts.size(); ++p) {
    list.push_back({{"name", valid_utf8(mesh.parts[p].name)},
                    {"kind", to_string(mesh.parts[p].kind)},
                    {"colour", css(part_colour(mesh.parts[p]))},
                    {"area_mm2", measured.part_area_mm2[p]},
                    {"triangles", triangles[p]}});
  }
  return list;
}

Json summary_json(const Model& model, const Json& branches, std::size_t junctions) {
  const auto rims = [&](RimKind kind) {
    return std::count_if(model.network.rims.begin(), model.network.rims.end(),
                         [&](const Rim& rim) { return rim.kind == kind; });
  };

  double length = 0;
  for (const Json& branch : branches) length += branch["length_mm"].get<double>();
  return {{"branches", model.tree.branches.size()},
          {"junctions", junctions},
          {"loops", cycle_count(model.tree)},
          {"components", component_count(model.tree)},
          {"inlets", rims(RimKind::kInlet)},
          {"outlets", rims(RimKind::kOutlet)},
          {"other_caps", rims(RimKind::kCap)},
          {"patches", model.network.patches.size()},
          {"control_points", model.network.control_points_mm.cols()},
          {"length_mm", length}};
}

Json facts_json(const Model& model, const TriangleMesh& mesh, const ReportExtras& extras) {
  const MeshMeasure measured = measure(mesh);
  Json branches = branches_json(model.tree, mesh, measured);
  Json junctions = junctions_json(model.tree, mesh, measured);
  Json failed = Json::array();
  for (const FailedPart& part : model.failed) {
    failed.push_back({{"name", valid_utf8(part.name)}, {"why", valid_utf8(part.why)}});
  }

  Json seconds = Json::object();
  for (const auto& [stage, time] : extras.seconds) seconds[valid_utf8(stage)] = time;
  Json json{
      {"schema", "angiospline-report"},
      {"schema_version", 1},
      {"version", version()},
      {"units", "mm"},
      {"name", valid_utf8(model.name)},
      {"source", valid_utf8(model.tree.source)},
      {"assumptions", texts(model.assumptions)},
      {"warnings", texts(texts_of(model.warnings))},
      {"failed", std::move(failed)},
      {"summary", summary_json(model, branches, junctions.size())},
      {"branches", std::move(branches)},
      {"junctions", std::move(junctions)},
      {"faces", faces_json(mesh, measured)},
      {"bounding_box_mm", {vector_json(measured.lowest_mm), vector_json(measured.highest_mm)}},
      {"mesh",
       {{"triangles", mesh.triangles.cols()},
        {"points", mesh.points_mm.cols()},
        {"closed", measured.closed()},
        {"volume_mm3", measured.volume_mm3},
        {"area_mm2", measured.area_mm2},
        {"genus", measured.genus}}},
      {"seconds", std::move(seconds)},
      {"files", texts(extras.files)}};
  json["certificate"] = extras.certificate ? to_json(*extras.certificate) : Json();
  return json;
}

// Arrays one after the other, each from a multiple of four; add() says where it began.
class Blob {
 public:
  template <typename T>
  std::size_t add(const std::vector<T>& items) {
    const std::size_t offset = bytes_.size();
    bytes_.resize(offset + items.size() * sizeof(T));
    std::memcpy(bytes_.data() + offset, items.data(), items.size() * sizeof(T));
    bytes_.resize((bytes_.size() + 3) / 4 * 4);
    return offset;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// A unit vector on the octahedron, unfolded into a square: two numbers in [-1, 1]
// (Cigolle et al., A survey of efficient representations for independent unit vectors, 2014).
std::array<std::int16_t, 2> octahedral(const Vec3& n) {
  const Vec3 m = n / n.lpNorm<1>();
  Vec2 p = m.head<2>();
  if (m.z() < 0) {
    p = {(1 - std::abs(m.y())) * (m.x() >= 0 ? 1 : -1),
         (1 - std::abs(m.x())) * (m.y() >= 0 ? 1 : -1)};
  }
  const auto quantised = [](double x) {
    return static_cast<std::int16_t>(std::lround(32767 * std::clamp(x, -1.0, 1.0)));
  };
  return {quantised(p.x()), quantised(p.y())};
}

std::uint16_t quantised(double value, double low, double extent) {
  if (std::isnan(value)) return 65535;
  const double t = extent > 0 ? (value - low) / extent : 0.5;
  return static_cast<std::uint16_t>(std::lround(65534 * std::clamp(t, 0.0, 1.0)));
}

// The colours of a scale from its lowest value to its highest, as CSS has them.
Json colours_json(const ColourScale& scale) {
  constexpr int kStops = 32;
  Json colours = Json::array();
  for (int k = 0; k <= kStops; ++k) {
    const double t = static_cast<double>(k) / kStops;
    colours.push_back(css(scale.diverging ? diverging_colour(t) : sequential_colour(t)));
  }
  return colours;
}

Json fields_json(const std::vector<MeshField>& fields) {
  Json list = Json::array();
  for (const MeshField& field : fields) {
    const ColourScale scale = scale_of(field);
    list.push_back({{"name", valid_utf8(field.name)},
                    {"low", scale.low},
                    {"high", scale.high},
                    {"colours", colours_json(scale)}});
  }
  return list;
}

struct BoundingBox {
  Vec3 low = Vec3::Zero();
  Vec3 extent = Vec3::Ones();
};

BoundingBox bounding_box(const Points3& points_mm) {
  if (points_mm.cols() == 0) return {};
  const Vec3 low = points_mm.rowwise().minCoeff();
  const Vec3 high = points_mm.rowwise().maxCoeff();
  return {low, high - low};
}

// Points as 16 bits of the bounding box, four numbers each: attributes start at multiples of four
// bytes.
std::vector<std::uint16_t> quantised_points(const PartArrays& part, const Points3& points_mm,
                                            const BoundingBox& box) {
  std::vector<std::uint16_t> positions;
  for (const int k : part.points) {
    for (Eigen::Index d = 0; d < 3; ++d) {
      const double t = box.extent[d] > 0 ? (points_mm(d, k) - box.low[d]) / box.extent[d] : 0.0;
      positions.push_back(static_cast<std::uint16_t>(std::lround(65535 * t)));
    }
    positions.push_back(0);
  }
  return positions;
}

// A part's numbers of points and triangles, and where its arrays begin in `blob`.
Json part_json(const PartArrays& part, std::size_t face, const Points3& points_mm,
               const BoundingBox& box, const std::vector<MeshField>& fields, Blob& blob) {
  std::vector<std::int16_t> normals;
  for (const Vec3& n : part.normals) {
    for (const std::int16_t x : octahedral(n)) normals.push_back(x);
  }
  Json json{{"face", face},
            {"points", part.points.size()},
            {"triangles", part.indices.size() / 3},
            {"positions", blob.add(quantised_points(part, points_mm, box))},
            {"normals", blob.add(normals)},
            {"fields", Json::array()}};

  // Half the bytes where 16 bits count all points.
  const bool wide = part.points.size() > std::numeric_limits<std::uint16_t>::max();
  json["indices"] =
      wide ? blob.add(part.indices)
           : blob.add(std::vector<std::uint16_t>(part.indices.begin(), part.indices.end()));

  for (const MeshField& field : fields) {
    const ColourScale scale = scale_of(field);
    std::vector<std::uint16_t> values;
    for (const int k : part.points) {
      values.push_back(quantised(field.values[k], scale.low, scale.high - scale.low));
      values.push_back(0);
    }
    json["fields"].push_back(blob.add(values));
  }
  return json;
}

// The geometry's table of contents for the page; the arrays go into `blob`.
Json geometry_json(const TriangleMesh& mesh, const std::vector<MeshField>& fields, Blob& blob) {
  const BoundingBox box = bounding_box(mesh.points_mm);
  const std::vector<PartArrays> parts = arrays_of_parts(mesh);
  Json list = Json::array();
  for (std::size_t p = 0; p < parts.size(); ++p) {
    if (parts[p].indices.empty()) continue;
    list.push_back(part_json(parts[p], p, mesh.points_mm, box, fields, blob));
  }
  return {{"low_mm", {box.low.x(), box.low.y(), box.low.z()}},
          {"extent_mm", {box.extent.x(), box.extent.y(), box.extent.z()}},
          {"fields", fields_json(fields)},
          {"parts", std::move(list)}};
}

Json image_json(const ReportImage& image) {
  Json lines = Json::array();
  for (const std::vector<Vec2>& line : image.lines) {
    Json points = Json::array();
    for (const Vec2& p : line)
      points.push_back({std::round(p.x() * 100) / 100, std::round(p.y() * 100) / 100});
    lines.push_back(std::move(points));
  }

  const std::string bytes(image.grey.begin(), image.grey.end());
  return {{"title", valid_utf8(image.title)},
          {"width", image.width},
          {"height", image.height},
          {"pixel_mm", {image.pixel_mm.x(), image.pixel_mm.y()}},
          {"grey", base64(bytes)},
          {"lines", std::move(lines)}};
}

// JSON inside a script element must not close it, nor open a comment.
std::string for_script(std::string text) {
  std::string safe;
  for (const char c : text) {
    if (c == '<') {
      safe += "\\u003c";
    } else {
      safe += c;
    }
  }
  return safe;
}

void replace_mark(std::string& page, std::string_view mark, const std::string& text) {
  const std::size_t at = page.find(mark);
  EXPECTS(at != std::string::npos);
  page.replace(at, mark.size(), text);
}

void check(const TriangleMesh& mesh, const ReportExtras& extras) {
  EXPECTS(!find_defect(mesh));
  for (const MeshField& field : extras.fields)
    EXPECTS(field.values.size() == mesh.points_mm.cols());
  for (const ReportImage& image : extras.images) {
    EXPECTS(image.grey.size() ==
            static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  }
}

}  // namespace

std::string report_json(const Model& model, const TriangleMesh& mesh, const ReportExtras& extras) {
  check(mesh, extras);
  return facts_json(model, mesh, extras).dump(1) + "\n";
}

std::string report_html(const Model& model, const TriangleMesh& mesh, const ReportExtras& extras) {
  check(mesh, extras);
  Json facts = facts_json(model, mesh, extras);
  Blob blob;
  facts["geometry"] = geometry_json(mesh, extras.fields, blob);
  facts["images"] = Json::array();
  for (const ReportImage& image : extras.images) facts["images"].push_back(image_json(image));

  std::string page(report_page());
  // From the back: what is filled in is never searched for marks.
  replace_mark(page, "%MESH%", base64(blob.bytes()));
  replace_mark(page, "%FACTS%", for_script(facts.dump()));
  return page;
}

Result<void> write_report(const std::filesystem::path& path, const Model& model,
                          const TriangleMesh& mesh, const ReportExtras& extras) {
  std::filesystem::path facts = path;
  facts.replace_filename(path.stem().string() + "_facts.json");
  if (auto done = write_file(facts, report_json(model, mesh, extras)); !done) return done;
  return write_file(path, report_html(model, mesh, extras));
}

}  // namespace angiospline
