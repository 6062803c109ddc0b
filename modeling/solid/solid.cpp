#include "modeling/solid/solid.h"

#include <algorithm>
#include <cmath>

#include <BRep_Builder.hxx>
#include <Eigen/Geometry>
#include <Geom2d_BSplineCurve.hxx>
#include <Geom2d_Line.hxx>
#include <Geom_Plane.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_Array1OfInteger.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TColgp_Array1OfPnt2d.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Shell.hxx>
#include <TopoDS_Solid.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Wire.hxx>

#include "base/index.h"
#include "modeling/network/network_topology.h"
#include "modeling/solid/boundary_model.h"
#include "modeling/solid/network_closure.h"
#include "modeling/solid/occt_bspline.h"
#include "modeling/solid/rules.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

using namespace solid_rules;

gp_Pnt point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

double tolerance_for(double gap_mm) {
  return std::max(Precision::Confusion(), kGapMargin * gap_mm);
}

// The straight curve in the (u, v) plane that runs from `a` at parameter `from` to `b` at `to`, on
// a parameter line. A line has unit speed; where the intervals differ in length it takes a spline.
// So does a part of a side: a line has no ends, and readers of STEP that do not find the edge's at
// the border of the surface search for them, point by point.
Handle(Geom2d_Curve) straight(const Vec2& a, const Vec2& b, double from, double to, bool whole) {
  const Vec2 step = b - a;
  if (whole &&
      std::abs(step.norm() - (to - from)) <= kUnitSpeed * std::max(std::abs(from), std::abs(to))) {
    const Vec2 unit = step.normalized();
    const Vec2 origin = a - from * unit;
    return new Geom2d_Line(gp_Pnt2d(origin.x(), origin.y()), gp_Dir2d(unit.x(), unit.y()));
  }

  TColgp_Array1OfPnt2d poles(1, 2);
  poles.SetValue(1, gp_Pnt2d(a.x(), a.y()));
  poles.SetValue(2, gp_Pnt2d(b.x(), b.y()));
  TColStd_Array1OfReal knots(1, 2);
  knots.SetValue(1, from);
  knots.SetValue(2, to);
  TColStd_Array1OfInteger multiplicities(1, 2);
  multiplicities.Init(2);
  return new Geom2d_BSplineCurve(poles, knots, multiplicities, 1);
}

// Whether the side is all of its patch's side.
bool is_whole(const Patch& patch, const Side& side) {
  const KnotVector& knots =
      side.side == PatchSide::kU0 || side.side == PatchSide::kU1 ? patch.v : patch.u;
  return side.from == knots.first() && side.to == knots.last();
}

// One network on its way to a shape.
class SolidBuilder {
 public:
  SolidBuilder(const SurfaceNetwork& network, NetworkTopology topology)
      : network_(network), topology_(std::move(topology)) {
    surfaces_.reserve(network.patches.size());
    for (std::size_t p = 0; p < network.patches.size(); ++p) {
      surfaces_.push_back(patch_surface(network, static_cast<int>(p)));
    }
  }

  Result<Solid> build() {
    const NetworkShape shape{network_, topology_, surfaces_};
    gaps_mm_ = join_gaps_mm(shape);
    if (auto error = find_open_join(shape, gaps_mm_)) return fail(*std::move(error));
    for (std::size_t r = 0; r < network_.rims.size(); ++r) {
      auto plane = cap_plane(shape, static_cast<int>(r));
      if (!plane) return fail(plane.error());
      planes_.push_back(*plane);
    }

    // OpenCASCADE builds upward, but an edge's parameter curves name the faces they lie on.
    make_vertices();
    make_faces();
    make_edges();
    for (std::size_t p = 0; p < patch_faces_.size(); ++p) {
      add_wire(patch_faces_[p], topology_.patch_loops[p], false);
    }
    for (std::size_t r = 0; r < cap_faces_.size(); ++r) {
      add_wire(cap_faces_[r], topology_.rim_loops[r], true);
    }
    return assemble(signed_volumes_mm3(shape, planes_));
  }

 private:
  // How far an edge's curve may lie from what it bounds.
  double gap_of(std::size_t e) const {
    const NetworkEdge& edge = topology_.edges[e];
    return edge.is_join() ? gaps_mm_[e] : planes_[index(edge.rim)].distance_mm;
  }

