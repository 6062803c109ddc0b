#include "io/centerlines/centerline_file.h"

#include <algorithm>
#include <array>
#include <span>

#include <fmt/format.h>

#include "io/centerlines/csv_centerline.h"
#include "io/centerlines/graphml_file.h"
#include "io/centerlines/gxl_file.h"
#include "io/centerlines/network_tables.h"
#include "io/centerlines/simvascular_file.h"
#include "io/centerlines/swc_file.h"
#include "io/centerlines/tree_definition.h"
#include "io/centerlines/vtk_centerline.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

using Parser = Result<CenterlineTree> (*)(std::string_view, std::string_view,
                                          const CenterlineFileOptions&);

struct Format {
  std::string_view suffix;
  Parser parse;
  bool is_text;
};

constexpr std::array kFormats = {Format{".swc", parse_swc, true},
                                 Format{".eswc", parse_swc, true},
                                 Format{".csv", parse_csv_centerline, true},
                                 Format{".tsv", parse_csv_centerline, true},
                                 Format{".txt", parse_csv_centerline, true},
                                 Format{".tree", parse_tree_definition, true},
                                 Format{".vtp", parse_vtp_centerline, false},
                                 Format{".vtk", parse_vtk_centerline, false},
                                 Format{".gxl", parse_gxl, true},
                                 Format{".xml", parse_gxl, true},
                                 Format{".graphml", parse_graphml, true}};

bool is_simvascular(const std::filesystem::path& path) {
  const std::string suffix = lower_case(path.extension().string());
  return suffix == ".ctgr" || suffix == ".pth";
}

Result<CenterlineTree> read_tables(const std::filesystem::path& vertices,
                                   const std::filesystem::path& edges,
                                   const CenterlineFileOptions& options) {
  const Result<std::string> vertex_text = read_text_file(vertices);
  if (!vertex_text) return fail(vertex_text.error());
  const Result<std::string> edge_text = read_text_file(edges);
  if (!edge_text) return fail(edge_text.error());
  return parse_network_tables(*vertex_text, vertices.string(), *edge_text, edges.string(), options);
}

// The other table of a pair: vertices.csv for edges.csv, a_nodes.csv for a_edges.csv and so on.
std::optional<std::filesystem::path> partner_of(const std::filesystem::path& path,
                                                std::span<const std::string_view> own,
                                                std::span<const std::string_view> others) {
  const std::string file = path.filename().string();
  const std::string lower = lower_case(file);
  for (const std::string_view word : own) {
    const std::size_t at = lower.find(word);
    if (at == std::string::npos) continue;
    for (const std::string_view other : others) {
      std::string partner = file;
      partner.replace(at, word.size(), other);
      const std::filesystem::path found = path.parent_path() / partner;
      if (std::filesystem::exists(found)) return found;
    }
  }
  return std::nullopt;
}

constexpr std::array<std::string_view, 4> kVertexWords = {"vertices", "nodes", "vertex", "node"};
constexpr std::array<std::string_view, 2> kEdgeWords = {"edges", "edge"};

Result<CenterlineTree> read_folder(const std::filesystem::path& path,
                                   const CenterlineFileOptions& options) {
  std::vector<std::filesystem::path> simvascular;
  std::vector<std::filesystem::path> edges;
  std::error_code code;
  for (const auto& entry : std::filesystem::directory_iterator(path, code)) {
    if (is_simvascular(entry.path())) simvascular.push_back(entry.path());
    const std::string file = lower_case(entry.path().filename().string());
    if (file.find("edge") != std::string::npos && file.ends_with(".csv"))
      edges.push_back(entry.path());
  }

  std::sort(simvascular.begin(), simvascular.end());
  if (edges.size() == 1 && simvascular.empty()) {
    if (const auto vertices = partner_of(edges[0], kEdgeWords, kVertexWords)) {
      return read_tables(*vertices, edges[0], options);
    }
  }
  if (!simvascular.empty() && edges.empty()) return read_simvascular(simvascular, options);
  return fail({ErrorKind::kBadInput,
               "the folder is not one vessel tree",
               path.string(),
               {},
               "a folder holds vertices.csv and edges.csv, or .ctgr and .pth files"});
}

bool holds_simvascular(const std::filesystem::path& folder) {
  std::error_code code;
  const std::filesystem::directory_iterator entries(folder, code);
  return std::any_of(begin(entries), end(entries), [](const auto& entry) {
    return lower_case(entry.path().extension().string()) == ".ctgr";
  });
}

