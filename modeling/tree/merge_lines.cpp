#include "modeling/tree/merge_lines.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>
#include <nanoflann.hpp>

#include "base/contract.h"
#include "base/index.h"
#include "modeling/tree/rules.h"

#if defined(__GNUC__) && !defined(__clang__)
// g++ follows nanoflann's empty trees into their bounding boxes, which are not used then.
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace angiospline {
namespace {

// The points of a graph as nanoflann reads them.
struct GraphPoints {
  const std::vector<GraphPoint>& points;

  // The names are nanoflann's.
  // NOLINTBEGIN(readability-identifier-naming)
  std::size_t kdtree_get_point_count() const { return points.size(); }
  double kdtree_get_pt(std::size_t i, std::size_t axis) const {
    return points[i].position_mm(static_cast<Eigen::Index>(axis));
  }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
  // NOLINTEND(readability-identifier-naming)
};

using Tree =
    nanoflann::KDTreeSingleIndexDynamicAdaptor<nanoflann::L2_Simple_Adaptor<double, GraphPoints>,
                                               GraphPoints, 3, std::size_t>;

// The nearest place of the graph: its distance, and the nearest point with the radius there.
struct Nearest {
  int point = -1;
  double distance = std::numeric_limits<double>::infinity();
  double radius = 0.0;
};

// nanoflann's result set for the nearest points that do not belong to a line (-1: of all points).
class NearestOfOthers {
 public:
  // The names are nanoflann's.
  // NOLINTBEGIN(readability-identifier-naming)
  using DistanceType = double;
  using IndexType = std::size_t;
  // NOLINTEND(readability-identifier-naming)
  NearestOfOthers(const std::vector<int>& line_of, int not_line)
      : line_of_(line_of), not_line_(not_line) {
    squared_.fill(std::numeric_limits<double>::infinity());
  }
  std::size_t size() const { return size_; }
  bool full() const { return size_ == CleaningRules::kNeighbours; }
  double worstDist() const { return squared_.back(); }  // NOLINT(readability-identifier-naming)
  bool addPoint(double squared, std::size_t point) {    // NOLINT(readability-identifier-naming)
    if (not_line_ >= 0 && line_of_[point] == not_line_) return true;
    if (squared >= squared_.back()) return true;
    std::size_t k = std::min(size_, CleaningRules::kNeighbours - 1);
    for (; k > 0 && squared_[k - 1] > squared; --k) {
      squared_[k] = squared_[k - 1];
      points_[k] = points_[k - 1];
    }
    squared_[k] = squared;
    points_[k] = static_cast<int>(point);
    size_ = std::min(size_ + 1, CleaningRules::kNeighbours);
    return true;
  }
  int point(std::size_t k) const { return points_[k]; }

 private:
  const std::vector<int>& line_of_;
  int not_line_;
  std::size_t size_ = 0;
  std::array<double, CleaningRules::kNeighbours> squared_{};
  std::array<int, CleaningRules::kNeighbours> points_{};
};

double distance_to_segment(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 d = b - a;
  const double squared = d.squaredNorm();
  const double t = squared > 0 ? std::clamp((p - a).dot(d) / squared, 0.0, 1.0) : 0.0;
  return (p - a - t * d).norm();
}

// A line with points no farther apart than a radius.
CenterlineLine densified(const CenterlineLine& line) {
  std::vector<Vec3> points;
  std::vector<double> radii;
  for (Eigen::Index i = 0; i < line.points_mm.cols(); ++i) {
    if (i > 0) {
      const Vec3 a = line.points_mm.col(i - 1);
      const Vec3 b = line.points_mm.col(i);
      const double r = std::min(line.radii_mm(i - 1), line.radii_mm(i));
      const int parts = static_cast<int>(std::clamp(
          std::ceil((b - a).norm() / r), 1.0, static_cast<double>(CleaningRules::kMostBetween)));
      for (int k = 1; k < parts; ++k) {
        const double t = static_cast<double>(k) / parts;
        points.emplace_back((1 - t) * a + t * b);
        radii.push_back((1 - t) * line.radii_mm(i - 1) + t * line.radii_mm(i));
      }
    }
    points.emplace_back(line.points_mm.col(i));
    radii.push_back(line.radii_mm(i));
  }

  CenterlineLine dense{
      line.name, Points3(3, static_cast<Eigen::Index>(points.size())),
      Eigen::Map<Eigen::VectorXd>(radii.data(), static_cast<Eigen::Index>(radii.size()))};
  for (std::size_t i = 0; i < points.size(); ++i) {
    dense.points_mm.col(static_cast<Eigen::Index>(i)) = points[i];
  }
  return dense;
}

class LineMerger {
 public:
  explicit LineMerger(const MergeOptions& options)
      : options_(options), adaptor_{merged_.graph.points}, tree_(3, adaptor_) {}

  MergedLines merge(const std::vector<CenterlineLine>& lines) {
    for (const CenterlineLine& line : lines) add(densified(line));
    if (options_.attach_ends) attach_ends();
    if (!merged_.graph.points.empty()) merged_.graph.roots.push_back(0);
    return std::move(merged_);
  }

 private:
  Nearest nearest(const Vec3& p, int not_line = -1) const {
    Nearest best;
    if (merged_.graph.points.empty()) return best;
    NearestOfOthers found(line_of_, not_line);
    tree_.findNeighbors(found, p.data(), nanoflann::SearchParams());

    // The nearest place lies on an edge of one of the nearest points, as these are a radius apart
    // at most.
    for (std::size_t k = 0; k < found.size(); ++k) {
      const GraphPoint& point = merged_.graph.points[index(found.point(k))];
      best.distance = std::min(best.distance, (p - point.position_mm).norm());
      for (const int other : neighbours_[index(found.point(k))]) {
        const Vec3& end = merged_.graph.points[index(other)].position_mm;
        best.distance = std::min(best.distance, distance_to_segment(p, point.position_mm, end));
      }
    }
    if (found.size() > 0) {
      best.point = found.point(0);
      best.radius = merged_.graph.points[index(best.point)].radius_mm;
    }
    return best;
  }

  void connect(int a, int b) {
    if (a == b) return;
    merged_.graph.edges.emplace_back(a, b);
    merged_.graph.line_of_edge.push_back(static_cast<int>(merged_.graph.line_names.size()) - 1);
    neighbours_[index(a)].push_back(b);
    neighbours_[index(b)].push_back(a);
  }

  // Of a line, what departs from those before it.
  void add(const CenterlineLine& line) {
    const Eigen::Index count = line.points_mm.cols();
    std::vector<Nearest> places(index(static_cast<int>(count)));
    std::vector<bool> shared(places.size());
    bool any_shared = false;
    for (Eigen::Index i = 0; i < count; ++i) {
      Nearest& place = places[static_cast<std::size_t>(i)];
      place = nearest(line.points_mm.col(i));
      const double radius = std::min(line.radii_mm(i), place.radius);
      const bool is_shared = place.point >= 0 && place.distance <= options_.overlap * radius;
      shared[static_cast<std::size_t>(i)] = is_shared;
      any_shared = any_shared || is_shared;
    }
    if (any_shared) tidy(line, places, shared);

    merged_.graph.line_names.push_back(line.name);
    merged_.overlapping += std::count(shared.begin(), shared.end(), true) > 0;
    const std::size_t first = merged_.graph.points.size();
    append(line, places, shared);

    const std::size_t last = merged_.graph.points.size();
    if (last == first) {
      ++merged_.dropped;
    } else {
      tree_.addPoints(first, last - 1);
    }
  }

  // New points for those that are not shared, and an edge to each from the one before, unless both
  // lie on what is there.
  void append(const CenterlineLine& line, const std::vector<Nearest>& places,
              const std::vector<bool>& shared) {
    int before = -1;
    for (std::size_t i = 0; i < places.size(); ++i) {
      int here = places[i].point;
      const bool was_shared = i > 0 && shared[i - 1];
      if (!shared[i]) {
        const auto k = static_cast<Eigen::Index>(i);
        here = static_cast<int>(merged_.graph.points.size());
        merged_.graph.points.push_back(
            {fmt::format("{}_{}", line.name, i + 1), line.points_mm.col(k), line.radii_mm(k)});
        neighbours_.emplace_back();
        line_of_.push_back(static_cast<int>(merged_.graph.line_names.size()) - 1);
      }

      if (before >= 0 && !(shared[i] && was_shared)) connect(before, here);
      before = here;
    }
  }

  // Takes back departures that stay close and encounters in passing.
  void tidy(const CenterlineLine& line, const std::vector<Nearest>& places,
            std::vector<bool>& shared) const {
    const std::size_t count = shared.size();
    const auto for_each_run = [&](bool kind, const auto& act) {
      for (std::size_t i = 0; i < count;) {
        std::size_t end = i;
        while (end < count && shared[end] == shared[i]) ++end;
        if (shared[i] == kind) act(i, end);
        i = end;
      }
    };

    // A departure that comes back without ever going far is none.
    for_each_run(false, [&](std::size_t i, std::size_t end) {
      if (i == 0 || end == count) return;
      for (std::size_t k = i; k < end; ++k) {
        const double r = std::min(line.radii_mm(static_cast<Eigen::Index>(k)), places[k].radius);
        if (places[k].distance > 2 * options_.overlap * r) return;
      }
      std::fill(shared.begin() + static_cast<std::ptrdiff_t>(i),
                shared.begin() + static_cast<std::ptrdiff_t>(end), true);
    });

    // Nor is a touch shorter than a radius a junction.
    for_each_run(true, [&](std::size_t i, std::size_t end) {
      if (i == 0 || end == count) return;
      const Vec3 a = line.points_mm.col(static_cast<Eigen::Index>(i));
      const Vec3 b = line.points_mm.col(static_cast<Eigen::Index>(end - 1));
      if ((b - a).norm() >= line.radii_mm(static_cast<Eigen::Index>(i))) return;
      std::fill(shared.begin() + static_cast<std::ptrdiff_t>(i),
                shared.begin() + static_cast<std::ptrdiff_t>(end), false);
    });
  }

  void attach_ends() {
    const int count = static_cast<int>(merged_.graph.points.size());
    for (int p = 0; p < count; ++p) {
      if (neighbours_[index(p)].size() != 1) continue;
      const Nearest place = nearest(merged_.graph.points[index(p)].position_mm, line_of_[index(p)]);
      if (place.point < 0 || place.distance >= place.radius) continue;
      // The edge belongs to the line that ends here.
      merged_.graph.edges.emplace_back(place.point, p);
      merged_.graph.line_of_edge.push_back(line_of_[index(p)]);
      neighbours_[index(p)].push_back(place.point);
      neighbours_[index(place.point)].push_back(p);
      ++merged_.attached;
    }
  }

  MergeOptions options_;
  MergedLines merged_;
  std::vector<std::vector<int>> neighbours_;
  std::vector<int> line_of_;
  GraphPoints adaptor_;
  Tree tree_;
};

}  // namespace

MergedLines merge_lines(const std::vector<CenterlineLine>& lines, const MergeOptions& options) {
  for (const CenterlineLine& line : lines) {
    EXPECTS(line.points_mm.cols() >= 2 && line.points_mm.cols() == line.radii_mm.size());
    EXPECTS(line.points_mm.allFinite() && line.radii_mm.minCoeff() > 0);
  }
  return LineMerger(options).merge(lines);
}

}  // namespace angiospline
