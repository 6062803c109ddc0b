#include "io/centerlines/tree_definition.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <vector>

#include <fmt/format.h>

#include "base/index.h"
#include "io/centerlines/rules.h"
#include "io/reading/finish_tree.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

struct PathPoint {
  Vec3 position;
  std::optional<double> radius;
};

struct DefinedBranch {
  std::string name;
  int from;
  int to;
  int line;
  double first_radius;
  double last_radius;
  std::vector<PathPoint> points;  // between the nodes
};

// Barry and Goldman's pyramid (1988) for the Catmull-Rom segment from p[1] to p[2], with
// centripetal knots (Yuksel, Schaefer and Keyser 2011): it has no cusp and no loop.
Vec3 catmull_rom(const std::array<Vec3, 4>& p, double u) {
  std::array<double, 4> t{};
  for (std::size_t i = 1; i < 4; ++i) t[i] = t[i - 1] + std::sqrt((p[i] - p[i - 1]).norm());
  const double x = t[1] + u * (t[2] - t[1]);
  const auto mix = [x](const Vec3& a, const Vec3& b, double ta, double tb) -> Vec3 {
    return (tb - x) / (tb - ta) * a + (x - ta) / (tb - ta) * b;
  };
  const Vec3 a1 = mix(p[0], p[1], t[0], t[1]);
  const Vec3 a2 = mix(p[1], p[2], t[1], t[2]);
  const Vec3 a3 = mix(p[2], p[3], t[2], t[3]);
  return mix(mix(a1, a2, t[0], t[2]), mix(a2, a3, t[1], t[3]), t[1], t[2]);
}

class DefinitionReader {
 public:
  DefinitionReader(std::string_view text, std::string_view name) : lines_(text), name_(name) {}

  Result<CenterlineTree> read(const CenterlineFileOptions& options) {
    while (const auto line = lines_.next()) {
      split_fields(line->substr(0, line->find('#')), ' ', words_);
      if (words_.empty()) continue;
      if (auto taken = statement(); !taken) return fail(taken.error());
    }
    if (branches_.empty()) {
      return fail({ErrorKind::kBadInput,
                   "defines no branch",
                   std::string(name_),
                   {},
                   "branch NAME FROM TO RADIUS"});
    }

    for (int b = 0; b < static_cast<int>(branches_.size()); ++b) {
      if (auto sampled = sample(b); !sampled) return fail(sampled.error());
    }
    for (const int n : inlets_) {
      const auto point = point_of_node_.find(n);
      if (point != point_of_node_.end()) graph_.roots.push_back(point->second);
    }
    return finish_tree(std::move(graph_), facts_, name_, options);
  }

 private:
  tl::unexpected<Error> bad(std::string what, std::string_view value, std::string rule) const {
    return fail({ErrorKind::kBadInput, std::move(what), at_line(name_, lines_.line()),
                 fmt::format("'{}'", quoted_value(value)), std::move(rule)});
  }

  Result<void> need(std::size_t fewest, std::size_t most, const char* form) const {
    if (words_.size() >= fewest && words_.size() <= most) return {};
    return fail({ErrorKind::kBadInput, "the statement is not complete or too long",
                 at_line(name_, lines_.line()), fmt::format("{} words", words_.size()), form});
  }

  Result<void> statement() {
    const std::string keyword = lower_case(words_[0]);
    if (keyword == "unit") return unit();
    if (keyword == "node") return node();
    if (keyword == "branch") return branch();
    if (keyword == "point") return point();
    if (keyword == "inlet") return inlet();
    return bad("not a known statement", words_[0], "unit, node, branch, point or inlet");
  }

  Result<void> unit() {
    if (auto enough = need(2, 2, "unit UNIT"); !enough) return enough;
    if (!nodes_.empty()) return bad("the unit comes too late", words_[1], "before the first node");
    const Result<double> mm = parse_unit_mm(words_[1]);
    if (!mm) return bad(mm.error().what, words_[1], mm.error().rule);
    facts_.state_unit(*mm, words_[1]);
    return {};
  }

  Result<Vec3> position(std::size_t first) const {
    return parse_position([&](int k) { return words_[first + index(k)]; }, name_, lines_.line());
  }

  Result<void> node() {
    if (auto enough = need(5, 5, "node NAME X Y Z"); !enough) return enough;
    const Result<Vec3> p = position(2);
    if (!p) return fail(p.error());
    const int number = static_cast<int>(nodes_.size());
    if (!node_of_.emplace(words_[1], number).second) {
      return bad("the node is defined twice", words_[1], "names of nodes are unique");
    }
    nodes_.push_back(*p);
    node_names_.emplace_back(words_[1]);
    return {};
  }

  Result<int> known_node(std::string_view word) const {
    const auto found = node_of_.find(word);
    if (found == node_of_.end()) {
      return bad("the node is not defined", word, "nodes are defined before they are used");
    }
    return found->second;
  }

  Result<void> branch() {
    if (auto enough = need(5, 6, "branch NAME FROM TO RADIUS [RADIUS]"); !enough) return enough;
    if (!branch_names_.emplace(words_[1]).second) {
      return bad("the branch is defined twice", words_[1], "names of branches are unique");
    }
    const Result<int> from = known_node(words_[2]);
    if (!from) return fail(from.error());
    const Result<int> to = known_node(words_[3]);
    if (!to) return fail(to.error());
    const Result<double> first = parse_radius(words_[4], name_, lines_.line());
    if (!first) return fail(first.error());
    const Result<double> last =
        words_.size() == 6 ? parse_radius(words_[5], name_, lines_.line()) : first;
    if (!last) return fail(last.error());
    branches_.push_back({std::string(words_[1]), *from, *to, lines_.line(), *first, *last, {}});
    return {};
  }

