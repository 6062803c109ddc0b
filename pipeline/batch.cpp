#include "pipeline/batch.h"

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <limits>
#include <set>
#include <sstream>
#include <thread>
#include <type_traits>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/process.h"
#include "base/version.h"
#include "io/centerlines/centerline_file.h"
#include "io/export/export_model.h"
#include "pipeline/report_json.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kListSuffix = ".list";
constexpr const char* kRecordSuffix = ".seed.json";  // beside the files of each finished tree

// What the program's processes say by their exit codes.
constexpr int kSound = 0;
constexpr int kUnsound = 1;
constexpr int kBadInput = 2;
constexpr int kStoppedOnRequest = 130;
constexpr int kSignal = 128;  // and the signal that ended it

struct Job {
  BatchTree tree;
  std::string key;  // of the input's bytes, the options and the program
};

// ---- what there is to do

Result<std::vector<fs::path>> paths_in_list(const fs::path& list) {
  const Result<std::string> text = read_file(list);
  if (!text) return fail(text.error());
  std::vector<fs::path> paths;
  std::istringstream lines(*text);
  for (std::string line; std::getline(lines, line);) {
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    paths.push_back(list.parent_path() / line);  // an absolute path stays as it is
  }
  return paths;
}

Result<std::vector<fs::path>> collect_inputs(const std::vector<fs::path>& arguments) {
  std::vector<fs::path> inputs;
  std::vector<std::string> given;
  for (const fs::path& argument : arguments) {
    given.push_back(argument.string());
    std::vector<fs::path> found{argument};
    const bool is_list = argument.extension() == kListSuffix;
    if (is_list || fs::is_directory(argument)) {
      auto listed = is_list ? paths_in_list(argument) : centerline_files_in(argument);
      if (!listed) return fail(listed.error());
      found = std::move(*listed);
    }
    inputs.insert(inputs.end(), found.begin(), found.end());
  }
  if (inputs.empty()) {
    return fail({ErrorKind::kBadInput,
                 "there is no tree to seed",
                 fmt::format("{}", fmt::join(given, " ")),
                 {},
                 "give centerline files, folders of them or a .list"});
  }
  return inputs;
}

// The stem; where several inputs share it, with their suffix; where that is not enough, a number.
std::vector<std::string> names_of(const std::vector<fs::path>& inputs) {
  std::map<std::string, int> stems;
  const auto stem_of = [](const fs::path& path) {
    const fs::path whole = path.has_filename() ? path : path.parent_path();
    return whole.stem().string();
  };
  for (const fs::path& input : inputs) ++stems[stem_of(input)];
  std::set<std::string> used;
  std::vector<std::string> names;
  for (const fs::path& input : inputs) {
    std::string name = stem_of(input);
    if (stems[name] > 1 && input.has_extension())
      name += '_' + input.extension().string().substr(1);
    const std::string base = name;
    for (int k = 2; !used.insert(name).second; ++k) name = fmt::format("{}_{}", base, k);
    names.push_back(name);
  }
  return names;
}

Result<std::vector<std::string>> formats_of(const std::string& text) {
  std::vector<std::string> formats;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    if (!part.empty() && part.front() == '.') part.erase(0, 1);
    std::string path = "x.";
    path += part;
    if (const auto target = check_export_target(path); !target) return fail(target.error());
    if (std::find(formats.begin(), formats.end(), part) == formats.end()) formats.push_back(part);
  }
  return formats;
}

// The options that shape a model, as a child gets them.
std::vector<std::string> option_words(const BuildFileOptions& options) {
  const CenterlineFileOptions& reading = options.reading;
  const BuildOptions& build = options.build;
  std::vector<std::string> words{
      "--step-schema", options.writing.step_schema == StepSchema::kAp214 ? "AP214" : "AP242"};
  const auto add = [&](const char* name, const std::string& value) {
    words.insert(words.end(), {name, value});
  };
  if (reading.unit_mm) add("--unit", fmt::format("{}mm", *reading.unit_mm));
  if (reading.radius_is_diameter) words.emplace_back("--radius-is-diameter");
  if (reading.frame) add("--frame", *reading.frame == CoordinateFrame::kRas ? "RAS" : "LPS");
  if (reading.voxel_width) add("--voxel-width", fmt::format("{}", *reading.voxel_width));
  if (build.extend_inlets > 0) add("--extend-inlets", fmt::format("{}", build.extend_inlets));
  if (build.extend_outlets > 0) add("--extend-outlets", fmt::format("{}", build.extend_outlets));
  if (build.clearance) add("--clearance", fmt::format("{}", *build.clearance));
  return words;
}

// FNV-1a over everything that reading the tree may open, with the files' names.
std::string fingerprint(const fs::path& input) {
  std::uint64_t hash = 0xcbf29ce484222325ULL;
  const auto add = [&](const std::string& bytes) {
    for (const char c : bytes) {
      hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3ULL;
    }
    hash = (hash ^ bytes.size()) * 0x100000001b3ULL;
  };
  for (const fs::path& file : files_of_tree(input)) {
    add(file.filename().string());
    if (const auto bytes = read_file(file)) add(*bytes);
  }
  return fmt::format("{:016x}", hash);
}

