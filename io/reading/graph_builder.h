// A graph of points as a reader collects it from one file: ids, edges between ids, parents, and the
// errors that all formats share.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"
#include "io/reading/finish_tree.h"
#include "modeling/tree/point_graph.h"

namespace angiospline {

// Every error names the file and the line. Points are counted from 0 in the order they are added.
class GraphBuilder {
 public:
  explicit GraphBuilder(std::string_view file) : file_(file) {}

  PointGraph graph;
  FileFacts facts;

  // What follows comes from this file: errors name it. A network of two tables is two files.
  void continue_in(std::string_view file) { file_ = file; }

  // The new point's number.
  int add_point(GraphPoint point, int line);

  int point_count() const { return static_cast<int>(graph.points.size()); }

  // Makes the name of the point its id, by which edges and parents find it. Error: another point
  // has it; `what` says so in the format's own words. O(log n).
  Result<void> register_id(int point, const char* what);

  // The point with this id. O(log n).
  std::optional<int> find(std::string_view id) const;

  // Joins the points with these ids. Error: one of them does not exist; `rule` says what an edge
  // of this format joins.
  Result<void> add_edge(std::string_view from, std::string_view to, int line, const char* rule);

  // The error for a point whose parent is not to be found.
  tl::unexpected<Error> missing_parent(int point, std::string_view parent, std::string rule) const;

  // Every walk from a point to its parent, and on, must end at a root, whose parent is -1. Requires
  // one parent a point, in range. Error: the first cycle in the order of the points. O(n).
  Result<void> check_parents(const std::vector<int>& parent_of) const;

  // Errors at a line and for the file as a whole.
  tl::unexpected<Error> bad(std::string what, int line, std::string value, std::string rule) const;
  tl::unexpected<Error> bad_file(std::string what, std::string rule) const;

  // The tree; what was collected is used up.
  Result<CenterlineTree> finish(const CenterlineFileOptions& options);

 private:
  std::string_view file_;
  std::vector<int> line_of_;  // each point's
  std::map<std::string, int, std::less<>> number_of_;
};

}  // namespace angiospline
