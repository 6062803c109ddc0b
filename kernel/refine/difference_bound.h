// How far two splines over the same domain are apart. Not part of the installed interface.
#pragma once

#include "kernel/spline/knot_vector.h"

namespace angiospline {

// Control points are blocks of `stride` doubles, in groups of `group` that are measured in the
// Euclidean norm. The longest group of one block, squared.
double largest_squared(const double* block, int stride, int group);

// Whether the knots outside the open domain are the same.
bool same_ends(const KnotVector& a, const KnotVector& b);

// No point of the difference of two splines of one degree over one domain is longer than this:
// control polygon of the difference over all knots of both and, where that is above `enough`, with
// the spans concerned cut in four. Ends that float differently are clamped first.
double difference_bound(const KnotVector& a_knots, const double* a, const KnotVector& b_knots,
                        const double* b, int stride, int group, double enough);

}  // namespace angiospline
