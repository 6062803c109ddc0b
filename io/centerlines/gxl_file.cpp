#include "io/centerlines/gxl_file.h"

#include <string>
#include <vector>

#include <fmt/format.h>

#include "io/centerlines/rules.h"
#include "io/reading/graph_builder.h"
#include "io/text/text_file.h"
#include "io/text/xml_reader.h"

namespace angiospline {
namespace {

// VascuSynth writes blanks into its attributes: name=" position".
std::string_view attribute(const XmlReader& xml, std::string_view name) {
  return trimmed(xml.attribute(name).value_or(std::string_view()));
}

class GxlReader {
 public:
  GxlReader(std::string_view text, std::string_view name, const CenterlineFileOptions& options)
      : xml_(text, name), name_(name), options_(options), builder_(name) {}

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
      return builder_.bad_file("holds no edge",
                               "a GXL tree has nodes with positions and edges with radii");
    }

    // Edges may stand before the nodes they join.
    for (const Edge& e : edges_) {
      auto joined = builder_.add_edge(e.from, e.to, e.line, "edges join nodes of this file");
      if (!joined) return fail(joined.error());
      builder_.graph.edge_radii_mm.push_back(e.radius);
    }

    // Positions count voxels, radii do not (Hamarneh and Jassi 2010, VascuSynth).
    const double width = options_.voxel_width.value_or(kVascuSynthVoxelWidth);
    for (GraphPoint& p : builder_.graph.points) p.position_mm *= width;
    builder_.facts.notes.push_back(fmt::format(
        "voxel width: {:g}{}", width,
        options_.voxel_width
            ? ", as given"
            : ", VascuSynth's default (the file does not say; --voxel-width overrides)"));
    builder_.facts.notes.push_back("edges: straight, each with one radius");
    return builder_.finish(options_);
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
        const Result<double> x = number_of_element(parse_coordinate);
        if (!x) return fail(x.error());
        position.push_back(*x);
      }
    }
    if (position.size() != 3) {
      return builder_.bad("the node's position is not complete", line,
                          fmt::format("{} numbers", position.size()),
                          "a position is three numbers");
    }

    // The radius is the edges' and not used; it only must be one.
    const Vec3 place(position[0], position[1], position[2]);
    const int point = builder_.add_point({id, place, 1.0}, line);
    if (is_root) builder_.graph.roots.push_back(point);
    return builder_.register_id(point, "the node is defined twice");
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
        const Result<double> r = number_of_element(parse_radius);
        if (!r) return fail(r.error());
        found.radius = *r;
      }
    }
    if (!(found.radius > 0)) {
      return builder_.bad("the edge has no radius", found.line,
                          fmt::format("{} to {}", quoted_value(found.from), quoted_value(found.to)),
                          "every edge has an attribute radius");
    }
    edges_.push_back(std::move(found));
    return {};
  }

  // The number that is the text of the element whose start was the last event.
  Result<double> number_of_element(Result<double> (*parse)(std::string_view, std::string_view,
                                                           int)) {
    const int line = xml_.line();
    const Result<std::string> text = xml_.text_of_element();
    if (!text) return fail(text.error());
    return parse(trimmed_lines(*text), name_, line);
  }

  XmlReader xml_;
  std::string_view name_;
  const CenterlineFileOptions& options_;
  std::vector<Edge> edges_;
  GraphBuilder builder_;
};

}  // namespace

Result<CenterlineTree> parse_gxl(std::string_view text, std::string_view name,
                                 const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return GxlReader(*plain, name, options).read();
}

}  // namespace angiospline
