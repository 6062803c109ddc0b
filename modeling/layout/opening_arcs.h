// A circle as a chain of polynomial quintic arcs, one for each sector.
#pragma once

#include <vector>

#include <Eigen/Core>

namespace angiospline {

// The six control points of one arc in the plane of a unit circle.
using QuinticArc = Eigen::Matrix<double, 2, 6>;

// Arcs between the azimuths seams[k] and seams[k + 1] (the last one back to seams[0] + 2 pi).
// They start and end on the circle, tangent to it, and neighbours meet with equal derivatives; the
// inner points are fitted. Radial error: 1.8e-6 of the radius for two equal sectors, and falling
// with the sixth power of the angle for more; unequal sectors cost accuracy because the derivative
// at a seam is the mean of what either arc alone would choose (see largest_radial_error). Requires
// at least two seams, increasing, less than a turn apart.
std::vector<QuinticArc> opening_arcs(const std::vector<double>& seams_rad);

// Largest | |c(t)| - 1 | over an arc, sampled at 65 parameters.
double largest_radial_error(const QuinticArc& arc);

}  // namespace angiospline
