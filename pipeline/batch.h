// Many trees into one folder: each in a process of its own, a record beside its files, one table.
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "pipeline/build.h"

namespace angiospline {

struct BatchOptions {
  BuildFileOptions build;        // of each tree; its `name` is not for many. Its `threads` 0: the
                                 // processors shared among the trees that are built at a time
  std::string formats = "step";  // to write of each tree: suffixes with commas between
  int jobs = 0;                  // trees at a time; 0: as many as there are processors
  std::string program;           // the angiospline program to run; empty: this process's own
};

enum class TreeState {
  kDone,       // now, and sound
  kUnchanged,  // was finished before, from the same bytes with the same options
  kUnsound,    // built, but something failed or the solid is not sound
  kRefused,    // the input is bad, or a file cannot be written
  kCrashed,
  kStopped  // on request, or not begun
};

// "done", "unchanged", "unsound", "refused", "crashed", "stopped".
std::string_view to_string(TreeState state);

// What a model was measured to be.
struct TreeFigures {
  int branches = 0;
  int junctions = 0;
  int loops = 0;
  int failed = 0;  // parts
  int solids = 0;
  bool closed = false;
  bool valid = false;
  bool self_intersecting = false;
  double volume_mm3 = 0.0;
  double max_normal_angle_deg = 0.0;
};

struct BatchTree {
  std::filesystem::path input;
  std::string name;                // of its files in the folder
  std::vector<std::string> files;  // to be written
  TreeState state = TreeState::kStopped;
  int exit_code = -1;  // of its process
  double seconds = 0.0;
  std::string message;                 // why it is not done; may be empty
  std::optional<TreeFigures> figures;  // none without a model
};

struct BatchReport {
  std::vector<BatchTree> trees;  // in the order of the inputs
  bool stopped = false;
};

// How many trees ended in each state, by its name.
std::map<std::string, int> count_states(const BatchReport& report);

// Builds every tree of the inputs (centerline files, folders of them, and .list files that name one
// a line, # for comments) into `folder`, which is made if need be. Files are named by the inputs'
// stems; where several share one, with their suffixes, and numbers where that is not enough. A tree
// whose record (NAME.seed.json) tells of the same bytes, options and program, and whose files are
// all there, is not built again; so a batch that was stopped goes on where it was. `ended` is
// called as each tree ends, one at a time. Writes summary.csv and summary.json. Errors: an unknown
// format, no tree at all, a folder that cannot be made, a record or table that cannot be written;
// what is wrong with a tree is its own.
Result<BatchReport> build_batch(const std::vector<std::filesystem::path>& inputs,
                                const std::filesystem::path& folder,
                                const BatchOptions& options = {}, const Progress& progress = {},
                                const std::function<void(const BatchTree&)>& ended = {});

}  // namespace angiospline
