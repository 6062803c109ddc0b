#include "io/cad/brep_file.h"

#include <exception>
#include <fstream>
#include <locale>
#include <optional>
#include <sstream>
#include <utility>

#include <BRepTools.hxx>
#include <BRep_Builder.hxx>
#include <Standard_Failure.hxx>
#include <TopExp_Explorer.hxx>

#include "base/atomic_file.h"
#include "io/cad/occt_exchange.h"
#include "modeling/solid/solid_shape.h"

namespace angiospline {
namespace {

// The line that opens the list of faces behind the shape; then one line a face:
// kind, radius in mm, red, green, blue, name.
constexpr const char* kFacesHeading = "Angiospline faces 1";

Result<void> write_unchecked(const Solid& solid, const std::filesystem::path& path,
                             const Progress& progress) {
  try {
    std::ofstream file(path, std::ios::binary);
    file.imbue(std::locale::classic());
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "write BREP");
    BRepTools::Write(solid.shape->shape, file, false, false, TopTools_FormatVersion_VERSION_1,
                     indicator->Start());
    if (progress.should_stop()) return fail(cancelled("write BREP"));

    // Behind the shape, where OpenCASCADE stops reading, stand the names and colours.
    file << '\n' << kFacesHeading << ' ' << solid.faces.size() << '\n';
    file.precision(17);
    for (const SolidFace& face : solid.faces) {
      file << to_string(face.kind) << ' ' << face.radius_mm << ' ' << face.colour.x() << ' '
           << face.colour.y() << ' ' << face.colour.z() << ' ' << face.name << '\n';
    }
    file.close();
    if (!file) return cannot_write(path, "could not be written");
    return {};
  } catch (const Standard_Failure& failure) {
    return cannot_write(path, std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  } catch (const std::exception&) {  // from a stream that OpenCASCADE could not go on writing to
    return cannot_write(path, "could not be written");
  }
}

FaceKind kind_of_word(const std::string& word) {
  for (const FaceKind kind : {FaceKind::kInlet, FaceKind::kOutlet, FaceKind::kCap}) {
    if (to_string(kind) == word) return kind;
  }
  return FaceKind::kWall;
}

// The faces' lines, if they are there and there is one for each face.
std::vector<SolidFace> read_faces(std::istream& in, std::size_t count) {
  std::vector<SolidFace> faces;
  std::string line;
  const std::string heading = kFacesHeading + (' ' + std::to_string(count));
  while (std::getline(in, line) && line != heading) {
  }

  while (faces.size() < count && std::getline(in, line)) {
    std::istringstream words(line);
    words.imbue(std::locale::classic());
    SolidFace face;
    std::string kind;
    words >> kind >> face.radius_mm >> face.colour.x() >> face.colour.y() >> face.colour.z();
    if (!words || !std::getline(words >> std::ws, face.name)) return {};
    face.kind = kind_of_word(kind);
    faces.push_back(std::move(face));
  }
  if (faces.size() != count) faces.clear();
  return faces;
}

// The faces of another program's file.
std::vector<SolidFace> faces_without_names(const TopoDS_Shape& shape, std::size_t count) {
  std::vector<SolidFace> faces;
  for (std::size_t k = 0; k < count; ++k) {
    const std::string name = "face_" + std::to_string(k + 1);
    faces.push_back({name, FaceKind::kWall, 0.0, face_colour(FaceKind::kWall, name)});
  }
  mark_caps(shape, faces);
  return faces;
}

// The first table that the text lacks, or nothing. OpenCASCADE's reader would say so on stdout.
std::optional<std::string> find_missing_table(const std::string& text) {
  std::size_t at = 0;
  for (const char* table :
       {"CASCADE Topology V", "Locations ", "Curve2ds ", "Curves ", "Polygon3D ",
        "PolygonOnTriangulations ", "Surfaces ", "Triangulations ", "TShapes "}) {
    const std::size_t found = text.find('\n' + std::string(table), at);
    if (found == std::string::npos) return std::string(table);
    at = found + 1;
  }
  return std::nullopt;
}

}  // namespace

Result<void> write_brep(Solid solid, const std::filesystem::path& path, const Progress& progress) {
  return write_verified(
      std::move(solid), path,
      [&](Solid given, const std::filesystem::path& temporary) {
        return write_unchecked(std::move(given), temporary, progress);
      },
      [&](const std::filesystem::path& temporary) { return read_brep(temporary, progress); });
}

Result<Solid> read_brep(const std::filesystem::path& path, const Progress& progress) {
  if (auto readable = expect_readable(path); !readable) return fail(readable.error());
  const auto bad = [&](std::string what) {
    return fail({ErrorKind::kBadInput, std::move(what), path.string(), {}, {}});
  };
  try {
    const Result<std::string> text = read_file(path);
    if (!text) return fail(text.error());
    if (const auto missing = find_missing_table('\n' + *text)) {
      return fail({ErrorKind::kBadInput,
                   "is not a whole BREP file",
                   path.string(),
                   "no line \"" + *missing + "...\"",
                   {}});
    }

    std::istringstream file(*text);
    file.imbue(std::locale::classic());
    TopoDS_Shape shape;
    const Handle(ExchangeProgress) indicator = new ExchangeProgress(progress, "read BREP");
    BRepTools::Read(shape, file, BRep_Builder(), indicator->Start());
    if (progress.should_stop()) return fail(cancelled("read BREP"));
    if (shape.IsNull()) return bad("is not a BREP file");
    std::size_t count = 0;
    for (TopExp_Explorer at(shape, TopAbs_FACE); at.More(); at.Next()) ++count;
    if (count == 0) return bad("holds no face");

    // Our own lines stand behind the shape, at whose end the stream may have stopped.
    file.clear();
    std::vector<SolidFace> faces = read_faces(file, count);
    if (faces.empty()) faces = faces_without_names(shape, count);
    return make_solid_value(shape, std::move(faces));
  } catch (const Standard_Failure& failure) {
    return bad(std::string("OpenCASCADE failed: ") + failure.GetMessageString());
  } catch (const std::exception& failure) {
    return bad(std::string("cannot be read: ") + failure.what());
  }
}

}  // namespace angiospline
