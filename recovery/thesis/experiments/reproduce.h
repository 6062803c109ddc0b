// The thesis's experiments on phantoms, with its figures beside ours (chapter 7).
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"

namespace angiospline {

// A figure of the thesis and ours; either may be missing.
struct ReproducedFigure {
  std::optional<double> thesis;
  std::optional<double> ours;
};

struct ReproducedRow {
  std::string label;
  std::vector<ReproducedFigure> figures;  // one a column
};

// What the thesis says of its figures, and whether ours say the same.
struct ReproducedTrend {
  std::string claim;
  bool holds = false;
  std::string ours;  // the figures it was judged by
};

struct ReproducedTable {
  std::string id;  // "7.2", "cylinder"
  std::string title;
  std::vector<std::string> columns;
  std::vector<ReproducedRow> rows;
  std::vector<ReproducedTrend> trends;
  std::vector<std::string> notes;
  double seconds = 0.0;
};

// 7.1 and rings (region growing), 7.2 to 7.5 (contours), cylinder, potato, 7.6 (noise), vessel,
// bifurcation (surfaces), smoothing (7.2.4): in this order.
const std::vector<std::string>& reproducible_tables();

struct ReproduceOptions {
  bool quick = false;      // fewer rows and iterations: whether it runs, not what it says
  std::uint64_t seed = 1;  // of the noise
};

// The table of this id. The thesis's images are not available: ours are phantoms of the same sizes,
// shapes and noise, the same on every machine. Errors: an unknown id (lists those known);
// kCancelled; those of the verbs that it runs.
Result<ReproducedTable> reproduce_table(const std::string& id, const ReproduceOptions& options = {},
                                        const Progress& progress = {});

}  // namespace angiospline
