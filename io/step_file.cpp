#include "io/step_file.h"

#include <APIHeaderSection_MakeHeader.hxx>
#include <Interface_Static.hxx>
#include <STEPCAFControl_Controller.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPCAFControl_Writer.hxx>
#include <Standard_Failure.hxx>
#include <StepData_StepModel.hxx>
#include <TCollection_HAsciiString.hxx>
#include <XSControl_WorkSession.hxx>

#include "base/atomic_file.h"
#include "io/exchange.h"

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
  Interface_Static::SetIVal("write.stepcaf.subshapes.name", 1);
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

tl::unexpected<Error> cannot_write(const std::filesystem::path& path, std::string what) {
  return fail({ErrorKind::kCannotWrite, std::move(what), path.string(), {}, {}});
}

Result<void> write_unchecked(const Solid& solid, const std::filesystem::path& path,
                             const StepOptions& options, const Progress& progress) {
  try {
    const auto lock = lock_exchange();
    STEPCAFControl_Controller::Init();
    set_write_options(
        options);  // before the writer makes its model, which takes the schema from them
    STEPCAFControl_Writer writer;
    writer.SetNameMode(true);
    writer.SetColorMode(true);
    const Handle(TDocStd_Document) document = document_of(solid, options.product);
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "write STEP");
    const bool done = writer.Transfer(document, STEPControl_AsIs, nullptr, indicator->Start());
    document->Close();
    if (progress.should_stop()) return fail(cancelled("write STEP"));
    if (!done) return cannot_write(path, "OpenCASCADE could not convert the solid to STEP");
    set_header(Handle(StepData_StepModel)::DownCast(writer.ChangeWriter().WS()->Model()), options);
    if (writer.Write(path.c_str()) != IFSelect_RetDone) {
      return cannot_write(path, "OpenCASCADE could not write the file");
    }
    return {};
  } catch (const Standard_Failure& failure) {
    return cannot_write(path, std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  }
}

}  // namespace

Result<void> write_step(const Solid& solid, const std::filesystem::path& path,
                        const StepOptions& options, const Progress& progress) {
  return write_atomically(path, [&](const std::filesystem::path& temporary) -> Result<void> {
    if (auto done = write_unchecked(solid, temporary, options, progress); !done) {
      if (done.error().kind == ErrorKind::kCancelled) return done;
      return cannot_write(path, done.error().what);  // the user knows nothing of the temporary file
    }
    const Result<Solid> read = read_step(temporary, progress);
    if (!read) {
      if (read.error().kind == ErrorKind::kCancelled) return fail(read.error());
      return cannot_write(path, "cannot be read back: " + read.error().what);
    }
    return expect_same(solid, *read, path);
  });
}

Result<Solid> read_step(const std::filesystem::path& path, const Progress& progress) {
  if (auto readable = expect_readable(path); !readable) return fail(readable.error());
  const auto bad = [&](std::string what) {
    return fail({ErrorKind::kBadInput, std::move(what), path.string(), {}, {}});
  };
  try {
    const auto lock = lock_exchange();
    STEPCAFControl_Reader reader;
    Interface_Static::SetIVal("read.stepcaf.subshapes.name", 1);
    Interface_Static::SetCVal("xstep.cascade.unit", "MM");
    reader.SetNameMode(true);
    reader.SetColorMode(true);
    reader.SetLayerMode(false);
    reader.SetPropsMode(false);
    reader.SetGDTMode(false);
    reader.SetMatMode(false);
    if (reader.ReadFile(path.c_str()) != IFSelect_RetDone) return bad("is not a STEP file");
    Handle(TDocStd_Document) document = empty_document();
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "read STEP");
    const bool done = reader.Transfer(document, indicator->Start());
    if (progress.should_stop()) return fail(cancelled("read STEP"));
    if (!done) return bad("holds no shape that OpenCASCADE can read");
    Result<Solid> solid = solid_of(document, path);
    document->Close();
    return solid;
  } catch (const Standard_Failure& failure) {
    return bad(std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  }
}

}  // namespace angiospline
