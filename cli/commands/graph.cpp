#include "pipeline/graph.h"

#include <memory>
#include <vector>

#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/options.h"
#include "pipeline/report_json.h"

namespace angiospline::cli {
namespace {

struct Arguments {
  std::filesystem::path skeleton;
  std::vector<std::filesystem::path> outputs;
  GraphFileOptions options;
  bool table = false;
  bool json = false;
};

int run(const Arguments& arguments) {
  const Console console;
  const auto graphed =
      graph_file(arguments.skeleton, arguments.outputs, arguments.options, console.progress());
  if (!graphed) return report_error(graphed.error());
  const Vessels& vessels = graphed->vessels;
  if (arguments.table) fmt::print("{}", level_order_table(vessels.graph));
  if (arguments.json) print_json(json_text(*graphed));

  for (const MaskContact& contact : vessels.contacts) {
    console.say(fmt::format("note: {} at {:.4g},{:.4g},{:.4g} mm{}", words_for(contact.kind),
                            contact.at_mm.x(), contact.at_mm.y(), contact.at_mm.z(),
                            vessels.contacts_cut > 0 ? ": cut" : " (--cut-contacts parts them)"));
  }
  const CenterlineTree& tree = vessels.tree;
  console.say(fmt::format("{} nodes, {} branches, {} cycles, {} components; {} twigs pruned",
                          tree.nodes.size(), tree.branches.size(), cycle_count(tree),
                          component_count(tree), vessels.twigs));
  return kSuccess;
}

}  // namespace

void add_graph(CommandLine& line) {
  const auto arguments = std::make_shared<Arguments>();
  Arguments& a = *arguments;
  const Command command = line.command("graph", "skeleton to vessel graph with radii");
  command.add("SKELETON", a.skeleton, "skeleton image, or the mask itself").required();
  command.add("--mask", a.options.mask, "mask the skeleton came from, for the radii");
  command.add("-o,--output", a.outputs, "centerline files to write: .swc .csv .graphml .vtp");
  add_vessel_options(command, a.options.vessels);
  command.flag("--keep-twigs", a.options.vessels.keep_twigs, "do not prune");
  command.flag("--table", a.table, "print the level-order table of nodes");
  add_json_flag(command, a.json);
  command.runs([arguments] { return run(*arguments); });
}

}  // namespace angiospline::cli