bool has_known_suffix(const std::filesystem::path& path) {
  const std::string suffix = lower_case(path.extension().string());
  return std::any_of(kFormats.begin(), kFormats.end(),
                     [&](const Format& f) { return f.suffix == suffix; });
}

}  // namespace

Result<std::vector<std::filesystem::path>> centerline_files_in(
    const std::filesystem::path& folder) {
  std::error_code code;
  std::filesystem::directory_iterator entries(folder, code);
  if (code) {
    return fail({ErrorKind::kBadInput, "the folder cannot be read", folder.string(), {}, {}});
  }

  // Of a pair of tables the vertices stand for both.
  std::vector<std::filesystem::path> trees;
  if (holds_simvascular(folder)) trees.push_back(folder);
  for (const auto& entry : entries) {
    const std::filesystem::path& path = entry.path();
    const bool is_tree = entry.is_directory(code) ? holds_simvascular(path)
                                                  : has_known_suffix(path) &&
                                                        !partner_of(path, kEdgeWords, kVertexWords);
    if (is_tree) trees.push_back(path);
  }
  std::sort(trees.begin(), trees.end());
  return trees;
}

std::vector<std::filesystem::path> files_of_tree(const std::filesystem::path& path) {
  std::error_code code;
  std::vector<std::filesystem::path> files;
  const bool is_folder = std::filesystem::is_directory(path, code);
  if (!is_folder) files.push_back(path);
  if (is_folder || is_simvascular(path)) {
    const std::filesystem::path beside = path.has_parent_path() ? path.parent_path() : ".";
    for (const auto& entry : std::filesystem::directory_iterator(is_folder ? path : beside, code)) {
      const bool is_part = is_folder ? entry.is_regular_file(code)
                                     : is_simvascular(entry.path()) && entry.path() != path &&
                                           entry.path().stem() == path.stem();
      if (is_part) files.push_back(entry.path());
    }
  }

  if (const auto edges = partner_of(path, kVertexWords, kEdgeWords)) files.push_back(*edges);
  if (const auto vertices = partner_of(path, kEdgeWords, kVertexWords)) files.push_back(*vertices);
  std::sort(files.begin(), files.end());
  return files;
}

Result<CenterlineTree> read_centerline_file(const std::filesystem::path& path,
                                            const CenterlineFileOptions& options) {
  if (std::filesystem::is_directory(path)) return read_folder(path, options);
  if (is_simvascular(path)) return read_simvascular({path}, options);
  const std::string suffix = lower_case(path.extension().string());
  const auto* const format = std::find_if(kFormats.begin(), kFormats.end(),
                                          [&](const Format& f) { return f.suffix == suffix; });
  if (format == kFormats.end()) {
    std::string known = ".ctgr .pth";
    for (const Format& f : kFormats) known += fmt::format(" {}", f.suffix);
    return fail({ErrorKind::kBadInput, "not a known format of centerlines", path.string(),
                 fmt::format("'{}'", suffix), "the suffix is one of " + known});
  }

  const Result<std::string> text = format->is_text ? read_text_file(path) : read_bytes(path);
  if (!text) return fail(text.error());

  // A table of vertices or edges looks like a table of points by its suffix only.
  if (suffix == ".csv") {
    const bool vertices = is_vertex_table(*text);
    if (vertices || is_edge_table(*text)) {
      const auto partner = vertices ? partner_of(path, kVertexWords, kEdgeWords)
                                    : partner_of(path, kEdgeWords, kVertexWords);
      if (partner)
        return read_tables(vertices ? path : *partner, vertices ? *partner : path, options);
      return fail({ErrorKind::kBadInput,
                   "the other table of the network is missing",
                   path.string(),
                   {},
                   "vertices.csv and edges.csv stand beside each other"});
    }
  }

  Result<CenterlineTree> tree = format->parse(*text, path.string(), options);
  if (tree && options.voxel_width && format->parse != parse_gxl) {
    tree->assumptions.emplace_back(
        "voxel width: not used, for only VascuSynth's files count in voxels (--unit scales "
        "others)");
  }
  return tree;
}

Result<CenterlineTree> read_centerline_files(const std::vector<std::filesystem::path>& paths,
                                             const CenterlineFileOptions& options) {
  if (paths.size() == 1) return read_centerline_file(paths.front(), options);
  if (!paths.empty() && std::all_of(paths.begin(), paths.end(), is_simvascular)) {
    return read_simvascular(paths, options);
  }
  return fail({ErrorKind::kBadInput,
               "several files are not one tree",
               paths.empty() ? std::string() : paths.front().string(),
               {},
               "only SimVascular's .ctgr and .pth files are read together"});
}

}  // namespace angiospline