  // The component that a rim closes.
  std::size_t component_of_rim(std::size_t r) const {
    const NetworkEdge& edge = topology_.edges[index(topology_.rim_loops[r].front().edge)];
    return index(topology_.components[index(edge.sides[0].patch)]);
  }

  void make_vertices() {
    std::vector<double> gaps = topology_.vertex_gaps_mm;
    for (std::size_t e = 0; e < topology_.edges.size(); ++e) {
      const NetworkEdge& edge = topology_.edges[e];
      for (const int v : {edge.first_vertex, edge.last_vertex}) {
        gaps[index(v)] = std::max(gaps[index(v)], gap_of(e));
      }
    }

    for (std::size_t v = 0; v < gaps.size(); ++v) {
      TopoDS_Vertex vertex;
      builder_.MakeVertex(vertex, point(topology_.vertices_mm.col(static_cast<Eigen::Index>(v))),
                          tolerance_for(gaps[v] + topology_.vertex_gaps_mm[v]));
      vertices_.push_back(vertex);
    }
  }

  void make_faces() {
    for (const BSplineSurface<3>& surface : surfaces_) {
      TopoDS_Face face;
      builder_.MakeFace(face, to_occt(surface), Precision::Confusion());
      patch_faces_.push_back(face);
    }
    for (const CapPlane& plane : planes_) {
      TopoDS_Face face;
      const gp_Dir normal(plane.normal.x(), plane.normal.y(), plane.normal.z());
      builder_.MakeFace(face, new Geom_Plane(point(plane.center_mm), normal),
                        Precision::Confusion());
      cap_faces_.push_back(face);
    }
  }

  void make_edges() {
    for (std::size_t e = 0; e < topology_.edges.size(); ++e) {
      const NetworkEdge& edge = topology_.edges[e];
      const Side& side = edge.sides[0];
      const double tolerance = tolerance_for(gap_of(e));
      Handle(Geom_BSplineCurve) curve =
          to_occt(side_curve(surfaces_[index(side.patch)], side.side));
      if (side.from != curve->FirstParameter() || side.to != curve->LastParameter()) {
        curve->Segment(side.from, side.to);
      }

      TopoDS_Edge shape;
      builder_.MakeEdge(shape, curve, tolerance);
      builder_.Add(shape, vertices_[index(edge.first_vertex)].Oriented(TopAbs_FORWARD));
      builder_.Add(shape, vertices_[index(edge.last_vertex)].Oriented(TopAbs_REVERSED));
      add_parameter_curves(shape, edge, tolerance);
      builder_.Range(shape, side.from, side.to);
      builder_.SameRange(shape, true);
      builder_.SameParameter(shape, true);
      edges_.push_back(shape);
    }
  }

  Handle(Geom2d_Curve) parameter_curve(const NetworkEdge& edge, int use) const {
    const Side& side = edge.sides[index(use)];
    const double from = edge.sides[0].from;
    const double to = edge.sides[0].to;
    const Patch& patch = network_.patches[index(side.patch)];
    const auto at = [&](double t) {
      return side_parameters(patch, side.side, use == 0 ? t : second_parameter(edge, t));
    };
    return straight(at(from), at(to), from, to, is_whole(patch, side));
  }

  // Where the edge lies in the parameters of the faces on both sides of it.
  void add_parameter_curves(const TopoDS_Edge& shape, const NetworkEdge& edge, double tolerance) {
    const int first = edge.sides[0].patch;
    if (!edge.is_join()) {
      builder_.UpdateEdge(shape, parameter_curve(edge, 0), patch_faces_[index(first)], tolerance);
      return;
    }
    const int second = edge.sides[1].patch;
    if (first != second) {
      builder_.UpdateEdge(shape, parameter_curve(edge, 0), patch_faces_[index(first)], tolerance);
      builder_.UpdateEdge(shape, parameter_curve(edge, 1), patch_faces_[index(second)], tolerance);
      return;
    }

    // A patch that closes on itself: the first curve is the one of the edge's forward use.
    const bool first_is_forward =
        edge.sides[0].side == PatchSide::kV0 || edge.sides[0].side == PatchSide::kU1;
    builder_.UpdateEdge(shape, parameter_curve(edge, first_is_forward ? 0 : 1),
                        parameter_curve(edge, first_is_forward ? 1 : 0), patch_faces_[index(first)],
                        tolerance);
  }

