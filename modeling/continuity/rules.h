// The tuned numbers of this room: what each one trades, in one place.
#pragma once

namespace angiospline::continuity_rules {

// Columns across a strip of a body, as make_body makes them: quintic without inner knots.
inline constexpr int kStripColumns = 6;
inline constexpr int kLeastStripRows = 4;  // two at each end, or both ends move one row

inline constexpr int kAngleSamplesPerSpan = 16;  // along a join, to find its largest angle
// A normal that smoothing turns by more has gone astray: the junction is refused.
inline constexpr double kMostTurnDeg = 60;

}  // namespace angiospline::continuity_rules
