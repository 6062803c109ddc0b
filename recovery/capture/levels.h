// Grey levels along the branches of a capture, and whether its sections lie on the vessels.
#pragma once

#include <vector>

#include "recovery/capture/stations.h"

namespace angiospline {

// Sets the levels at each station: the mean over the measured stations around it, twelve radii to
// either side for the inside, six for the outside; NaN where the image has neither. O(stations^2).
void measure_levels(const GreyField& field, CaptureBranch& branch);

// Of all measured stations together: the brighter ones' inside, the middle one's outside.
WallLevels levels_of_stations(const std::vector<CaptureBranch>& branches);

// Puts the common levels where a branch's own are not finite or hardly differ.
void fill_levels(const WallLevels& common, CaptureBranch& branch);

// Deviation of the greys around the stations from their medians: noise, and what else is there.
double noise_around(const GreyField& field, const std::vector<CaptureBranch>& branches);

// For a tree that lies beside its vessels, or wholly inside them: two means of grey in discs around
// all stations, the smallest discs in which they differ about as much as in any.
struct DiscLevels {
  WallLevels levels;
  double reach = 1.0;  // of those discs, in multiples of their usual size
};
DiscLevels look_around(const GreyField& field, const std::vector<CaptureBranch>& branches);

// Sets the branch's evidence: how much greys fall across its sections' rims in the mean, over the
// common contrast; 1 on the vessel's wall, 0 away from it. 1 where no section can be measured: such
// a branch is led by its neighbours.
void set_evidence(const GreyField& field, const WallLevels& common, CaptureBranch& branch);

}  // namespace angiospline
