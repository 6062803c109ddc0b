// Vessels that touch but do not join: found on the graph, reported, cut on request.
#pragma once

#include <vector>

#include "base/progress.h"
#include "recovery/image.h"
#include "recovery/vessel_graph.h"

namespace angiospline {

enum class ContactKind {
  kKissing,  // the walls of two vessels touch, at a point or over a length
  kBridge,   // something thinner than both leads across a gap: noise, or a communicating artery
};

// One of the two vessels of a contact: a cubic from where it enters to where it leaves, and
// straight on for three radii at both ends.
struct ContactVessel {
  Points3 axis_mm;       // evenly sampled, about half a voxel apart
  double radius_mm = 0;  // the mean of the distances to the wall where it enters and leaves
};

struct VesselContact {
  ContactKind kind = ContactKind::kKissing;
  Vec3 at_mm = Vec3::Zero();  // between the axes where they are nearest to each other
  double distance_mm = 0;     // of the axes there
  ContactVessel a, b;
};

// A contact is looked for at every junction of four branches and at every branch between two
// junctions of three. Of the four branches that lead away, two and two are taken together, so that
// they bend least and their radii agree. Both pairs must be vessels that go through: bending by at
// most 60 degrees, radii (where they come out of the junction) within a factor of 1.7. With radii
// ra, rb and a least distance d between the axes it is
//   kKissing if 0.55 (ra + rb) <= d <= ra + rb + 1.5 voxels: nearer, the vessels do cross or fork;
//   kBridge  if d is up to 2 (ra + rb), and the branch between them, which it needs, is somewhere
//            thinner than 0.6 of the thinner vessel.
// In the order of the graph's nodes. The graph's junctions must not have been merged. O(nodes +
// arcs).
std::vector<VesselContact> find_contacts(const VesselGraph& graph, const Mask& mask);

// The mask with every contact cut: near it each voxel belongs to the vessel of whose axis it is the
// fewer radii away, and the wider vessel loses the voxels that touch (26) the other. Nothing but
// those changes.
Mask cut_contacts(Mask mask, const std::vector<VesselContact>& contacts);

}  // namespace angiospline
