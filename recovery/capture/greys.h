// Grey values around the cross-sections of a capture.
#pragma once

#include <vector>

#include "recovery/capture/stations.h"

namespace angiospline {

inline constexpr int kSectionAngles = 24;  // of a section, for grey levels and moments

// NaN outside the image.
double mean_on_ring(const GreyField& field, const CaptureStation& station, double radius_mm);
double inside_of(const GreyField& field, const CaptureStation& station);
// The lower half of what lies around: another vessel beside it does not count.
double outside_of(const GreyField& field, const CaptureStation& station);

// Grey around a station, averaged over its neighbours.
struct Disc {
  struct Cell {
    Vec2 at;
    double grey;
  };
  std::vector<Cell> cells;
  double cell_area = 1.0;
  double radius = 0.0;
};
// `reach` widens it, in multiples of what the branch started with.
Disc disc_at(const GreyField& field, const CaptureBranch& branch, std::size_t k, double reach);

// Means of the brighter and the darker part; no contrast if either has less than 2 % of them.
WallLevels two_levels(std::vector<double> greys);

}  // namespace angiospline
