#include "modeling/tree/point_graph.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <tuple>

#include <fmt/format.h>

#include "base/contract.h"
#include "base/disjoint_sets.h"
#include "base/index.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

// For each point the edges at it, as one flat list (compressed rows).
class Incidence {
 public:
  Incidence(std::size_t count, const std::vector<std::pair<int, int>>& edges)
      : first_(count + 1, 0), edges_(2 * edges.size()) {
    for (const auto& [a, b] : edges) {
      ++first_[index(a) + 1];
      ++first_[index(b) + 1];
    }
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    std::vector<int> at = first_;
    for (std::size_t e = 0; e < edges.size(); ++e) {
      edges_[index(at[index(edges[e].first)]++)] = static_cast<int>(e);
      edges_[index(at[index(edges[e].second)]++)] = static_cast<int>(e);
    }
  }
  int degree(int p) const { return first_[index(p) + 1] - first_[index(p)]; }
  const int* begin(int p) const { return edges_.data() + first_[index(p)]; }
  const int* end(int p) const { return edges_.data() + first_[index(p) + 1]; }

 private:
  std::vector<int> first_;
  std::vector<int> edges_;
};

using Key = std::array<double, 3>;

Key key_of(const Vec3& p) { return {p.x() + 0.0, p.y() + 0.0, p.z() + 0.0}; }  // -0 becomes 0

// An edge between groups that still knows its own points: they carry the branch's radii.
struct Edge {
  int a, b;              // groups
  int point_a, point_b;  // members
  int line;              // or -1
  double radius_mm;      // or 0
};

class TreeBuilder {
 public:
  explicit TreeBuilder(const PointGraph& graph) : graph_(graph), groups_(graph.points.size()) {}

  Result<CenterlineTree> build() {
    // What is one point, in the order of the header's list; then what is left of the edges.
    join_along_edges();
    join_siblings();
    join_ends();
    collect_edges();
    if (edges_.empty()) {
      return fail({ErrorKind::kBadInput,
                   "no branch has a positive length",
                   {},
                   {},
                   "two points at different positions must be connected"});
    }

    collect_pairs();
    trace_chains();
    orient_and_choose_inlets();
    name_branches();
    return std::move(tree_);
  }

 private:
  const Vec3& position(int p) const { return graph_.points[index(p)].position_mm; }
  const std::string& name(int p) const { return graph_.points[index(p)].name; }

  void join_along_edges() {
    int zero_length = 0;
    for (const auto& [a, b] : graph_.edges) {
      if (position(a) == position(b) && groups_.join(a, b)) ++zero_length;
    }
    say(zero_length, "edge of zero length", "edges of zero length", "removed");
  }

  // For each group those it is joined to by edges; equal ones more than once.
  std::vector<std::vector<int>> neighbours_of_groups() {
    std::vector<std::vector<int>> neighbours(graph_.points.size());
    for (const auto& [a, b] : graph_.edges) {
      const int ga = groups_.root(a);
      const int gb = groups_.root(b);
      if (ga == gb) continue;
      neighbours[index(ga)].push_back(gb);
      neighbours[index(gb)].push_back(ga);
    }
    return neighbours;
  }

  // A group's neighbours as they are now, each once, with those at the same place side by side.
  std::vector<std::pair<Key, int>> sorted_by_place(int g, const std::vector<int>& neighbours) {
    std::vector<std::pair<Key, int>> around;
    for (const int n : neighbours) {
      const int other = groups_.root(n);
      if (other != g) around.emplace_back(key_of(position(other)), other);
    }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    return around;
  }

  // Neighbours of one point at the same position are one point; their own neighbours follow, so a
  // worklist of groups runs until nothing changes.
  void join_siblings() {
    std::vector<std::vector<int>> neighbours = neighbours_of_groups();
    std::vector<int> work;
    for (std::size_t g = neighbours.size(); g-- > 0;) {
      if (neighbours[g].size() > 1) work.push_back(static_cast<int>(g));
    }

    int joined = 0;
    while (!work.empty()) {
      const int g = work.back();
      work.pop_back();
      if (groups_.root(g) != g || neighbours[index(g)].size() < 2) continue;
      const auto around = sorted_by_place(g, neighbours[index(g)]);
      neighbours[index(g)].clear();
      for (const auto& [key, other] : around) neighbours[index(g)].push_back(other);

      for (std::size_t i = 1; i < around.size(); ++i) {
        if (around[i].first != around[i - 1].first) continue;
        const int a = groups_.root(around[i - 1].second);
        const int b = groups_.root(around[i].second);
        if (!groups_.join(a, b)) continue;
        ++joined;

        // The smaller list moves, so that all moves together are O(n log n).
        const int winner = groups_.root(a);
        auto& to = neighbours[index(winner)];
        auto& from = neighbours[index(winner == a ? b : a)];
        if (to.size() < from.size()) to.swap(from);
        to.insert(to.end(), from.begin(), from.end());
        from.clear();
        from.shrink_to_fit();
        work.push_back(winner);
      }
    }
    say(joined, "point repeats a neighbour's", "points repeat a neighbour's",
        "position: joined with it");
  }

