#include <algorithm>
#include <array>
#include <optional>

#include <fmt/format.h>

#include "modeling/thesis_smoothing.h"
#include "recovery/deform_experiments_tables.h"

namespace angiospline::experiments {
namespace {

// Constraints, unknowns, iterations and seconds that the thesis states for its cases, in the order
// of run_thesis_smoothing; what it only describes is left open.
using Stated = std::array<std::optional<double>, 4>;
constexpr double kDay = 86400;
constexpr std::array<Stated, 4> kStated{
    {{436, 726, {}, {}}, {134, 156, 10000, 4 * kDay}, {45, 66, 10000, 45 * 60}, {}}};
constexpr Stated kHeld{45, 66, {}, {}};
constexpr Stated kFloating{45, 102, {}, {}};

Stated stated(std::size_t row) {
  if (row < kStated.size()) return kStated[row];
  return row == 4 ? kHeld : row == 5 ? kFloating : Stated{};
}

double largest(const ThesisSmoothingRow& row, double TripleSystemReport::*figure) {
  double most = 0;
  for (const TripleSystemReport& r : row.reports) most = std::max(most, r.*figure);
  return most;
}

}  // namespace

Result<ReproducedTable> smoothing(const ReproduceOptions& options, const Progress& progress) {
  const auto rows = run_thesis_smoothing(options.quick ? 2.0 : 30.0, progress);
  if (!rows) return fail(rows.error());
  ReproducedTable t;
  t.columns = {"constraints", "unknowns", "iterations", "seconds"};
  double rough = 0, held = 0, floating = 0;
  for (std::size_t k = 0; k < rows->size(); ++k) {
    const ThesisSmoothingRow& row = (*rows)[k];
    const TripleSystemReport& one = row.reports.front();
    const Stated thesis = stated(k);
    const double after = largest(row, &TripleSystemReport::after_deg);
    const bool counted = one.constraints > 0;
    const auto ours = [&](int value) {
      return counted ? std::optional<double>(value) : std::nullopt;
    };
    t.rows.push_back({fmt::format("{}, {}", row.name, row.method),
                      {{thesis[0], ours(one.constraints)},
                       {thesis[1], ours(one.unknowns)},
                       {thesis[2], ours(one.evaluations)},
                       {thesis[3], largest(row, &TripleSystemReport::seconds)}}});
    t.notes.push_back(fmt::format("{}, {}: {} patches, {} system{}, {:.3g} -> {:.2g} degrees",
                                  row.name, row.method, row.patches, row.systems,
                                  row.systems == 1 ? "" : "s",
                                  largest(row, &TripleSystemReport::before_deg), after));
    if (k == 1) rough = after;
    if (k == 4) held = after;
    if (k == 5) floating = after;
  }
  t.trends.push_back({"the six rough boundaries become smooth", rough <= 0.01,
                      fmt::format("{:.2g} degrees", rough)});
  t.trends.push_back({"after a fit, held boundaries do not become smooth and floating ones do",
                      held > 0.01 && floating <= 0.01,
                      fmt::format("{:.3g} and {:.2g} degrees", held, floating)});
  return t;
}

}  // namespace angiospline::experiments
