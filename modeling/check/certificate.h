// What a model is, measured: closed, valid, smooth, unfolded, free of self-intersection, how large.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/progress.h"
#include "base/result.h"
#include "base/vector.h"
#include "base/warning.h"
#include "modeling/solid/solid.h"

namespace angiospline {

struct CertificateOptions {
  int samples_per_span = 16;  // intervals on each knot span, of edges and of faces' grids
  bool find_self_intersections = true;
  int most_triangles = 4'000'000;  // the mesh that is searched for self-intersections gets coarser
                                   // rather than larger
};

struct FaceCertificate {
  std::string name;
  FaceKind kind = FaceKind::kWall;
  double area_mm2 = 0.0;
};

// Two faces that meet where they should not; the same twice for a face with itself.
struct FaceCrossing {
  std::array<std::string, 2> faces;
  Vec3 at_mm = Vec3::Zero();
};

// Figures of a solid, or of whatever surfaces a file holds. "Smooth edges" are those that two wall
// faces share; the rims of caps are not among them.
struct Certificate {
  int solids = 0;
  bool closed = false;  // each edge is used twice, in opposite directions; at least one shell
  bool valid = false;   // topology and geometry agree, and every solid has positive volume
  bool self_intersecting = false;  // two parts of the surface that are not neighbours meet
  double volume_mm3 = 0.0;         // of the closed solids
  double area_mm2 = 0.0;
  Vec3 lowest_mm = Vec3::Zero();  // corners of the bounding box, tight
  Vec3 highest_mm = Vec3::Zero();
  std::vector<FaceCertificate> faces;
  int smooth_edges = 0;
  int free_edges = 0;                     // edges of one face
  double max_gap_mm = 0.0;                // between the two faces of an edge, over all shared edges
  double max_normal_angle_deg = 0.0;      // between the two faces' normals, over all smooth edges
  std::array<std::string, 2> worst_edge;  // the faces that meet at that angle; empty without one
  Vec3 worst_point_mm = Vec3::Zero();
  double min_jacobian_ratio = 0.0;  // least |Su x Sv| over its mean on the same wall face
  std::string min_jacobian_face;
  std::optional<double> max_curvature_times_radius;  // where faces know their vessel's radius
  std::string max_curvature_face;
  std::optional<int> genus;  // handles of all closed shells together; none if the surface is open
  std::vector<FaceCrossing> self_intersections;  // one for each pair of names
  double self_intersection_resolution_mm = 0.0;  // overlaps thinner than this may be missed
  int edge_samples = 0;                          // points at which gaps and angles were taken
  std::vector<Warning> warnings;
};

// The certificate of any solid. Normals and gaps are sampled on every shared edge, corners
// included, at the parameters of both faces; polynomial faces that are whole patches have volume
// and area by Gauss's rule (the volume exactly), others by adaptive quadrature (1e-9, relative).
// Linear in the number of knot spans. Errors: stopped on request; OpenCASCADE failed.
Result<Certificate> certify(const Solid& solid, const CertificateOptions& options = {},
                            const Progress& progress = {});

// The same figures for a network, without OpenCASCADE; rims count as closed by plane caps.
// Errors: the first defect of the network; stopped on request.
Result<Certificate> certify(const SurfaceNetwork& network, const CertificateOptions& options = {},
                            const Progress& progress = {});

}  // namespace angiospline
