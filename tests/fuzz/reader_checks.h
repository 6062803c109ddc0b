// What every reader of centerlines owes to whatever bytes it is given: a tree that keeps its
// invariants, or an error of one line.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "io/centerlines/csv_centerline.h"
#include "io/centerlines/graphml_file.h"
#include "io/centerlines/gxl_file.h"
#include "io/centerlines/network_tables.h"
#include "io/centerlines/simvascular_file.h"
#include "io/centerlines/swc_file.h"
#include "io/centerlines/tree_definition.h"
#include "io/centerlines/vtk_centerline.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline::fuzz {

using Reader = Result<CenterlineTree> (*)(std::string_view text, std::string_view name,
                                          const CenterlineFileOptions& options);

inline Result<CenterlineTree> tables(std::string_view text, std::string_view name,
                                     const CenterlineFileOptions& options) {
  const std::size_t cut = text.find("====");  // between the vertices and the edges
  if (cut == std::string_view::npos) return parse_network_tables(text, name, text, name, options);
  return parse_network_tables(text.substr(0, cut), name, text.substr(cut + 4), name, options);
}

inline Result<CenterlineTree> simvascular(std::string_view text, std::string_view name,
                                          const CenterlineFileOptions&) {
  const auto path = parse_pth(text, name);
  const auto group = parse_ctgr(text, name);
  if (!group && !path) return fail(group.error());
  return CenterlineTree{};
}

// Ends the program where a promise is broken: a fuzzer keeps the bytes that did it.
inline void require(bool condition) {
  if (!condition) std::abort();
}

inline void check(const CenterlineTree& tree) {
  const int nodes = static_cast<int>(tree.nodes.size());
  for (const CenterlineBranch& branch : tree.branches) {
    require(branch.from >= 0 && branch.from < nodes && branch.to >= 0 && branch.to < nodes);
    require(branch.points_mm.cols() >= 2 && branch.points_mm.cols() == branch.radii_mm.size());
    require(branch.points_mm.allFinite() && branch.radii_mm.minCoeff() > 0);
    require(branch.points_mm.col(0) == tree.nodes[std::size_t(branch.from)].position_mm);
    require(branch.points_mm.rightCols(1) == tree.nodes[std::size_t(branch.to)].position_mm);
  }
  const auto at = branches_at_nodes(tree);
  for (const int n : tree.inlets) require(n >= 0 && n < nodes && at[std::size_t(n)].size() == 1);
}

// Reads the bytes, checks what comes of them, and smooths it where it is small. Whether they were a
// tree.
inline bool read_and_check(Reader read, std::string_view text) {
  const auto tree = read(text, "fuzz", {});
  if (!tree) {
    require(tree.error().message().find('\n') == std::string::npos);
    return false;
  }
  check(*tree);
  constexpr std::size_t kSmallEnoughToSmooth = 4;
  if (tree->branches.empty() || tree->branches.size() > kSmallEnoughToSmooth) return true;
  const auto smooth = smooth_centerlines(*tree);
  if (!smooth) return true;
  check(smooth->tree);
  for (const auto& path : smooth->paths) require(path.control_points().allFinite());
  return true;
}

}  // namespace angiospline::fuzz
