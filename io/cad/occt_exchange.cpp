#include "io/cad/occt_exchange.h"

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string_view>
#include <unordered_map>
#include <utility>

#include <BRepBndLib.hxx>
#include <BRep_Builder.hxx>
#include <BRep_Tool.hxx>
#include <Bnd_Box.hxx>
#include <Geom_Plane.hxx>
#include <Geom_Surface.hxx>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Message_Printer.hxx>
#include <Message_ProgressScope.hxx>
#include <Precision.hxx>
#include <Quantity_Color.hxx>
#include <TDF_ChildIterator.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TopExp.hxx>
#include <TopExp_Explorer.hxx>
#include <TopTools_IndexedDataMapOfShapeListOfShape.hxx>
#include <TopTools_ListOfShape.hxx>
#include <TopoDS.hxx>
#include <TopoDS_Compound.hxx>
#include <XCAFApp_Application.hxx>
#include <XCAFDoc_ColorTool.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSAlgo.hxx>

#include "base/atomic_file.h"
#include "io/cad/rules.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

TCollection_ExtendedString extended(const std::string& text) {
  return TCollection_ExtendedString(text.c_str(), true);
}

std::string plain(const TCollection_ExtendedString& text) {
  std::string result(static_cast<std::size_t>(text.LengthOfCString()), '\0');
  Standard_PCharacter data = result.data();
  text.ToUTF8CString(data);
  return result;
}

// Names and colours by the face's geometry, whatever its place in an assembly.
struct FaceNote {
  std::optional<std::string> name;
  std::optional<Vec3> colour;
};
using FaceNotes = std::unordered_map<const TopoDS_TShape*, FaceNote>;

void collect_notes(const TDF_Label& label, XCAFDoc_ColorTool& colours, FaceNotes& notes) {
  const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label);
  if (shape.IsNull()) return;
  FaceNote note;
  Handle(TDataStd_Name) name;
  const bool is_face = shape.ShapeType() == TopAbs_FACE;
  if (is_face && label.FindAttribute(TDataStd_Name::GetID(), name)) {
    note.name = plain(name->Get());
  }

  Quantity_Color colour;
  if (colours.GetColor(label, XCAFDoc_ColorSurf, colour) ||
      colours.GetColor(label, XCAFDoc_ColorGen, colour)) {
    Standard_Real r = 0, g = 0, b = 0;
    colour.Values(r, g, b, Quantity_TOC_sRGB);
    note.colour = Vec3(r, g, b);
  }

  if (!note.name && !note.colour) return;
  for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) {
    FaceNote& kept = notes[at.Current().TShape().get()];
    if (is_face && note.name) kept.name = note.name;
    // A face's own colour is stronger than its solid's.
    if (note.colour && (is_face || !kept.colour)) kept.colour = note.colour;
  }
}

// Of all shapes of a document and of their parts.
FaceNotes notes_of(XCAFDoc_ShapeTool& shapes, XCAFDoc_ColorTool& colours) {
  FaceNotes notes;
  TDF_LabelSequence all;
  shapes.GetShapes(all);
  for (const TDF_Label& label : all) {
    collect_notes(label, colours, notes);
    for (TDF_ChildIterator child(label); child.More(); child.Next()) {
      collect_notes(child.Value(), colours, notes);
    }
  }
  return notes;
}

int count(const TopoDS_Shape& shape, TopAbs_ShapeEnum kind) {
  int n = 0;
  for (TopExp_Explorer at(shape, kind); at.More(); at.Next()) ++n;
  return n;
}

static_assert((kDigestSteps + 1) * (kDigestSteps + 1) == kDigestSamples);

// The surface at even fractions of its domain; nothing for a plane, whose domain is endless.
std::vector<Vec3> samples_of(const Geom_Surface& surface) {
  double u0 = 0, u1 = 0, v0 = 0, v1 = 0;
  surface.Bounds(u0, u1, v0, v1);
  if (Precision::IsInfinite(u0)) return {};
  std::vector<Vec3> samples;
  samples.reserve(kDigestSamples);
  for (int i = 0; i <= kDigestSteps; ++i) {
    for (int j = 0; j <= kDigestSteps; ++j) {
      const gp_Pnt p =
          surface.Value(u0 + (u1 - u0) * i / kDigestSteps, v0 + (v1 - v0) * j / kDigestSteps);
      samples.emplace_back(p.X(), p.Y(), p.Z());
    }
  }
  return samples;
}

// Largest distance of two samplings; nothing if one of them is a plane's.
std::optional<double> surface_distance(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  if (a.empty() || b.empty()) return std::nullopt;
  double largest = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    const double distance = (a[k] - b[k]).norm();
    if (!std::isfinite(distance)) return std::numeric_limits<double>::infinity();
    largest = std::max(largest, distance);
  }
  return largest;
}

