// The thesis's smoothing experiments (7.2.4), its figures beside ours.
// bench_thesis_smoothing [SECONDS]: the most that one system may take (20).
#include <algorithm>
#include <cstdlib>
#include <string>

#include <fmt/core.h>

#include "recovery/thesis/smoothing/thesis_smoothing.h"

int main(int argc, char** argv) {
  using namespace angiospline;
  const auto rows = run_thesis_smoothing(argc > 1 ? std::atof(argv[1]) : 20.0);
  if (!rows) {
    fmt::print(stderr, "{}\n", rows.error().message());
    return 1;
  }
  fmt::print(
      "| case | thesis | patches | systems | constraints (independent) | unknowns | evaluations | "
      "s | angle "
      "before -> after, degrees | moved, radii | all boundaries after | fixed: constraints, "
      "residual, "
      "degrees at ends |\n"
      "|---|---|---|---|---|---|---|---|---|---|---|---|\n");
  for (const ThesisSmoothingRow& row : *rows) {
    for (const TripleSystemReport& r : row.reports) {
      const std::string counts = r.constraints == 0
                                     ? std::string("- | - | -")
                                     : fmt::format("{} ({}) | {} | {}", r.constraints,
                                                   r.independent, r.unknowns, r.evaluations);
      const std::string fixed = r.fixed == 0 ? std::string("-")
                                             : fmt::format("{}, {:.2g}, {:.3g}", r.fixed,
                                                           r.fixed_residual, r.fixed_angle_deg);
      fmt::print(
          "| {}: {} | {} | {} | {} | {} | {:.2f} | {:.3g} -> {:.2g} | {:.3f} | {:.2g} | {} |\n",
          row.name, row.method, row.thesis, row.patches, row.systems, counts, r.seconds,
          r.before_deg, r.after_deg, r.moved_mm, row.after_deg, fixed);
    }
  }
}
