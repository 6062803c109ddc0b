// The experiments behind reproduce_table, by chapter; nothing else includes this.
#pragma once

#include "recovery/thesis/deform/solver.h"
#include "recovery/thesis/experiments/reproduce.h"

namespace angiospline::experiments {

Result<ReproducedTable> region_growing(const ReproduceOptions& options, const Progress& progress);
Result<ReproducedTable> two_modalities(const ReproduceOptions& options, const Progress& progress);

Result<ReproducedTable> methods_and_strengths(const ReproduceOptions&, const Progress&);  // 7.2
Result<ReproducedTable> gravity_and_springs(const ReproduceOptions&, const Progress&);    // 7.3
Result<ReproducedTable> starts(const ReproduceOptions&, const Progress&);                 // 7.4
Result<ReproducedTable> fineness(const ReproduceOptions&, const Progress&);               // 7.5

Result<ReproducedTable> cylinder(const ReproduceOptions&, const Progress&);
Result<ReproducedTable> potato(const ReproduceOptions&, const Progress&);
Result<ReproducedTable> noise(const ReproduceOptions&, const Progress&);  // 7.6
Result<ReproducedTable> small_vessel(const ReproduceOptions&, const Progress&);
Result<ReproducedTable> bifurcation(const ReproduceOptions&, const Progress&);
Result<ReproducedTable> smoothing(const ReproduceOptions&, const Progress&);  // 7.2.4

// "12, 15, 18"
std::string listed(const std::vector<double>& values, int digits = 0);

}  // namespace angiospline::experiments