// Leaves shapes that are read as they are.
class UnhealedShapes : public XSAlgo_AlgoContainer {
 public:
  TopoDS_Shape ProcessShape(const TopoDS_Shape& shape, double precision, double max_tolerance,
                            Standard_CString resource, Standard_CString sequence,
                            Handle(Standard_Transient) & info,
                            const Message_ProgressRange& progress,
                            Standard_Boolean non_manifold) const override {
    if (std::string_view(sequence).starts_with("read.")) return shape;
    return XSAlgo_AlgoContainer::ProcessShape(shape, precision, max_tolerance, resource, sequence,
                                              info, progress, non_manifold);
  }
};

tl::unexpected<Error> differs(const std::filesystem::path& path, std::string what,
                              std::string value, std::string rule) {
  return fail(
      {ErrorKind::kCannotWrite, std::move(what), path.string(), std::move(value), std::move(rule)});
}

}  // namespace

Quantity_Color occt_colour(const Vec3& srgb) {
  return Quantity_Color(srgb.x(), srgb.y(), srgb.z(), Quantity_TOC_sRGB);
}

std::unique_lock<std::mutex> lock_exchange() {
  static std::mutex mutex;
  std::unique_lock<std::mutex> lock(mutex);
  static const bool silent = [] {
    Message::DefaultMessenger()->RemovePrinters(STANDARD_TYPE(Message_Printer));
    return true;
  }();
  static_cast<void>(silent);
  return lock;
}

Handle(TDocStd_Document) empty_document() {
  Handle(TDocStd_Document) document;
  XCAFApp_Application::GetApplication()->NewDocument("MDTV-XCAF", document);
  return document;
}

Handle(TDocStd_Document) document_of(const Solid& solid, const std::string& product) {
  Handle(TDocStd_Document) document = empty_document();
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const Handle(XCAFDoc_ColorTool) colours = XCAFDoc_DocumentTool::ColorTool(document->Main());
  const TDF_Label label = shapes->AddShape(solid.shape->shape, false);
  TDataStd_Name::Set(label, extended(product));
  std::size_t k = 0;
  for (TopExp_Explorer at(solid.shape->shape, TopAbs_FACE); at.More(); at.Next(), ++k) {
    const TDF_Label face = shapes->AddSubShape(label, at.Current());
    if (face.IsNull()) continue;
    TDataStd_Name::Set(face, extended(solid.faces[k].name));
    colours->SetColor(face, occt_colour(solid.faces[k].colour), XCAFDoc_ColorSurf);
  }
  return document;
}

Result<Solid> solid_of(const Handle(TDocStd_Document) & document,
                       const std::filesystem::path& path) {
  const Handle(XCAFDoc_ShapeTool) shapes = XCAFDoc_DocumentTool::ShapeTool(document->Main());
  const Handle(XCAFDoc_ColorTool) colours = XCAFDoc_DocumentTool::ColorTool(document->Main());
  TDF_LabelSequence free;
  shapes->GetFreeShapes(free);

  TopoDS_Shape shape;
  if (free.Length() == 1) {
    shape = XCAFDoc_ShapeTool::GetShape(free.First());
  } else {
    TopoDS_Compound compound;
    BRep_Builder builder;
    builder.MakeCompound(compound);
    for (const TDF_Label& label : free) builder.Add(compound, XCAFDoc_ShapeTool::GetShape(label));
    shape = compound;
  }

  const FaceNotes notes = notes_of(*shapes, *colours);
  std::vector<SolidFace> faces;
  bool has_names = false;
  if (!shape.IsNull()) {
    for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) {
      const auto found = notes.find(at.Current().TShape().get());
      const FaceNote note = found != notes.end() ? found->second : FaceNote{};
      SolidFace face;
      const bool is_named = note.name && !note.name->empty();
      has_names = has_names || is_named;
      face.name = is_named ? *note.name : "face_" + std::to_string(faces.size() + 1);
      face.kind = kind_of_name(face.name);
      face.colour = note.colour ? *note.colour : face_colour(face.kind, face.name);
      faces.push_back(std::move(face));
    }
  }
  if (faces.empty()) {
    return fail({ErrorKind::kBadInput,
                 "holds no face",
                 path.string(),
                 {},
                 "a model has at least one surface"});
  }
  if (!has_names) mark_caps(shape, faces);
  return make_solid_value(shape, std::move(faces));
}

void mark_caps(const TopoDS_Shape& shape, std::vector<SolidFace>& faces) {
  TopTools_IndexedDataMapOfShapeListOfShape faces_of_edges;
  TopExp::MapShapesAndAncestors(shape, TopAbs_EDGE, TopAbs_FACE, faces_of_edges);
  const auto is_plane = [](const TopoDS_Shape& face) {
    return BRep_Tool::Surface(TopoDS::Face(face))->IsKind(STANDARD_TYPE(Geom_Plane));
  };
  const auto is_cap = [&](const TopoDS_Shape& face) {
    if (!is_plane(face) || count(face, TopAbs_WIRE) != 1) return false;
    for (TopExp_Explorer edge(face, TopAbs_EDGE); edge.More(); edge.Next()) {
      const TopTools_ListOfShape& neighbours = faces_of_edges.FindFromKey(edge.Current());
      if (neighbours.Extent() < 2) return false;
      for (const TopoDS_Shape& other : neighbours) {
        if (!other.IsSame(face) && is_plane(other)) return false;
      }
    }
    return true;
  };

  std::size_t k = 0;
  for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next(), ++k) {
    if (is_cap(at.Current())) faces[k].kind = FaceKind::kCap;
  }
}

