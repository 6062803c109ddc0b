#include "modeling/solid/solid_boundary.h"

#include <array>
#include <cmath>

#include <BRepBndLib.hxx>
#include <BRepBuilderAPI_Copy.hxx>
#include <BRepCheck_Analyzer.hxx>
#include <BRepMesh_IncrementalMesh.hxx>
#include <BRepTools.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <Geom2d_Curve.hxx>
#include <Geom_Plane.hxx>
#include <Geom_RectangularTrimmedSurface.hxx>
#include <Geom_TrimmedCurve.hxx>
#include <Poly_Triangulation.hxx>
#include <Precision.hxx>
#include <Standard_Failure.hxx>
#include <TColStd_Array1OfReal.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedMapOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Edge.hxx>
#include <TopoDS_Face.hxx>
#include <TopoDS_Iterator.hxx>
#include <TopoDS_Vertex.hxx>
#include <TopoDS_Wire.hxx>
#include <gp_Pln.hxx>

#include "base/index.h"
#include "modeling/solid/occt_bspline.h"
#include "modeling/solid/rules.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

using namespace solid_rules;

Vec3 vec(const gp_XYZ& p) { return {p.X(), p.Y(), p.Z()}; }

Vec3 transformed(const gp_Trsf& place, const gp_Pnt& p) { return vec(p.Transformed(place).XYZ()); }

// The knots between two parameters, both included.
std::vector<double> breaks_of(const TColStd_Array1OfReal& knots, double from, double to) {
  std::vector<double> breaks{from};
  for (const double k : knots) {
    if (k > from && k < to) breaks.push_back(k);
  }
  breaks.push_back(to);
  return breaks;
}

struct Domain {
  double u0, u1, v0, v1;
};

// The side of the patch on which a parameter curve lies from `from` to `to`, running affinely.
bool find_side(const Geom2d_Curve& curve, double from, double to, const Domain& domain,
               EdgeUse& use) {
  std::array<gp_Pnt2d, kSidePoints> points;
  for (int k = 0; k < kSidePoints; ++k) {
    points[index(k)] = curve.Value(from + (to - from) * k / (kSidePoints - 1));
  }

  // All points on one of the four parameter lines around the domain.
  const double eps_u = kParameterTolerance * (domain.u1 - domain.u0);
  const double eps_v = kParameterTolerance * (domain.v1 - domain.v0);
  const auto all_at = [&](bool u, double value, double eps) {
    for (const gp_Pnt2d& p : points) {
      if (!(std::abs((u ? p.X() : p.Y()) - value) <= eps)) return false;
    }
    return true;
  };
  if (all_at(true, domain.u0, eps_u)) {
    use.side = PatchSide::kU0;
  } else if (all_at(true, domain.u1, eps_u)) {
    use.side = PatchSide::kU1;
  } else if (all_at(false, domain.v0, eps_v)) {
    use.side = PatchSide::kV0;
  } else if (all_at(false, domain.v1, eps_v)) {
    use.side = PatchSide::kV1;
  } else {
    return false;
  }

  // And evenly spaced along it, so that a parameter of the edge is one of the side.
  const bool along_v = use.side == PatchSide::kU0 || use.side == PatchSide::kU1;
  const auto along = [&](int k) { return along_v ? points[index(k)].Y() : points[index(k)].X(); };
  const double low = along_v ? domain.v0 : domain.u0;
  const double high = along_v ? domain.v1 : domain.u1;
  const double eps = along_v ? eps_v : eps_u;
  for (int k = 1; k + 1 < kSidePoints; ++k) {
    const double affine = along(0) + (along(kSidePoints - 1) - along(0)) * k / (kSidePoints - 1);
    if (std::abs(along(k) - affine) > eps) return false;
  }

  // Ends that mean the domain's become the domain's.
  const auto snapped = [&](double t) {
    if (std::abs(t - low) <= eps) return low;
    if (std::abs(t - high) <= eps) return high;
    return t;
  };
  use.side_from = snapped(along(0));
  use.side_to = snapped(along(kSidePoints - 1));
  use.on_side = true;
  return true;
}

