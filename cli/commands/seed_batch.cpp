// Many trees into one folder: each in a process of its own, a record beside its files, one table.
#include <algorithm>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <sstream>
#include <thread>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/atomic_file.h"
#include "cli/child_process.h"
#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "io/centerlines/centerline_file.h"
#include "io/export/export_model.h"

namespace angiospline::cli {
namespace {

namespace fs = std::filesystem;

constexpr const char* kListSuffix = ".list";
constexpr const char* kRecordSuffix = ".seed.json";  // beside the files of each finished tree

struct Job {
  fs::path input;
  std::string name;                // of its files in the folder
  std::vector<std::string> files;  // to be written
  std::string key;                 // of the input's bytes, the options and the program
  std::string state;  // "done", "unchanged", "unsound", "refused", "crashed", "stopped"
  int exit_code = -1;
  double seconds = 0.0;
  std::string message;
  Json figures;  // what seed --json says of it
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

Result<std::vector<fs::path>> collect_inputs(const std::vector<std::string>& arguments) {
  std::vector<fs::path> inputs;
  for (const fs::path argument : arguments) {
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
                 fmt::format("{}", fmt::join(arguments, " ")),
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
std::vector<std::string> option_words(const SeedArguments& a) {
  std::vector<std::string> words{"--step-schema", a.step_schema};
  if (!a.reading.unit.empty()) words.insert(words.end(), {"--unit", a.reading.unit});
  if (a.reading.radius_is_diameter) words.emplace_back("--radius-is-diameter");
  if (!a.reading.frame.empty()) words.insert(words.end(), {"--frame", a.reading.frame});
  if (a.reading.voxel_width) {
    words.insert(words.end(), {"--voxel-width", fmt::format("{}", *a.reading.voxel_width)});
  }
  if (a.extend_inlets > 0) {
    words.insert(words.end(), {"--extend-inlets", fmt::format("{}", a.extend_inlets)});
  }
  if (a.extend_outlets > 0) {
    words.insert(words.end(), {"--extend-outlets", fmt::format("{}", a.extend_outlets)});
  }
  if (a.clearance) words.insert(words.end(), {"--clearance", fmt::format("{}", *a.clearance)});
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
    job.input = inputs[k];
    job.name = names[k];
    for (const std::string& format : formats) {
      job.files.push_back((folder / (job.name + "." + format)).string());
    }
    job.key = fmt::format("{} {} {} {}", ANGIOSPLINE_VERSION, fingerprint(job.input),
                          fmt::join(formats, ","), fmt::join(options, " "));
    jobs.push_back(std::move(job));
  }
  return jobs;
}

// ---- one tree

// A tree was finished before if its record has the same key and all its files are there.
bool recall(Job& job, const fs::path& folder) {
  const auto text = read_file(folder / (job.name + kRecordSuffix));
  if (!text) return false;
  const Json record = Json::parse(*text, nullptr, false);
  if (!record.is_object() || record.value("key", "") != job.key) return false;
  if (!record.contains("exit_code") || !record["exit_code"].is_number_integer()) return false;
  for (const std::string& file : job.files) {
    if (!fs::exists(file)) return false;
  }
  job.exit_code = record["exit_code"].get<int>();
  job.figures = record.value("figures", Json::object());
  job.message = record.value("message", "");
  job.state = "unchanged";
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

// What became of the tree; a finished one gets its record.
Result<void> settle(Job& job, const ChildRun& run, const fs::path& folder) {
  job.exit_code = run.exit_code;
  job.seconds = run.seconds;
  if (run.exit_code != kSuccess) job.message = message_of(run.err);
  job.figures = Json::parse(run.out, nullptr, false);
  if (!job.figures.is_object()) job.figures = Json::object();
  switch (run.exit_code) {
    case kSuccess:
      job.state = "done";
      break;
    case kFailure:
      job.state = "unsound";
      break;
    case kBadInput:
      job.state = "refused";
      break;
    case kStopped:
    case 128 + SIGTERM:  // asked to stop before it could listen
      job.exit_code = kStopped;
      job.state = "stopped";
      break;
    default:
      job.state = "crashed";
      if (run.exit_code > 128) job.message = fmt::format("ended by signal {}", run.exit_code - 128);
  }
  if (job.exit_code != kSuccess && job.exit_code != kFailure) return {};
  const Json record{
      {"key", job.key},         {"input", job.input.string()}, {"exit_code", job.exit_code},
      {"message", job.message}, {"files", job.files},          {"figures", job.figures}};
  return write_file(folder / (job.name + kRecordSuffix), record.dump(1, ' ') + "\n");
}

// ---- the table

Json row_of(const Job& job) {
  const Json figures = job.figures.is_object() ? job.figures : Json::object();  // null: not run
  const Json check = figures.value("check", Json::object());
  const Json failed = figures.value("failed", Json::array());
  return {{"name", job.name},
          {"input", job.input.string()},
          {"state", job.state},
          {"exit_code", job.exit_code},
          {"branches", figures.value("branches", Json())},
          {"junctions", figures.value("junctions", Json())},
          {"loops", figures.value("loops", Json())},
          {"failed", figures.empty() ? Json() : Json(failed.size())},
          {"solids", check.value("solids", Json())},
          {"closed", check.value("closed", Json())},
          {"valid", check.value("valid", Json())},
          {"self_intersecting", check.value("self_intersecting", Json())},
          {"volume_mm3", check.value("volume_mm3", Json())},
          {"max_normal_angle_deg", check.value("max_normal_angle_deg", Json())},
          {"seconds", job.seconds},
          {"message", job.message}};
}

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

constexpr const char* kColumns[] = {"name",   "state",  "branches", "junctions",
                                    "failed", "solids", "seconds",  "message"};

std::string text_table(const Json& rows) {
  std::vector<std::vector<std::string>> cells{{std::begin(kColumns), std::end(kColumns)}};
  for (const Json& row : rows) {
    std::vector<std::string>& line = cells.emplace_back();
    for (const char* column : kColumns) {
      const Json& value = row[column];
      line.push_back(value.is_number_float() ? fmt::format("{:.1f}", value.get<double>())
                     : value.is_string()     ? value.get<std::string>()
                                             : csv_field(value));
    }
  }
  std::vector<std::size_t> widths(std::size(kColumns), 0);
  for (const auto& line : cells) {
    for (std::size_t c = 0; c < line.size(); ++c) widths[c] = std::max(widths[c], line[c].size());
  }
  std::string text;
  for (const auto& line : cells) {
    std::string row;
    for (std::size_t c = 0; c < line.size(); ++c) {
      const bool is_number = c >= 2 && c + 1 < line.size();
      row += is_number ? fmt::format("{:>{}}  ", line[c], widths[c])
                       : fmt::format("{:<{}}  ", line[c], widths[c]);
    }
    row.erase(row.find_last_not_of(' ') + 1);
    text += row + "\n";
  }
  return text;
}

Result<void> write_summary(const fs::path& folder, const Json& summary) {
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
  return write_file(folder / "summary.json", summary.dump(1, ' ') + "\n");
}

int exit_code_of(const std::vector<Job>& jobs, bool stopped) {
  if (stopped) return kStopped;
  const bool all = std::all_of(jobs.begin(), jobs.end(),
                               [](const Job& job) { return job.exit_code == kSuccess; });
  return all ? kSuccess : kFailure;
}

}  // namespace

int run_seed_batch(const SeedArguments& arguments) {
  const Console console;
  const Progress progress = console.progress();
  const fs::path folder = arguments.outputs.front();
  const auto formats = formats_of(arguments.formats);
  if (!formats) return report_error(formats.error());
  const auto inputs = collect_inputs(arguments.trees);
  if (!inputs) return report_error(inputs.error());
  std::error_code code;
  fs::create_directories(folder, code);
  if (!fs::is_directory(folder)) {
    return report_error(
        {ErrorKind::kCannotWrite, "cannot make the folder", folder.string(), {}, {}});
  }
  const std::vector<std::string> options = option_words(arguments);
  std::vector<Job> jobs = plan_jobs(*inputs, *formats, folder, options);

  const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  const int side_by_side = arguments.jobs > 0 ? arguments.jobs : processors;
  const int threads =
      arguments.threads > 0 ? arguments.threads : std::max(1, processors / side_by_side);
  std::vector<std::vector<std::string>> commands;
  std::vector<std::size_t> job_of;
  for (std::size_t k = 0; k < jobs.size(); ++k) {
    if (recall(jobs[k], folder)) continue;
    jobs[k].state = "stopped";  // until it has run
    jobs[k].exit_code = kStopped;
    std::vector<std::string> command{own_program(), "seed",      jobs[k].input.string(),
                                     "--json",      "--threads", std::to_string(threads)};
    command.insert(command.end(), options.begin(), options.end());
    command.emplace_back("-o");
    command.insert(command.end(), jobs[k].files.begin(), jobs[k].files.end());
    commands.push_back(std::move(command));
    job_of.push_back(k);
  }
  std::size_t ended = 0;
  Result<void> recorded;
  run_children(commands, side_by_side, progress.stop_requested,
               [&](std::size_t k, const ChildRun& run) {
                 Job& job = jobs[job_of[k]];
                 if (auto done = settle(job, run, folder); !done && recorded) recorded = done;
                 progress.at("seed", static_cast<double>(++ended) / double(commands.size()));
                 console.say(fmt::format("{}: {}{}{}", job.name, job.state,
                                         job.message.empty() ? "" : ": ", job.message));
               });
  Json rows = Json::array();
  std::map<std::string, int> states;
  for (const Job& job : jobs) {
    rows.push_back(row_of(job));
    ++states[job.state];
  }
  const Json summary{{"trees", rows}, {"states", states}};
  if (const auto written = write_summary(folder, summary); !written) {
    return report_error(written.error());
  }
  if (!recorded) return report_error(recorded.error());
  console.finish_line();
  if (arguments.json) {
    print_json(summary);
  } else {
    fmt::print("{}", text_table(rows));
  }
  return exit_code_of(jobs, progress.should_stop());
}

}  // namespace angiospline::cli
