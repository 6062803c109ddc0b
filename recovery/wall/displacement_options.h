// How a wall's displacement is measured and smoothed (recovery/wall/displacement.h).
#pragma once

#include <vector>

namespace angiospline {

struct DisplacementOptions {
  std::vector<double> half_windows_vox{1.5, 0.75};  // of the profile, one for each round
  // Waves that are tried, in multiples of the rule's own.
  std::vector<double> wave_factors{0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0};
  double largest_move_radii = 0.5;  // of any node from where the mesh has it
};

}  // namespace angiospline
