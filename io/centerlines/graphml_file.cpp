#include "io/centerlines/graphml_file.h"

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/index.h"
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
  GraphmlReader(std::string_view text, std::string_view name) : xml_(text, name), name_(name) {}

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
    if (graph_.points.empty()) {
      return fail({ErrorKind::kBadInput,
                   "holds no node",
                   std::string(name_),
                   {},
                   "a GraphML tree has nodes with x, y, z"});
    }
    if (auto linked = link(); !linked) return fail(linked.error());
    return finish_tree(std::move(graph_), facts_, name_, options);
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
    facts_.unit_mm = *unit;
    facts_.unit_name = std::string(trimmed_lines(*text));
    facts_.unit_stated = true;
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
      const Meaning meaning = key == keys_.end() ? Meaning::kNothing : key->second;
      const std::string_view value = trimmed_lines(*text);
      if (meaning == Meaning::kBranch) data.branch = std::string(value);
      if (meaning == Meaning::kX || meaning == Meaning::kY || meaning == Meaning::kZ) {
        const Result<double> x = parse_coordinate(value, name_, line);
        if (!x) return fail(x.error());
        data.xyz[static_cast<std::size_t>(meaning) - static_cast<std::size_t>(Meaning::kX)] = *x;
      }
      if (meaning == Meaning::kRadius || meaning == Meaning::kDiameter) {
        const Result<double> r = parse_radius(value, name_, line);
        if (!r) return fail(r.error());
        if (meaning == Meaning::kRadius || !data.radius) {
          data.radius = meaning == Meaning::kRadius ? *r : 0.5 * *r;
        }
      }
    }
  }

  Result<void> node() {
    const std::string id(xml_.attribute("id").value_or(""));
    const int line = xml_.line();
    const Result<Data> data = data_until("node");
    if (!data) return fail(data.error());
    if (!data->xyz[0] || !data->xyz[1] || !data->xyz[2]) {
      return fail({ErrorKind::kBadInput, "the node has no position", at_line(name_, line),
                   quoted_value(id), "data of the names x, y and z"});
    }
    if (!node_of_.emplace(id, static_cast<int>(graph_.points.size())).second) {
      return fail({ErrorKind::kBadInput, "the node is defined twice", at_line(name_, line),
                   quoted_value(id), "ids are unique"});
    }
    nodes_without_radius_ += !data->radius;
    graph_.points.push_back(
        {id, Vec3(*data->xyz[0], *data->xyz[1], *data->xyz[2]), data->radius.value_or(1.0)});
    return {};
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
                   fmt::format("{} of {}", nodes_without_radius_, graph_.points.size()),
                   "every node or every edge has data of the name radius or diameter"});
    }
    facts_.notes.push_back(by_edge ? "radii: those of the edges" : "radii: those of the nodes");
    std::map<std::string, int> lines;
    for (const Edge& e : edges_) {
      const auto from = node_of_.find(e.from);
      const auto to = node_of_.find(e.to);
      if (from == node_of_.end() || to == node_of_.end()) {
        return fail({ErrorKind::kBadInput, "the edge's node does not exist", at_line(name_, e.line),
                     quoted_value(from == node_of_.end() ? e.from : e.to),
                     "edges join nodes of this file"});
      }
      graph_.edges.emplace_back(from->second, to->second);
      if (by_edge) graph_.edge_radii_mm.push_back(*e.data.radius);
      const auto [line, is_new] =
          lines.emplace(e.data.branch, static_cast<int>(graph_.line_names.size()));
      if (is_new) graph_.line_names.push_back(e.data.branch);
      graph_.line_of_edge.push_back(e.data.branch.empty() ? -1 : line->second);
    }
    if (is_directed_) {  // flow enters where no edge does
      std::vector<bool> entered(graph_.points.size(), false);
      for (const auto& [from, to] : graph_.edges) entered[index(to)] = true;
      for (std::size_t p = 0; p < entered.size(); ++p) {
        if (!entered[p]) graph_.roots.push_back(static_cast<int>(p));
      }
    }
    return {};
  }

  XmlReader xml_;
  std::string_view name_;
  std::map<std::string, Meaning> keys_;
  std::map<std::string, int> node_of_;
  std::vector<Edge> edges_;
  int nodes_without_radius_ = 0;
  bool is_directed_ = false;
  PointGraph graph_;
  FileFacts facts_;
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

}  // namespace

Result<CenterlineTree> parse_graphml(std::string_view text, std::string_view name,
                                     const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return GraphmlReader(*plain, name).read(options);
}

std::string graphml_text(const CenterlineTree& tree) {
  std::string out =
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<graphml xmlns=\"http://graphml.graphdrawing.org/xmlns\">\n";
  for (const char* key : {"x", "y", "z", "radius"}) {
    fmt::format_to(std::back_inserter(out),
                   "<key id=\"{0}\" for=\"node\" attr.name=\"{0}\" attr.type=\"double\"/>\n", key);
  }
  out +=
      "<key id=\"branch\" for=\"edge\" attr.name=\"branch\" attr.type=\"string\"/>\n"
      "<key id=\"unit\" for=\"graph\" attr.name=\"unit\" attr.type=\"string\"/>\n"
      "<graph id=\"centerlines\" edgedefault=\"directed\">\n<data key=\"unit\">mm</data>\n";
  const auto node = [&](std::string_view id, const Vec3& p, double r) {
    fmt::format_to(std::back_inserter(out),
                   "<node id=\"{}\"><data key=\"x\">{}</data><data key=\"y\">{}</data>"
                   "<data key=\"z\">{}</data><data key=\"radius\">{}</data></node>\n",
                   escaped(id), p.x(), p.y(), p.z(), r);
  };
  const auto edge = [&](std::string_view from, std::string_view to, std::string_view branch) {
    fmt::format_to(std::back_inserter(out),
                   "<edge source=\"{}\" target=\"{}\"><data key=\"branch\">{}</data></edge>\n",
                   escaped(from), escaped(to), escaped(branch));
  };
  std::vector<double> radius_of(tree.nodes.size(), 0.0);
  for (const CenterlineBranch& branch : tree.branches) {
    const Eigen::Index last = branch.points_mm.cols() - 1;
    const auto end = [&](int n,
                         double r) {  // the node, or a copy of it with the branch's own radius
      const CenterlineNode& at = tree.nodes[index(n)];
      if (!(radius_of[index(n)] > 0)) {
        radius_of[index(n)] = r;
        node(at.name, at.position_mm, r);
      }
      return radius_of[index(n)] == r;
    };
    const std::string from = tree.nodes[index(branch.from)].name;
    const std::string to = tree.nodes[index(branch.to)].name;
    std::string before = from;
    if (!end(branch.from, branch.radii_mm(0))) {
      before = branch.name + ":0";
      node(before, branch.points_mm.col(0), branch.radii_mm(0));
      edge(from, before, branch.name);
    }
    for (Eigen::Index i = 1; i < last; ++i) {
      std::string here = fmt::format("{}:{}", branch.name, i);
      node(here, branch.points_mm.col(i), branch.radii_mm(i));
      edge(before, here, branch.name);
      before = std::move(here);
    }
    if (end(branch.to, branch.radii_mm(last))) {
      edge(before, to, branch.name);
    } else {
      const std::string copy = fmt::format("{}:{}", branch.name, last);
      node(copy, branch.points_mm.col(last), branch.radii_mm(last));
      edge(before, copy, branch.name);
      edge(copy, to, branch.name);
    }
  }
  return out + "</graph>\n</graphml>\n";
}

}  // namespace angiospline
