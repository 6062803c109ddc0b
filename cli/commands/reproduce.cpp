#include "recovery/thesis/experiments/reproduce.h"

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"

namespace angiospline::cli {
namespace {

using Json = nlohmann::ordered_json;

struct Arguments {
  std::vector<std::string> tables;  // none: all
  ReproduceOptions options;
  bool json = false;
};

std::string figure(const std::optional<double>& value) {
  if (!value) return "-";
  const bool whole = *value == static_cast<double>(static_cast<long long>(*value));
  return whole ? fmt::format("{:.0f}", *value) : fmt::format("{:.2f}", *value);
}

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json to_json(const ReproducedTable& table) {
  Json out{{"id", table.id}, {"title", table.title}, {"columns", table.columns}};
  out["rows"] = Json::array();
  for (const ReproducedRow& row : table.rows) {
    Json figures = Json::array();
    for (const ReproducedFigure& f : row.figures)
      figures.push_back({{"thesis", number(f.thesis)}, {"ours", number(f.ours)}});
    out["rows"].push_back({{"label", row.label}, {"figures", figures}});
  }
  out["trends"] = Json::array();
  for (const ReproducedTrend& t : table.trends)
    out["trends"].push_back({{"claim", t.claim}, {"holds", t.holds}, {"ours", t.ours}});
  out["notes"] = table.notes;
  out["seconds"] = table.seconds;
  return out;
}

// Cells are "thesis | ours"; a dash where there is no figure.
void print(const ReproducedTable& table) {
  fmt::print("\n{}: {}   (thesis | ours)\n", table.id, table.title);
  std::size_t label = 0;
  for (const ReproducedRow& row : table.rows) label = std::max(label, row.label.size());
  std::vector<std::size_t> width;
  for (const std::string& c : table.columns) width.push_back(std::max<std::size_t>(c.size(), 15));
  fmt::print("{:{}}", "", label);
  for (std::size_t c = 0; c < table.columns.size(); ++c)
    fmt::print("  {:>{}}", table.columns[c], width[c]);
  fmt::print("\n");
  for (const ReproducedRow& row : table.rows) {
    fmt::print("{:{}}", row.label, label);
    for (std::size_t c = 0; c < row.figures.size(); ++c)
      fmt::print("  {:>{}}",
                 fmt::format("{} | {}", figure(row.figures[c].thesis), figure(row.figures[c].ours)),
                 width[c]);
    fmt::print("\n");
  }
  for (const ReproducedTrend& t : table.trends)
    fmt::print("  {}: {} ({})\n", t.holds ? "holds" : "does NOT hold", t.claim, t.ours);
  for (const std::string& note : table.notes) fmt::print("  note: {}\n", note);
}

int run(const Arguments& arguments) {
  const Console console;
  const std::vector<std::string>& ids =
      arguments.tables.empty() ? reproducible_tables() : arguments.tables;
  Json all = Json::array();
  if (!arguments.json)
    fmt::print(
        "The thesis's images are not available: these are phantoms of the same sizes, shapes and "
        "noise.\n");
  for (const std::string& id : ids) {
    const auto table = reproduce_table(id, arguments.options, console.progress());
    console.finish_line();
    if (!table) return report_error(table.error());
    if (arguments.json)
      all.push_back(to_json(*table));
    else
      print(*table);
    std::fflush(stdout);
  }
  if (arguments.json)
    print_json(
        Json{{"images", "phantoms; the thesis's images are not available"}, {"tables", all}}.dump(
            1, ' '));
  return kSuccess;
}

}  // namespace

void add_reproduce(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command =
      line.command("reproduce", "the thesis's experiments on phantoms, its figures beside ours");
  command.add("TABLE", a.tables,
              "7.1 rings 7.2 7.3 7.4 7.5 cylinder potato 7.6 vessel bifurcation smoothing "
              "(default: all)");
  command.flag("--quick", a.options.quick, "a few rows and iterations only, to see that it runs");
  command.add("--random-seed", a.options.seed, "of the noise");
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