// Builds the model face by face and edge by edge.
class BoundaryBuilder {
 public:
  BoundaryBuilder(const Solid& solid, const Progress& progress)
      : solid_(solid), shape_(solid.shape->shape), progress_(progress) {}

  Result<BoundaryModel> build() {
    TopTools_IndexedMapOfShape vertices;
    TopExp::MapShapes(shape_, TopAbs_VERTEX, vertices);
    TopExp::MapShapes(shape_, TopAbs_EDGE, edges_);
    model_.vertex_count = vertices.Extent();
    model_.edges.resize(index(edges_.Extent()));
    for (int e = 1; e <= edges_.Extent(); ++e) add_edge(TopoDS::Edge(edges_(e)), vertices);

    collect(shape_, -1, -1);
    for (std::size_t f = 0; f < faces_.size(); ++f) {
      if (f % kStopEvery == 0 && progress_.should_stop()) return fail(cancelled("measure"));
      add_face(static_cast<int>(f));
    }

    if (needs_mesh_) add_mesh();
    if (progress_.should_stop()) return fail(cancelled("measure"));
    model_.is_sound = BRepCheck_Analyzer(shape_, true, true).IsValid();
    return std::move(model_);
  }

 private:
  void add_edge(const TopoDS_Edge& edge, const TopTools_IndexedMapOfShape& vertices) {
    BoundaryEdge& result = model_.edges[index(edges_.FindIndex(edge)) - 1];
    TopoDS_Vertex first, last;
    TopExp::Vertices(TopoDS::Edge(edge.Oriented(TopAbs_FORWARD)), first, last);
    if (!first.IsNull()) result.first_vertex = vertices.FindIndex(first) - 1;
    if (!last.IsNull()) result.last_vertex = vertices.FindIndex(last) - 1;

    // An edge without a curve is a point, as at the pole of a sphere.
    TopLoc_Location place;
    const Handle(Geom_Curve) curve = BRep_Tool::Curve(edge, place, result.from, result.to);
    result.is_degenerate = BRep_Tool::Degenerated(edge) || curve.IsNull();
    if (curve.IsNull()) {
      BRep_Tool::Range(edge, result.from, result.to);
      result.breaks = {result.from, result.to};
      return;
    }

    // A polynomial spline that was not moved is taken over; anything else keeps its evaluator.
    const gp_Trsf trsf = place.Transformation();
    auto spline = Handle(Geom_BSplineCurve)::DownCast(curve);
    if (!spline.IsNull()) {
      result.breaks = breaks_of(spline->Knots(), result.from, result.to);
      // Parameters may run over the seam of a periodic one.
      if (auto own = from_occt(*spline); own && !spline->IsPeriodic() && place.IsIdentity()) {
        result.point = edge_points(*std::move(own));
        return;
      }
    } else {
      for (int k = 0; k <= kPanels; ++k) {
        result.breaks.push_back(result.from + (result.to - result.from) * k / kPanels);
      }
    }
    result.point = [curve, trsf](double t) {
      gp_Pnt p;
      gp_Vec d;
      curve->D1(t, p, d);
      return EdgePoint<Vec3>{transformed(trsf, p), vec(d.Transformed(trsf).XYZ())};
    };
  }

  // Shells, their solids, and the faces, in the order in which TopExp_Explorer meets the faces.
  void collect(const TopoDS_Shape& shape, int solid, int shell) {
    switch (shape.ShapeType()) {
      case TopAbs_SOLID:
        solid = model_.solids++;
        break;
      case TopAbs_SHELL:
        shell = model_.shells++;
        model_.shell_solids.push_back(solid);
        break;
      case TopAbs_FACE:
        faces_.push_back(TopoDS::Face(shape));
        model_.faces.emplace_back().shell = shell;
        return;
      default:
        break;
    }
    for (TopoDS_Iterator part(shape); part.More(); part.Next()) collect(part.Value(), solid, shell);
  }

