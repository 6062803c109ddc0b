// Centerline+radius files of every dialect, in: the suffix says which reader takes a file.
#pragma once

#include <filesystem>
#include <vector>

#include "base/result.h"
#include "io/reading/reader_options.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// The tree in a file; the suffix says the format: .swc .eswc; .csv .tsv .txt; .tree (the plain text
// definition); .vtp .vtk; .gxl .xml (VascuSynth); .ctgr .pth (SimVascular); .graphml; vertices.csv
// and edges.csv, either of which finds the other; a folder of such a pair or of one tree's
// SimVascular files. Errors name file, line, value and rule: missing, empty or truncated file, a
// value that is no finite number, a radius that is not positive, a parent that does not exist, a
// cycle of parents, an id used twice, no positive length; or say which option decides what the file
// leaves open. Memory O(size of the file), time O(n log n).
Result<CenterlineTree> read_centerline_file(const std::filesystem::path& path,
                                            const CenterlineFileOptions& options = {});

// The trees in a folder, in the order of their names: every file with a suffix from above that is
// not the other table of a pair; the folder itself where it holds one tree's SimVascular files; and
// folders in it that do. Errors: not a folder.
Result<std::vector<std::filesystem::path>> centerline_files_in(const std::filesystem::path& folder);

// Every file that reading `path` may open, sorted: itself, and those it may find beside it.
std::vector<std::filesystem::path> files_of_tree(const std::filesystem::path& path);

// One tree from several files: SimVascular's vessels. A single path is read as above.
Result<CenterlineTree> read_centerline_files(const std::vector<std::filesystem::path>& paths,
                                             const CenterlineFileOptions& options = {});

}  // namespace angiospline
