#include "io/centerlines/simvascular_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "io/centerlines/rules.h"
#include "io/reading/finish_tree.h"
#include "io/text/text_file.h"
#include "io/text/xml_reader.h"
#include "modeling/tree/merge_lines.h"

namespace angiospline {
namespace {

class SimVascularReader {
 public:
  SimVascularReader(std::string_view text, std::string_view name) : xml_(text, name), name_(name) {}

  Result<SimVascularGroup> group() {
    SimVascularGroup group;
    bool found = false;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) break;
      if (*event != XmlReader::Event::kStart) continue;
      if (xml_.tag() == "contourgroup") {
        found = true;
        group.name = xml_.attribute("path_name").value_or("");
      }
      if (xml_.tag() == "timestep" && timesteps_++ > 0) break;  // the first is the model
      if (xml_.tag() == "contour") {
        auto one = contour();
        if (!one) return fail(one.error());
        group.contours.push_back(*one);
      }
    }

    if (!found) {
      return fail({ErrorKind::kBadInput,
                   "is not a SimVascular contour group",
                   std::string(name_),
                   {},
                   "it has an element contourgroup"});
    }
    if (group.contours.size() < 2) {
      return fail({ErrorKind::kBadInput, "holds too few contours", std::string(name_),
                   std::to_string(group.contours.size()), "a vessel has at least two"});
    }
    std::stable_sort(group.contours.begin(), group.contours.end(),
                     [](const auto& a, const auto& b) { return a.path_point < b.path_point; });
    return group;
  }

  Result<std::vector<Vec3>> path() {
    std::vector<Vec3> points;
    bool inside = false;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      if (*event == XmlReader::Event::kDone) break;
      const bool starts = *event == XmlReader::Event::kStart;
      if (starts && xml_.tag() == "timestep" && timesteps_++ > 0) break;
      if (xml_.tag() == "path_points") inside = starts;
      if (!starts || !inside || xml_.tag() != "pos") continue;
      const Result<Vec3> p = position();
      if (!p) return fail(p.error());
      points.push_back(*p);
    }

    if (points.size() < 2) {
      return fail({ErrorKind::kBadInput, "is not a SimVascular path", std::string(name_),
                   fmt::format("{} path points", points.size()), "a path has at least two"});
    }
    return points;
  }

 private:
  Result<Vec3> position() {
    Vec3 p;
    const char* const names[3] = {"x", "y", "z"};
    for (Eigen::Index k = 0; k < 3; ++k) {
      const auto value = xml_.attribute(names[k]);
      if (!value) return xml_.bad("a point lacks a coordinate", xml_.tag(), "x, y and z");
      const Result<double> x = parse_coordinate(trimmed(*value), name_, xml_.line());
      if (!x) return fail(x.error());
      p(k) = *x;
    }
    return p;
  }

  Result<SimVascularContour> contour() {
    const int line = xml_.line();
    SimVascularContour found;
    std::vector<Vec3> ring;
    bool in_ring = false;
    while (true) {
      const auto event = xml_.next();
      if (!event) return fail(event.error());
      const bool starts = *event == XmlReader::Event::kStart;
      if (*event == XmlReader::Event::kEnd && xml_.tag() == "contour") break;
      if (*event == XmlReader::Event::kText) continue;
      if (xml_.tag() == "contour_points") in_ring = starts;
      if (!starts) continue;
      if (xml_.tag() == "path_point") {
        const auto id = parse_whole_number(xml_.attribute("id").value_or(""));
        found.path_point = id && *id >= 0 && *id < 1'000'000'000 ? static_cast<int>(*id) : -1;
      }
      if (xml_.tag() == "pos" || (in_ring && xml_.tag() == "point")) {
        const Result<Vec3> p = position();
        if (!p) return fail(p.error());
        if (xml_.tag() == "pos") found.on_path = *p;
        if (xml_.tag() == "point") ring.push_back(*p);
      }
    }

    if (ring.size() < 3) {
      return fail({ErrorKind::kBadInput, "the contour has too few points", at_line(name_, line),
                   std::to_string(ring.size()), "a cross-section has at least three"});
    }
    measure(ring, found);
    if (!(found.radius >= kSmallestFileRadius)) {
      return fail({ErrorKind::kBadInput,
                   "the contour has no area",
                   at_line(name_, line),
                   {},
                   "its points go round the vessel"});
    }
    return found;
  }

  // Area and centroid of a nearly plane polygon, by the fan of triangles from its first point.
  static void measure(const std::vector<Vec3>& ring, SimVascularContour& found) {
    // The sum of the triangles' normals is twice the polygon's area, whatever its shape (Newell).
    Vec3 normal = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
      normal += (ring[i] - ring[0]).cross(ring[i + 1] - ring[0]);
    }
    const double twice_area = normal.norm();
    if (!(twice_area > 0)) return;

    // The centroid is the triangles' weighted by their areas, with signs: the ring may be concave.
    Vec3 sum = Vec3::Zero();
    for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
      const double part = (ring[i] - ring[0]).cross(ring[i + 1] - ring[0]).dot(normal) / twice_area;
      sum += part * ((ring[i] - ring[0]) + (ring[i + 1] - ring[0])) / 3.0;
    }
    found.center = ring[0] + sum / twice_area;

    // The circle of the same area.
    found.radius = std::sqrt(0.5 * twice_area / std::numbers::pi);
  }

  XmlReader xml_;
  std::string_view name_;
  int timesteps_ = 0;
};

