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
#include "kernel/evaluate/grid.h"
#include "kernel/numerics/quadrature.h"
#include "modeling/network/network_topology.h"
#include "modeling/solid/boundary_model.h"
#include "modeling/solid/occt_bspline.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

// A measured gap is the largest of some samples: the true one may be a little larger.
constexpr double kGapMargin = 1.5;
constexpr int kGapSamples = 17;
// Joined sides that lie farther apart than this, in radii, are not the same curve.
constexpr double kLargestGap = 1e-3;

gp_Pnt point(const Vec3& p) { return {p.x(), p.y(), p.z()}; }

double tolerance_for(double gap_mm) {
  return std::max(Precision::Confusion(), kGapMargin * gap_mm);
}

FaceKind kind_of(RimKind kind) {
  switch (kind) {
    case RimKind::kInlet:
      return FaceKind::kInlet;
    case RimKind::kOutlet:
      return FaceKind::kOutlet;
    case RimKind::kCap:
      break;
  }
  return FaceKind::kCap;
}

// The straight curve in the (u, v) plane that runs from `a` at parameter `from` to `b` at `to`, on
// a parameter line. A line has unit speed; where the intervals differ in length it takes a spline.
// So does a part of a side: a line has no ends, and readers of STEP that do not find the edge's at
// the border of the surface search for them, point by point.
Handle(Geom2d_Curve) straight(const Vec2& a, const Vec2& b, double from, double to, bool whole) {
  const Vec2 step = b - a;
  if (whole &&
      std::abs(step.norm() - (to - from)) <= 4e-16 * std::max(std::abs(from), std::abs(to))) {
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
    measure_gaps();
    if (auto error = find_open_join()) return fail(*std::move(error));
    for (std::size_t r = 0; r < network_.rims.size(); ++r) {
      auto plane = cap_plane(static_cast<int>(r));
      if (!plane) return fail(plane.error());
      planes_.push_back(*plane);
    }
    make_vertices();
    make_faces();
    make_edges();
    for (std::size_t p = 0; p < patch_faces_.size(); ++p) {
      add_wire(patch_faces_[p], topology_.patch_loops[p], false);
    }
    for (std::size_t r = 0; r < cap_faces_.size(); ++r) {
      add_wire(cap_faces_[r], topology_.rim_loops[r], true);
    }
    return assemble();
  }

 private:
  double radius_of(int patch) const {
    return network_.regions[index(network_.patches[index(patch)].region)].radius_mm;
  }
  std::string name_of(int patch) const {
    return "patch " + std::to_string(patch) + " of " +
           network_.regions[index(network_.patches[index(patch)].region)].name;
  }
  Vec3 point_on(const Side& side, double t) const {
    const Vec2 uv = side_parameters(network_.patches[index(side.patch)], side.side, t);
    return surfaces_[index(side.patch)].at(uv.x(), uv.y());
  }

  // The distance between the two curves of each join, by samples that include the ends. Sides on
  // the same pool columns with the same knots are the same curve and need no samples.
  void measure_gaps() {
    gaps_mm_.assign(topology_.edges.size(), 0.0);
    for (std::size_t e = 0; e < gaps_mm_.size(); ++e) {
      const NetworkEdge& edge = topology_.edges[e];
      if (!edge.is_join()) continue;
      for (int k = 0; k < kGapSamples; ++k) {
        const double s = k / (kGapSamples - 1.0);
        const double t = edge.sides[0].from + s * (edge.sides[0].to - edge.sides[0].from);
        const double gap =
            (point_on(edge.sides[0], t) - point_on(edge.sides[1], second_parameter(edge, t)))
                .norm();
        gaps_mm_[e] = std::max(gaps_mm_[e], gap);
      }
    }
  }

  std::optional<Error> find_open_join() const {
    for (std::size_t e = 0; e < gaps_mm_.size(); ++e) {
      const NetworkEdge& edge = topology_.edges[e];
      if (!edge.is_join()) continue;
      const double radius =
          std::min(radius_of(edge.sides[0].patch), radius_of(edge.sides[1].patch));
      if (!(radius > 0) || gaps_mm_[e] <= kLargestGap * radius) continue;
      return Error{ErrorKind::kBadInput, "joined sides are not the same curve",
                   name_of(edge.sides[0].patch) + " and " + name_of(edge.sides[1].patch),
                   std::to_string(gaps_mm_[e]) + " mm apart", "joins close within 0.001 radii"};
    }
    return std::nullopt;
  }

  struct CapPlane {
    Vec3 center_mm;
    Vec3 normal;         // out of the vessel: the loop runs counter-clockwise around it
    double distance_mm;  // no point of the rim lies farther from the plane
  };

  // The rim's own plane if its control points lie in it, else the best fitting one.
  Result<CapPlane> cap_plane(int number) const {
    const Rim& rim = network_.rims[index(number)];
    std::vector<Vec3> points;
    Vec3 area = Vec3::Zero();
    for (const LoopEdge& step : topology_.rim_loops[index(number)]) {
      const Side& side = topology_.edges[index(step.edge)].sides[0];
      const BSplineCurve<3> curve = side_curve(surfaces_[index(side.patch)], side.side);
      const Points3& polygon = curve.control_points();
      for (Eigen::Index k = 0; k < polygon.cols(); ++k) points.emplace_back(polygon.col(k));
      constexpr int kChords = 16;
      for (int k = 0; k < kChords; ++k) {
        const Vec3 a = curve.at(side.from + k * (side.to - side.from) / kChords) - rim.center_mm;
        const Vec3 b =
            curve.at(side.from + (k + 1) * (side.to - side.from) / kChords) - rim.center_mm;
        area += (step.forward ? 0.5 : -0.5) * a.cross(b);
      }
    }
    const auto distance_to = [&](const Vec3& center, const Vec3& normal) {
      double largest = 0;
      for (const Vec3& p : points) largest = std::max(largest, std::abs((p - center).dot(normal)));
      return largest;
    };
    const double size = std::max(rim.radius_mm, std::sqrt(area.norm()));
    CapPlane plane{rim.center_mm, rim.normal, 0.0};
    if (plane.normal.dot(area) < 0) plane.normal = -plane.normal;
    plane.distance_mm = distance_to(plane.center_mm, plane.normal);
    if (!(plane.distance_mm <= 1e-9 * size)) {
      Vec3 mean = Vec3::Zero();
      for (const Vec3& p : points) mean += p / static_cast<double>(points.size());
      plane = {mean, area.normalized(), distance_to(mean, area.normalized())};
    }
    if (!(plane.distance_mm <= kLargestGap * size)) {
      return fail({ErrorKind::kBadInput, "rim is not plane", rim.name,
                   std::to_string(plane.distance_mm) + " mm",
                   "a rim lies within 0.001 radii of a plane"});
    }
    return plane;
  }

  void make_vertices() {
    std::vector<double> gaps = topology_.vertex_gaps_mm;
    for (std::size_t e = 0; e < topology_.edges.size(); ++e) {
      const NetworkEdge& edge = topology_.edges[e];
      const double gap = edge.is_join() ? gaps_mm_[e] : planes_[index(edge.rim)].distance_mm;
      for (const int v : {edge.first_vertex, edge.last_vertex}) {
        gaps[index(v)] = std::max(gaps[index(v)], gap);
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
      const double gap = edge.is_join() ? gaps_mm_[e] : planes_[index(edge.rim)].distance_mm;
      const double tolerance = tolerance_for(gap);
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

  // Exact but for rounding: in a component of ten thousand branches the faces that are far from its
  // origin cancel to a millionth, and the errors of a coarse rule turn the sign.
  std::vector<double> signed_volumes() const {
    std::vector<double> volumes(index(topology_.component_count), 0.0);
    std::vector<Vec3> origins(volumes.size(), Vec3::Zero());
    for (std::size_t p = surfaces_.size(); p-- > 0;) {
      origins[index(topology_.components[p])] = surfaces_[p].control_points().col(0);
    }
    for (std::size_t p = 0; p < surfaces_.size(); ++p) {
      const std::size_t c = index(topology_.components[p]);
      volumes[c] += volume_under(surfaces_[p], origins[c]);
    }
    for (std::size_t r = 0; r < planes_.size(); ++r) {
      const NetworkEdge& edge = topology_.edges[index(topology_.rim_loops[r].front().edge)];
      const std::size_t c = index(topology_.components[index(edge.sides[0].patch)]);
      volumes[c] += cap_area(static_cast<int>(r)) *
                    planes_[r].normal.dot(planes_[r].center_mm - origins[c]) / 3;
    }
    return volumes;
  }

  // (S - origin) . (Su x Sv) / 3 has degree 3 p - 1 in each direction.
  static double volume_under(const BSplineSurface<3>& surface, const Vec3& origin) {
    const auto rule = [](const KnotVector& knots) {
      return gauss_legendre(knots.breakpoints(), (3 * knots.degree() + 1) / 2);
    };
    const PiecewiseRule us = rule(surface.u()), vs = rule(surface.v());
    const SurfaceGrid<3> grid = evaluate_grid(surface, us.nodes, vs.nodes, 1);
    double volume = 0;
    Eigen::Index k = 0;
    for (const double wu : us.weights) {
      for (const double wv : vs.weights) {
        const Vec3 su = grid.partial(1, 0).col(k), sv = grid.partial(0, 1).col(k);
        volume += wu * wv * (grid.points().col(k) - origin).dot(su.cross(sv)) / 3;
        ++k;
      }
    }
    return volume;
  }

  // Half the integral of (C - center) x C', of degree 2 p - 1, along the rim.
  double cap_area(int rim) const {
    const CapPlane& plane = planes_[index(rim)];
    double area = 0;
    for (const LoopEdge& step : topology_.rim_loops[index(rim)]) {
      const Side& side = topology_.edges[index(step.edge)].sides[0];
      const BSplineCurve<3> curve = side_curve(surfaces_[index(side.patch)], side.side);
      std::vector<double> breaks{side.from};
      for (const double t : curve.knots().breakpoints()) {
        if (t > side.from && t < side.to) breaks.push_back(t);
      }
      breaks.push_back(side.to);
      const PiecewiseRule rule = gauss_legendre(breaks, curve.knots().degree());
      for (std::size_t k = 0; k < rule.nodes.size(); ++k) {
        const Vec3 arm = curve.at(rule.nodes[k]) - plane.center_mm;
        area += (step.forward ? 0.5 : -0.5) * rule.weights[k] *
                arm.cross(curve.at(rule.nodes[k], 1)).dot(plane.normal);
      }
    }
    return area;
  }

  Result<Solid> assemble() {
    const std::vector<double> volumes = signed_volumes();
    std::vector<std::vector<int>> patches(index(topology_.component_count));
    std::vector<std::vector<int>> rims(patches.size());
    for (std::size_t p = 0; p < patch_faces_.size(); ++p) {
      patches[index(topology_.components[p])].push_back(static_cast<int>(p));
    }
    for (std::size_t r = 0; r < cap_faces_.size(); ++r) {
      const NetworkEdge& edge = topology_.edges[index(topology_.rim_loops[r].front().edge)];
      rims[index(topology_.components[index(edge.sides[0].patch)])].push_back(static_cast<int>(r));
    }
    TopoDS_Compound compound;
    builder_.MakeCompound(compound);
    TopoDS_Solid solid;
    std::vector<SolidFace> faces;
    for (std::size_t c = 0; c < patches.size(); ++c) {
      if (!(volumes[c] > 0)) {
        return fail({ErrorKind::kBadInput, "component is inside out", name_of(patches[c].front()),
                     std::to_string(volumes[c]) + " mm3", "Su x Sv points out of the vessel"});
      }
      TopoDS_Shell shell;
      builder_.MakeShell(shell);
      for (const int p : patches[c]) {
        builder_.Add(shell, patch_faces_[index(p)]);
        const Region& region = network_.regions[index(network_.patches[index(p)].region)];
        faces.push_back({region.name, FaceKind::kWall, region.radius_mm,
                         face_colour(FaceKind::kWall, region.name)});
      }
      for (const int r : rims[c]) {
        builder_.Add(shell, cap_faces_[index(r)]);
        const Rim& rim = network_.rims[index(r)];
        const FaceKind kind = kind_of(rim.kind);
        faces.push_back({rim.name, kind, rim.radius_mm, face_colour(kind, rim.name)});
      }
      shell.Closed(true);
      builder_.MakeSolid(solid);
      builder_.Add(solid, shell);
      builder_.Add(compound, solid);
    }
    if (patches.size() == 1) return make_solid_value(solid, std::move(faces));
    return make_solid_value(compound, std::move(faces));
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
