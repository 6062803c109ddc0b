#include "base/warning.h"

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/index.h"

namespace angiospline {
namespace {

using enum WarningCode;

// The one list of names: one is added at its place in the enum, none is ever changed or used again.
constexpr std::array kKinds = {
    WarningKind{kUnspecified, "unspecified", "the file that the warning came from gives no code"},
    WarningKind{kNoContrastAtSeeds, "no-contrast-at-seeds",
                "the vessel does not stand out around the seeds; growing uses fixed settings"},
    WarningKind{kGrowingStopped, "growing-stopped",
                "the mask is incomplete: growing reached its limit of examined voxels"},
    WarningKind{kProbableLeak, "probable-leak",
                "the mask has many loops and has probably grown out of the vessels"},
    WarningKind{kSwelling, "swelling",
                "a part of the mask behind a neck is much thicker than what leads to it"},
    WarningKind{kPointsReordered, "points-reordered",
                "points of a centerline that lead back and forth were put in order"},
    WarningKind{kBadRadius, "bad-radius",
                "a branch was left out because a radius is not positive and finite"},
    WarningKind{kBranchWithoutLength, "branch-without-length",
                "a branch whose points coincide was dropped"},
    WarningKind{kBranchInsideLumen, "branch-inside-lumen",
                "a branch that ends inside the vessel it leaves was dropped"},
    WarningKind{kRadiusReducedInBend, "radius-reduced-in-bend",
                "a vessel was made thinner in a bend that is too sharp for its radius"},
    WarningKind{kBendTooSharp, "bend-too-sharp",
                "a bend stays sharper than the vessel's radius allows; its wall may fold"},
    WarningKind{kVesselsOverlap, "vessels-overlap",
                "vessels that are not joined overlap; the solid may intersect itself there"},
    WarningKind{kMovedForClearance, "moved-for-clearance",
                "a branch was moved to keep clear of its neighbours"},
    WarningKind{kThinnedForClearance, "thinned-for-clearance",
                "a branch was made thinner to keep clear of its neighbours"},
    WarningKind{kClearanceMissing, "clearance-missing",
                "two branches stay nearer to each other than was asked for"},
    WarningKind{kBranchLeftOut, "branch-left-out",
                "a branch that cannot be modelled at its junction is not in the model"},
    WarningKind{kJunctionsMerged, "junctions-merged",
                "two junctions too near each other to have a vessel between them became one"},
    WarningKind{kBranchLengthened, "branch-lengthened",
                "a free end that lay within its junction was moved outward"},
    WarningKind{kThinnedForJunctions, "thinned-for-junctions",
                "a branch was made thinner so that the junctions near it have room"},
    WarningKind{kBranchCutAtJunction, "branch-cut-at-junction",
                "a branch has no wall of its own: it ends where its junction does"},
    WarningKind{kBranchStraightened, "branch-straightened",
                "a branch too curved for its radius was replaced by a straighter one"},
    WarningKind{kWallFolds, "wall-folds", "the wall of a branch folds over itself"},
    WarningKind{kAxisOffCenterline, "axis-off-centerline",
                "the axis of a vessel departs from its centerline by a good part of its radius"},
    WarningKind{kJunctionNotFair, "junction-not-fair",
                "a junction is smooth but lumpy, or departs from its branches"},
    WarningKind{kPiecesLeftOut, "pieces-left-out",
                "pieces of the mask were too small to be modelled"},
    WarningKind{kWallsNotFitted, "walls-not-fitted",
                "the walls have the radii of the mask, because fitting to the image failed"},
    WarningKind{kClosedPiecesNotFitted, "closed-pieces-not-fitted",
                "closed pieces stay ellipsoids, because fitting to the image failed"},
    WarningKind{kNoWallInImage, "no-wall-in-image",
                "no wall was found in the image near a part, which was left as it was"},
    WarningKind{kRegionNotRefined, "region-not-refined",
                "a part was left as it was, because refining it to the image failed"},
    WarningKind{kNoEdgeInImage, "no-edge-in-image",
                "no edge was found in the image near a part, which was left as it was"},
    WarningKind{kDeformationNotAtRest, "deformation-not-at-rest",
                "the deformation was ended before the surface came to rest"},
    WarningKind{kPartNotSmoothed, "part-not-smoothed",
                "a junction or a seam could not be made smooth and was left as it was"},
    WarningKind{kFaceNotSearched, "face-not-searched",
                "a face could not be meshed and was not searched for self-intersections"},
    WarningKind{kMeshCoarsened, "mesh-coarsened",
                "the triangle mesh is coarser than the usual tolerance to limit its size"},
    WarningKind{kMasksPlacedApart, "masks-placed-apart",
                "two masks lie at different places and were compared voxel by voxel"},
};

constexpr bool each_in_its_place() {
  for (std::size_t k = 0; k < kKinds.size(); ++k) {
    if (kKinds[k].code != static_cast<WarningCode>(k)) return false;
  }
  return kKinds.back().code == kMasksPlacedApart;  // the last of the enum
}
static_assert(each_in_its_place());

}  // namespace

std::span<const WarningKind> warning_kinds() { return kKinds; }

std::string_view name_of(WarningCode code) { return kKinds[index(static_cast<int>(code))].name; }

WarningCode warning_code(std::string_view name) {
  const auto at = std::find_if(kKinds.begin(), kKinds.end(),
                               [&](const WarningKind& kind) { return kind.name == name; });
  return at == kKinds.end() ? kUnspecified : at->code;
}

std::vector<std::string> texts_of(const std::vector<Warning>& warnings) {
  std::vector<std::string> texts;
  texts.reserve(warnings.size());
  for (const Warning& warning : warnings) texts.push_back(warning.text);
  return texts;
}

std::vector<std::string> code_names_of(const std::vector<Warning>& warnings) {
  std::vector<std::string> names;
  names.reserve(warnings.size());
  for (const Warning& warning : warnings) names.emplace_back(name_of(warning.code));
  return names;
}

}  // namespace angiospline
