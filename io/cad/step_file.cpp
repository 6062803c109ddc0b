#include "io/cad/step_file.h"

#include <array>
#include <bit>
#include <cstdint>
#include <fstream>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include <APIHeaderSection_MakeHeader.hxx>
#include <Interface_EntityIterator.hxx>
#include <Interface_Static.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPConstruct.hxx>
#include <STEPConstruct_DataMapOfAsciiStringTransient.hxx>
#include <STEPConstruct_DataMapOfPointTransient.hxx>
#include <STEPConstruct_Styles.hxx>
#include <STEPControl_Controller.hxx>
#include <STEPControl_Writer.hxx>
#include <StepBasic_Product.hxx>
#include <StepData_Protocol.hxx>
#include <StepData_StepModel.hxx>
#include <StepData_StepWriter.hxx>
#include <StepGeom_BSplineCurve.hxx>
#include <StepGeom_BSplineSurface.hxx>
#include <StepGeom_CartesianPoint.hxx>
#include <StepRepr_RepresentationContext.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <StepShape_ShapeRepresentation.hxx>
#include <StepVisual_Colour.hxx>
#include <StepVisual_MechanicalDesignGeometricPresentationRepresentation.hxx>
#include <StepVisual_PresentationStyleAssignment.hxx>
#include <StepVisual_StyledItem.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp_Explorer.hxx>
#include <Transfer_FinderProcess.hxx>
#include <XSControl_TransferWriter.hxx>
#include <XSControl_WorkSession.hxx>

#include "io/cad/occt_exchange.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

// Repeatable bytes: the model's day is not news to its reader.
constexpr const char* kTimeStamp = "2000-01-01T00:00:00";

Handle(TCollection_HAsciiString) text(const std::string& value) {
  return new TCollection_HAsciiString(value.c_str());
}

void set_write_options(const StepOptions& options) {
  Interface_Static::SetIVal("write.step.schema", options.schema == StepSchema::kAp214 ? 4 : 5);
  Interface_Static::SetCVal("write.step.unit", "MM");
  Interface_Static::SetCVal("xstep.cascade.unit", "MM");
  Interface_Static::SetIVal("write.step.assembly", 0);  // several solids are one product
  Interface_Static::SetCVal("write.step.product.name", options.product.c_str());
  Interface_Static::SetIVal("write.precision.mode", 0);
  Interface_Static::SetIVal("write.surfacecurve.mode", 1);
}

void set_header(const Handle(StepData_StepModel) & model, const StepOptions& options) {
  APIHeaderSection_MakeHeader header(model);
  header.SetName(text(options.product));
  header.SetTimeStamp(text(kTimeStamp));
  header.SetAuthorValue(1, text(""));
  header.SetOrganizationValue(1, text(""));
  header.SetPreprocessorVersion(text("Angiospline with OpenCASCADE"));
  header.SetOriginatingSystem(text("Angiospline"));
  header.SetAuthorisation(text(""));
  header.SetDescriptionValue(1, text("vessel model, lengths in millimetres"));
}

// Points by the bits of their coordinates, so that each is written once.
class PointPool {
 public:
  // The first point with the same coordinates and name.
  Handle(StepGeom_CartesianPoint) shared(const Handle(StepGeom_CartesianPoint) & point) {
    std::array<std::uint64_t, 4> key{static_cast<std::uint64_t>(point->NbCoordinates())};
    for (int k = 1; k <= point->NbCoordinates(); ++k) {
      key[static_cast<std::size_t>(k)] = std::bit_cast<std::uint64_t>(point->CoordinatesValue(k));
    }
    return points_.try_emplace(key, point).first->second;
  }

 private:
  struct Hash {
    std::size_t operator()(const std::array<std::uint64_t, 4>& key) const {
      std::uint64_t h = 0;
      for (const std::uint64_t k : key) h = (h ^ k ^ (h >> 29)) * 0x9e3779b97f4a7c15ULL;
      return h ^ (h >> 32);
    }
  };
  std::unordered_map<std::array<std::uint64_t, 4>, Handle(StepGeom_CartesianPoint), Hash> points_;
};

// The same model with every control point of curves and surfaces written once: neighbours share
// their sides', edges those of the surfaces beside them. It holds on to nothing but its entities.
Handle(StepData_StepModel) with_shared_points(const Handle(StepData_StepModel) & model) {
  PointPool pool;
  std::unordered_set<const Standard_Transient*> replaced;
  const auto share = [&](Handle(StepGeom_CartesianPoint) & point) {
    const Handle(StepGeom_CartesianPoint) kept = pool.shared(point);
    if (kept == point) return;
    replaced.insert(point.get());
    point = kept;
  };

  // The control points of curves and surfaces are nearly all points that there are.
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(Standard_Transient)& entity = model->Value(i);
    if (const auto curve = Handle(StepGeom_BSplineCurve)::DownCast(entity); !curve.IsNull()) {
      for (Handle(StepGeom_CartesianPoint) & p : *curve->ControlPointsList()) share(p);
    } else if (const auto surface = Handle(StepGeom_BSplineSurface)::DownCast(entity);
               !surface.IsNull()) {
      const Handle(StepGeom_HArray2OfCartesianPoint) points = surface->ControlPointsList();
      for (int r = points->LowerRow(); r <= points->UpperRow(); ++r) {
        for (int c = points->LowerCol(); c <= points->UpperCol(); ++c) {
          share(points->ChangeValue(r, c));
        }
      }
    }
  }

  const Handle(StepData_StepModel) result = new StepData_StepModel;
  result->SetProtocol(model->Protocol());
  Interface_EntityIterator header = model->Header();
  for (; header.More(); header.Next()) result->AddHeaderEntity(header.Value());
  for (int i = 1; i <= model->NbEntities(); ++i) {
    if (!replaced.contains(model->Value(i).get())) result->AddEntity(model->Value(i));
  }
  return result;
}