CenterlineLine line_of(const std::vector<Vec3>& points, const std::vector<double>& radii,
                       const std::string& name) {
  CenterlineLine line{name, Points3(3, static_cast<Eigen::Index>(points.size())),
                      Eigen::VectorXd(static_cast<Eigen::Index>(points.size()))};
  for (std::size_t i = 0; i < points.size(); ++i) {
    line.points_mm.col(static_cast<Eigen::Index>(i)) = points[i];
    line.radii_mm(static_cast<Eigen::Index>(i)) = radii[i];
  }
  return line;
}

CenterlineLine line_of_contours(const SimVascularGroup& group) {
  std::vector<Vec3> points;
  std::vector<double> radii;
  for (const SimVascularContour& c : group.contours) {
    points.push_back(c.center);
    radii.push_back(c.radius);
  }
  return line_of(points, radii, group.name);
}

// The path from the first contour to the last; radii, and the contours' offsets from the path, vary
// linearly with the index between contours.
CenterlineLine line_of_path(const SimVascularGroup& group, const std::vector<Vec3>& path) {
  std::vector<Vec3> points;
  std::vector<double> radii;
  for (std::size_t c = 0; c + 1 < group.contours.size(); ++c) {
    const SimVascularContour& a = group.contours[c];
    const SimVascularContour& b = group.contours[c + 1];
    const int steps = std::max(1, b.path_point - a.path_point);
    for (int k = points.empty() ? 0 : 1; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      const Vec3& on_path =
          path[static_cast<std::size_t>(std::min(a.path_point + k, b.path_point))];
      points.emplace_back(on_path + (1 - t) * (a.center - a.on_path) + t * (b.center - b.on_path));
      radii.push_back((1 - t) * a.radius + t * b.radius);
    }
  }
  return line_of(points, radii, group.name);
}

// The files of each vessel; a centerline may be missing.
struct VesselFiles {
  std::filesystem::path contours;
  std::filesystem::path centerline;
};

