#include <algorithm>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include <BRepPrimAPI_MakeBox.hxx>
#include <BRepPrimAPI_MakeCylinder.hxx>
#include <BRepTools.hxx>
#include <gtest/gtest.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/cad/brep_file.h"
#include "io/cad/iges_file.h"
#include "io/cad/occt_exchange.h"
#include "io/cad/rules.h"
#include "io/cad/step_file.h"
#include "modeling/check/certificate.h"
#include "tests/shapes/crafted_networks.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

struct Format {
  const char* suffix;
  std::function<Result<void>(const Solid&, const fs::path&, const Progress&)> write;
  std::function<Result<Solid>(const fs::path&, const Progress&)> read;
};

std::vector<Format> all_formats() {
  const auto step = [](StepSchema schema) {
    return [schema](const Solid& s, const fs::path& p, const Progress& progress) {
      return write_step(s, p, {schema, "tree 7"}, progress);
    };
  };
  return {{".242.step", step(StepSchema::kAp242), read_step},
          {".214.step", step(StepSchema::kAp214), read_step},
          {".igs",
           [](const Solid& s, const fs::path& p, const Progress& progress) {
             return write_iges(s, p, {"tree 7"}, progress);
           },
           read_iges},
          {".brep", write_brep, read_brep}};
}

class CadFiles : public testing::Test {
 protected:
  CadFiles() {
    folder_ =
        fs::temp_directory_path() / ("angiospline_cad_" + std::to_string(::getpid()) + "_" +
                                     testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  ~CadFiles() override { fs::remove_all(folder_); }

  fs::path folder_;
};

Solid sample() { return make_solid(crafted::tube_of_quarters(1, 6)).value(); }

TEST_F(CadFiles, ASurfaceThatMovedFartherThanRoundingIsNotTheOneWritten) {
  const Solid solid = make_solid(samples::model_of(samples::tube_with_t_vertex()).network).value();
  const SolidDigest digest = digest_of(solid);
  EXPECT_TRUE(expect_same(digest, solid, "f"));
  int moved = 0;
  for (std::size_t k = 0; k < digest.faces.size(); ++k) {
    if (digest.faces[k].samples_mm.empty()) continue;  // planes have none
    for (const double step : {0.5, 2.0}) {
      SolidDigest other = digest;
      other.faces[k].samples_mm[17].x() += step * kDigestTolerance * digest.size_mm;
      const auto same = expect_same(other, solid, "f");
      EXPECT_EQ(same.has_value(), step < 1) << digest.faces[k].name;
      if (!same) {
        EXPECT_EQ(same.error().what, "surface moved: " + digest.faces[k].name);
      }
      ++moved;
    }
  }
  EXPECT_GE(moved, 2);
}

TEST_F(CadFiles, FacesThatTurnedOrChangedTheirNamesAreNotThoseWritten) {
  const Solid solid = make_solid(samples::model_of(samples::tube_with_t_vertex()).network).value();
  SolidDigest digest = digest_of(solid);
  digest.faces[0].reversed = !digest.faces[0].reversed;
  EXPECT_EQ(expect_same(digest, solid, "f").error().what, "face is inside out");
  digest = digest_of(solid);
  digest.faces[0].name += "x";
  EXPECT_EQ(expect_same(digest, solid, "f").error().what,
            "face name did not survive: " + digest.faces[0].name);
  digest = digest_of(solid);
  ++digest.shells;
  EXPECT_EQ(expect_same(digest, solid, "f").error().what, "other number of shells read back");
}

TEST_F(CadFiles, KeepNamesKindsAndColoursOfEveryFace) {
  const Solid written = sample();
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const fs::path path = folder_ / (std::string("model") + format.suffix);
    const Result<void> done = format.write(written, path, {});
    ASSERT_TRUE(done) << done.error().message();
    const Result<Solid> read = format.read(path, {});
    ASSERT_TRUE(read) << read.error().message();
    ASSERT_EQ(read->faces.size(), written.faces.size());
    for (std::size_t k = 0; k < read->faces.size(); ++k) {
      EXPECT_EQ(read->faces[k].name, written.faces[k].name);
      EXPECT_EQ(read->faces[k].kind, written.faces[k].kind);
      EXPECT_LT((read->faces[k].colour - written.faces[k].colour).norm(), 1e-3);
    }
  }
}

TEST_F(CadFiles, CarrySeveralSolidsAndClosedRings) {
  SurfaceNetwork network = samples::bent_tube();
  SurfaceNetwork ring = samples::torus(3, 1);
  ring.control_points_mm.row(0).array() += 30;
  append(network, ring);
  const Solid written = make_solid(network).value();
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const fs::path path = folder_ / (std::string("model") + format.suffix);
    const Result<void> done = format.write(written, path, {});
    EXPECT_TRUE(done) << done.error().message();
  }
}

