// Vessels that touch but do not join: found on the graph, reported, cut on request.
#pragma once

#include <string_view>
#include <vector>

#include "base/progress.h"
#include "recovery/imaging/image/image.h"
#include "recovery/imaging/skeleton/vessel_graph.h"

namespace angiospline {

enum class ContactKind {
  kKissing,    // the walls of two vessels touch, at a point or over a length
  kBridge,     // something thinner than both leads across a gap: noise, or a communicating artery
  kEndToSide,  // the end of one vessel touches the side of another, or a branch is narrow where it
               // leaves
};

// "kissing", "bridge", "end_to_side", and the same in words.
std::string_view name_of(ContactKind kind);
std::string_view words_for(ContactKind kind);

// One of the two vessels of a contact: a cubic from where it enters to where it leaves, and
// straight on for three radii at both ends. A branch of it within the contact follows, straight. A
// vessel that ends there begins three quarters of a radius beyond its end, and goes on for three.
struct ContactVessel {
  Points3 axis_mm;       // sampled about half a voxel apart (a vessel that ends: a voxel)
  double radius_mm = 0;  // the mean of the distances to the wall where it enters and leaves
};

struct MaskContact {
  ContactKind kind = ContactKind::kKissing;
  Vec3 at_mm = Vec3::Zero();  // between the axes where they are nearest; an end: at its neck
  double distance_mm = 0;     // of the axes there
  ContactVessel a, b;
};

// A contact is looked for at every junction of four to eight branches and at every branch between
// two junctions from which four to eight others lead away (unless one of the two is a contact by
// itself). Of the branches that lead away two and two are taken together, so that they bend least
// and their radii agree; of more than four the rest belongs to the vessel of which it is the fewer
// radii away, and the mask (between two junctions also the branch) must be thinner between the
// vessels than 0.8 of the thinner one. Both pairs must be vessels that go through: bending by at
// most 60 degrees, radii (where they come out of the junction) within a factor of 1.7. With radii
// ra, rb and a least distance d between the axes it is
//   kKissing if 0.55 (ra + rb) <= d <= ra + rb + 1.5 voxels: nearer, the vessels do cross or fork;
//   kBridge  if d is up to 2 (ra + rb), and the branch between them, which it needs, is somewhere
//            thinner than 0.6 of the thinner vessel.
// At every other junction of three it is
//   kEndToSide if two of the branches go through, and the third comes out of a neck at their wall
//            (at most 1.5 voxels beyond it) that is thinner than 0.6 of either vessel and by a
//            voxel thinner than the third, which goes on for three radii (less is a bump).
// In the order of the graph's nodes, ends to sides last. The graph's junctions must not have been
// merged. O(nodes + arcs).
std::vector<MaskContact> find_contacts(const VesselGraph& graph, const Mask& mask);

// The mask with every contact cut: near it each voxel belongs to the vessel of whose axis it is the
// fewer radii away, and the wider vessel loses the voxels that touch (26) the other. Nothing but
// those changes.
Mask cut_contacts(Mask mask, const std::vector<MaskContact>& contacts);

}  // namespace angiospline