  // An end at the place of another point is joined to it: so loops are closed in files that cannot
  // close them.
  void join_ends() {
    std::vector<int> degree(graph_.points.size(), 0);
    for (const auto& [a, b] : graph_.edges) {
      const int ga = groups_.root(a);
      const int gb = groups_.root(b);
      if (ga == gb) continue;
      ++degree[index(ga)];
      ++degree[index(gb)];
    }

    std::vector<std::pair<Key, int>> places;
    for (std::size_t p = 0; p < graph_.points.size(); ++p) {
      const int g = static_cast<int>(p);
      if (groups_.root(g) == g && degree[p] > 0) places.emplace_back(key_of(position(g)), g);
    }
    std::sort(places.begin(), places.end());

    // Runs of groups in one place, of which one at least is an end.
    int joined = 0;
    std::string names;
    for (std::size_t i = 0; i < places.size();) {
      std::size_t last = i;
      bool has_end = false;
      while (last < places.size() && places[last].first == places[i].first) {
        has_end = has_end || degree[index(places[last].second)] == 1;
        ++last;
      }
      for (std::size_t j = i + 1; has_end && j < last; ++j) {
        if (groups_.join(places[i].second, places[j].second)) {
          ++joined;
          if (joined <= CleaningRules::kNamedJoins) {
            names += fmt::format("{}{} and {}", joined == 1 ? "" : ", ", name(places[i].second),
                                 name(places[j].second));
          }
        }
      }
      i = last;
    }

    if (joined > CleaningRules::kNamedJoins)
      names += fmt::format(" and {} more", joined - CleaningRules::kNamedJoins);
    if (joined > 0)
      tree_.assumptions.push_back("ends at the position of another point joined to it: " + names);
  }

  // Edges between different groups; of the copies of a doubled edge the first stays.
  void collect_edges() {
    std::vector<std::tuple<int, int, int>> sorted;
    for (std::size_t e = 0; e < graph_.edges.size(); ++e) {
      const int a = groups_.root(graph_.edges[e].first);
      const int b = groups_.root(graph_.edges[e].second);
      if (a != b) sorted.emplace_back(std::min(a, b), std::max(a, b), static_cast<int>(e));
    }
    std::sort(sorted.begin(), sorted.end());

    std::vector<int> kept;
    for (std::size_t i = 0; i < sorted.size(); ++i) {
      const auto& [a, b, e] = sorted[i];
      if (i > 0 && std::get<0>(sorted[i - 1]) == a && std::get<1>(sorted[i - 1]) == b) continue;
      kept.push_back(e);
    }
    say(static_cast<int>(sorted.size() - kept.size()), "doubled edge", "doubled edges", "dropped");

    // In the order of the input again: names and orientations follow it.
    std::sort(kept.begin(), kept.end());
    edges_.reserve(kept.size());
    for (const int e : kept) {
      const auto& [a, b] = graph_.edges[index(e)];
      const int line = graph_.line_of_edge.empty() ? -1 : graph_.line_of_edge[index(e)];
      const double radius = graph_.edge_radii_mm.empty() ? 0.0 : graph_.edge_radii_mm[index(e)];
      edges_.push_back({groups_.root(a), groups_.root(b), a, b, line, radius});
    }
  }

  void collect_pairs() {
    pairs_.reserve(edges_.size());
    for (const Edge& e : edges_) pairs_.emplace_back(e.a, e.b);
    int lonely = 0;
    std::vector<bool> used(graph_.points.size(), false);
    for (const Edge& e : edges_) used[index(e.a)] = used[index(e.b)] = true;
    for (std::size_t p = 0; p < used.size(); ++p) lonely += !used[index(groups_.root(int(p)))];
    say(lonely, "point without a branch", "points without a branch", "dropped");
  }

