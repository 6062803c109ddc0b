// The tuned numbers of contacts between vessels; contacts.h and docs/topology.md tell the rules
// they serve. Not installed.
#pragma once

#include <cstddef>
#include <numbers>

namespace angiospline::contact_rules {

// Two branches are one vessel that goes through if they bend by at most this (radians), and their
// radii agree within this factor. Wider, forks pass for contacts; narrower, bent vessels are
// missed.
constexpr double kMostBend = std::numbers::pi / 3;
constexpr double kRadiusRatio = 1.7;
constexpr double kCrossing = 0.55;      // of both radii: axes nearer than that do meet
constexpr double kTouchVoxels = 1.5;    // between walls that still touch in the mask
constexpr double kLongestBridge = 2.0;  // of both radii, between the axes
constexpr double kThinBridge = 0.6;     // of the thinner vessel: a bridge is thinner somewhere
constexpr double kOnward = 3.0;         // radii that an axis goes on straight beyond its exits
constexpr double kExit = 1.5;           // lumen radii from a junction to where a branch is itself
constexpr double kWaist = 0.8;  // of the thinner vessel, between vessels where one of them forks
constexpr std::size_t kMostExits = 8;  // of a contact: pairs are tried, of which there are n^4 / 8
constexpr double kNeck = 0.7;          // of an end at a side, against the thinner vessel
constexpr double kSearched = 6.0;      // lumen radii from a junction in which a branch is itself
constexpr double kGoesOn = 3.0;      // radii of a vessel beyond its neck, at least: less is a bump
constexpr double kEndToAxis = 0.75;  // radii from a vessel's end to where its axis begins

}  // namespace angiospline::contact_rules