// By the stems of their names, so that the order of the list does not matter. Error: a path without
// contours, which alone say how wide the vessel is.
Result<std::map<std::string, VesselFiles>> pair_files(
    const std::vector<std::filesystem::path>& paths) {
  std::map<std::string, VesselFiles> vessels;
  for (const std::filesystem::path& path : paths) {
    std::filesystem::path stem = path;
    stem.replace_extension();
    const bool is_path = lower_case(path.extension().string()) == ".pth";
    VesselFiles& vessel = vessels[stem.string()];
    (is_path ? vessel.centerline : vessel.contours) = path;
  }

  for (auto& [stem, vessel] : vessels) {
    if (!vessel.contours.empty()) continue;
    std::filesystem::path beside = vessel.centerline;
    beside.replace_extension(".ctgr");
    if (std::filesystem::exists(beside)) {
      vessel.contours = beside;
      continue;
    }
    return fail({ErrorKind::kBadInput,
                 "a path has no radii",
                 vessel.centerline.string(),
                 {},
                 "give the contour group of the same name (.ctgr), too"});
  }
  return vessels;
}

Result<CenterlineLine> read_vessel(const VesselFiles& files) {
  const Result<std::string> text = read_text_file(files.contours);
  if (!text) return fail(text.error());
  Result<SimVascularGroup> group = parse_ctgr(*text, files.contours.string());
  if (!group) return fail(group.error());
  if (group->name.empty()) group->name = files.contours.stem().string();
  if (files.centerline.empty()) return line_of_contours(*group);

  const Result<std::string> path_text = read_text_file(files.centerline);
  if (!path_text) return fail(path_text.error());
  const Result<std::vector<Vec3>> points = parse_pth(*path_text, files.centerline.string());
  if (!points) return fail(points.error());
  const int last = group->contours.back().path_point;
  if (group->contours.front().path_point < 0 || last >= static_cast<int>(points->size())) {
    return fail({ErrorKind::kBadInput, "a contour is not on the path", files.contours.string(),
                 std::to_string(last), fmt::format("the path has {} points", points->size())});
  }
  return line_of_path(*group, *points);
}

FileFacts facts_of(const MergedLines& merged, std::size_t vessels, bool with_paths) {
  FileFacts facts;
  facts.unit_mm = kSimVascularUnitMm;
  facts.unit_name = "cm, SimVascular's habit";
  facts.notes.push_back(fmt::format(
      "{} vessels: radii are those of circles of the contours' areas, points {}", vessels,
      with_paths ? "the paths' between the contours, moved to their centroids"
                 : "their centroids"));
  facts.notes.push_back(
      fmt::format("{} ends joined to the vessel whose lumen they lie in", merged.attached));
  if (merged.overlapping > 0) {
    facts.notes.push_back(fmt::format("{} vessels merged where they overlap", merged.overlapping));
  }
  return facts;
}

}  // namespace

Result<SimVascularGroup> parse_ctgr(std::string_view text, std::string_view name) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return SimVascularReader(*plain, name).group();
}

Result<std::vector<Vec3>> parse_pth(std::string_view text, std::string_view name) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return SimVascularReader(*plain, name).path();
}

Result<CenterlineTree> read_simvascular(const std::vector<std::filesystem::path>& paths,
                                        const CenterlineFileOptions& options) {
  const auto vessels = pair_files(paths);
  if (!vessels) return fail(vessels.error());

  std::vector<CenterlineLine> lines;
  bool with_paths = false;
  for (const auto& [stem, files] : *vessels) {
    Result<CenterlineLine> line = read_vessel(files);
    if (!line) return fail(line.error());
    lines.push_back(*std::move(line));
    with_paths = with_paths || !files.centerline.empty();
  }

  // The widest vessel first: the others are joined to it.
  std::stable_sort(lines.begin(), lines.end(), [](const auto& a, const auto& b) {
    return a.radii_mm.mean() > b.radii_mm.mean();
  });
  MergedLines merged = merge_lines(lines);
  const FileFacts facts = facts_of(merged, lines.size(), with_paths);

  std::string names;
  for (const std::filesystem::path& path : paths) {
    names += (names.empty() ? "" : ", ") + path.filename().string();
  }
  return finish_tree(std::move(merged.graph), facts, names, options);
}

}  // namespace angiospline
