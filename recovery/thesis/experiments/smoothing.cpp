#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string>

#include <fmt/format.h>

#include "recovery/thesis/experiments/tables.h"
#include "recovery/thesis/smoothing/thesis_smoothing.h"

namespace angiospline::experiments {
namespace {

constexpr double kDay = 86400;

// Constraints, unknowns, iterations and seconds that the thesis states; what it only describes is
// left open.
using Stated = std::array<std::optional<double>, 4>;
Stated stated(ThesisCase which) {
  switch (which) {
    case ThesisCase::kAll:
      return {436, 726, {}, {}};
    case ThesisCase::kRough:
      return {134, 156, 10000, 4 * kDay};
    case ThesisCase::kHeld:
      return {45, 66, 10000, 45 * 60};
    case ThesisCase::kFittedHeld:
      return {45, 66, {}, {}};
    case ThesisCase::kFittedFloating:
      return {45, 102, {}, {}};
    case ThesisCase::kHeldLevel:
    case ThesisCase::kFloating:
    case ThesisCase::kFittedHeldLevel:
    case ThesisCase::kSparse:
      break;
  }
  return {};
}

// Why there is no solution, in figures.
std::string certificate(const ThesisSmoothingRow& row) {
  std::string text;
  for (const TripleSystemReport& r : row.reports) {
    if (r.ending == TripleEnding::kSmooth) continue;
    text += fmt::format(
        "; {} of {} constraints no unknown can change: residual {:.2g}, {:.3g} degrees at ends",
        r.fixed, r.constraints, r.fixed_residual, r.fixed_angle_deg);
  }
  return text;
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

  // A row for each of the thesis's systems and ours; what is left of the angle goes to the trends.
  std::map<ThesisCase, double> left_deg;
  for (const ThesisSmoothingRow& row : *rows) {
    const TripleSystemReport& one = row.reports.front();
    const Stated thesis = stated(row.which);
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

    t.notes.push_back(
        fmt::format("{}, {}: {} patches, {} system{}, {:.3g} -> {:.2g} degrees{}", row.name,
                    row.method, row.patches, row.systems, row.systems == 1 ? "" : "s",
                    largest(row, &TripleSystemReport::before_deg), after, certificate(row)));
    left_deg[row.which] = after;
  }

  // Smooth is within a hundredth of a degree everywhere.
  const double rough = left_deg[ThesisCase::kRough];
  const double level = left_deg[ThesisCase::kHeldLevel];
  const double held = left_deg[ThesisCase::kFittedHeld];
  const double floating = left_deg[ThesisCase::kFittedFloating];
  t.trends.push_back({"the six rough boundaries become smooth", rough <= 0.01,
                      fmt::format("{:.2g} degrees", rough)});
  t.trends.push_back({"the tessellation becomes smooth with boundaries held", level <= 0.01,
                      fmt::format("{:.2g} degrees, once its corners are level", level)});
  t.trends.push_back({"after a fit, held boundaries do not become smooth and floating ones do",
                      held > 0.01 && floating <= 0.01,
                      fmt::format("{:.3g} and {:.2g} degrees", held, floating)});
  return t;
}

}  // namespace angiospline::experiments