  void trace_chains() {
    const Incidence at(graph_.points.size(), pairs_);
    std::vector<bool> done(edges_.size(), false);
    node_of_.assign(graph_.points.size(), -1);
    for (std::size_t p = 0; p < graph_.points.size(); ++p) {
      const int g = static_cast<int>(p);
      if (at.degree(g) > 0 && at.degree(g) != 2) add_node(g);
    }

    const auto node_count = tree_.nodes.size();
    for (std::size_t n = 0; n < node_count; ++n) {
      const int g = group_of_node_[n];
      for (const int* e = at.begin(g); e != at.end(g); ++e) trace(g, *e, at, done);
    }

    // What is left are rings, which begin at their lowest point.
    for (std::size_t e = 0; e < edges_.size(); ++e) {
      if (done[e]) continue;
      const int g = std::min(edges_[e].a, edges_[e].b);
      add_node(g);
      trace(g, *at.begin(g), at, done);
    }
  }

  void add_node(int g) {
    node_of_[index(g)] = static_cast<int>(tree_.nodes.size());
    tree_.nodes.push_back({name(g), position(g)});
    group_of_node_.push_back(g);
  }

  void trace(int start, int e, const Incidence& at, std::vector<bool>& done) {
    if (done[index(e)]) return;
    std::vector<int> members;   // the points whose radii the branch bears
    std::vector<double> radii;  // of the edges between them
    int here = start;
    int forward = 0;
    int line = edges_[index(e)].line;
    while (true) {
      done[index(e)] = true;
      const Edge& edge = edges_[index(e)];
      if (edge.line != line) line = -1;
      radii.push_back(edge.radius_mm);
      const bool along = edge.a == here;
      forward += along ? 1 : -1;
      if (members.empty()) members.push_back(along ? edge.point_a : edge.point_b);
      members.push_back(along ? edge.point_b : edge.point_a);
      here = along ? edge.b : edge.a;
      if (node_of_[index(here)] >= 0) break;
      const int* next = at.begin(here);
      e = done[index(next[0])] ? next[1] : next[0];
    }

    // The way most of its edges were given.
    if (forward < 0) {
      std::reverse(members.begin(), members.end());
      std::reverse(radii.begin(), radii.end());
    }
    tree_.branches.push_back(branch_through(members, radii));
    second_.push_back(members.size() > 2 ? std::pair{members[1], members[members.size() - 2]}
                                         : std::pair{-1, -1});
    line_.push_back(line);
  }

  // The branch through these points; radii of edges, where there are any, count at both their
  // points.
  CenterlineBranch branch_through(const std::vector<int>& members,
                                  const std::vector<double>& radii) {
    CenterlineBranch branch;
    branch.from = node_of_[index(groups_.root(members.front()))];
    branch.to = node_of_[index(groups_.root(members.back()))];
    branch.points_mm.resize(3, static_cast<Eigen::Index>(members.size()));
    branch.radii_mm.resize(static_cast<Eigen::Index>(members.size()));
    for (std::size_t i = 0; i < members.size(); ++i) {
      branch.points_mm.col(static_cast<Eigen::Index>(i)) = position(members[i]);
      const double of_edges =
          0.5 * (radii[i > 0 ? i - 1 : 0] + radii[std::min(i, radii.size() - 1)]);
      branch.radii_mm(static_cast<Eigen::Index>(i)) =
          of_edges > 0 ? of_edges : graph_.points[index(members[i])].radius_mm;
    }
    return branch;
  }

