#include "io/centerlines/swc_file.h"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "base/index.h"
#include "io/reading/graph_builder.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

constexpr std::size_t kColumns = 7;

struct SwcPoint {
  long long id;
  long long parent;
  int line;
};

// A comment like "# unit: um" or "# units = micrometre".
void read_unit(std::string_view comment, FileFacts& facts) {
  const std::string lower = lower_case(comment);
  const std::size_t at = lower.find("unit");
  if (at == std::string::npos) return;
  // The first of the next words that is a unit: "units in mm", "unit = um".
  std::string_view rest = std::string_view(lower).substr(at + 4);
  for (int word_count = 0; word_count < 4; ++word_count) {
    const std::size_t first = rest.find_first_not_of(":=,;()[] \t");
    if (first == std::string_view::npos) return;
    rest.remove_prefix(first);
    const std::string_view word = rest.substr(0, rest.find_first_of(":=,;()[] \t"));
    rest.remove_prefix(word.size());
    const Result<double> unit = parse_unit_mm(word);
    if (!unit || parse_number(word)) continue;
    facts.state_unit(*unit, word);
    return;
  }
}

class SwcReader {
 public:
  SwcReader(std::string_view text, std::string_view name)
      : lines_(text), name_(name), builder_(name) {}

  Result<CenterlineTree> read(const CenterlineFileOptions& options) {
    if (auto read = read_points(); !read) return fail(read.error());
    if (auto linked = link_parents(); !linked) return fail(linked.error());
    if (auto tree = builder_.check_parents(parent_of_); !tree) return fail(tree.error());
    return builder_.finish(options);
  }

 private:
  Result<void> read_points() {
    while (const auto line = lines_.next()) {
      const std::size_t comment = line->find('#');
      if (comment != std::string_view::npos) read_unit(line->substr(comment + 1), builder_.facts);

      split_fields(line->substr(0, comment), ' ', fields_);
      if (fields_.empty()) continue;
      if (auto added = add_point(); !added) return added;
    }
    if (points_.empty()) {
      return builder_.bad_file("holds no point", "a line is: id type x y z radius parent");
    }
    return {};
  }

  // Cannon et al. 1998 (J. Neurosci. Methods 84), who gave the format its seven columns.
  Result<void> add_point() {
    const int line = lines_.line();
    if (fields_.size() < kColumns) {
      return builder_.bad("the line is cut short", line, fmt::format("{} values", fields_.size()),
                          "a line is: id type x y z radius parent");
    }
    const auto id = parse_whole_number(fields_[0]);
    const auto parent = parse_whole_number(fields_[6]);
    if (!id || *id < 0) {
      return builder_.bad("the id is not a whole number from 0", line,
                          fmt::format("'{}'", quoted_value(fields_[0])),
                          "the first value is the point's id");
    }
    if (!parent) {
      return builder_.bad("the parent is not a whole number", line,
                          fmt::format("'{}'", quoted_value(fields_[6])),
                          "the seventh value is the parent's id or -1");
    }

    const Result<Vec3> position =
        parse_position([&](int k) { return fields_[index(2 + k)]; }, name_, line);
    if (!position) return fail(position.error());
    const Result<double> r = parse_radius(fields_[5], name_, line);
    if (!r) return fail(r.error());
    builder_.add_point({std::to_string(*id), *position, *r}, line);
    points_.push_back({*id, *parent, line});
    return {};
  }

  Result<void> link_parents() {
    const Result<std::vector<int>> order = order_by_id();
    if (!order) return fail(order.error());

    // Some programs count from 1 and write 0 for "no parent".
    const bool zero_is_root = points_[index(order->front())].id != 0;
    int zero_roots = 0;
    parent_of_.assign(points_.size(), -1);
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const SwcPoint& p = points_[i];
      const int here = static_cast<int>(i);
      if (p.parent == -1 || (p.parent == 0 && zero_is_root)) {
        builder_.graph.roots.push_back(here);
        zero_roots += p.parent == 0;
        continue;
      }
      const auto found =
          std::lower_bound(order->begin(), order->end(), p.parent,
                           [&](int a, long long id) { return points_[index(a)].id < id; });
      if (found == order->end() || points_[index(*found)].id != p.parent) {
        return builder_.missing_parent(
            here, std::to_string(p.parent),
            "a parent is the id of a point of this file, or -1 for a root");
      }
      parent_of_[i] = *found;
      builder_.graph.edges.emplace_back(*found, here);
    }

