// Points of a graph's branches as unknowns of one linear least-squares problem.
#pragma once

#include <array>
#include <vector>

#include "base/vector.h"

namespace angiospline {

// A chain of unknowns, head to tail; chains that share a first or last unknown meet there.
struct SmoothingChain {
  std::vector<int> unknowns;
};

// For each unknown: what was measured, how much it counts, and the wavelength of what is halved.
struct SmoothingData {
  Points3 measured;
  Eigen::VectorXd weight;      // at least one positive in every connected set of chains
  Eigen::VectorXd wavelength;  // same unit as the points
};

// The points x that minimise, summed over chains and with arc length s of the measured points,
//   integral weight |x - measured|^2 ds + integral (wavelength / 2 pi)^4 |d^2x / ds^2|^2 ds:
// a smoothing spline on the graph, free at its ends. A wave of the given wavelength keeps half its
// amplitude, one twice as long 94 %. O(unknowns). Straight, evenly measured lines do not change.
Points3 smooth_on_graph(const std::vector<SmoothingChain>& chains, const SmoothingData& data);

}  // namespace angiospline