  void add_wire(TopoDS_Face& face, const std::vector<LoopEdge>& loop, bool is_cap) {
    TopoDS_Wire wire;
    builder_.MakeWire(wire);
    for (const LoopEdge& step : loop) {
      builder_.Add(
          wire, edges_[index(step.edge)].Oriented(step.forward ? TopAbs_FORWARD : TopAbs_REVERSED));
    }
    wire.Closed(true);
    builder_.Add(face, wire);
    builder_.NaturalRestriction(face, !is_cap);
  }

  // One closed solid for each component: its patches, then its caps, all on one shell.
  Result<Solid> assemble(const std::vector<double>& volumes_mm3) {
    std::vector<std::vector<int>> patches(index(topology_.component_count));
    std::vector<std::vector<int>> rims(patches.size());
    for (std::size_t p = 0; p < patch_faces_.size(); ++p) {
      patches[index(topology_.components[p])].push_back(static_cast<int>(p));
    }
    for (std::size_t r = 0; r < cap_faces_.size(); ++r) {
      rims[component_of_rim(r)].push_back(static_cast<int>(r));
    }

    TopoDS_Compound compound;
    builder_.MakeCompound(compound);
    TopoDS_Solid solid;
    std::vector<SolidFace> faces;
    for (std::size_t c = 0; c < patches.size(); ++c) {
      if (!(volumes_mm3[c] > 0)) {
        return fail({ErrorKind::kBadInput, "component is inside out",
                     patch_title(network_, patches[c].front()),
                     std::to_string(volumes_mm3[c]) + " mm3", "Su x Sv points out of the vessel"});
      }
      solid = solid_of(shell_of(patches[c], rims[c], faces));
      builder_.Add(compound, solid);
    }
    if (patches.size() == 1) return make_solid_value(solid, std::move(faces));
    return make_solid_value(compound, std::move(faces));
  }

  // A closed shell of these faces, whose names are added to `faces`.
  TopoDS_Shell shell_of(const std::vector<int>& patches, const std::vector<int>& rims,
                        std::vector<SolidFace>& faces) {
    TopoDS_Shell shell;
    builder_.MakeShell(shell);
    for (const int p : patches) {
      builder_.Add(shell, patch_faces_[index(p)]);
      const Region& region = network_.regions[index(network_.patches[index(p)].region)];
      faces.push_back({region.name, FaceKind::kWall, region.radius_mm,
                       face_colour(FaceKind::kWall, region.name)});
    }
    for (const int r : rims) {
      builder_.Add(shell, cap_faces_[index(r)]);
      const Rim& rim = network_.rims[index(r)];
      const FaceKind kind = kind_of_rim(rim.kind);
      faces.push_back({rim.name, kind, rim.radius_mm, face_colour(kind, rim.name)});
    }
    shell.Closed(true);
    return shell;
  }

  TopoDS_Solid solid_of(const TopoDS_Shell& shell) {
    TopoDS_Solid solid;
    builder_.MakeSolid(solid);
    builder_.Add(solid, shell);
    return solid;
  }

  const SurfaceNetwork& network_;
  NetworkTopology topology_;
  std::vector<BSplineSurface<3>> surfaces_;
  std::vector<double> gaps_mm_;  // one for each edge
  std::vector<CapPlane> planes_;
  BRep_Builder builder_;
  std::vector<TopoDS_Vertex> vertices_;
  std::vector<TopoDS_Edge> edges_;
  std::vector<TopoDS_Face> patch_faces_;
  std::vector<TopoDS_Face> cap_faces_;
};

}  // namespace

Result<Solid> make_solid(const SurfaceNetwork& network) {
  if (network.patches.empty()) {
    return fail({ErrorKind::kBadInput,
                 "network has no patches",
                 "network",
                 {},
                 "a solid needs a closed wall"});
  }
  Result<NetworkTopology> topology = network_topology(network);
  if (!topology) return fail(topology.error());
  try {
    return SolidBuilder(network, *std::move(topology)).build();
  } catch (const Standard_Failure& failure) {
    return fail({ErrorKind::kFailed,
                 "OpenCASCADE refused the network",
                 "solid",
                 failure.GetMessageString(),
                 {}});
  }
}

}  // namespace angiospline
