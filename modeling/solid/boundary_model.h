// Faces, edges and their parameters as measuring needs them, whether they come from a surface
// network or from OpenCASCADE.
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/result.h"
#include "base/warning.h"
#include "kernel/evaluate/curvature.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"
#include "modeling/network/surface_network.h"
#include "modeling/solid/solid.h"

namespace angiospline {

// Triangles of a face, for faces that are not whole patches; `points` are columns of
// BoundaryModel::mesh_points.
struct FaceTriangles {
  std::vector<std::array<int, 3>> triangles;  // counter-clockwise seen from outside
  std::vector<Vec2> parameters;               // where on the surface samples are taken
};

struct BoundaryFace {
  std::string name;
  FaceKind kind = FaceKind::kWall;
  double radius_mm = 0.0;
  bool reversed = false;  // the outward normal is -(Su x Sv)
  int shell = 0;
  int loops = 1;  // closed wires around it

  // One of the three:
  std::shared_ptr<const BSplineSurface<3>> patch;  // a polynomial patch
  std::optional<std::pair<Vec3, Vec3>> plane;      // a plane: a point of it and its outward normal
  std::function<SurfaceJet(double, double)> jet;   // anything else

  bool is_whole = false;  // the face is all of its patch, and its edges lie on the patch's sides

  // For faces that are neither whole patches nor planes between splines.
  double u_reference = 0.0;                           // area is integrated along u from here
  std::vector<double> u_breaks;                       // where the surface is less smooth
  std::optional<std::pair<Vec3, Vec3>> bounding_box;  // lowest, highest
  FaceTriangles mesh;
};

// A point of an edge, in space or in a face's parameters, and its derivative.
template <typename Vector>
struct EdgePoint {
  Vector at, derivative;
};

// How an edge lies on a face.
struct EdgeUse {
  int face = -1;
  bool forward = true;  // the loop of the face runs along the edge
  // On a whole patch: the side, and its parameters at the edge's ends.
  bool on_side = false;
  PatchSide side = PatchSide::kU0;
  double side_from = 0.0;
  double side_to = 1.0;
  // Otherwise the parameters on the face, or nothing on planes.
  std::function<EdgePoint<Vec2>(double)> parameters;
};

struct BoundaryEdge {
  double from = 0.0;
  double to = 1.0;
  int first_vertex = -1;
  int last_vertex = -1;
  bool is_degenerate = false;                    // a point
  std::function<EdgePoint<Vec3>(double)> point;  // empty for degenerate edges
  std::vector<double> breaks;  // from `from` to `to`: between them the curve is smooth
  std::vector<EdgeUse> uses;
};

struct BoundaryModel {
  std::vector<BoundaryFace> faces;
  std::vector<BoundaryEdge> edges;
  int vertex_count = 0;
  int solids = 0;
  int shells = 0;
  std::vector<int> shell_solids;  // the solid of each shell, or -1
  bool is_sound = true;           // no defect was found on the way here
  std::vector<Warning> warnings;

  // Given when some face has `mesh`: then all have, on these points.
  Points3 mesh_points;
  double mesh_deflection_mm = 0.0;
};

Result<BoundaryModel> boundary_of(const SurfaceNetwork& network);

// The vector from a side's parameter to (u, v).
Vec2 side_parameters(const BSplineSurface<3>& patch, PatchSide side, double t);

// Boundary row of a patch: the curve of its side.
BSplineCurve<3> side_curve(const BSplineSurface<3>& patch, PatchSide side);

// Point and derivative of a spline, as an edge wants them; and the breaks of [from, to].
std::function<EdgePoint<Vec3>(double)> edge_points(BSplineCurve<3> curve);
std::vector<double> breaks_between(const KnotVector& knots, double from, double to);

}  // namespace angiospline