TEST_F(CadFiles, HaveTheSameBytesEveryTime) {
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const fs::path first = folder_ / (std::string("a") + format.suffix);
    const fs::path second = folder_ / (std::string("b") + format.suffix);
    ASSERT_TRUE(format.write(sample(), first, {}));
    ASSERT_TRUE(format.write(sample(), second, {}));
    EXPECT_EQ(read_file(first).value(), read_file(second).value());
  }
}

TEST_F(CadFiles, OfStepStateSchemaProductAndMillimetres) {
  const fs::path path = folder_ / "model.step";
  ASSERT_TRUE(write_step(sample(), path, {StepSchema::kAp242, "left carotid"}));
  const std::string text = read_file(path).value();
  EXPECT_NE(text.find("AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF"), std::string::npos);
  EXPECT_NE(text.find("PRODUCT('left carotid'"), std::string::npos);
  EXPECT_NE(text.find("SI_UNIT(.MILLI.,.METRE.)"), std::string::npos);
  ASSERT_TRUE(write_step(sample(), path, {StepSchema::kAp214, "left carotid"}));
  EXPECT_NE(read_file(path).value().find("AUTOMOTIVE_DESIGN"), std::string::npos);
}

// Neighbours share the control points of their common side, and edges those of the surfaces.
TEST_F(CadFiles, OfStepHoldEachControlPointOnce) {
  const fs::path path = folder_ / "model.step";
  ASSERT_TRUE(write_step(sample(), path));
  std::string text = read_file(path).value();
  std::erase_if(text, [](char c) { return c == '\n' || c == '\r'; });
  const auto entities = [&](const std::string& kind) {
    std::vector<std::string> found;
    for (std::size_t at = text.find(kind); at != std::string::npos; at = text.find(kind, at + 1)) {
      found.push_back(text.substr(at, text.find(';', at) - at));
    }
    return found;
  };
  std::vector<std::string> points = entities("CARTESIAN_POINT(");
  const std::size_t all = points.size();
  std::sort(points.begin(), points.end());
  const auto distinct =
      static_cast<std::size_t>(std::unique(points.begin(), points.end()) - points.begin());
  // Vertices, planes and lines have points of their own.
  const std::size_t own = entities("VERTEX_POINT(").size() +
                          entities("AXIS2_PLACEMENT_3D(").size() + entities("= LINE(").size();
  EXPECT_GT(distinct, 2 * own);
  EXPECT_LE(all, distinct + own);
}

TEST_F(CadFiles, AreNotLeftHalfWrittenWhenStopped) {
  Progress progress;
  progress.stop_requested = [] { return true; };
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const fs::path path = folder_ / (std::string("model") + format.suffix);
    const Result<void> done = format.write(sample(), path, progress);
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().kind, ErrorKind::kCancelled);
  }
  EXPECT_TRUE(fs::is_empty(folder_));
}

