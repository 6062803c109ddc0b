// Images with an analytic truth for the fit, and how far a surface is from it.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "kernel/geometry/triangle_mesh.h"
#include "modeling/network/surface_network.h"
#include "modeling/tree/centerline_tree.h"
#include "recovery/imaging/image/image.h"
#include "recovery/phantoms/phantom.h"

namespace angiospline {

struct FitPhantom {
  std::string name;
  Image<float> clean;                           // background 200, vessel 1200, partial volumes
  Mask truth;                                   // voxels at least half filled
  CenterlineTree tree;                          // what the fit starts from; empty: a closed surface
  std::function<double(const Vec3&)> distance;  // to the wall, mm, negative inside
  std::vector<Vec3> ends_mm, ends_out;          // open ends and their outward directions
  std::vector<double> end_radii_mm;
  double voxel_mm = 1.0;
};

// A wall with something small on it: a tube of radius 6 with a narrow throat (radius 3.5, deviation
// 2.5 along it), the same with a bleb (2 high, deviation 2), a ball of radius 11 with a bulge (2.5
// high, deviation 10 degrees). `there` tells the neighbourhood of it.
enum class LocalKind { kThroat, kBleb, kBulge };
struct LocalPhantom {
  FitPhantom phantom;
  std::function<bool(const Vec3&)> there;
};
LocalPhantom local_phantom(LocalKind kind);

inline constexpr double kBackground = 200, kContrast = 1000;

// The phantoms of recovery/phantoms/phantom.h; spacing in mm. The tree has 21 branches in 144 mm,
// seed 3.
FitPhantom fit_phantom(PhantomKind kind, const Vec3& spacing_mm = Vec3::Ones());

// The bent tube with another of its kind beside it, wall to wall one diameter apart. Only the first
// is modelled.
FitPhantom bent_pair();

// Noise on the clean image: white, of deviation contrast / snr (0: none).
Image<float> with_noise(const FitPhantom& phantom, double snr, std::uint64_t seed);
// The magnitude of a complex signal with such noise in both parts.
Image<float> with_rician_noise(const FitPhantom& phantom, double snr, std::uint64_t seed);
// With a background that rises by half of the contrast across the field, along its diagonal.
Image<float> with_ramp(const FitPhantom& phantom, double snr, std::uint64_t seed);

struct Accuracy {
  double mean_vox = 0, p95_vox = 0, bias_vox = 0;
};

// Over the wall's area; what lies within two voxels of an open end of the phantom, or beyond it, or
// of one of these rims, is left out, and what is not `where`.
Accuracy accuracy(const FitPhantom& phantom, const TriangleMesh& mesh,
                  const std::vector<Rim>& rims = {},
                  const std::function<bool(const Vec3&)>& where = {});

// The thesis's figure over the voxels that are not within two voxels of an open end or beyond it.
double missed_percent(const FitPhantom& phantom, const TriangleMesh& mesh);

// Marching cubes on the image smoothed by 0.6 voxel, its largest piece, at the threshold (of 15
// between 0.36 and 0.64 of the contrast) that comes nearest to the truth.
struct MarchingCubes {
  Accuracy accuracy;
  double threshold = 0;
  long points = 0, triangles = 0;
};
MarchingCubes marching_cubes(const FitPhantom& phantom, const Image<float>& image);

}  // namespace angiospline