  // Inlets of the input first, then a chosen one for each component without; branches then point
  // the way a search in breadth from the inlets meets them.
  void orient_and_choose_inlets() {
    const auto at = branches_at_nodes(tree_);
    const std::vector<int> component = components_of_nodes(tree_);
    std::vector<bool> has_inlet(tree_.nodes.size(), false);  // by component
    std::set<int> inlets;
    for (const int root : graph_.roots) {
      const int n = node_of_[index(groups_.root(root))];
      if (n < 0 || at[index(n)].size() != 1) continue;
      inlets.insert(n);
      has_inlet[index(component[index(n)])] = true;
    }

    // The widest end of each component that is left.
    std::vector<int> widest(tree_.nodes.size(), -1);  // by component
    std::vector<double> width(tree_.nodes.size(), 0.0);
    for (std::size_t n = 0; n < tree_.nodes.size(); ++n) {
      const std::size_t c = index(component[n]);
      if (at[n].size() != 1 || has_inlet[c]) continue;
      const CenterlineBranch& branch = tree_.branches[index(at[n][0])];
      const auto last = branch.radii_mm.size() - 1;
      const double r = branch.radii_mm(branch.from == static_cast<int>(n) ? 0 : last);
      if (r <= width[c]) continue;
      width[c] = r;
      widest[c] = static_cast<int>(n);
    }

    for (const int n : widest) {
      if (n < 0) continue;
      inlets.insert(n);
      tree_.assumptions.push_back(
          fmt::format("the inlet is not given by an end: taken to be {}, the widest end",
                      tree_.nodes[index(n)].name));
    }
    tree_.inlets.assign(inlets.begin(), inlets.end());
    orient(at);
  }

  void orient(const std::vector<std::vector<int>>& at) {
    std::vector<int> queue = tree_.inlets;
    std::vector<bool> met(tree_.nodes.size(), false);
    std::vector<bool> passed(tree_.branches.size(), false);
    for (const int n : queue) met[index(n)] = true;

    // In breadth: where two ways meet, the branch between points from the nearer one.
    for (std::size_t q = 0; q < queue.size(); ++q) {
      for (const int b : at[index(queue[q])]) {
        if (passed[index(b)]) continue;
        passed[index(b)] = true;
        CenterlineBranch& branch = tree_.branches[index(b)];
        if (branch.from != queue[q]) {
          std::swap(branch.from, branch.to);
          branch.points_mm = branch.points_mm.rowwise().reverse().eval();
          branch.radii_mm = branch.radii_mm.reverse().eval();
          std::swap(second_[index(b)].first, second_[index(b)].second);
        }
        if (!met[index(branch.to)]) queue.push_back(branch.to);
        met[index(branch.to)] = true;
      }
    }
  }

  void name_branches() {
    std::map<std::pair<int, int>, int> count;
    for (const CenterlineBranch& b : tree_.branches) ++count[std::minmax(b.from, b.to)];
    std::vector<int> branches_of_line(graph_.line_names.size(), 0);
    for (const int line : line_) {
      if (line >= 0) ++branches_of_line[index(line)];
    }

    // By its ends; by a point between where others have the same ends; by its line's name if that
    // is its alone. What is still the same is numbered.
    std::map<std::string, int> taken;
    for (std::size_t b = 0; b < tree_.branches.size(); ++b) {
      CenterlineBranch& branch = tree_.branches[b];
      branch.name = tree_.nodes[index(branch.from)].name + "_" + tree_.nodes[index(branch.to)].name;
      if (count[std::minmax(branch.from, branch.to)] > 1 && second_[b].first >= 0) {
        branch.name += "_via_" + name(second_[b].first);
      }
      if (line_[b] >= 0 && branches_of_line[index(line_[b])] == 1 &&
          !graph_.line_names[index(line_[b])].empty()) {
        branch.name = graph_.line_names[index(line_[b])];
      }
      const int copies = taken[branch.name]++;
      if (copies > 0) branch.name += fmt::format("_copy_{}", copies);
    }
  }

  void say(int count, std::string_view one, std::string_view many, std::string_view rest) {
    if (count == 0) return;
    tree_.assumptions.push_back(fmt::format("{} {} {}", count, count == 1 ? one : many, rest));
  }

  const PointGraph& graph_;
  DisjointSets groups_;
  CenterlineTree tree_;
  std::vector<Edge> edges_;
  std::vector<std::pair<int, int>> pairs_;
  std::vector<int> node_of_;  // by group
  std::vector<int> group_of_node_;
  std::vector<int> line_;                    // by branch: the only line it belongs to, or -1
  std::vector<std::pair<int, int>> second_;  // by branch: its points next to from and to, or -1
};

}  // namespace

Result<CenterlineTree> tree_from_points(const PointGraph& graph) {
  const int count = static_cast<int>(graph.points.size());
  for (const auto& [a, b] : graph.edges) EXPECTS(a >= 0 && a < count && b >= 0 && b < count);
  for (const GraphPoint& p : graph.points) EXPECTS(p.position_mm.allFinite() && p.radius_mm > 0);
  return TreeBuilder(graph).build();
}

}  // namespace angiospline
