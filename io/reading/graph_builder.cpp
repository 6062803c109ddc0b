#include "io/reading/graph_builder.h"

#include <utility>

#include "base/index.h"
#include "io/text/text_file.h"

namespace angiospline {

int GraphBuilder::add_point(GraphPoint point, int line) {
  graph.points.push_back(std::move(point));
  line_of_.push_back(line);
  return point_count() - 1;
}

Result<void> GraphBuilder::register_id(int point, const char* what) {
  const std::string& id = graph.points[index(point)].name;
  if (number_of_.emplace(id, point).second) return {};
  return bad(what, line_of_[index(point)], quoted_value(id), "ids are unique");
}

std::optional<int> GraphBuilder::find(std::string_view id) const {
  const auto found = number_of_.find(id);
  return found == number_of_.end() ? std::nullopt : std::optional<int>(found->second);
}

Result<void> GraphBuilder::add_edge(std::string_view from, std::string_view to, int line,
                                    const char* rule) {
  const std::optional<int> a = find(from);
  const std::optional<int> b = find(to);
  if (!a || !b)
    return bad("the edge's node does not exist", line, quoted_value(a ? to : from), rule);
  graph.edges.emplace_back(*a, *b);
  return {};
}

tl::unexpected<Error> GraphBuilder::missing_parent(int point, std::string_view parent,
                                                   std::string rule) const {
  return bad("the parent does not exist", line_of_[index(point)], quoted_value(parent),
             std::move(rule));
}

Result<void> GraphBuilder::check_parents(const std::vector<int>& parent_of) const {
  // Each walk stops where an earlier one has been, so that every point is passed once; it has gone
  // round only if it meets its own mark.
  std::vector<int> walk(parent_of.size(), -1);
  for (int start = 0; start < static_cast<int>(parent_of.size()); ++start) {
    int p = start;
    while (p >= 0 && walk[index(p)] < 0) {
      walk[index(p)] = start;
      p = parent_of[index(p)];
    }
    if (p < 0 || walk[index(p)] != start) continue;

    return bad("the point is its own ancestor", line_of_[index(p)],
               quoted_value(graph.points[index(p)].name),
               "parents lead to a root, without a cycle");
  }
  return {};
}

tl::unexpected<Error> GraphBuilder::bad(std::string what, int line, std::string value,
                                        std::string rule) const {
  return fail({ErrorKind::kBadInput, std::move(what), at_line(file_, line), std::move(value),
               std::move(rule)});
}

tl::unexpected<Error> GraphBuilder::bad_file(std::string what, std::string rule) const {
  return fail({ErrorKind::kBadInput, std::move(what), std::string(file_), {}, std::move(rule)});
}

Result<CenterlineTree> GraphBuilder::finish(const CenterlineFileOptions& options) {
  return finish_tree(std::move(graph), facts, file_, options);
}

}  // namespace angiospline
