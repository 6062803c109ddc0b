#include "io/model/model_file.h"

#include <array>
#include <utility>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/contract.h"
#include "base/version.h"

namespace angiospline {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view kSchema = "angiospline-model";
constexpr std::array<const char*, 2> kRegionKinds{"body", "junction"};
constexpr std::array<const char*, 3> kRimKinds{"inlet", "outlet", "cap"};
constexpr std::array<const char*, 4> kSides{"u0", "u1", "v0", "v1"};

Json to_json(const Vec3& p) { return Json::array({p.x(), p.y(), p.z()}); }

Json to_json(const Points3& points) {
  Json columns = Json::array();
  for (const auto& p : points.colwise()) columns.push_back(to_json(Vec3(p)));
  return columns;
}

Json to_json(const Side& side) {
  return {{"patch", side.patch},
          {"side", kSides[static_cast<std::size_t>(side.side)]},
          {"from", side.from},
          {"to", side.to}};
}

Json to_json(const KnotVector& knots) {
  return {{"degree", knots.degree()}, {"knots", knots.knots()}};
}

Json to_json(const Rim& rim) {
  Json sides = Json::array();
  for (const Side& side : rim.sides) sides.push_back(to_json(side));
  return {{"name", rim.name},
          {"kind", kRimKinds[static_cast<std::size_t>(rim.kind)]},
          {"center_mm", to_json(rim.center_mm)},
          {"normal", to_json(rim.normal)},
          {"radius_mm", rim.radius_mm},
          {"sides", std::move(sides)}};
}

Json to_json(const SurfaceNetwork& network) {
  Json json{{"control_points_mm", to_json(network.control_points_mm)}};
  for (const char* key : {"patches", "regions", "joins", "rims", "dependencies"}) {
    json[key] = Json::array();
  }

  // Keys keep this order; an index in the file is a place in one of these lists.
  for (const Patch& patch : network.patches) {
    json["patches"].push_back({{"region", patch.region},
                               {"u", to_json(patch.u)},
                               {"v", to_json(patch.v)},
                               {"control", patch.control}});
  }
  for (const Region& region : network.regions) {
    json["regions"].push_back({{"name", region.name},
                               {"kind", kRegionKinds[static_cast<std::size_t>(region.kind)]},
                               {"radius_mm", region.radius_mm}});
  }
  for (const Join& join : network.joins) {
    json["joins"].push_back(
        {{"a", to_json(join.a)}, {"b", to_json(join.b)}, {"reversed", join.reversed}});
  }
  for (const Rim& rim : network.rims) json["rims"].push_back(to_json(rim));
  for (const Dependency& dependency : network.dependencies) {
    Json masters = Json::array();
    for (const auto& [master, weight] : dependency.masters) {
      masters.push_back(Json::array({master, weight}));
    }
    json["dependencies"].push_back({{"point", dependency.point}, {"masters", std::move(masters)}});
  }
  return json;
}

Json to_json(const CenterlineTree& tree) {
  Json nodes = Json::array();
  for (const CenterlineNode& node : tree.nodes) {
    nodes.push_back({{"name", node.name}, {"position_mm", to_json(node.position_mm)}});
  }

  Json branches = Json::array();
  for (const CenterlineBranch& branch : tree.branches) {
    branches.push_back(
        {{"name", branch.name},
         {"from", branch.from},
         {"to", branch.to},
         {"points_mm", to_json(branch.points_mm)},
         {"radii_mm", std::vector<double>(branch.radii_mm.begin(), branch.radii_mm.end())}});
  }
  return {{"source", tree.source},
          {"assumptions", tree.assumptions},
          {"nodes", std::move(nodes)},
          {"branches", std::move(branches)},
          {"inlets", tree.inlets}};
}

// Carries an Error from the depth of a document to model_from_json, the only place that catches it.
struct Refusal {
  Error error;
};

// A value of the document that knows its place; the pointer is spelt out only for errors.
class Cursor {
 public:
  Cursor(const Json& json, const std::string& file) : json_(json), file_(file) {}

  bool has(const char* key) const { return json_.is_object() && json_.contains(key); }

  Cursor operator[](const char* key) const {
    if (!json_.is_object()) refuse("an object is needed");
    const auto found = json_.find(key);
    if (found == json_.end()) {
      throw Refusal{{ErrorKind::kBadInput, "key is missing", file_ + ":" + pointer(), key,
                     "every key of the schema is needed"}};
    }
    return Cursor(*found, *this, key, 0);
  }

  std::size_t size() const {
    if (!json_.is_array()) refuse("an array is needed");
    return json_.size();
  }
  Cursor operator[](std::size_t i) const { return Cursor(json_[i], *this, nullptr, i); }

