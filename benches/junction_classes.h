// Random junctions of the classes a vessel tree can ask for.
#pragma once

#include <string>
#include <vector>

#include "base/random.h"
#include "modeling/junction/junction.h"

namespace angiospline {

// One family: `make` draws a junction from it.
struct JunctionClass {
  std::string name;
  JunctionSpec (*make)(Random& random);
};

// ordinary, acute, one-sided 3 and 4, cone 3, random 4, 5, 6 and 8, twig, collinear, planar.
const std::vector<JunctionClass>& junction_classes();

}  // namespace angiospline
