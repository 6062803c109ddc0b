#include <fmt/format.h>

#include "cli/commands.h"
#include "cli/console.h"
#include "cli/figures.h"
#include "io/centerlines/centerline_export.h"

namespace angiospline::cli {

int run_graph(const GraphArguments& arguments) {
  const Console console;
  Stopwatch watch;
  for (const std::string& path : arguments.outputs) {
    if (const auto target = check_centerline_target(path); !target) {
      return report_error(target.error());
    }
  }
  const auto first = read_image(arguments.skeleton, {}, console.progress());
  if (!first) return report_error(first.error());
  auto mask = mask_from_image(first->image, arguments.skeleton);
  if (!mask) return report_error(mask.error());

  VesselsOptions options;
  if (arguments.root_mm) options.roots_mm.push_back(*arguments.root_mm);
  options.keep_twigs = arguments.keep_twigs;
  options.cut_contacts = arguments.cut_contacts;
  if (!arguments.mask.empty()) {
    options.skeleton = std::move(*mask);
    const auto second = read_image(arguments.mask, {}, console.progress());
    if (!second) return report_error(second.error());
    mask = mask_from_image(second->image, arguments.mask);
    if (!mask) return report_error(mask.error());
  }
  watch.lap("read");
  const auto vessels = vessels_from_mask(*mask, options, console.progress());
  if (!vessels) {
    Error error = vessels.error();
    const std::string& file = arguments.mask.empty() ? arguments.skeleton : arguments.mask;
    if (error.kind != ErrorKind::kCancelled)
      error.where = error.where.empty() ? file : file + ": " + error.where;
    return report_error(error);
  }
  watch.lap("graph");
  const CenterlineTree& tree = vessels->tree;
  for (const std::string& path : arguments.outputs) {
    if (const auto written = write_centerline_file(path, tree); !written) {
      return report_error(written.error());
    }
  }
  if (arguments.table) fmt::print("{}", level_order_table(vessels->graph));
  if (arguments.json) {
    Json json = graph_json(tree);
    json["contacts"] = contacts_json(*vessels);
    json["twigs_pruned"] = vessels->twigs;
    json["seconds"] = seconds_json(watch);
    print_json(json);
  }
  for (const MaskContact& contact : vessels->contacts)
    console.say(fmt::format("note: {} at {:.4g},{:.4g},{:.4g} mm{}", words_for(contact.kind),
                            contact.at_mm.x(), contact.at_mm.y(), contact.at_mm.z(),
                            vessels->contacts_cut > 0 ? ": cut" : " (--cut-contacts parts them)"));
  console.say(fmt::format("{} nodes, {} branches, {} cycles, {} components; {} twigs pruned",
                          tree.nodes.size(), tree.branches.size(), cycle_count(tree),
                          component_count(tree), vessels->twigs));
  return kSuccess;
}

}  // namespace angiospline::cli
