#include "io/centerlines/gxl_file.h"

#include <map>
#include <vector>

#include <fmt/format.h>

#include "io/text/text_file.h"
#include "io/text/xml_reader.h"

namespace angiospline {
namespace {

constexpr double kVascuSynthVoxelWidth = 0.04;

// VascuSynth writes blanks into its attributes: name=" position".
std::string_view attribute(const XmlReader& xml, std::string_view name) {
  return trimmed(xml.attribute(name).value_or(std::string_view()));
}

class GxlReader {
 public:
  GxlReader(std::string_view text, std::string_view name, const CenterlineFileOptions& options)
      : xml_(text, name), name_(name), options_(options) {}

  Result<CenterlineTree> read() {
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) break;
      Result<void> taken;
      if (*event == XmlReader::Event::kStart && xml_.tag() == "node") taken = node();
      if (*event == XmlReader::Event::kStart && xml_.tag() == "edge") taken = edge();
      if (!taken) return fail(taken.error());
    }
    if (edges_.empty()) {
      return fail({ErrorKind::kBadInput,
                   "holds no edge",
                   std::string(name_),
                   {},
                   "a GXL tree has nodes with positions and edges with radii"});
    }
    if (auto linked = link(); !linked) return fail(linked.error());
    const double width = options_.voxel_width.value_or(kVascuSynthVoxelWidth);
    for (GraphPoint& p : graph_.points) p.position_mm *= width;
    facts_.notes.push_back(fmt::format(
        "voxel width: {:g}{}", width,
        options_.voxel_width
            ? ", as given"
            : ", VascuSynth's default (the file does not say; --voxel-width overrides)"));
    facts_.notes.push_back("edges: straight, each with one radius");
    return finish_tree(std::move(graph_), facts_, name_, options_);
  }

 private:
  struct Edge {
    std::string from;
    std::string to;
    double radius;
    int line;
  };

  Result<void> node() {
    const std::string id(attribute(xml_, "id"));
    const int line = xml_.line();
    std::string attr;
    std::vector<double> position;
    bool is_root = false;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kEnd && xml_.tag() == "node") break;
      if (*event != XmlReader::Event::kStart) continue;
      if (xml_.tag() == "attr") attr = attribute(xml_, "name");
      if (xml_.tag() == "string" && attr == "nodeType") {
        const Result<std::string> type = xml_.text_of_element();
        if (!type) return fail(type.error());
        is_root = type->find("root") != std::string::npos;
      }
      if (xml_.tag() == "float" && attr == "position") {
        const int here = xml_.line();
        const Result<std::string> number = xml_.text_of_element();
        if (!number) return fail(number.error());
        const Result<double> x = parse_coordinate(trimmed_lines(*number), name_, here);
        if (!x) return fail(x.error());
        position.push_back(*x);
      }
    }
    if (position.size() != 3) {
      return fail({ErrorKind::kBadInput, "the node's position is not complete",
                   at_line(name_, line), fmt::format("{} numbers", position.size()),
                   "a position is three numbers"});
    }
    const int number = static_cast<int>(graph_.points.size());
    if (!node_of_.emplace(id, number).second) {
      return fail({ErrorKind::kBadInput, "the node is defined twice", at_line(name_, line),
                   quoted_value(id), "ids are unique"});
    }
    if (is_root) graph_.roots.push_back(number);
    // The radius is the edges' and not used; it only must be one.
    graph_.points.push_back({id, Vec3(position[0], position[1], position[2]), 1.0});
    return {};
  }

  Result<void> edge() {
    Edge found{std::string(attribute(xml_, "from")), std::string(attribute(xml_, "to")), 0.0,
               xml_.line()};
    std::string attr;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kEnd && xml_.tag() == "edge") break;
      if (*event != XmlReader::Event::kStart) continue;
      if (xml_.tag() == "attr") attr = attribute(xml_, "name");
      if (xml_.tag() == "float" && attr == "radius") {
        const int here = xml_.line();
        const Result<std::string> number = xml_.text_of_element();
        if (!number) return fail(number.error());
        const Result<double> r = parse_radius(trimmed_lines(*number), name_, here);
        if (!r) return fail(r.error());
        found.radius = *r;
      }
    }
    if (!(found.radius > 0)) {
      return fail({ErrorKind::kBadInput, "the edge has no radius", at_line(name_, found.line),
                   fmt::format("{} to {}", quoted_value(found.from), quoted_value(found.to)),
                   "every edge has an attribute radius"});
    }
    edges_.push_back(std::move(found));
    return {};
  }

  Result<void> link() {
    for (const Edge& e : edges_) {
      const auto from = node_of_.find(e.from);
      const auto to = node_of_.find(e.to);
      if (from == node_of_.end() || to == node_of_.end()) {
        return fail({ErrorKind::kBadInput, "the edge's node does not exist", at_line(name_, e.line),
                     quoted_value(from == node_of_.end() ? e.from : e.to),
                     "edges join nodes of this file"});
      }
      graph_.edges.emplace_back(from->second, to->second);
      graph_.edge_radii_mm.push_back(e.radius);
    }
    return {};
  }

  XmlReader xml_;
  std::string_view name_;
  const CenterlineFileOptions& options_;
  std::map<std::string, int> node_of_;
  std::vector<Edge> edges_;
  PointGraph graph_;
  FileFacts facts_;
};

}  // namespace

Result<CenterlineTree> parse_gxl(std::string_view text, std::string_view name,
                                 const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return GxlReader(*plain, name, options).read();
}

}  // namespace angiospline
