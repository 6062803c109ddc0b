// What STEP and IGES have in common: OpenCASCADE's document of shapes with names and colours.
// Only the files of io that know OpenCASCADE include this header.
#pragma once

#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <IFSelect_ReturnStatus.hxx>
#include <Message_ProgressIndicator.hxx>
#include <Quantity_Color.hxx>
#include <Standard_Failure.hxx>
#include <TDocStd_Document.hxx>
#include <TopoDS_Shape.hxx>
#include <XSAlgo_AlgoContainer.hxx>

#include "base/progress.h"
#include "base/result.h"
#include "modeling/solid/solid.h"

namespace angiospline {

// OpenCASCADE's exchange settings are global to the process: every reader and writer holds this
// lock, and its messages are kept off our streams.
std::unique_lock<std::mutex> lock_exchange();

// A colour of ours, red, green, blue in [0, 1] (sRGB).
Quantity_Color occt_colour(const Vec3& srgb);

// A new document with the solid under the product's name, and its faces' names and colours.
Handle(TDocStd_Document) document_of(const Solid& solid, const std::string& product);

// An empty document for a reader to fill.
Handle(TDocStd_Document) empty_document();

// All free shapes of the document as one value, with the names and colours of its faces; faces
// without a name are called "face_<k>", counted from 1. Kinds come from the names; where no face
// has one, plane faces with one loop and only curved neighbours are caps: the ends of a tube.
// Errors: there is no face in it; `path` says where.
Result<Solid> solid_of(const Handle(TDocStd_Document) & document,
                       const std::filesystem::path& path);

// Marks as caps the plane faces with one loop whose neighbours are all curved. Requires one entry
// of `faces` for each face of the shape, in its order.
void mark_caps(const TopoDS_Shape& shape, std::vector<SolidFace>& faces);

// Points of each curved face that are compared.
inline constexpr int kDigestSamples = 49;

// What a solid's file is compared with. It shares no memory with the solid, so that a large one can
// be let go before its file is read back: 1.3 kB a face.
struct SolidDigest {
  struct Face {
    std::string name;
    bool reversed = false;
    std::vector<Vec3> samples_mm;  // kDigestSamples, or none of a plane
  };
  int solids = 0;
  int shells = 0;
  double size_mm = 0.0;  // diagonal of the bounding box
  std::vector<Face> faces;
};

SolidDigest digest_of(const Solid& solid);

// Nothing if `read` is what was written: solids, closed shells, faces in order with names and
// orientations, surfaces at 49 points each within 1e-9 of the model's size; otherwise what differs.
Result<void> expect_same(const SolidDigest& written, const Solid& read,
                         const std::filesystem::path& path);

tl::unexpected<Error> cannot_write(const std::filesystem::path& path, std::string what);

// Writes a solid into a temporary file beside `path`, lets it go, reads the file back and compares;
// only then the file has its name. Errors: those of `write` and `read`, what differs, all of them
// naming `path`; stopped on request.
Result<void> write_verified(
    Solid solid, const std::filesystem::path& path,
    const std::function<Result<void>(Solid, const std::filesystem::path&)>& write,
    const std::function<Result<Solid>(const std::filesystem::path&)>& read);

// What is done to shapes that are read. Our own files are compared as they are.
enum class Healing { kAsReadersDo, kNone };

// While it lives, OpenCASCADE's readers do not heal what they read: a file is compared with what
// stands in it, not with what was mended, in a third less time. Hold lock_exchange().
class WithoutHealing {
 public:
  WithoutHealing();
  ~WithoutHealing();
  WithoutHealing(const WithoutHealing&) = delete;
  WithoutHealing& operator=(const WithoutHealing&) = delete;

 private:
  Handle(XSAlgo_AlgoContainer) kept_;
};

// Errors for a file that is not there, is a folder, or is empty.
Result<void> expect_readable(const std::filesystem::path& path);

// OpenCASCADE's progress, told to ours. Lives on the heap under a handle.
class ExchangeProgress : public Message_ProgressIndicator {
 public:
  ExchangeProgress(const Progress& progress, std::string stage)
      : progress_(progress), stage_(std::move(stage)) {}

 protected:
  void Show(const Message_ProgressScope& scope, Standard_Boolean force) override;
  Standard_Boolean UserBreak() override { return progress_.should_stop(); }

 private:
  const Progress& progress_;
  std::string stage_;
};

// A format of files as messages call it.
struct ExchangeFormat {
  const char* name;
  const char* one;  // with its article
};

// The solid in a file, by the `Reader` of documents that OpenCASCADE has for its format. `prepare`
// sets what is the format's own before the file is read. Errors: no such file, a folder, an empty
// file; not of the format; no shape or no face in it; stopped on request; OpenCASCADE failed. All
// name the file.
template <typename Reader, typename Prepare>
Result<Solid> read_document(const std::filesystem::path& path, const ExchangeFormat& format,
                            Healing healing, const Progress& progress, const Prepare& prepare) {
  if (auto readable = expect_readable(path); !readable) return fail(readable.error());
  const auto bad = [&](std::string what) {
    return fail({ErrorKind::kBadInput, std::move(what), path.string(), {}, {}});
  };
  const std::string stage = std::string("read ") + format.name;
  try {
    // The reader is made first: its constructor defines the settings that `prepare` changes.
    const auto lock = lock_exchange();
    Reader reader;
    std::optional<WithoutHealing> unhealed;
    if (healing == Healing::kNone) unhealed.emplace();
    prepare(reader);
    reader.SetNameMode(true);
    reader.SetColorMode(true);
    if (reader.ReadFile(path.c_str()) != IFSelect_RetDone) {
      return bad(std::string("is not ") + format.one + " file");
    }

    Handle(TDocStd_Document) document = empty_document();
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, stage);
    const bool done = reader.Transfer(document, indicator->Start());
    if (progress.should_stop()) return fail(cancelled(stage));
    if (!done) return bad("holds no shape that OpenCASCADE can read");

    Result<Solid> solid = solid_of(document, path);
    document->Close();
    return solid;
  } catch (const Standard_Failure& failure) {
    return bad(std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  }
}

// Runs `write` alone among readers and writers. Errors: its own; OpenCASCADE failed.
template <typename Write>
Result<void> write_checked(const std::filesystem::path& path, const Write& write) {
  try {
    const auto lock = lock_exchange();
    return write();
  } catch (const Standard_Failure& failure) {
    return cannot_write(path, std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  }
}

}  // namespace angiospline
