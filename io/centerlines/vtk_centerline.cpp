#include "io/centerlines/vtk_centerline.h"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

#include "io/reading/finish_tree.h"
#include "io/reading/vtk_polylines.h"
#include "io/text/text_file.h"
#include "modeling/tree/merge_lines.h"

namespace angiospline {
namespace {

class LinesToTree {
 public:
  LinesToTree(const VtkPolylines& lines, std::string_view name) : lines_(lines), name_(name) {}

  Result<CenterlineTree> tree(const CenterlineFileOptions& options) {
    if (lines_.offsets.empty() || lines_.points.empty()) {
      return fail({ErrorKind::kBadInput,
                   "holds no lines",
                   std::string(name_),
                   {},
                   "centerlines are polydata with lines"});
    }
    if (auto found = find_radii(); !found) return fail(found.error());
    if (auto good = check_used_points(); !good) return fail(good.error());

    // 3D Slicer says the frame in the header.
    if (lines_.header.find("SPACE=LPS") != std::string::npos) facts_.frame = CoordinateFrame::kLps;
    if (lines_.header.find("SPACE=RAS") != std::string::npos) facts_.frame = CoordinateFrame::kRas;

    // VMTK repeats the way from the inlet in every line: what runs together is one vessel.
    if (shares_points_) return finish_tree(graph(), facts_, name_, options);
    MergedLines merged = merge_lines(separate_lines());
    if (merged.overlapping > 0) {
      facts_.notes.push_back(
          fmt::format("{} lines merged where they run within a quarter of the radius of another",
                      merged.overlapping));
    }
    if (merged.attached > 0) {
      facts_.notes.push_back(
          fmt::format("{} ends joined to the line whose lumen they lie in", merged.attached));
    }
    return finish_tree(std::move(merged.graph), facts_, name_, options);
  }

 private:
  Result<void> find_radii() {
    for (const std::string_view wanted : {"maximuminscribedsphereradius", "radius", "radii"}) {
      for (const auto& [array_name, values] : lines_.scalars) {
        if (lower_case(array_name) != wanted || values.size() * 3 != lines_.points.size()) continue;
        radii_ = &values;
        facts_.notes.push_back(fmt::format("radius: the array {}", quoted_value(array_name)));
        return {};
      }
    }

    std::string known;
    for (const auto& [array_name, values] : lines_.scalars) {
      known += (known.empty() ? "" : ", ") + array_name;
      if (known.size() > 200) break;
    }
    return fail({ErrorKind::kBadInput, "no point array holds the radius", std::string(name_),
                 known.empty() ? "no point arrays" : "the point arrays are " + known,
                 "it is called MaximumInscribedSphereRadius or Radius"});
  }

  Result<void> check_used_points() {
    std::vector<bool> used(lines_.points.size() / 3, false);
    for (const long long i : lines_.indices) {
      const auto p = static_cast<std::size_t>(i);
      if (used[p]) shares_points_ = true;
      used[p] = true;
      const auto where = [&] { return fmt::format("{}: point {}", name_, p); };
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = lines_.points[3 * p + k];
        if (std::isfinite(x) && std::abs(x) <= kLargestFileCoordinate) continue;
        return fail({ErrorKind::kBadInput, "the coordinate is not a finite number", where(),
                     fmt::format("{}", x), fmt::format("at most {:g}", kLargestFileCoordinate)});
      }
      const double r = (*radii_)[p];
      if (r >= kSmallestFileRadius && r <= kLargestFileCoordinate) continue;
      return fail({ErrorKind::kBadInput, "the radius is not positive and finite", where(),
                   fmt::format("{}", r), "radii are positive"});
    }
    return {};
  }

  GraphPoint point(long long i) const {
    const auto p = static_cast<std::size_t>(i);
    return {std::to_string(i),
            Vec3(lines_.points[3 * p], lines_.points[3 * p + 1], lines_.points[3 * p + 2]),
            (*radii_)[p]};
  }

  // Lines that share points: the graph they are.
  PointGraph graph() {
    PointGraph graph;
    const auto count = static_cast<long long>(lines_.points.size() / 3);
    std::vector<int> number(static_cast<std::size_t>(count), -1);
    std::size_t i = 0;
    for (const long long end : lines_.offsets) {
      int before = -1;
      for (; i < static_cast<std::size_t>(end); ++i) {
        int& here = number[static_cast<std::size_t>(lines_.indices[i])];
        if (here < 0) {
          here = static_cast<int>(graph.points.size());
          graph.points.push_back(point(lines_.indices[i]));
        }
        if (before >= 0 && before != here) graph.edges.emplace_back(before, here);
        before = here;
      }
    }

    // As VMTK writes them, the first line begins at the inlet.
    graph.roots.push_back(0);
    facts_.notes.push_back("lines: joined at the points they share");
    return graph;
  }

  std::vector<CenterlineLine> separate_lines() const {
    std::vector<CenterlineLine> separate;
    std::size_t i = 0;
    for (const long long end : lines_.offsets) {
      const std::size_t first = i;
      i = static_cast<std::size_t>(end);
      if (i < first + 2) continue;
      const auto count = static_cast<Eigen::Index>(i - first);
      CenterlineLine line{fmt::format("line{}", separate.size() + 1), Points3(3, count),
                          Eigen::VectorXd(count)};
      for (Eigen::Index k = 0; k < count; ++k) {
        const GraphPoint p = point(lines_.indices[first + static_cast<std::size_t>(k)]);
        line.points_mm.col(k) = p.position_mm;
        line.radii_mm(k) = p.radius_mm;
      }
      separate.push_back(std::move(line));
    }
    return separate;
  }

  const VtkPolylines& lines_;
  std::string_view name_;
  const std::vector<double>* radii_ = nullptr;
  bool shares_points_ = false;
  FileFacts facts_;
};

Result<CenterlineTree> tree_of(const Result<VtkPolylines>& lines, std::string_view name,
                               const CenterlineFileOptions& options) {
  if (!lines) return fail(lines.error());
  return LinesToTree(*lines, name).tree(options);
}

}  // namespace

Result<CenterlineTree> parse_vtp_centerline(std::string_view bytes, std::string_view name,
                                            const CenterlineFileOptions& options) {
  return tree_of(parse_vtp(bytes, name), name, options);
}

Result<CenterlineTree> parse_vtk_centerline(std::string_view bytes, std::string_view name,
                                            const CenterlineFileOptions& options) {
  return tree_of(parse_legacy_vtk(bytes, name), name, options);
}

}  // namespace angiospline