  // The surface as ours, if it is a polynomial spline with clamped ends.
  static std::shared_ptr<const BSplineSurface<3>> patch_of(const Handle(Geom_Surface) & surface) {
    const auto spline = Handle(Geom_BSplineSurface)::DownCast(surface);
    if (spline.IsNull() || spline->IsUPeriodic() || spline->IsVPeriodic()) return nullptr;
    auto own = from_occt(*spline);
    return own ? std::make_shared<BSplineSurface<3>>(*std::move(own)) : nullptr;
  }

  void add_face(int number) {
    const TopoDS_Face& shape = faces_[index(number)];
    BoundaryFace& face = model_.faces[index(number)];
    if (index(number) < solid_.faces.size()) {
      face.name = solid_.faces[index(number)].name;
      face.kind = solid_.faces[index(number)].kind;
      face.radius_mm = solid_.faces[index(number)].radius_mm;
    }

    face.reversed = shape.Orientation() == TopAbs_REVERSED;
    TopLoc_Location place;
    Handle(Geom_Surface) surface = BRep_Tool::Surface(shape, place);
    while (surface->IsKind(STANDARD_TYPE(Geom_RectangularTrimmedSurface))) {
      surface = Handle(Geom_RectangularTrimmedSurface)::DownCast(surface)->BasisSurface();
    }
    if (place.IsIdentity()) face.patch = patch_of(surface);

    const gp_Trsf trsf = place.Transformation();
    const auto plane = Handle(Geom_Plane)::DownCast(surface);
    if (!plane.IsNull()) {
      const gp_Pln at = plane->Pln().Transformed(trsf);
      Vec3 normal = vec((at.Direct() ? 1.0 : -1.0) * at.Axis().Direction().XYZ());
      if (face.reversed) normal = -normal;
      face.plane = {vec(at.Location().XYZ()), normal};
    }

    face.jet = [surface, trsf](double u, double v) {
      gp_Pnt s;
      gp_Vec su, sv, suu, svv, suv;
      surface->D2(u, v, s, su, sv, suu, svv, suv);
      for (gp_Vec* d : {&su, &sv, &suu, &svv, &suv}) d->Transform(trsf);
      return SurfaceJet{transformed(trsf, s), vec(su.XYZ()),  vec(sv.XYZ()),
                        vec(suu.XYZ()),       vec(suv.XYZ()), vec(svv.XYZ())};
    };

    add_uses(number, surface);
    complete_face(number, surface);
  }

  // The edges around a face, and whether they are just the sides of its whole patch.
  void add_uses(int number, const Handle(Geom_Surface) & surface) {
    const TopoDS_Face& shape = faces_[index(number)];
    BoundaryFace& face = model_.faces[index(number)];
    Domain domain{};
    surface->Bounds(domain.u0, domain.u1, domain.v0, domain.v1);
    face.loops = 0;
    double covered = 0;  // of the domain's perimeter, each direction counting 2
    bool all_on_sides = face.patch != nullptr;
    for (TopExp_Explorer wire(shape, TopAbs_WIRE); wire.More(); wire.Next()) {
      ++face.loops;
      for (TopExp_Explorer at(wire.Current(), TopAbs_EDGE); at.More(); at.Next()) {
        const TopoDS_Edge edge = TopoDS::Edge(at.Current());
        BoundaryEdge& result = model_.edges[index(edges_.FindIndex(edge)) - 1];
        EdgeUse use = use_of(edge, result, number, all_on_sides, domain);
        all_on_sides = all_on_sides && use.on_side;
        if (use.on_side) {
          const bool along_v = use.side == PatchSide::kU0 || use.side == PatchSide::kU1;
          covered += std::abs(use.side_to - use.side_from) /
                     (along_v ? domain.v1 - domain.v0 : domain.u1 - domain.u0);
        }
        result.uses.push_back(std::move(use));
      }
    }

    face.is_whole = all_on_sides && face.loops == 1 && std::abs(covered - 4) <= kPerimeterSlack;
    needs_mesh_ = needs_mesh_ || !(face.is_whole || (face.plane && face.loops == 1));
    if (!face.is_whole) face.patch = nullptr;  // a trimmed one is measured through its evaluator
  }