  double number() const {
    if (!json_.is_number()) refuse("a number is needed");
    return json_.get<double>();
  }
  int integer() const {
    if (!json_.is_number_integer()) refuse("an integer is needed");
    const auto value = json_.get<std::int64_t>();
    const bool too_large = json_.is_number_unsigned() && json_.get<std::uint64_t>() > INT32_MAX;
    if (too_large || value < INT32_MIN || value > INT32_MAX) refuse("a 32-bit integer is needed");
    return static_cast<int>(value);
  }
  bool boolean() const {
    if (!json_.is_boolean()) refuse("true or false is needed");
    return json_.get<bool>();
  }
  std::string text() const {
    if (!json_.is_string()) refuse("a string is needed");
    return json_.get<std::string>();
  }

  template <std::size_t N>
  std::size_t one_of(const std::array<const char*, N>& choices) const {
    const std::string given = text();
    std::string rule = "one of";
    for (std::size_t k = 0; k < N; ++k) {
      if (given == choices[k]) return k;
      rule += std::string(" ") + choices[k];
    }
    refuse(rule);
  }

  template <typename Read>
  auto each(const Read& read) const {
    std::vector<decltype(read(*this))> items;
    const std::size_t count = size();
    items.reserve(count);
    for (std::size_t i = 0; i < count; ++i) items.push_back(read((*this)[i]));
    return items;
  }

  [[noreturn]] void refuse(std::string rule, std::string what = "unexpected value") const {
    // Structures are named, not shown: printing them is recursive and a hostile file is deep.
    std::string value = json_.is_structured()
                            ? json_.type_name()
                            : json_.dump(-1, ' ', false, Json::error_handler_t::replace);
    constexpr std::size_t kShown = 40;
    if (value.size() > kShown) value = value.substr(0, kShown) + "...";
    throw Refusal{{ErrorKind::kBadInput, std::move(what), file_ + ":" + pointer(), std::move(value),
                   std::move(rule)}};
  }
  std::string pointer() const {
    if (parent_ == nullptr) return "";
    return parent_->pointer() + "/" + (key_ != nullptr ? key_ : std::to_string(index_));
  }

 private:
  Cursor(const Json& json, const Cursor& parent, const char* key, std::size_t index)
      : json_(json), file_(parent.file_), parent_(&parent), key_(key), index_(index) {}

