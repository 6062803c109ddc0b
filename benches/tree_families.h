// Random centerline trees of the kinds that files hold, pleasant and not.
#pragma once

#include <string>
#include <vector>

#include "base/random.h"
#include "modeling/tree/centerline_tree.h"

namespace angiospline {

// One family: `make` draws a tree from it, in mm, as a reader would hand it over.
struct TreeFamily {
  std::string name;
  CenterlineTree (*make)(Random& random);
  // The input's own vessels run into each other in places: crossings are no fault of the model.
  bool may_touch = false;
};

// Murray's trees, clean, jagged and coarsely sampled; daughters thicker than their parents; steps
// of radius; branches shorter than their radius; bends as tight as the vessel; hairpins; helices;
// trifurcations; stars of eight; twigs on trunks; acute forks; loops; very long and very short
// branches; repeated points; the sizes of a capillary and of a whale's aorta.
const std::vector<TreeFamily>& tree_families();

// A caterpillar of `branches` branches (an odd number) that meets itself nowhere: a trunk that
// winds gently, with a twig at every ten radii; five points a branch.
CenterlineTree comb_tree(int branches);

// The circle of Willis as a closed graph: nine arteries in a ring with two carotids and a basilar
// artery coming in and six cerebral arteries going out. Genus 1.
CenterlineTree circle_of_willis();

}  // namespace angiospline
