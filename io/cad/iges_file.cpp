#include "io/cad/iges_file.h"

#include <utility>

#include <IGESBasic_Name.hxx>
#include <IGESCAFControl_Reader.hxx>
#include <IGESCAFControl_Writer.hxx>
#include <IGESControl_Controller.hxx>
#include <IGESData_GlobalSection.hxx>
#include <IGESData_IGESModel.hxx>
#include <Interface_Static.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TopExp_Explorer.hxx>
#include <TransferBRep.hxx>
#include <TransferBRep_ShapeMapper.hxx>
#include <Transfer_FinderProcess.hxx>

#include "io/cad/occt_exchange.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

// Repeatable bytes: the model's day is not news to its reader.
constexpr const char* kTimeStamp = "20000101.000000";

Handle(TCollection_HAsciiString) text(const std::string& value) {
  return new TCollection_HAsciiString(value.c_str());
}

// The global section (IGES 5.3, section 2.2.4.3).
void set_header(const Handle(IGESData_IGESModel) & model, const IgesOptions& options) {
  IGESData_GlobalSection header = model->GlobalSection();
  header.SetSendName(text(options.product));
  header.SetReceiveName(text(options.product));
  header.SetFileName(text(options.product));
  header.SetSystemId(text("Angiospline with OpenCASCADE"));
  header.SetInterfaceVersion(text("Angiospline"));
  header.SetDate(text(kTimeStamp));
  header.SetLastChangeDate(text(kTimeStamp));
  header.SetAuthorName(text(""));
  header.SetCompanyName(text(""));
  model->SetGlobalSection(header);
}

// OpenCASCADE's own way to write names goes through a map that is hashed by addresses: the order of
// the name entities, and with it the bytes, would differ from run to run.
void write_name(IGESControl_Writer& writer, const TopoDS_Shape& shape, const std::string& name) {
  const Handle(Transfer_FinderProcess) transfers = writer.TransferProcess();
  Handle(IGESData_IGESEntity) entity;
  if (!transfers->FindTypedTransient(TransferBRep::ShapeMapper(transfers, shape),
                                     STANDARD_TYPE(IGESData_IGESEntity), entity)) {
    return;
  }
  const Handle(IGESBasic_Name) property = new IGESBasic_Name;
  property->Init(1, text(name));
  entity->AddProperty(property);
  writer.AddEntity(property);
}

void write_names(IGESControl_Writer& writer, const Solid& solid, const IgesOptions& options) {
  write_name(writer, solid.shape->shape, options.product);
  std::size_t k = 0;
  for (TopExp_Explorer at(solid.shape->shape, TopAbs_FACE); at.More(); at.Next(), ++k) {
    write_name(writer, at.Current(), solid.faces[k].name);
  }
}

Result<void> write_unchecked(const Solid& solid, const std::filesystem::path& path,
                             const IgesOptions& options, const Progress& progress) {
  return write_checked(path, [&]() -> Result<void> {
    IGESControl_Controller::Init();
    Interface_Static::SetIVal("write.iges.brep.mode", 1);
    Interface_Static::SetCVal("write.iges.unit", "MM");
    Interface_Static::SetCVal("xstep.cascade.unit", "MM");
    IGESCAFControl_Writer writer;
    writer.SetNameMode(false);
    writer.SetColorMode(true);

    const Handle(TDocStd_Document) document = document_of(solid, options.product);
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "write IGES");
    const bool done = writer.Transfer(document, indicator->Start());
    document->Close();
    if (progress.should_stop()) return fail(cancelled("write IGES"));
    if (!done) return cannot_write(path, "OpenCASCADE could not convert the solid to IGES");

    write_names(writer, solid, options);
    set_header(writer.Model(), options);
    if (!writer.Write(path.c_str())) {
      return cannot_write(path, "OpenCASCADE could not write the file");
    }
    return {};
  });
}

Result<Solid> read_iges(const std::filesystem::path& path, Healing healing,
                        const Progress& progress) {
  return read_document<IGESCAFControl_Reader>(
      path, {"IGES", "an IGES"}, healing, progress,
      [](IGESCAFControl_Reader&) { Interface_Static::SetCVal("xstep.cascade.unit", "MM"); });
}

}  // namespace

Result<void> write_iges(Solid solid, const std::filesystem::path& path, const IgesOptions& options,
                        const Progress& progress) {
  return write_verified(
      std::move(solid), path,
      [&](Solid given, const std::filesystem::path& temporary) {
        return write_unchecked(std::move(given), temporary, options, progress);
      },
      [&](const std::filesystem::path& temporary) {
        return read_iges(temporary, Healing::kNone, progress);
      });
}

Result<Solid> read_iges(const std::filesystem::path& path, const Progress& progress) {
  return read_iges(path, Healing::kAsReadersDo, progress);
}

}  // namespace angiospline