std::vector<Job> plan_jobs(const std::vector<fs::path>& inputs,
                           const std::vector<std::string>& formats, const fs::path& folder,
                           const std::vector<std::string>& options) {
  const std::vector<std::string> names = names_of(inputs);
  std::vector<Job> jobs;
  for (std::size_t k = 0; k < inputs.size(); ++k) {
    Job job;
    job.tree.input = inputs[k];
    job.tree.name = names[k];
    for (const std::string& format : formats) {
      job.tree.files.push_back((folder / (names[k] + "." + format)).string());
    }
    job.key = fmt::format("{} {} {} {}", version(), fingerprint(inputs[k]), fmt::join(formats, ","),
                          fmt::join(options, " "));
    jobs.push_back(std::move(job));
  }
  return jobs;
}

// ---- one tree

template <typename T>
T value_or(const Json& object, const char* key, T otherwise) {
  const auto at = object.find(key);
  if (at == object.end()) return otherwise;
  const bool fits = std::is_same_v<T, bool> ? at->is_boolean() : at->is_number();
  return fits ? at->template get<T>() : otherwise;
}

// From what the program prints of a model; nothing if it made none.
std::optional<TreeFigures> figures_of(const Json& printed) {
  if (!printed.contains("branches") || !printed.contains("check")) return std::nullopt;
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const Json& check = printed["check"];
  TreeFigures figures;
  figures.branches = value_or(printed, "branches", 0);
  figures.junctions = value_or(printed, "junctions", 0);
  figures.loops = value_or(printed, "loops", 0);
  figures.failed = static_cast<int>(printed.value("failed", Json::array()).size());
  figures.solids = value_or(check, "solids", 0);
  figures.closed = value_or(check, "closed", false);
  figures.valid = value_or(check, "valid", false);
  figures.self_intersecting = value_or(check, "self_intersecting", false);
  figures.volume_mm3 = value_or(check, "volume_mm3", kNan);
  figures.max_normal_angle_deg = value_or(check, "max_normal_angle_deg", kNan);
  return figures;
}

fs::path record_of(const BatchTree& tree, const fs::path& folder) {
  return folder / (tree.name + kRecordSuffix);
}

// A tree was finished before if its record has the same key and all its files are there.
bool recall(Job& job, const fs::path& folder) {
  BatchTree& tree = job.tree;
  const auto text = read_file(record_of(tree, folder));
  if (!text) return false;
  const Json record = Json::parse(*text, nullptr, false);
  if (!record.is_object() || record.value("key", "") != job.key) return false;
  if (!record.contains("exit_code") || !record["exit_code"].is_number_integer()) return false;
  for (const std::string& file : tree.files) {
    if (!fs::exists(file)) return false;
  }

  tree.exit_code = record["exit_code"].get<int>();
  tree.figures = figures_of(record.value("figures", Json::object()));
  tree.message = record.value("message", "");
  tree.state = TreeState::kUnchanged;
  return true;
}

// The line that says why: the program's own error, else the first part that failed, else the last.
std::string message_of(const std::string& err) {
  std::string last, first_failed;
  std::istringstream lines(err);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind("angiospline: ", 0) == 0) return line.substr(13);
    if (first_failed.empty() && line.rfind("failed: ", 0) == 0) first_failed = line.substr(8);
    if (!line.empty()) last = line;
  }
  return first_failed.empty() ? last : first_failed;
}

TreeState state_of(int exit_code) {
  switch (exit_code) {
    case kSound:
      return TreeState::kDone;
    case kUnsound:
      return TreeState::kUnsound;
    case kBadInput:
      return TreeState::kRefused;
    case kStoppedOnRequest:
    case kSignal + SIGTERM:  // asked to stop before it could listen
      return TreeState::kStopped;
    default:
      return TreeState::kCrashed;
  }
}

// What became of the tree; a finished one gets its record.
Result<void> settle(Job& job, const ChildRun& run, const fs::path& folder) {
  BatchTree& tree = job.tree;
  tree.state = state_of(run.exit_code);
  tree.exit_code = tree.state == TreeState::kStopped ? kStoppedOnRequest : run.exit_code;
  tree.seconds = run.seconds;
  if (run.exit_code != kSound) tree.message = message_of(run.err);
  if (tree.state == TreeState::kCrashed && run.exit_code > kSignal) {
    tree.message = fmt::format("ended by signal {}", run.exit_code - kSignal);
  }
  Json printed = Json::parse(run.out, nullptr, false);
  if (!printed.is_object()) printed = Json::object();
  tree.figures = figures_of(printed);

  if (tree.state != TreeState::kDone && tree.state != TreeState::kUnsound) return {};
  const Json record{
      {"key", job.key},          {"input", tree.input.string()}, {"exit_code", tree.exit_code},
      {"message", tree.message}, {"files", tree.files},          {"figures", printed}};
  return write_file(record_of(tree, folder), record.dump(1, ' ') + "\n");
}

