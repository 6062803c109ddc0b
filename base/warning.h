// Reservations about a result that is there all the same: a stable code and a text for a person.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace angiospline {

// What a warning is about, in the order in which a model comes into being. Scripts and
// docs/troubleshooting.md know a code by its name, which never changes and is never given to
// another meaning; warning.cpp holds the names.
enum class WarningCode {
  kUnspecified,  // of a model file that was written without codes, or with ones not known here
  // An image becomes a mask.
  kNoContrastAtSeeds,
  kGrowingStopped,
  kProbableLeak,
  kSwelling,
  // A centerline tree is cleaned, smoothed and moved clear of itself.
  kPointsReordered,
  kBadRadius,
  kBranchWithoutLength,
  kBranchInsideLumen,
  kRadiusReducedInBend,
  kBendTooSharp,
  kVesselsOverlap,
  kMovedForClearance,
  kThinnedForClearance,
  kClearanceMissing,
  // A surface is planned and built.
  kBranchLeftOut,
  kJunctionsMerged,
  kBranchLengthened,
  kThinnedForJunctions,
  kBranchCutAtJunction,
  kBranchStraightened,
  kWallFolds,
  kAxisOffCenterline,
  kJunctionNotFair,
  // A surface is fitted to an image.
  kPiecesLeftOut,
  kWallsNotFitted,
  kClosedPiecesNotFitted,
  kNoWallInImage,
  kRegionNotRefined,
  // The thesis's deformation and smoothing.
  kNoEdgeInImage,
  kDeformationNotAtRest,
  kPartNotSmoothed,
  // A solid is measured and written.
  kFaceNotSearched,
  kMeshCoarsened,
  // Two masks are compared.
  kMasksPlacedApart,
};

struct Warning {
  WarningCode code = WarningCode::kUnspecified;
  std::string text;  // one line that names the vessel or the part and its figures

  friend bool operator==(const Warning&, const Warning&) = default;
};

// A code with its name, in lower case with hyphens ("vessels-overlap"), and one line that says what
// it means for every warning that bears it.
struct WarningKind {
  WarningCode code;
  std::string_view name;
  std::string_view meaning;
};

// Every code there is, in the order of the enum.
std::span<const WarningKind> warning_kinds();

// The name of a code.
std::string_view name_of(WarningCode code);

// The code of a name; kUnspecified for one that is not known.
WarningCode warning_code(std::string_view name);

// The texts, and the names of the codes, one for each warning in its order.
std::vector<std::string> texts_of(const std::vector<Warning>& warnings);
std::vector<std::string> code_names_of(const std::vector<Warning>& warnings);

}  // namespace angiospline
