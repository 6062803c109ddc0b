#include "io/centerlines/graphml_file.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/index.h"
#include "io/reading/graph_builder.h"
#include "io/text/text_file.h"
#include "io/text/xml_reader.h"

namespace angiospline {
namespace {

// What a key means for us, from its attr.name.
enum class Meaning { kNothing, kX, kY, kZ, kRadius, kDiameter, kBranch, kUnit };

Meaning meaning_of(std::string_view attr_name) {
  std::string plain = lower_case(attr_name);
  std::erase_if(plain, [](char c) { return c == '_' || c == ' ' || c == '-'; });
  constexpr std::array<std::pair<std::string_view, Meaning>, 16> kNames = {
      {{"x", Meaning::kX},
       {"posx", Meaning::kX},
       {"coordx", Meaning::kX},
       {"y", Meaning::kY},
       {"posy", Meaning::kY},
       {"coordy", Meaning::kY},
       {"z", Meaning::kZ},
       {"posz", Meaning::kZ},
       {"coordz", Meaning::kZ},
       {"radius", Meaning::kRadius},
       {"r", Meaning::kRadius},
       {"avgradiusavg", Meaning::kRadius},
       {"radiusavg", Meaning::kRadius},
       {"diameter", Meaning::kDiameter},
       {"branch", Meaning::kBranch},
       {"unit", Meaning::kUnit}}};
  for (const auto& [name, meaning] : kNames) {
    if (plain == name) return meaning;
  }
  return Meaning::kNothing;
}

class GraphmlReader {
 public:
  GraphmlReader(std::string_view text, std::string_view name)
      : xml_(text, name), name_(name), builder_(name) {}

  Result<CenterlineTree> read(const CenterlineFileOptions& options) {
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) break;
      if (*event != XmlReader::Event::kStart) continue;

      Result<void> taken;
      if (xml_.tag() == "key") {
        keys_[std::string(xml_.attribute("id").value_or(""))] =
            meaning_of(xml_.attribute("attr.name").value_or(""));
      }
      if (xml_.tag() == "graph") is_directed_ = xml_.attribute("edgedefault") == "directed";
      if (xml_.tag() == "data") taken = graph_data();
      if (xml_.tag() == "node") taken = node();
      if (xml_.tag() == "edge") taken = edge();
      if (!taken) return fail(taken.error());
    }
    if (builder_.point_count() == 0) {
      return builder_.bad_file("holds no node", "a GraphML tree has nodes with x, y, z");
    }

    // Edges may stand before the nodes they join.
    if (auto linked = link(); !linked) return fail(linked.error());
    if (is_directed_) start_where_no_edge_enters();
    return builder_.finish(options);
  }

 private:
  struct Data {
    std::array<std::optional<double>, 3> xyz;
    std::optional<double> radius;
    std::string branch;
  };
  struct Edge {
    std::string from;
    std::string to;
    Data data;
    int line;
  };

  Result<void> graph_data() {
    const auto key = keys_.find(std::string(xml_.attribute("key").value_or("")));
    const Result<std::string> text = xml_.text_of_element();
    if (!text) return fail(text.error());
    if (key == keys_.end() || key->second != Meaning::kUnit) return {};
    const Result<double> unit = parse_unit_mm(trimmed_lines(*text));
    if (!unit) return xml_.bad(unit.error().what, *text, unit.error().rule);
    builder_.facts.state_unit(*unit, trimmed_lines(*text));
    return {};
  }

  // The data of a node or an edge up to its end.
  Result<Data> data_until(std::string_view end_tag) {
    Data data;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kEnd && xml_.tag() == end_tag) return data;
      if (*event != XmlReader::Event::kStart || xml_.tag() != "data") continue;

