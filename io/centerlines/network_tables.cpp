#include "io/centerlines/network_tables.h"

#include <algorithm>
#include <initializer_list>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "base/index.h"
#include "io/reading/graph_builder.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

// A table with a header line, one row after the other.
class Table {
 public:
  Table(std::string_view text, std::string_view name) : lines_(text), name_(name) {
    if (!next_fields()) return;
    for (const std::string_view field : fields_) {
      std::string plain = lower_case(field);
      std::erase_if(plain, [](char c) { return c == '_' || c == ' ' || c == '-'; });
      header_.push_back(std::move(plain));
    }
  }

  // The column that bears the first of these names that any does, or -1.
  int column(std::initializer_list<std::string_view> names) const {
    for (const std::string_view name : names) {
      const auto found = std::find(header_.begin(), header_.end(), name);
      if (found != header_.end()) return static_cast<int>(found - header_.begin());
    }
    return -1;
  }

  Result<bool> next_row() {
    if (!next_fields()) return false;
    if (fields_.size() < header_.size()) {
      return bad("the row is cut short", fmt::format("{} values", fields_.size()),
                 fmt::format("every row has {}", header_.size()));
    }
    return true;
  }

  std::string_view field(int c) const { return fields_[index(c)]; }
  int line() const { return lines_.line(); }
  std::string_view name() const { return name_; }

  tl::unexpected<Error> bad(std::string what, std::string value, std::string rule) const {
    return fail({ErrorKind::kBadInput, std::move(what), at_line(name_, line()), std::move(value),
                 std::move(rule)});
  }

 private:
  bool next_fields() {
    while (const auto line = lines_.next()) {
      const std::string_view content = trimmed(*line);
      if (content.empty() || content.front() == '#') continue;
      if (separator_ == 0) separator_ = separator_of(content);
      split_fields(content, separator_, fields_);
      return true;
    }
    fields_.clear();
    return false;
  }

  LineReader lines_;
  std::string_view name_;
  char separator_ = 0;
  std::vector<std::string_view> fields_;
  std::vector<std::string> header_;
};

class NetworkReader {
 public:
  Result<void> read_vertices(Table table) {
    const int id = table.column({"id", "node", "nodeid"});
    const int xyz[3] = {table.column({"posx", "x"}), table.column({"posy", "y"}),
                        table.column({"posz", "z"})};
    builder_.continue_in(table.name());
    if (id < 0 || xyz[0] < 0 || xyz[1] < 0 || xyz[2] < 0) {
      return builder_.bad_file("is not a table of vertices",
                               "its columns are id, pos_x, pos_y, pos_z");
    }

    while (true) {
      const Result<bool> row = table.next_row();
      if (!row) return fail(row.error());
      if (!*row) return {};
      const Result<Vec3> position =
          parse_position([&](int k) { return table.field(xyz[k]); }, table.name(), table.line());
      if (!position) return fail(position.error());
      const int point =
          builder_.add_point({std::string(table.field(id)), *position, 1.0}, table.line());
      if (auto unique = builder_.register_id(point, "the id is used twice"); !unique) return unique;
    }
  }

  Result<void> read_edges(Table table) {
    const int from = table.column({"node1id", "source", "from", "node1"});
    const int to = table.column({"node2id", "target", "to", "node2"});
    int radius = table.column({"avgradiusavg", "radiusavg", "avgradius", "radius", "r"});
    builder_.continue_in(table.name());
    if (radius < 0) {
      radius = table.column({"diameter", "d"});
      builder_.facts.has_diameters = radius >= 0;
    }
    if (from < 0 || to < 0 || radius < 0) {
      return builder_.bad_file(
          "is not a table of edges with radii",
          "its columns are node1id, node2id and avgRadiusAvg, radius or diameter");
    }

    while (true) {
      const Result<bool> row = table.next_row();
      if (!row) return fail(row.error());
      if (!*row) return {};
      auto joined = builder_.add_edge(table.field(from), table.field(to), table.line(),
                                      "edges join ids of the vertices");
      if (!joined) return joined;

      // Voreen writes -1 where an edge is too short to be measured.
      const auto number = parse_number(table.field(radius));
      if (number && *number <= 0) {
        ++without_radius_;
        builder_.graph.edge_radii_mm.push_back(0.0);
      } else {
        const Result<double> r = parse_radius(table.field(radius), table.name(), table.line());
        if (!r) return fail(r.error());
        builder_.graph.edge_radii_mm.push_back(*r);
      }
    }
  }

  // Edges without a radius of their own get the mean of those they meet.
  Result<void> complete_radii(std::string_view name) {
    PointGraph& graph = builder_.graph;
    std::vector<std::pair<double, int>> at(graph.points.size(), {0.0, 0});  // sum and number
    for (std::size_t e = 0; e < graph.edges.size(); ++e) {
      if (!(graph.edge_radii_mm[e] > 0)) continue;
      for (const int n : {graph.edges[e].first, graph.edges[e].second}) {
        at[index(n)].first += graph.edge_radii_mm[e];
        ++at[index(n)].second;
      }
    }

    for (std::size_t e = 0; e < graph.edges.size(); ++e) {
      if (graph.edge_radii_mm[e] > 0) continue;
      const auto& a = at[index(graph.edges[e].first)];
      const auto& b = at[index(graph.edges[e].second)];
      if (a.second + b.second == 0) {
        return fail({ErrorKind::kBadInput, "an edge has no radius, nor have its neighbours",
                     std::string(name),
                     fmt::format("{} to {}", graph.points[index(graph.edges[e].first)].name,
                                 graph.points[index(graph.edges[e].second)].name),
                     "radii are positive"});
      }
      graph.edge_radii_mm[e] = (a.first + b.first) / (a.second + b.second);
    }
    if (without_radius_ > 0) {
      builder_.facts.notes.push_back(
          fmt::format("{} edges without a positive radius: given the mean of those they meet",
                      without_radius_));
    }
    return {};
  }

  Result<CenterlineTree> finish(const CenterlineFileOptions& options) {
    builder_.facts.unit_name = "voxels of 1 mm";
    builder_.facts.notes.push_back("edges: straight, each with one radius");
    return builder_.finish(options);
  }

 private:
  GraphBuilder builder_{""};
  int without_radius_ = 0;
};

}  // namespace

Result<CenterlineTree> parse_network_tables(std::string_view vertices,
                                            std::string_view vertices_name, std::string_view edges,
                                            std::string_view edges_name,
                                            const CenterlineFileOptions& options) {
  const auto plain_vertices = plain_text(vertices, vertices_name);
  if (!plain_vertices) return fail(plain_vertices.error());
  const auto plain_edges = plain_text(edges, edges_name);
  if (!plain_edges) return fail(plain_edges.error());

  NetworkReader reader;
  if (auto read = reader.read_vertices({*plain_vertices, vertices_name}); !read)
    return fail(read.error());
  if (auto read = reader.read_edges({*plain_edges, edges_name}); !read) return fail(read.error());
  if (auto done = reader.complete_radii(edges_name); !done) return fail(done.error());
  return reader.finish(options);
}

bool is_vertex_table(std::string_view text) {
  const Table table(text, "");
  return table.column({"posx"}) >= 0 && table.column({"id"}) >= 0 &&
         table.column({"radius", "r", "diameter"}) < 0;
}

bool is_edge_table(std::string_view text) {
  const Table table(text, "");
  return table.column({"node1id"}) >= 0 && table.column({"node2id"}) >= 0;
}

}  // namespace angiospline