// The product's name, and names and colours of the faces. OpenCASCADE's writer of documents would
// set them too, after it has listed and checked for every entity which others share it.
void set_names_and_colours(const STEPControl_Writer& writer, const Solid& solid,
                           const std::string& product) {
  const auto model = Handle(StepData_StepModel)::DownCast(writer.WS()->Model());
  const Handle(Transfer_FinderProcess) made = writer.WS()->TransferWriter()->FinderProcess();
  STEPConstruct_Styles styles;
  STEPConstruct_DataMapOfAsciiStringTransient predefined_colours;
  STEPConstruct_DataMapOfPointTransient colours;

  std::size_t k = 0;
  for (TopExp_Explorer at(solid.shape->shape, TopAbs_FACE); at.More(); at.Next(), ++k) {
    const Handle(StepRepr_RepresentationItem) item = STEPConstruct::FindEntity(made, at.Current());
    if (item.IsNull()) continue;  // found missing when the file is read back
    item->SetName(text(solid.faces[k].name));
    const Handle(StepVisual_Colour) colour = STEPConstruct_Styles::EncodeColor(
        occt_colour(solid.faces[k].colour), predefined_colours, colours);
    styles.AddStyle(item, styles.MakeColorPSA(item, colour, nullptr, nullptr, 0.0), nullptr);
  }

  // Colours are drawn in the context of the shape (ISO 10303-46, presentation styles).
  Handle(StepRepr_RepresentationContext) context;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(Standard_Transient)& entity = model->Value(i);
    if (const auto named = Handle(StepBasic_Product)::DownCast(entity); !named.IsNull()) {
      named->SetId(text(product));  // OpenCASCADE numbers the products of a process
      named->SetName(text(product));
    } else if (const auto shape = Handle(StepShape_ShapeRepresentation)::DownCast(entity);
               !shape.IsNull()) {
      context = shape->ContextOfItems();
    }
  }
  Handle(StepVisual_MechanicalDesignGeometricPresentationRepresentation) drawn;
  if (styles.CreateMDGPR(context, drawn)) model->AddWithRefs(drawn);
}

// The entities of the solid. OpenCASCADE's maps from shapes to entities and the solid itself are
// not needed any longer when it returns.
Result<Handle(StepData_StepModel)> entities_of(const Solid& solid,
                                               const std::filesystem::path& path,
                                               const StepOptions& options,
                                               const Progress& progress) {
  STEPControl_Controller::Init();
  set_write_options(
      options);  // before the writer makes its model, which takes the schema from them

  STEPControl_Writer writer;
  const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "write STEP");
  const IFSelect_ReturnStatus done =
      writer.Transfer(solid.shape->shape, STEPControl_AsIs, false, indicator->Start());
  if (progress.should_stop()) return fail(cancelled("write STEP"));
  if (done != IFSelect_RetDone) {
    return cannot_write(path, "OpenCASCADE could not convert the solid to STEP");
  }

  set_names_and_colours(writer, solid, options.product);
  const auto model = Handle(StepData_StepModel)::DownCast(writer.WS()->Model());
  set_header(model, options);
  return with_shared_points(model);
}

// Takes the solid, and lets it go before the text is made.
Result<void> write_unchecked(Solid solid, const std::filesystem::path& path,
                             const StepOptions& options, const Progress& progress) {
  return write_checked(path, [&]() -> Result<void> {
    const auto model = entities_of(std::exchange(solid, {}), path, options, progress);
    if (!model) return fail(model.error());
    StepData_StepWriter text(*model);
    text.SendModel(Handle(StepData_Protocol)::DownCast((*model)->Protocol()));
    std::ofstream file(path, std::ios::binary);
    if (!text.Print(file) || !file.flush()) {
      return cannot_write(path, "OpenCASCADE could not write the file");
    }
    return {};
  });
}

Result<Solid> read_step(const std::filesystem::path& path, Healing healing,
                        const Progress& progress) {
  return read_document<STEPCAFControl_Reader>(
      path, {"STEP", "a STEP"}, healing, progress, [](STEPCAFControl_Reader& reader) {
        Interface_Static::SetIVal("read.stepcaf.subshapes.name", 1);
        Interface_Static::SetCVal("xstep.cascade.unit", "MM");
        reader.SetLayerMode(false);
        reader.SetPropsMode(false);
        reader.SetGDTMode(false);
        reader.SetMatMode(false);
      });
}

}  // namespace

Result<void> write_step(Solid solid, const std::filesystem::path& path, const StepOptions& options,
                        const Progress& progress) {
  return write_verified(
      std::move(solid), path,
      [&](Solid given, const std::filesystem::path& temporary) {
        return write_unchecked(std::move(given), temporary, options, progress);
      },
      [&](const std::filesystem::path& temporary) {
        return read_step(temporary, Healing::kNone, progress);
      });
}

Result<Solid> read_step(const std::filesystem::path& path, const Progress& progress) {
  return read_step(path, Healing::kAsReadersDo, progress);
}

}  // namespace angiospline