// ---- the table

std::string csv_field(const Json& value) {
  if (value.is_null()) return {};
  if (!value.is_string()) return value.dump();
  std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  for (std::size_t at = 0; (at = text.find('"', at)) != std::string::npos; at += 2) {
    text.insert(at, 1, '"');
  }
  return '"' + text + '"';
}

Result<void> write_summary(const fs::path& folder, const BatchReport& report) {
  const std::string text = json_text(report);
  const Json summary = Json::parse(text);
  std::string csv;
  const Json& rows = summary["trees"];
  for (const auto& column : rows.front().items()) {
    csv += (csv.empty() ? "" : ",") + column.key();
  }
  csv += "\n";
  for (const Json& row : rows) {
    std::string line;
    for (const auto& column : row.items()) {
      if (column.key() != rows.front().items().begin().key()) line += ',';
      line += csv_field(column.value());
    }
    csv += line + "\n";
  }
  if (auto done = write_file(folder / "summary.csv", csv); !done) return done;
  return write_file(folder / "summary.json", text + "\n");
}

// The jobs that are not finished, each as a command of the program.
struct Commands {
  std::vector<std::vector<std::string>> words;
  std::vector<std::size_t> job;  // of each
};

Commands commands_for(std::vector<Job>& jobs, const fs::path& folder, const BatchOptions& options,
                      const std::vector<std::string>& shared_words, int threads) {
  const std::string program = options.program.empty() ? own_program() : options.program;
  Commands commands;
  for (std::size_t k = 0; k < jobs.size(); ++k) {
    if (recall(jobs[k], folder)) continue;
    BatchTree& tree = jobs[k].tree;
    tree.state = TreeState::kStopped;  // until it has run
    tree.exit_code = kStoppedOnRequest;
    std::vector<std::string> command{program,  "seed",      tree.input.string(),
                                     "--json", "--threads", std::to_string(threads)};
    command.insert(command.end(), shared_words.begin(), shared_words.end());
    command.emplace_back("-o");
    command.insert(command.end(), tree.files.begin(), tree.files.end());
    commands.words.push_back(std::move(command));
    commands.job.push_back(k);
  }
  return commands;
}

}  // namespace

std::string_view to_string(TreeState state) {
  switch (state) {
    case TreeState::kDone:
      return "done";
    case TreeState::kUnchanged:
      return "unchanged";
    case TreeState::kUnsound:
      return "unsound";
    case TreeState::kRefused:
      return "refused";
    case TreeState::kCrashed:
      return "crashed";
    case TreeState::kStopped:
      break;
  }
  return "stopped";
}

std::map<std::string, int> count_states(const BatchReport& report) {
  std::map<std::string, int> states;
  for (const BatchTree& tree : report.trees) ++states[std::string(to_string(tree.state))];
  return states;
}

Result<BatchReport> build_batch(const std::vector<fs::path>& inputs, const fs::path& folder,
                                const BatchOptions& options, const Progress& progress,
                                const std::function<void(const BatchTree&)>& ended) {
  const auto formats = formats_of(options.formats);
  if (!formats) return fail(formats.error());
  const auto trees = collect_inputs(inputs);
  if (!trees) return fail(trees.error());
  std::error_code code;
  fs::create_directories(folder, code);
  if (!fs::is_directory(folder)) {
    return fail({ErrorKind::kCannotWrite, "cannot make the folder", folder.string(), {}, {}});
  }

  // Each tree is smaller than a machine: processors are shared among those built at a time.
  const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int side_by_side = options.jobs > 0 ? options.jobs : processors;
  const int threads =
      options.build.threads > 0 ? options.build.threads : std::max(1, processors / side_by_side);
  const std::vector<std::string> words = option_words(options.build);
  std::vector<Job> jobs = plan_jobs(*trees, *formats, folder, words);
  const Commands commands = commands_for(jobs, folder, options, words, threads);

  std::size_t count = 0;
  Result<void> recorded;
  run_children(commands.words, side_by_side, progress.stop_requested,
               [&](std::size_t k, const ChildRun& run) {
                 Job& job = jobs[commands.job[k]];
                 if (auto done = settle(job, run, folder); !done && recorded) recorded = done;
                 progress.at("seed", static_cast<double>(++count) /
                                         static_cast<double>(commands.words.size()));
                 if (ended) ended(job.tree);
               });

  BatchReport report;
  for (Job& job : jobs) report.trees.push_back(std::move(job.tree));
  report.stopped = progress.should_stop();
  if (auto written = write_summary(folder, report); !written) return fail(written.error());
  if (!recorded) return fail(recorded.error());
  return report;
}

}  // namespace angiospline
