// The thesis's own smoothing experiments (7.2.4), set up and run: a bifurcation with its three
// vessel bodies, 12 patches and 21 shared boundaries of which 6 are rough.
#pragma once

#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/network/surface_network.h"
#include "recovery/thesis/smoothing/triple_smoothing.h"

namespace angiospline {

// The bifurcation: one junction of three branches, radius `radius_mm` and less, each with a
// straight body of two patches. Joins come in the order legs, saddles, seams, openings.
struct ThesisBifurcation {
  SurfaceNetwork network;
  std::vector<int> rough;  // the six joins from the openings to the poles
};
Result<ThesisBifurcation> thesis_bifurcation();

// The same shape with each junction patch cut into four, and the parts of the rough boundaries
// around each pole: two systems of three boundaries.
struct ThesisTessellation {
  SurfaceNetwork network;
  std::vector<std::vector<int>> systems;
};
ThesisTessellation tessellated(const ThesisBifurcation& bifurcation);

// Levels every corner at which a boundary of the systems ends (corner_tangents.h): without it the
// held curves' own tangents forbid a common tangent plane there. The farthest move of a point, mm.
double flatten_corners(ThesisTessellation& tessellation);

enum class ThesisCase {
  kAll,
  kRough,
  kHeld,
  kHeldLevel,  // not the thesis's: kHeld after flatten_corners
  kFloating,
  kFittedHeld,
  kFittedHeldLevel,
  kFittedFloating,
  kSparse,
};

// A row of the comparison. Figures of the thesis are text, as it prints them; ours are the sums and
// largest values over the case's systems.
struct ThesisSmoothingRow {
  ThesisCase which = ThesisCase::kAll;
  std::string name;
  std::string thesis;  // "134 constraints, 156 unknowns, 10,000 iterations, 4 days"
  std::string method;  // "SLSQP on triple curves", "sparse cofactor form"
  int patches = 0;
  int systems = 0;
  std::vector<TripleSystemReport> reports;  // one for each system; of the sparse form: one
  double before_deg = 0.0;                  // over all shared boundaries of the model
  double after_deg = 0.0;
};

// Every case of ThesisCase, in that order: all 21 boundaries; the 6 rough ones; the tessellation
// with boundaries held, held after its corners were levelled, and floating; the same three moved at
// random as a fit would; and, for comparison, all boundaries by the sparse form. `most_seconds`
// bounds each system. Errors: stopped on request.
Result<std::vector<ThesisSmoothingRow>> run_thesis_smoothing(double most_seconds = 20.0,
                                                             const Progress& progress = {});

}  // namespace angiospline
