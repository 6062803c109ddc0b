// A junction on its way: what each of its parts' tests starts from.
#pragma once

#include <utility>
#include <vector>

#include "modeling/junction/plan_openings.h"
#include "modeling/layout/layout.h"
#include "modeling/layout/target.h"
#include "modeling/layout/topology.h"

namespace angiospline {

inline JunctionSpec sample_spec(const std::vector<Vec3>& directions,
                                const std::vector<double>& radii) {
  JunctionSpec spec;
  for (std::size_t b = 0; b < directions.size(); ++b) {
    JunctionBranch branch;
    branch.name = "abcdefgh"[b];
    branch.direction = directions[b].normalized();
    branch.radius_mm = radii[b];
    spec.branches.push_back(branch);
  }
  return spec;
}

struct SampleJunction {
  OpeningPlan plan;
  JunctionTopology topology;
  JunctionTarget target;
  JunctionLayout layout;
};

inline SampleJunction sample_junction(const JunctionSpec& spec) {
  OpeningPlan plan = plan_openings(spec, {}).value();
  JunctionTopology topology = junction_topology(plan.directions(), 0.09);
  JunctionTarget target(plan.branches, plan.blend, plan.rounding);
  JunctionLayout layout = relaxed_layout(topology, target, plan.distances);
  return {std::move(plan), std::move(topology), std::move(target), std::move(layout)};
}

// Three branches in a plane, and four that are not.
inline JunctionSpec y_spec() {
  return sample_spec({{-1, 0, 0}, {1, 1.6, 0.1}, {1.2, -1.4, 0}}, {1.0, 0.8, 0.7});
}
inline JunctionSpec four_spec() {
  return sample_spec({{1, 0.1, 0}, {-0.5, 1, 0.2}, {-0.4, -1, 0.1}, {0.1, 0.2, 1}},
                     {1.0, 0.9, 0.8, 0.6});
}

}  // namespace angiospline
