// How true a model is to the tree it was seeded from: radii of its cross-sections, its axis, and
// what smoothing moved.
#pragma once

#include <string>

#include "modeling/network/surface_network.h"
#include "modeling/tree/smooth_centerlines.h"

namespace angiospline {

// Relative errors of radii are parts of the smoothed radius; offsets are in smoothed radii.
struct Fidelity {
  // Cross-sections of the bodies at right angles to the smoothed paths, one a radius.
  int sections = 0;
  int near_junctions = 0;  // of those: within two radii of a junction's opening
  int missed = 0;          // places within a body's reach where no closed section was found

  // Away from junctions: |sqrt(area / pi) - r| / r.
  double mean_radius_error = 0.0;
  double largest_radius_error = 0.0;
  int far_off = 0;  // sections more than 5 % off
  std::string largest_error_branch;
  Vec3 largest_error_at_mm = Vec3::Zero();

  double largest_radius_error_near_junctions = 0.0;

  // The distance of a section's centroid from the path; all sections.
  double mean_axis_offset = 0.0;
  double largest_axis_offset = 0.0;
  std::string largest_offset_branch;

  // The distance of the input's points from their smoothed path, before vessels were kept apart.
  double largest_move_mm = 0.0;
  double largest_move_radii = 0.0;
  double mean_move_radii = 0.0;
  std::string largest_move_branch;

  // How far keeping vessels apart moved the paths on from there, and the distance of the input's
  // points from where they are then. The latter is the largest move where nothing was kept apart.
  double largest_clearance_move_radii = 0.0;
  std::string largest_clearance_move_branch;
  double largest_total_move_mm = 0.0;
  double largest_total_move_radii = 0.0;
  std::string largest_total_move_branch;
};

// Bodies are the regions called "wall_<branch>". A branch that became part of a junction has none
// and no sections. O(length / radius) for each branch. Requires find_defect(network) == nullopt.
Fidelity measure_fidelity(const SurfaceNetwork& network, const SmoothedTree& tree);

// Two lines for a person, without a line feed at the end.
std::string to_text(const Fidelity& fidelity);

}  // namespace angiospline
