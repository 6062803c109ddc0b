// What may be changed in a plan: branches leave it, junctions become one, free ends grow.
#pragma once

#include <string>

#include "modeling/build/plan.h"

namespace angiospline {

// Every change says so in Plan::warnings (but for join_through, which loses nothing) and marks the
// nodes it touches as dirty.

// Two different branches that end at node `n`, and nothing else, become one, under the names of
// both; otherwise nothing.
void join_through(Plan& plan, int n);

// Takes branch `b` out of the plan; `why` ends the sentence "branch x was left out: ...".
void drop(Plan& plan, int b, const std::string& why);

// The two junctions at the ends of branch `b` become one, at the place on the branch that is
// weighted by the sections of the branches at either side. `fits`: see AbsorbedBranch; `why` ends
// "junctions x and y became one: b ...". Requires two different nodes.
void merge(Plan& plan, int b, double fits, const std::string& why);

// The free end of branch `b` is moved outward along its last direction, by `missing_mm`. Requires
// that one of its ends is free.
void extend(Plan& plan, int b, double missing_mm);

// After a junction failed: look for directions at this multiple of the distance, or move its centre
// along the mean of its directions, by so many mean radii: seen from there they part at wider
// angles.
void reach_farther(Plan& plan, int n, double factor);
void move_forward(Plan& plan, int n, double radii);

// Or merge it with the nearest junction no farther than `radii` of the branch between them. False
// if there is none.
bool merge_with_nearest(Plan& plan, int n, double radii);

// After a body folded: its two junctions become one. False if it has not two.
bool merge_along(Plan& plan, int b);

}  // namespace angiospline
