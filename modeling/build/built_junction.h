// Junctions as a plan wants them, built or not.
#pragma once

#include <map>
#include <optional>
#include <string>

#include "base/progress.h"
#include "modeling/build/plan.h"
#include "modeling/junction/junction.h"

namespace angiospline {

// A junction that was built, for one state of the plan.
struct BuiltJunction {
  JunctionSpec spec;
  std::optional<Junction> junction;
  std::optional<Error> error;
};

using BuiltByName = std::map<std::string, BuiltJunction>;

// Whether two specifications are the same to the bit.
bool same(const JunctionSpec& a, const JunctionSpec& b);

// A junction inside which branches bend: a few settings say whether it can be had.
BuiltJunction build_bent_junction(const PlannedNode& node, JunctionOptions options,
                                  const Progress& progress);

// The junction with the options asked for; if that fails, with openings farther out. Branches that
// do not meet in a point are first taken as if they did, with the openings where they are planned:
// that is built sooner, and more often.
BuiltJunction build_junction(const PlannedNode& node, const JunctionOptions& options,
                             const Progress& progress);

}  // namespace angiospline