  // How an edge lies on a face; its side is looked for only while the face may still be whole.
  EdgeUse use_of(const TopoDS_Edge& edge, const BoundaryEdge& of, int number, bool may_be_whole,
                 const Domain& domain) const {
    EdgeUse use;
    use.face = number;
    use.forward = edge.Orientation() != TopAbs_REVERSED;
    // Not of plane faces without one: none are made up.
    if (model_.faces[index(number)].plane) return use;
    double from = 0, to = 0;
    const Handle(Geom2d_Curve) curve =
        BRep_Tool::CurveOnSurface(edge, faces_[index(number)], from, to);
    if (curve.IsNull()) return use;

    if (may_be_whole) find_side(*curve, from, to, domain, use);
    const double edge_from = of.from;
    const double rate = (to - from) / (of.to - of.from);
    use.parameters = [curve, from, edge_from, rate](double t) {
      gp_Pnt2d p;
      gp_Vec2d d;
      curve->D1(from + (t - edge_from) * rate, p, d);
      return EdgePoint<Vec2>{{p.X(), p.Y()}, {d.X() * rate, d.Y() * rate}};
    };
    return use;
  }

  // What measuring a trimmed face in its parameters needs, and its box (1e-7 mm too large).
  void complete_face(int number, const Handle(Geom_Surface) & surface) {
    BoundaryFace& face = model_.faces[index(number)];
    if (face.is_whole || face.plane) return;
    const TopoDS_Face& shape = faces_[index(number)];
    Bnd_Box box;
    BRepBndLib::AddOptimal(shape, box, false, false);
    if (!box.IsVoid()) {
      face.bounding_box = {vec(box.CornerMin().XYZ()), vec(box.CornerMax().XYZ())};
    }
    double u0 = 0, u1 = 0, v0 = 0, v1 = 0;
    BRepTools::UVBounds(shape, u0, u1, v0, v1);
    face.u_reference = u0;
    const auto spline = Handle(Geom_BSplineSurface)::DownCast(surface);
    if (!spline.IsNull()) {
      face.u_breaks = breaks_of(spline->UKnots(), u0, u1);
    } else {
      for (int k = 0; k <= kPanels; ++k) face.u_breaks.push_back(u0 + (u1 - u0) * k / kPanels);
    }
  }

  // Triangles that share the points of their edges.
  void add_mesh() {
    Bnd_Box box;
    BRepBndLib::Add(shape_, box, false);
    const double size = box.IsVoid() ? 1.0 : std::sqrt(box.SquareExtent());
    model_.mesh_deflection_mm = kMeshDeflection * size;
    const TopoDS_Shape copy = BRepBuilderAPI_Copy(shape_, false, false).Shape();
    BRepMesh_IncrementalMesh(copy, model_.mesh_deflection_mm, false, kMeshAngle, true);

    SharedPoints shared;
    TopExp::MapShapes(copy, TopAbs_VERTEX, shared.vertices);
    TopExp::MapShapes(copy, TopAbs_EDGE, shared.edges);
    shared.of_edge.resize(index(shared.edges.Extent()));
    for (int v = 1; v <= shared.vertices.Extent(); ++v) {
      shared.points.push_back(vec(BRep_Tool::Pnt(TopoDS::Vertex(shared.vertices(v))).XYZ()));
    }
    std::size_t number = 0;
    for (TopExp_Explorer f(copy, TopAbs_FACE); f.More(); f.Next(), ++number) {
      add_face_mesh(TopoDS::Face(f.Current()), model_.faces[number], shared);
    }

    model_.mesh_points.resize(3, static_cast<Eigen::Index>(shared.points.size()));
    for (std::size_t k = 0; k < shared.points.size(); ++k) {
      model_.mesh_points.col(static_cast<Eigen::Index>(k)) = shared.points[k];
    }
  }

  // The points of all faces' meshes, those of a vertex or an edge once for all faces on it.
  struct SharedPoints {
    TopTools_IndexedMapOfShape vertices, edges;
    std::vector<Vec3> points;               // those of the vertices first
    std::vector<std::vector<int>> of_edge;  // empty: not met yet