      const auto key = keys_.find(std::string(xml_.attribute("key").value_or("")));
      const int line = xml_.line();
      const Result<std::string> text = xml_.text_of_element();
      if (!text) return fail(text.error());
      if (key == keys_.end()) continue;
      const auto kept = keep(trimmed_lines(*text), key->second, line, data);
      if (!kept) return fail(kept.error());
    }
  }

  Result<void> keep(std::string_view value, Meaning meaning, int line, Data& data) const {
    if (meaning == Meaning::kBranch) data.branch = std::string(value);
    if (meaning == Meaning::kX || meaning == Meaning::kY || meaning == Meaning::kZ) {
      const Result<double> x = parse_coordinate(value, name_, line);
      if (!x) return fail(x.error());
      data.xyz[static_cast<std::size_t>(meaning) - static_cast<std::size_t>(Meaning::kX)] = *x;
    }

    // A radius beats a diameter, whichever comes first.
    if (meaning == Meaning::kRadius || meaning == Meaning::kDiameter) {
      const Result<double> r = parse_radius(value, name_, line);
      if (!r) return fail(r.error());
      if (meaning == Meaning::kRadius || !data.radius) {
        data.radius = meaning == Meaning::kRadius ? *r : 0.5 * *r;
      }
    }
    return {};
  }

  Result<void> node() {
    const std::string id(xml_.attribute("id").value_or(""));
    const int line = xml_.line();
    const Result<Data> data = data_until("node");
    if (!data) return fail(data.error());
    if (!data->xyz[0] || !data->xyz[1] || !data->xyz[2]) {
      return builder_.bad("the node has no position", line, quoted_value(id),
                          "data of the names x, y and z");
    }

    // Radii of 1 stand in where only the edges have them; they are never used.
    nodes_without_radius_ += !data->radius;
    const Vec3 position(*data->xyz[0], *data->xyz[1], *data->xyz[2]);
    const int point = builder_.add_point({id, position, data->radius.value_or(1.0)}, line);
    return builder_.register_id(point, "the node is defined twice");
  }

  Result<void> edge() {
    std::string from(xml_.attribute("source").value_or(""));
    std::string to(xml_.attribute("target").value_or(""));
    const int line = xml_.line();
    Result<Data> data = data_until("edge");
    if (!data) return fail(data.error());
    edges_.push_back({std::move(from), std::move(to), std::move(*data), line});
    return {};
  }

  Result<void> link() {
    const bool by_edge =
        !edges_.empty() && std::all_of(edges_.begin(), edges_.end(),
                                       [](const Edge& e) { return e.data.radius.has_value(); });
    if (!by_edge && nodes_without_radius_ > 0) {
      return fail({ErrorKind::kBadInput, "nodes have no radius", std::string(name_),
                   fmt::format("{} of {}", nodes_without_radius_, builder_.point_count()),
                   "every node or every edge has data of the name radius or diameter"});
    }
    builder_.facts.notes.push_back(by_edge ? "radii: those of the edges"
                                           : "radii: those of the nodes");

    PointGraph& graph = builder_.graph;
    std::map<std::string, int> lines;
    for (const Edge& e : edges_) {
      auto joined = builder_.add_edge(e.from, e.to, e.line, "edges join nodes of this file");
      if (!joined) return joined;
      if (by_edge) graph.edge_radii_mm.push_back(*e.data.radius);
      const auto [line, is_new] =
          lines.emplace(e.data.branch, static_cast<int>(graph.line_names.size()));
      if (is_new) graph.line_names.push_back(e.data.branch);
      graph.line_of_edge.push_back(e.data.branch.empty() ? -1 : line->second);
    }
    return {};
  }

  void start_where_no_edge_enters() {
    PointGraph& graph = builder_.graph;
    std::vector<bool> entered(graph.points.size(), false);
    for (const auto& [from, to] : graph.edges) entered[index(to)] = true;
    for (std::size_t p = 0; p < entered.size(); ++p) {
      if (!entered[p]) graph.roots.push_back(static_cast<int>(p));
    }
  }

  XmlReader xml_;
  std::string_view name_;
  std::map<std::string, Meaning> keys_;
  std::vector<Edge> edges_;
  int nodes_without_radius_ = 0;
  bool is_directed_ = false;
  GraphBuilder builder_;
};

