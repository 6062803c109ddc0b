#include <algorithm>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "cli/outcome.h"
#include "pipeline/batch.h"
#include "pipeline/build.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

namespace fs = std::filesystem;

struct Arguments {
  std::vector<fs::path> trees;    // files, folders, or lists of them
  std::vector<fs::path> outputs;  // model files of one tree, or one folder for many
  BatchOptions options;
  bool json = false;
};

// ---- one tree

int run_one(const Arguments& arguments) {
  const Console console;
  const auto built =
      build_file(arguments.trees, arguments.outputs, arguments.options.build, console.progress());
  if (!built) return report_error(built.error());
  if (arguments.json) print_json(json_text(*built));
  console.say(to_text(built->fidelity));
  return tell_outcome(built->model, built->certificate, built->files, console);
}

// ---- many trees

std::vector<std::vector<std::string>> table_cells(const BatchReport& report) {
  std::vector<std::vector<std::string>> cells{
      {"name", "state", "branches", "junctions", "failed", "solids", "seconds", "message"}};
  for (const BatchTree& tree : report.trees) {
    const auto figure = [&](int TreeFigures::*member) {
      return tree.figures ? std::to_string((*tree.figures).*member) : std::string();
    };
    cells.push_back({tree.name, std::string(to_string(tree.state)), figure(&TreeFigures::branches),
                     figure(&TreeFigures::junctions), figure(&TreeFigures::failed),
                     figure(&TreeFigures::solids), fmt::format("{:.1f}", tree.seconds),
                     tree.message});
  }
  return cells;
}

// Words to the left, numbers to the right, columns as wide as their widest cell.
std::string text_table(const std::vector<std::vector<std::string>>& cells) {
  std::vector<std::size_t> widths(cells.front().size(), 0);
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

int exit_code_of(const BatchReport& report) {
  if (report.stopped) return kStopped;
  const bool all = std::all_of(report.trees.begin(), report.trees.end(),
                               [](const BatchTree& tree) { return tree.exit_code == kSuccess; });
  return all ? kSuccess : kFailure;
}

int run_many(const Arguments& arguments) {
  const Console console;
  const auto tell = [&](const BatchTree& tree) {
    console.say(fmt::format("{}: {}{}{}", tree.name, to_string(tree.state),
                            tree.message.empty() ? "" : ": ", tree.message));
  };
  const auto report = build_batch(arguments.trees, arguments.outputs.front(), arguments.options,
                                  console.progress(), tell);
  if (!report) return report_error(report.error());
  console.finish_line();
  if (arguments.json) {
    print_json(json_text(*report));
  } else {
    fmt::print("{}", text_table(table_cells(*report)));
  }
  return exit_code_of(*report);
}

// One output without a model's suffix, or with a folder of that name: a folder for many trees.
bool wants_batch(const Arguments& arguments) {
  if (arguments.outputs.size() != 1) return false;
  const fs::path& target = arguments.outputs.front();
  return !target.has_extension() || fs::is_directory(target);
}

int run(const Arguments& arguments) {
  return wants_batch(arguments) ? run_many(arguments) : run_one(arguments);
}

// ---- the options

void add_reading_options(const Command& command, CenterlineFileOptions& reading) {
  command.text(
      "--unit",
      [&reading](const std::string& text) -> std::optional<std::string> {
        const auto unit = parse_unit_mm(text);
        if (!unit) return unit.error().message();
        reading.unit_mm = *unit;
        return std::nullopt;
      },
      "unit of the file: m, cm, mm, um, nm, inch or a number of them, like 0.04mm");
  command.flag("--radius-is-diameter", reading.radius_is_diameter,
               "the radius column holds diameters");
  command
      .add("--voxel-width", reading.voxel_width,
           "VascuSynth only: width of a voxel in the unit of the radii")
      .positive();
  command.choose("--frame", reading.frame,
                 std::vector<std::pair<std::string, CoordinateFrame>>{
                     {"LPS", CoordinateFrame::kLps}, {"RAS", CoordinateFrame::kRas}},
                 "coordinate frame of the file: LPS or RAS");
}

void add_building_options(const Command& command, BuildOptions& build) {
  command
      .add("--extend-inlets", build.extend_inlets,
           "straight round tube added at each inlet, in diameters")
      .between(0.0, 1e3);
  command.add("--extend-outlets", build.extend_outlets, "the same at each outlet")
      .between(0.0, 1e3);
  command
      .add("--clearance", build.clearance,
           "move apart and thin vessels that come nearer than this, in radii of the thinner")
      .between(0.0, 10.0);
}

}  // namespace

void add_seed(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("seed", "from a centerline+radius file to a CAD model");
  command.alias("build");
  command
      .add("TREE", a.trees,
           "centerline file (.swc .csv ...); several .ctgr and .pth are one tree; with a "
           "folder as output: any number of files, folders of them, and lists (.list)")
      .required();
  command
      .add("-o,--output", a.outputs,
           "files to write, by suffix: .step .iges .brep .glb .stl .vtp .vtu .json .html .geo; or "
           "one folder, which gets the models of all trees and summary.csv and summary.json")
      .required();
  add_building_options(command, a.options.build.build);
  command.add("--format", a.options.formats,
              "into a folder: what to write of each tree, as in step,glb,json");
  command.add("--jobs", a.options.jobs, "into a folder: trees at a time (default: one a processor)")
      .between(1, 1024);
  command.add("--threads", a.options.build.threads, "processors used for one tree (default: all)")
      .between(1, 1024);
  add_reading_options(command, a.options.build.reading);
  command.add("--name", a.options.build.name, "product name (default: the file's name)");
  add_writing_options(command, a.options.build.writing);
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