  Result<void> point() {
    if (auto enough = need(4, 5, "point X Y Z [RADIUS]"); !enough) return enough;
    if (branches_.empty())
      return bad("the point has no branch", words_[0], "points follow a branch");
    const Result<Vec3> p = position(1);
    if (!p) return fail(p.error());
    PathPoint through{*p, std::nullopt};
    if (words_.size() == 5) {
      const Result<double> r = parse_radius(words_[4], name_, lines_.line());
      if (!r) return fail(r.error());
      through.radius = *r;
    }
    branches_.back().points.push_back(through);
    return {};
  }

  Result<void> inlet() {
    if (words_.size() < 2) return need(2, 2, "inlet NODE ...");
    for (std::size_t i = 1; i < words_.size(); ++i) {
      const Result<int> n = known_node(words_[i]);
      if (!n) return fail(n.error());
      inlets_.push_back(*n);
    }
    return {};
  }

  // Radii that are not given: linear in the length between those that are.
  static void fill_radii(std::vector<PathPoint>& path) {
    std::size_t given = 0;
    for (std::size_t i = 1; i < path.size(); ++i) {
      if (!path[i].radius) continue;

      double whole = 0;
      for (std::size_t k = given + 1; k <= i; ++k) {
        whole += (path[k].position - path[k - 1].position).norm();
      }

      double part = 0;
      for (std::size_t k = given + 1; k < i; ++k) {
        part += (path[k].position - path[k - 1].position).norm();
        const double t = whole > 0 ? part / whole : 0.0;
        path[k].radius = (1 - t) * *path[given].radius + t * *path[i].radius;
      }
      given = i;
    }
  }

  // The first branch at a node makes its point; others come as points of their own at the same
  // place, so that each keeps its own radius there.
  int end_point(int n, double radius) {
    const int point = add(Vec3(nodes_[index(n)]), radius, "");
    const auto [first, is_new] = point_of_node_.emplace(n, point);
    if (is_new) {
      graph_.points.back().name = node_names_[index(n)];
    } else {
      connect(first->second, point);
    }
    return point;
  }

  int add(const Vec3& p, double radius, std::string point_name) {
    graph_.points.push_back({std::move(point_name), p, radius});
    return static_cast<int>(graph_.points.size()) - 1;
  }

  void connect(int a, int b) {
    graph_.edges.emplace_back(a, b);
    graph_.line_of_edge.push_back(static_cast<int>(graph_.line_names.size()) - 1);
  }

  // The nodes' places and the points between them, without repeated places.
  std::vector<PathPoint> path_of(const DefinedBranch& b) const {
    std::vector<PathPoint> path;
    path.push_back({nodes_[index(b.from)], b.first_radius});
    path.insert(path.end(), b.points.begin(), b.points.end());
    path.push_back({nodes_[index(b.to)], b.last_radius});
    fill_radii(path);
    path.erase(std::unique(
                   path.begin(), path.end(),
                   [](const PathPoint& p, const PathPoint& q) { return p.position == q.position; }),
               path.end());
    return path;
  }

  Result<void> sample(int number) {
    const DefinedBranch& b = branches_[index(number)];
    graph_.line_names.push_back(b.name);
    const std::vector<PathPoint> path = path_of(b);
    if (path.size() < 2) {
      return fail({ErrorKind::kBadInput, "the branch has no length", at_line(name_, b.line),
                   fmt::format("'{}'", quoted_value(b.name)), "it must leave its first node"});
    }

    int before = end_point(b.from, b.first_radius);
    for (std::size_t i = 0; i + 1 < path.size(); ++i) {
      // At an end of the branch its last step goes on, mirrored, as the fourth point of the spline.
      const Vec3& p = path[i].position;
      const Vec3& q = path[i + 1].position;
      const std::array<Vec3, 4> around = {
          i > 0 ? path[i - 1].position : Vec3(2 * p - q), p, q,
          i + 2 < path.size() ? path[i + 2].position : Vec3(2 * q - p)};
      const double length = (q - p).norm();
      const double radius = std::min(*path[i].radius, *path[i + 1].radius);
      const int samples =
          static_cast<int>(std::clamp(std::ceil(length / (kDefinitionSampleRadii * radius)), 1.0,
                                      static_cast<double>(kDefinitionMostSamples)));

      for (int k = 1; k <= samples; ++k) {
        const double u = static_cast<double>(k) / samples;
        const double r = (1 - u) * *path[i].radius + u * *path[i + 1].radius;
        const bool is_last = i + 2 == path.size() && k == samples;
        const int next = is_last ? end_point(b.to, b.last_radius)
                                 : add(catmull_rom(around, u), r,
                                       fmt::format("{}_{}", b.name, graph_.points.size()));
        connect(before, next);
        before = next;
      }
    }
    return {};
  }

  LineReader lines_;
  std::string_view name_;
  std::vector<std::string_view> words_;
  std::vector<Vec3> nodes_;
  std::vector<std::string> node_names_;
  std::map<std::string, int, std::less<>> node_of_;
  std::set<std::string> branch_names_;
  std::vector<DefinedBranch> branches_;
  std::vector<int> inlets_;
  std::map<int, int> point_of_node_;
  PointGraph graph_;
  FileFacts facts_;
};

}  // namespace

Result<CenterlineTree> parse_tree_definition(std::string_view text, std::string_view name,
                                             const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return DefinitionReader(*plain, name).read(options);
}

}  // namespace angiospline
