// Synthetic images of known shape (the thesis's experiments, chapter 7), with their truth.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/imaging/image/image.h"

namespace angiospline {

// Shapes fill a field of view of so many mm, centred in it; voxels of 1 mm give the thesis's sizes.
enum class PhantomKind {
  kRings,        // three interlocking orthogonal rings, ring radius 40, tube radius 4; 128^3
  kCylinder,     // right cylinder, radius 10, length 50, flat ends; 64^3
  kPotato,       // a star-shaped solid with five bulges, radius 11 to 18; 64^3
  kBifurcation,  // parent of radius 14, daughters of 11 and 9 at 30 and 45 degrees to its axis;
                 // 128^3
  kBentVessel,   // a tube of radius 2.5 in an S bend; 32 x 32 x 48
  kRandomTree,   // a bifurcating tree by Murray's law
};

// How grey values go over an edge: by the filled share of each voxel, or in one step (a voxel at
// least half filled is full), as in the thesis's synthetic images.
enum class PhantomEdges { kPartialVolume, kSteps };

struct PhantomOptions {
  Vec3 spacing_mm = Vec3::Ones();     // the field of view stays; the number of voxels follows
  Mat3 direction = Mat3::Identity();  // orthonormal
  Vec3 origin_mm = Vec3::Zero();
  double background = 200.0;  // grey values; partial volumes lie between
  double vessel = 1200.0;
  PhantomEdges edges = PhantomEdges::kPartialVolume;
  // Signal to noise: (vessel - background) over the standard deviation of additive white Gaussian
  // noise; none: no noise.
  std::optional<double> snr;
  std::uint64_t seed = 1;  // of the noise and of the random tree
  // Rings only: the signal is lost in stretches this long (degrees, smooth to both sides) every 45
  // degrees, starting at `loss_phase_deg`; 0: nowhere (thesis 7.1: MR and X-ray lose at phases 22.5
  // apart).
  double loss_deg = 0.0;
  double loss_phase_deg = 0.0;
  double loss_depth = 1.0;  // share of the contrast lost there
  // Random tree only.
  double field_mm = 256.0;     // edge of the cubic field of view
  int ends = 31;               // leaves wanted, besides the root
  double radius_max_mm = 6.0;  // of the trunk
  double radius_min_mm = 1.5;  // no branch is thinner
};

struct Phantom {
  Image<std::int16_t> image;
  Mask truth;           // voxels at least half filled; signal losses do not shrink it
  CenterlineTree tree;  // empty for the potato; a ring is a branch from a node to itself
  std::string description;
};

// Error: spacing, SNR or sizes not positive; a random tree that finds no room for its ends (the
// message says how many it placed). Same options, same voxels on every machine.
Result<Phantom> make_phantom(PhantomKind kind, const PhantomOptions& options = {});

// "rings", "cylinder", "potato", "bifurcation", "bent-vessel", "tree".
std::optional<PhantomKind> phantom_kind(const std::string& name);

// The potato, in the grid's own frame: its centre, and its radius in a direction (a unit vector).
Vec3 potato_center_mm();
double potato_radius_mm(const Vec3& direction);

// The axes of the rings and the middle of each, in the grid's own frame; for projections.
struct Ring {
  Vec3 centre_mm, axis, start;  // angle 0 lies along `start`
  double ring_radius_mm, tube_radius_mm;

  Vec3 at(double angle_rad) const;  // on the centerline
};
std::vector<Ring> phantom_rings();

}  // namespace angiospline
