#include "io/centerlines/centerline_export.h"

#include "base/atomic_file.h"
#include "io/centerlines/csv_centerline.h"
#include "io/centerlines/graphml_file.h"
#include "io/centerlines/swc_file.h"
#include "io/centerlines/vtp_writer.h"

namespace angiospline {

Result<void> check_centerline_target(const std::filesystem::path& path) {
  const std::string suffix = path.extension().string();
  if (suffix == ".swc" || suffix == ".csv" || suffix == ".graphml" || suffix == ".vtp") return {};
  return fail({ErrorKind::kBadInput, "unknown centerline format", path.string(), suffix,
               "one of .swc .csv .graphml .vtp"});
}

Result<void> write_centerline_file(const std::filesystem::path& path, const CenterlineTree& tree) {
  if (auto target = check_centerline_target(path); !target) return target;
  const std::string suffix = path.extension().string();
  if (suffix == ".swc") return write_file(path, swc_text(tree));
  if (suffix == ".csv") return write_file(path, csv_text(tree));
  if (suffix == ".graphml") return write_file(path, graphml_text(tree));
  return write_vtk_centerlines(path, tree);
}

}  // namespace angiospline