    std::vector<std::string>& notes = builder_.facts.notes;
    if (zero_roots > 0) notes.push_back("parent 0: a root, since no point has the id 0");
    if (builder_.graph.roots.size() > 1) {
      notes.push_back(fmt::format("{} roots: as many trees, unless they share a position",
                                  builder_.graph.roots.size()));
    }
    return {};
  }

  // The points by their ids, which are numbers here: sorting them takes less than a map of texts.
  Result<std::vector<int>> order_by_id() const {
    std::vector<int> order(points_.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    std::stable_sort(order.begin(), order.end(),
                     [&](int a, int b) { return points_[index(a)].id < points_[index(b)].id; });
    for (std::size_t i = 1; i < order.size(); ++i) {
      const SwcPoint& a = points_[index(order[i - 1])];
      const SwcPoint& b = points_[index(order[i])];
      if (a.id != b.id) continue;
      return builder_.bad("the id is used twice", b.line, std::to_string(b.id),
                          fmt::format("ids are unique; line {} has it too", a.line));
    }
    return order;
  }

  LineReader lines_;
  std::string_view name_;
  std::vector<std::string_view> fields_;
  std::vector<SwcPoint> points_;
  std::vector<int> parent_of_;
  GraphBuilder builder_;
};

}  // namespace

Result<CenterlineTree> parse_swc(std::string_view text, std::string_view name,
                                 const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return SwcReader(*plain, name).read(options);
}

namespace {

// Walks the tree in breadth from its inlets and writes each branch as points below its parent.
class SwcWriter {
 public:
  explicit SwcWriter(const CenterlineTree& tree)
      : tree_(tree), id_of_(tree.nodes.size(), -1), radius_of_(tree.nodes.size(), 0.0) {}

  std::string write() {
    text_ = "# id type x y z radius parent\n# unit: mm\n";
    reserve_names();
    const auto at = branches_at_nodes(tree_);
    std::vector<bool> written(tree_.branches.size(), false);
    std::vector<int> queue;

    const auto visit = [&](int start) {
      if (id_of_[index(start)] >= 0) return;
      queue.push_back(start);
      for (std::size_t q = queue.size() - 1; q < queue.size(); ++q) {
        for (const int b : at[index(queue[q])]) {
          if (written[index(b)]) continue;
          written[index(b)] = true;
          const int other = write_branch(tree_.branches[index(b)], queue[q]);
          if (other >= 0) queue.push_back(other);
        }
      }
    };

    // What no inlet reaches starts at any of its nodes.
    for (const int n : tree_.inlets) visit(n);
    for (std::size_t n = 0; n < tree_.nodes.size(); ++n) visit(static_cast<int>(n));
    return std::move(text_);
  }

 private:
  void reserve_names() {
    wanted_.assign(tree_.nodes.size(), -1);
    for (std::size_t n = 0; n < tree_.nodes.size(); ++n) {
      const auto id = parse_whole_number(tree_.nodes[n].name);
      if (id && *id > 0 && taken_.insert(*id).second) wanted_[n] = *id;
    }
  }

  long long fresh_id() {
    while (taken_.count(next_) > 0) ++next_;
    return next_++;
  }

  long long node_id(int n) { return wanted_[index(n)] >= 0 ? wanted_[index(n)] : fresh_id(); }

  void line(long long id, const Vec3& p, double r, long long parent) {
    fmt::format_to(std::back_inserter(text_), "{} 3 {} {} {} {} {}\n", id, p.x(), p.y(), p.z(), r,
                   parent);
  }

  // Returns the other node when it was met for the first time, else -1.
  int write_branch(const CenterlineBranch& branch, int start) {
    const Eigen::Index count = branch.points_mm.cols();
    const bool along = branch.from == start;
    const auto at = [&](Eigen::Index i) { return along ? i : count - 1 - i; };
    const int other = along ? branch.to : branch.from;

    if (id_of_[index(start)] < 0) {
      id_of_[index(start)] = node_id(start);
      radius_of_[index(start)] = branch.radii_mm(at(0));
      line(id_of_[index(start)], tree_.nodes[index(start)].position_mm, branch.radii_mm(at(0)), -1);
    }

    long long parent = id_of_[index(start)];
    if (branch.radii_mm(at(0)) != radius_of_[index(start)]) {
      // SWC has one radius a point: a copy of the node's point, at its place, keeps this branch's
      // own.
      const long long id = fresh_id();
      line(id, tree_.nodes[index(start)].position_mm, branch.radii_mm(at(0)), parent);
      parent = id;
    }

    for (Eigen::Index i = 1; i + 1 < count; ++i) {
      const long long id = fresh_id();
      line(id, branch.points_mm.col(at(i)), branch.radii_mm(at(i)), parent);
      parent = id;
    }

    // A node that is met again closes a loop: the last point repeats its position.
    const bool met = id_of_[index(other)] >= 0;
    const long long last = met ? fresh_id() : node_id(other);
    if (!met) {
      id_of_[index(other)] = last;
      radius_of_[index(other)] = branch.radii_mm(at(count - 1));
    }
    line(last, tree_.nodes[index(other)].position_mm, branch.radii_mm(at(count - 1)), parent);
    return met ? -1 : other;
  }

  const CenterlineTree& tree_;
  std::vector<long long> id_of_;
  std::vector<double> radius_of_;  // as written with the node
  std::vector<long long> wanted_;
  std::set<long long> taken_;
  long long next_ = 1;
  std::string text_;
};

}  // namespace

std::string swc_text(const CenterlineTree& tree) { return SwcWriter(tree).write(); }

}  // namespace angiospline