  const Json& json_;
  const std::string& file_;
  const Cursor* parent_ = nullptr;
  const char* key_ = nullptr;
  std::size_t index_ = 0;
};

std::vector<std::string> read_texts(const Cursor& c) {
  return c.each([](const Cursor& item) { return item.text(); });
}

std::vector<double> read_numbers(const Cursor& c) {
  return c.each([](const Cursor& item) { return item.number(); });
}

Vec3 read_point(const Cursor& c) {
  if (c.size() != 3) c.refuse("three coordinates");
  return {c[std::size_t{0}].number(), c[1].number(), c[2].number()};
}

Points3 read_points(const Cursor& c) {
  Points3 points(3, static_cast<Eigen::Index>(c.size()));
  for (std::size_t k = 0; k < c.size(); ++k) {
    points.col(static_cast<Eigen::Index>(k)) = read_point(c[k]);
  }
  return points;
}

KnotVector read_knots(const Cursor& c) {
  Result<KnotVector> knots = KnotVector::make(c["degree"].integer(), read_numbers(c["knots"]));
  if (!knots) c.refuse(knots.error().rule, knots.error().where + ": " + knots.error().what);
  return *std::move(knots);
}

Side read_side(const Cursor& c) {
  return {c["patch"].integer(), static_cast<PatchSide>(c["side"].one_of(kSides)),
          c["from"].number(), c["to"].number()};
}

Rim read_rim(const Cursor& c) {
  return {c["name"].text(),           static_cast<RimKind>(c["kind"].one_of(kRimKinds)),
          read_point(c["center_mm"]), read_point(c["normal"]),
          c["radius_mm"].number(),    c["sides"].each(read_side)};
}

Dependency read_dependency(const Cursor& c) {
  return {c["point"].integer(), c["masters"].each([](const Cursor& m) {
            if (m.size() != 2) m.refuse("a point and a weight");
            return std::pair(m[std::size_t{0}].integer(), m[1].number());
          })};
}

SurfaceNetwork read_network(const Cursor& c) {
  SurfaceNetwork network;
  network.control_points_mm = read_points(c["control_points_mm"]);
  network.patches = c["patches"].each([](const Cursor& p) {
    return Patch{read_knots(p["u"]), read_knots(p["v"]),
                 p["control"].each([](const Cursor& i) { return i.integer(); }),
                 p["region"].integer()};
  });
  network.regions = c["regions"].each([](const Cursor& r) {
    return Region{r["name"].text(), static_cast<RegionKind>(r["kind"].one_of(kRegionKinds)),
                  r["radius_mm"].number()};
  });
  network.joins = c["joins"].each([](const Cursor& j) {
    return Join{read_side(j["a"]), read_side(j["b"]), j["reversed"].boolean()};
  });
  network.rims = c["rims"].each(read_rim);
  network.dependencies = c["dependencies"].each(read_dependency);
  return network;
}

CenterlineTree read_tree(const Cursor& c) {
  CenterlineTree tree;
  tree.source = c["source"].text();
  tree.assumptions = read_texts(c["assumptions"]);
  tree.nodes = c["nodes"].each([](const Cursor& n) {
    return CenterlineNode{n["name"].text(), read_point(n["position_mm"])};
  });
  tree.branches = c["branches"].each([](const Cursor& b) {
    const std::vector<double> radii = read_numbers(b["radii_mm"]);
    return CenterlineBranch{
        b["name"].text(), b["from"].integer(), b["to"].integer(), read_points(b["points_mm"]),
        Eigen::VectorXd::Map(radii.data(), static_cast<Eigen::Index>(radii.size()))};
  });
  tree.inlets = c["inlets"].each([](const Cursor& i) { return i.integer(); });
  return tree;
}

// Files of earlier releases have texts alone; their warnings stay without a code.
std::vector<Warning> read_warnings(const Cursor& c) {
  std::vector<Warning> warnings = c["warnings"].each([](const Cursor& w) {
    return Warning{{}, w.text()};
  });
  if (!c.has("warning_codes")) return warnings;

  const Cursor codes = c["warning_codes"];
  if (codes.size() != warnings.size()) codes.refuse("a code for each warning");
  for (std::size_t k = 0; k < warnings.size(); ++k)
    warnings[k].code = warning_code(codes[k].text());
  return warnings;
}

Model read_document(const Cursor& c) {
  if (c["schema"].text() != kSchema) c["schema"].refuse(std::string(kSchema), "unknown schema");
  if (c["schema_version"].integer() != kModelSchemaVersion) {
    c["schema_version"].refuse("this program reads version " + std::to_string(kModelSchemaVersion),
                               "unknown schema version");
  }
  if (c["units"]["length"].text() != "mm") c["units"]["length"].refuse("mm", "unknown unit");

  Model model;
  model.name = c["name"].text();
  model.assumptions = read_texts(c["assumptions"]);
  model.warnings = read_warnings(c);
  model.failed = c["failed"].each([](const Cursor& f) {
    return FailedPart{f["name"].text(), f["why"].text()};
  });
  model.tree = read_tree(c["tree"]);
  model.network = read_network(c["network"]);
  return model;
}

}  // namespace

std::string model_to_json(const Model& model) {
  EXPECTS(!find_defect(model));
  Json failed = Json::array();
  for (const FailedPart& part : model.failed) {
    failed.push_back({{"name", part.name}, {"why", part.why}});
  }

  const Json json{
      {"schema", kSchema},
      {"schema_version", kModelSchemaVersion},
      {"units", {{"length", "mm"}}},
      {"provenance",
       {{"program", "angiospline"}, {"version", version()}, {"source", model.tree.source}}},
      {"name", model.name},
      {"assumptions", model.assumptions},
      {"warnings", texts_of(model.warnings)},
      {"warning_codes", code_names_of(model.warnings)},
      {"failed", std::move(failed)},
      {"tree", to_json(model.tree)},
      {"network", to_json(model.network)}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

Result<Model> model_from_json(std::string_view text, const std::string& file) {
  try {
    const Json json = Json::parse(text);
    Model model = read_document(Cursor(json, file));
    if (auto error = find_defect(model)) {
      error->where = file + ": " + error->where;
      return fail(*error);
    }
    return model;
  } catch (const Refusal& refusal) {
    return fail(refusal.error);
  } catch (const Json::exception& e) {
    return fail({ErrorKind::kBadInput, "not a JSON document", file, e.what(), {}});
  }
}

Result<void> write_model(const std::filesystem::path& path, const Model& model) {
  if (auto error = find_defect(model)) {
    error->kind = ErrorKind::kFailed;
    return fail(*error);
  }
  return write_file(path, model_to_json(model));
}

Result<Model> read_model(const std::filesystem::path& path) {
  const Result<std::string> text = read_file(path);
  if (!text) return fail(text.error());
  return model_from_json(*text, path.string());
}

}  // namespace angiospline