SolidDigest digest_of(const Solid& solid) {
  const TopoDS_Shape& shape = solid.shape->shape;
  SolidDigest digest;
  digest.solids = count(shape, TopAbs_SOLID);
  digest.shells = count(shape, TopAbs_SHELL);

  Bnd_Box box;
  BRepBndLib::AddClose(shape, box);
  digest.size_mm = std::sqrt(box.SquareExtent());
  digest.faces.reserve(solid.faces.size());
  for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) {
    digest.faces.push_back({solid.faces[digest.faces.size()].name,
                            at.Current().Orientation() == TopAbs_REVERSED,
                            samples_of(*BRep_Tool::Surface(TopoDS::Face(at.Current())))});
  }
  return digest;
}

tl::unexpected<Error> cannot_write(const std::filesystem::path& path, std::string what) {
  return fail({ErrorKind::kCannotWrite, std::move(what), path.string(), {}, {}});
}

Result<void> write_verified(
    Solid solid, const std::filesystem::path& path,
    const std::function<Result<void>(Solid, const std::filesystem::path&)>& write,
    const std::function<Result<Solid>(const std::filesystem::path&)>& read) {
  const SolidDigest digest = digest_of(solid);
  return write_atomically(path, [&](const std::filesystem::path& temporary) -> Result<void> {
    if (auto done = write(std::exchange(solid, {}), temporary); !done) {
      if (done.error().kind == ErrorKind::kCancelled) return done;
      return cannot_write(path, done.error().what);  // the user knows nothing of the temporary file
    }

    // A writer that reports success proves nothing: only what comes back does.
    const Result<Solid> back = read(temporary);
    if (!back) {
      if (back.error().kind == ErrorKind::kCancelled) return fail(back.error());
      return cannot_write(path, "cannot be read back: " + back.error().what);
    }
    return expect_same(digest, *back, path);
  });
}

Result<void> expect_same(const SolidDigest& written, const Solid& read,
                         const std::filesystem::path& path) {
  const TopoDS_Shape& shape = read.shape->shape;
  const std::string rule = "the file must hold what was written";
  const auto other_number = [&](const char* of, int number) {
    return differs(path, std::string("other number of ") + of + " read back",
                   std::to_string(number), rule);
  };
  if (const int solids = count(shape, TopAbs_SOLID); solids != written.solids) {
    return other_number("solids", solids);
  }
  if (const int shells = count(shape, TopAbs_SHELL); shells != written.shells) {
    return other_number("shells", shells);
  }
  if (written.faces.size() != read.faces.size()) {
    return other_number("faces", static_cast<int>(read.faces.size()));
  }

  // Faces come back in their order; a surface may move by rounding only.
  TopExp_Explorer at(shape, TopAbs_FACE);
  for (std::size_t k = 0; k < written.faces.size(); ++k, at.Next()) {
    const SolidDigest::Face& face = written.faces[k];
    if (face.name != read.faces[k].name) {
      return differs(path, "face name did not survive: " + face.name, read.faces[k].name, rule);
    }
    if (face.reversed != (at.Current().Orientation() == TopAbs_REVERSED)) {
      return differs(path, "face is inside out", face.name, rule);
    }
    const auto distance = surface_distance(
        face.samples_mm, samples_of(*BRep_Tool::Surface(TopoDS::Face(at.Current()))));
    if (distance && !(*distance <= kDigestTolerance * written.size_mm)) {
      return differs(path, "surface moved: " + face.name, std::to_string(*distance) + " mm", rule);
    }
  }

  for (TopExp_Explorer shell(shape, TopAbs_SHELL); shell.More(); shell.Next()) {
    if (BRep_Tool::IsClosed(shell.Current())) continue;
    return differs(path, "shell is open after reading back", {}, rule);
  }
  return {};
}

WithoutHealing::WithoutHealing() : kept_(XSAlgo::AlgoContainer()) {
  const Handle(XSAlgo_AlgoContainer) unhealed = new UnhealedShapes;
  unhealed->SetToolContainer(kept_->ToolContainer());
  XSAlgo::SetAlgoContainer(unhealed);
}

WithoutHealing::~WithoutHealing() { XSAlgo::SetAlgoContainer(kept_); }

Result<void> expect_readable(const std::filesystem::path& path) {
  std::error_code ec;
  const auto bad = [&](std::string what) {
    return fail({ErrorKind::kBadInput, std::move(what), path.string(), {}, {}});
  };
  const std::filesystem::file_status status = std::filesystem::status(path, ec);
  if (!std::filesystem::exists(status)) return bad("no such file");
  if (std::filesystem::is_directory(status)) return bad("is a folder, not a file");
  if (std::filesystem::is_regular_file(status) && std::filesystem::file_size(path, ec) == 0) {
    return bad("is empty");
  }
  return {};
}

void ExchangeProgress::Show(const Message_ProgressScope&, Standard_Boolean) {
  progress_.at(stage_, GetPosition());
}

}  // namespace angiospline