    // The points of an edge in the order of a face's polygon along it.
    const std::vector<int>& along(const TopoDS_Edge& edge,
                                  const Handle(Poly_PolygonOnTriangulation) & polygon,
                                  const Handle(Poly_Triangulation) & mesh,
                                  const TopLoc_Location& place) {
      std::vector<int>& shared = of_edge[index(edges.FindIndex(edge)) - 1];
      if (!shared.empty()) return shared;
      TopoDS_Vertex first, last;
      TopExp::Vertices(TopoDS::Edge(edge.Oriented(TopAbs_FORWARD)), first, last);
      for (int k = 1; k <= polygon->NbNodes(); ++k) {
        const TopoDS_Vertex& end = k == 1 ? first : last;
        if ((k == 1 || k == polygon->NbNodes()) && !end.IsNull()) {
          shared.push_back(vertices.FindIndex(end) - 1);
        } else {
          shared.push_back(add(mesh->Node(polygon->Node(k)), place));
        }
      }
      return shared;
    }

    int add(const gp_Pnt& node, const TopLoc_Location& place) {
      points.push_back(vec(node.Transformed(place).XYZ()));
      return static_cast<int>(points.size()) - 1;
    }
  };

  void add_face_mesh(const TopoDS_Face& shape, BoundaryFace& face, SharedPoints& shared) {
    TopLoc_Location place;
    const Handle(Poly_Triangulation) mesh = BRep_Tool::Triangulation(shape, place);
    if (mesh.IsNull()) {
      model_.warnings.push_back({WarningCode::kFaceNotSearched,
                                 face.name + ": could not be meshed and was not searched for "
                                             "self-intersections"});
      return;
    }

    // Nodes on edges are the edges' points; those inside are the face's own.
    std::vector<int> number(index(mesh->NbNodes()), -1);
    for (TopExp_Explorer at(shape, TopAbs_EDGE); at.More(); at.Next()) {
      const TopoDS_Edge edge = TopoDS::Edge(at.Current());
      const Handle(Poly_PolygonOnTriangulation) polygon =
          BRep_Tool::PolygonOnTriangulation(edge, mesh, place);
      if (polygon.IsNull()) continue;
      const std::vector<int>& along = shared.along(edge, polygon, mesh, place);
      for (std::size_t k = 0; k < along.size() && k < index(polygon->NbNodes()); ++k) {
        number[index(polygon->Node(static_cast<int>(k) + 1)) - 1] = along[k];
      }
    }
    for (int k = 1; k <= mesh->NbNodes(); ++k) {
      int& n = number[index(k) - 1];
      if (n < 0) n = shared.add(mesh->Node(k), place);
      if (mesh->HasUVNodes()) {
        const gp_Pnt2d uv = mesh->UVNode(k);
        face.mesh.parameters.emplace_back(uv.X(), uv.Y());
      }
    }

    for (int t = 1; t <= mesh->NbTriangles(); ++t) {
      int a = 0, b = 0, c = 0;
      mesh->Triangle(t).Get(a, b, c);
      if (face.reversed) std::swap(b, c);
      face.mesh.triangles.push_back(
          {number[index(a) - 1], number[index(b) - 1], number[index(c) - 1]});
    }
  }

  const Solid& solid_;
  const TopoDS_Shape& shape_;
  const Progress& progress_;
  BoundaryModel model_;
  TopTools_IndexedMapOfShape edges_;
  std::vector<TopoDS_Face> faces_;
  bool needs_mesh_ = false;
};

}  // namespace

Result<BoundaryModel> boundary_of(const Solid& solid, const Progress& progress) {
  try {
    return BoundaryBuilder(solid, progress).build();
  } catch (const Standard_Failure& failure) {
    return fail({ErrorKind::kFailed,
                 "OpenCASCADE could not measure the solid",
                 "solid",
                 failure.GetMessageString(),
                 {}});
  }
}

}  // namespace angiospline