TEST_F(CadFiles, ByOthersWithoutNamesAreNumberedAndTheirEndsAreCaps) {
  const fs::path path = folder_ / "foreign.brep";
  BRepTools::Write(BRepPrimAPI_MakeCylinder(1, 5).Shape(), path.c_str());
  const Solid tube = read_brep(path).value();
  ASSERT_EQ(tube.faces.size(), 3U);
  EXPECT_EQ(tube.faces[0].name, "face_1");
  EXPECT_EQ(tube.faces[0].kind, FaceKind::kWall);
  EXPECT_EQ(tube.faces[1].kind, FaceKind::kCap);
  EXPECT_EQ(tube.faces[2].kind, FaceKind::kCap);
  const Certificate c = certify(tube).value();
  EXPECT_EQ(c.smooth_edges, 1);  // the seam
  EXPECT_LT(c.max_normal_angle_deg, 1e-9);
  BRepTools::Write(BRepPrimAPI_MakeBox(1, 2, 3).Shape(), path.c_str());
  const Solid box = read_brep(path).value();
  ASSERT_EQ(box.faces.size(), 6U);
  for (const SolidFace& face : box.faces) EXPECT_EQ(face.kind, FaceKind::kWall);
}

TEST_F(CadFiles, InOtherUnitsAreReadInMillimetres) {
  const Solid written = sample();
  const fs::path path = folder_ / "model.step";
  ASSERT_TRUE(write_step(written, path));
  std::string text = read_file(path).value();
  const std::string unit = "SI_UNIT(.MILLI.,.METRE.)";
  ASSERT_NE(text.find(unit), std::string::npos);
  for (std::size_t at = text.find(unit); at != std::string::npos; at = text.find(unit)) {
    text.replace(at, unit.size(), "SI_UNIT(.CENTI.,.METRE.)");
  }
  ASSERT_TRUE(write_file(path, text));
  const double in_mm = certify(written).value().volume_mm3;
  EXPECT_NEAR(certify(read_step(path).value()).value().volume_mm3, 1000 * in_mm, 1e-6 * in_mm);
}

TEST_F(CadFiles, ThatCannotBeWrittenAreNamed) {
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const fs::path path = folder_ / "missing" / (std::string("model") + format.suffix);
    const Result<void> done = format.write(sample(), path, {});
    ASSERT_FALSE(done);
    EXPECT_EQ(done.error().kind, ErrorKind::kCannotWrite);
    EXPECT_NE(done.error().message().find("missing"), std::string::npos);
  }
}

TEST_F(CadFiles, ThatAreMissingEmptyTruncatedOrNonsenseAreErrors) {
  for (const Format& format : all_formats()) {
    SCOPED_TRACE(format.suffix);
    const auto expect_error = [&](const fs::path& path, const char* what) {
      SCOPED_TRACE(what);
      const Result<Solid> read = format.read(path, {});
      ASSERT_FALSE(read);
      EXPECT_EQ(read.error().kind, ErrorKind::kBadInput);
      EXPECT_NE(read.error().message().find(path.string()), std::string::npos);
    };
    expect_error(folder_ / "nothing", "missing");
    expect_error(folder_, "a folder");
    const fs::path empty = folder_ / (std::string("empty") + format.suffix);
    ASSERT_TRUE(write_file(empty, ""));
    expect_error(empty, "empty");
    const fs::path nonsense = folder_ / (std::string("nonsense") + format.suffix);
    ASSERT_TRUE(write_file(nonsense, std::string(2000, 'x') + "\nISO-10303-21;\n"));
    expect_error(nonsense, "nonsense");
    const fs::path whole = folder_ / (std::string("whole") + format.suffix);
    ASSERT_TRUE(format.write(sample(), whole, {}));
    const std::string bytes = read_file(whole).value();
    const fs::path cut = folder_ / (std::string("cut") + format.suffix);
    for (const double share : {0.02, 0.3}) {
      ASSERT_TRUE(write_file(cut, bytes.substr(0, static_cast<std::size_t>(
                                                      share * static_cast<double>(bytes.size())))));
      expect_error(cut, "cut off");
    }
  }
}

}  // namespace
}  // namespace angiospline