std::string escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '<') {
      out += "&lt;";
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '"') {
      out += "&quot;";
    } else {
      out += c;
    }
  }
  return out;
}

// Points become nodes in the order of the branches, each followed by the edge that reaches it.
class GraphmlWriter {
 public:
  explicit GraphmlWriter(const CenterlineTree& tree)
      : tree_(tree), radius_of_(tree.nodes.size(), 0.0) {}

  std::string write() {
    write_keys();
    for (const CenterlineBranch& branch : tree_.branches) write_branch(branch);
    return std::move(out_) + "</graph>\n</graphml>\n";
  }

 private:
  // What the data mean (GraphML Primer, "Declaring GraphML-Attributes").
  void write_keys() {
    out_ =
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
        "<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n";
    for (const char* key : {"x", "y", "z", "radius"}) {
      fmt::format_to(std::back_inserter(out_),
                     "<key id=\"{0}\" for=\"node\" attr.name=\"{0}\" attr.type=\"double\"/>\n",
                     key);
    }
    out_ +=
        "<key id=\"branch\" for=\"edge\" attr.name=\"branch\" attr.type=\"string\"/>\n"
        "<key id=\"unit\" for=\"graph\" attr.name=\"unit\" attr.type=\"string\"/>\n"
        "<graph id=\"centerlines\" edgedefault=\"directed\">\n<data key=\"unit\">mm</data>\n";
  }

  void write_node(std::string_view id, const Vec3& p, double r) {
    fmt::format_to(std::back_inserter(out_),
                   "<node id=\"{}\"><data key=\"x\">{}</data><data key=\"y\">{}</data>"
                   "<data key=\"z\">{}</data><data key=\"radius\">{}</data></node>\n",
                   escaped(id), p.x(), p.y(), p.z(), r);
  }

  void write_edge(std::string_view from, std::string_view to, std::string_view branch) {
    fmt::format_to(std::back_inserter(out_),
                   "<edge source=\"{}\" target=\"{}\"><data key=\"branch\">{}</data></edge>\n",
                   escaped(from), escaped(to), escaped(branch));
  }

  // Writes tree node n when it is met first, with this radius; whether it has this radius.
  bool meet(int n, double r) {
    const CenterlineNode& node = tree_.nodes[index(n)];
    if (!(radius_of_[index(n)] > 0)) {
      radius_of_[index(n)] = r;
      write_node(node.name, node.position_mm, r);
    }
    return radius_of_[index(n)] == r;
  }

  void write_branch(const CenterlineBranch& branch) {
    const Eigen::Index last = branch.points_mm.cols() - 1;
    const auto copy = [&](Eigen::Index i) {  // a node of the branch's own, and its name
      std::string id = fmt::format("{}:{}", branch.name, i);
      write_node(id, branch.points_mm.col(i), branch.radii_mm(i));
      return id;
    };

    // GraphML has one radius a node: a branch with another one starts at a copy beside it.
    std::string before = tree_.nodes[index(branch.from)].name;
    if (!meet(branch.from, branch.radii_mm(0))) {
      std::string start = copy(0);
      write_edge(before, start, branch.name);
      before = std::move(start);
    }

    for (Eigen::Index i = 1; i < last; ++i) {
      std::string here = copy(i);
      write_edge(before, here, branch.name);
      before = std::move(here);
    }

    // The same at its end.
    if (!meet(branch.to, branch.radii_mm(last))) {
      std::string end = copy(last);
      write_edge(before, end, branch.name);
      before = std::move(end);
    }
    write_edge(before, tree_.nodes[index(branch.to)].name, branch.name);
  }

  const CenterlineTree& tree_;
  std::vector<double> radius_of_;  // as written with the node; 0 before
  std::string out_;
};

}  // namespace

Result<CenterlineTree> parse_graphml(std::string_view text, std::string_view name,
                                     const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return GraphmlReader(*plain, name).read(options);
}

std::string graphml_text(const CenterlineTree& tree) { return GraphmlWriter(tree).write(); }

}  // namespace angiospline
