#include <cmath>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <limits>

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/images/image_file.h"
#include "recovery/phantoms/phantom.h"
#include "tests/shapes/dicom_slice.h"

namespace angiospline {
namespace {

using test::dicom_slice;

namespace fs = std::filesystem;

class ImageFiles : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::temp_directory_path() /
              ("angiospline-images-" + std::to_string(::getpid()) + "-" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  fs::path put(const std::string& name, const std::string& bytes) const {
    const fs::path path = folder_ / name;
    fs::create_directories(path.parent_path());
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  static std::string message(const fs::path& path) {
    const auto image = read_image(path);
    return image ? "" : image.error().message();
  }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::recursive_directory_iterator(folder_),
                                                  fs::recursive_directory_iterator()));
  }

  fs::path folder_;
};

using RealDataImages = ImageFiles;

// ---- round trips ------------------------------------------------------------------------------

ImageGrid oblique_grid() {
  ImageGrid grid;
  grid.size = {5, 4, 3};
  grid.spacing_mm = Vec3(0.5, 0.75, 1.25);
  grid.origin_mm = Vec3(-12.5, 30.25, 7.125);
  const double c = std::cos(0.3), s = std::sin(0.3);
  grid.direction << c, -s, 0, s, c, 0, 0, 0, -1;  // left-handed on purpose
  return grid;
}

template <typename T>
Image<T> pattern(const ImageGrid& grid) {
  Image<T> image(grid);
  for (std::size_t i = 0; i < image.voxels.size(); ++i)
    image.voxels[i] =
        static_cast<T>(std::is_signed_v<T> ? static_cast<int>(i) - 30 : static_cast<int>(i));
  return image;
}

template <typename T>
class ImageRoundTrip : public ImageFiles {};
using PixelTypes = ::testing::Types<std::uint8_t, std::int8_t, std::uint16_t, std::int16_t,
                                    std::uint32_t, std::int32_t, float, double>;
TYPED_TEST_SUITE(ImageRoundTrip, PixelTypes);

TYPED_TEST(ImageRoundTrip, KeepsPixelTypeValuesAndObliqueGeometry) {
  const Image<TypeParam> image = pattern<TypeParam>(oblique_grid());
  for (const char* name : {"a.nii", "a.nii.gz", "a.nrrd", "a.mha", "a.vti"}) {
    SCOPED_TRACE(name);
    const fs::path path = this->folder_ / name;
    const auto written = write_image(image, path);
    ASSERT_TRUE(written.has_value()) << written.error().message();
    const auto read = read_image(path);
    ASSERT_TRUE(read.has_value()) << read.error().message();
    const auto* back = std::get_if<Image<TypeParam>>(&read->image);
    ASSERT_NE(back, nullptr) << pixel_type_name(read->image);
    EXPECT_EQ(back->voxels, image.voxels);
    EXPECT_EQ(back->grid.size, image.grid.size);
    // NIfTI keeps its geometry in single precision.
    EXPECT_TRUE(back->grid.spacing_mm.isApprox(image.grid.spacing_mm, 1e-6));
    EXPECT_TRUE(back->grid.origin_mm.isApprox(image.grid.origin_mm, 1e-6));
    EXPECT_TRUE(back->grid.direction.isApprox(image.grid.direction, 1e-6)) << back->grid.direction;
    EXPECT_TRUE((back->grid.direction.transpose() * back->grid.direction).isIdentity(1e-12));
  }
  EXPECT_EQ(this->files(), 5U);  // nothing but the targets
}

TEST_F(ImageFiles, TiffStacksKeepValuesAndTakeSpacingFromTheCaller) {
  const Image<std::uint16_t> image = pattern<std::uint16_t>(oblique_grid());
  ASSERT_TRUE(write_image(image, folder_ / "a.tif").has_value());
  ReadImageOptions options;
  options.stack_spacing_mm = Vec3(0.5, 0.5, 2);
  const auto read = read_image(folder_ / "a.tif", options);
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(std::get<Image<std::uint16_t>>(read->image).voxels, image.voxels);
  EXPECT_EQ(grid_of(read->image).spacing_mm, Vec3(0.5, 0.5, 2));
  EXPECT_TRUE(read->notes.empty());
  const auto assumed = read_image(folder_ / "a.tif");
  ASSERT_TRUE(assumed.has_value());
  ASSERT_EQ(assumed->notes.size(), 1U);  // says that it assumed 1 mm
}

TEST_F(ImageFiles, FoldersOfSlicesAreReadInNaturalOrder) {
  for (const int k : {1, 2, 10}) {
    Image<std::uint8_t> slice;
    slice.grid.size = {4, 3, 1};
    slice.voxels.assign(12, static_cast<std::uint8_t>(k));
    ASSERT_TRUE(write_image(slice, folder_ / ("slice_" + std::to_string(k) + ".tif")).has_value());
  }
  const auto read = read_image(folder_);
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(grid_of(read->image).size, (Voxel{4, 3, 3}));
  EXPECT_EQ(value_at(read->image, {0, 0, 0}), 1);
  EXPECT_EQ(value_at(read->image, {0, 0, 1}), 2);
  EXPECT_EQ(value_at(read->image, {0, 0, 2}), 10);
  Image<std::uint8_t> odd;
  odd.grid.size = {5, 3, 1};
  odd.voxels.assign(15, 0);
  ASSERT_TRUE(write_image(odd, folder_ / "slice_11.tif").has_value());
  EXPECT_NE(message(folder_).find("slice_11.tif: slice has another size: 5x3"), std::string::npos)
      << message(folder_);
}

// ---- NIfTI by hand ----------------------------------------------------------------------------

struct NiftiText {
  std::array<std::int16_t, 8> dim{3, 4, 5, 6, 1, 1, 1, 1};
  std::array<float, 8> pixdim{1, 0.5F, 0.6F, 0.7F, 0, 0, 0, 0};
  std::int16_t datatype = 4, bits = 16;
  float slope = 1, intercept = 0;
  std::string voxels = std::string(240, '\1');

  std::string bytes() const {
    std::string h(352, '\0');
    const auto set = [&](std::size_t at, const auto& value) {
      std::memcpy(&h[at], &value, sizeof value);
    };
    set(0, std::int32_t{348});
    set(40, dim);
    set(70, datatype);
    set(72, bits);
    set(76, pixdim);
    set(108, 352.0F);
    set(112, slope);
    set(116, intercept);
    set(254, std::int16_t{1});  // sform
    const float rows[3][4] = {{pixdim[1], 0, 0, -5}, {0, pixdim[2], 0, -6}, {0, 0, pixdim[3], 7}};
    set(280, rows);
    std::memcpy(&h[344], "n+1", 4);
    return h + voxels;
  }
};

TEST_F(ImageFiles, NiftiIsTurnedFromRasToLps) {
  const auto read = read_image(put("a.nii", NiftiText().bytes()));
  ASSERT_TRUE(read.has_value()) << read.error().message();
  const ImageGrid& grid = grid_of(read->image);
  EXPECT_TRUE(grid.world_mm(Voxel{0, 0, 0}).isApprox(Vec3(5, 6, 7), 1e-6));
  EXPECT_TRUE(grid.world_mm(Voxel{1, 1, 1}).isApprox(Vec3(4.5, 5.4, 7.7), 1e-6));
  EXPECT_EQ(pixel_type_name(read->image), "int16");
}

TEST_F(ImageFiles, SlopeAndInterceptAreApplied) {
  NiftiText n;
  n.slope = 2.5F;
  n.intercept = -10;
  const auto read = read_image(put("a.nii", n.bytes()));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(pixel_type_name(read->image), "float");
  EXPECT_FLOAT_EQ(static_cast<float>(value_at(read->image, {1, 1, 1})), 2.5F * 257 - 10);
  n.slope = std::numeric_limits<float>::quiet_NaN();
  n.intercept = std::numeric_limits<float>::quiet_NaN();
  const auto unscaled = read_image(put("b.nii", n.bytes()));
  ASSERT_TRUE(unscaled.has_value());
  EXPECT_EQ(value_at(unscaled->image, {1, 1, 1}), 257);
  ASSERT_EQ(unscaled->notes.size(), 2U);
  const std::string meta =
      "NDims = 3\nDimSize = 4 5 6\nElementType = MET_UCHAR\n"
      "ElementToIntensityFunctionSlope = 2\nElementToIntensityFunctionOffset = 3\n"
      "ElementDataFile = LOCAL\n" +
      std::string(120, '\5');
  const auto scaled = read_image(put("c.mha", meta));
  ASSERT_TRUE(scaled.has_value()) << scaled.error().message();
  EXPECT_EQ(value_at(scaled->image, {1, 1, 1}), 13);
}

TEST_F(ImageFiles, VoxelsThatAreNotFiniteAreKeptAndCounted) {
  NiftiText n;
  n.datatype = 16;
  n.bits = 32;
  std::vector<float> values(120, 1.5F);
  values[7] = std::numeric_limits<float>::quiet_NaN();
  values[9] = std::numeric_limits<float>::infinity();
  n.voxels.assign(480, '\0');
  std::memcpy(n.voxels.data(), values.data(), 480);
  const auto read = read_image(put("a.nii", n.bytes()));
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->non_finite, 2U);
  ASSERT_EQ(read->notes.size(), 1U);
  EXPECT_TRUE(std::isnan(std::get<Image<float>>(read->image).voxels[7]));
  EXPECT_TRUE(std::isinf(std::get<Image<float>>(read->image).voxels[9]));
  // And through a file of our own.
  ASSERT_TRUE(write_image(read->image, folder_ / "b.nii.gz").has_value());
  EXPECT_EQ(read_image(folder_ / "b.nii.gz")->non_finite, 2U);
}

TEST_F(ImageFiles, AFourthAxisOfOneIsNoFourthAxis) {
  NiftiText n;
  n.dim = {4, 4, 5, 6, 1, 1, 1, 1};
  EXPECT_EQ(message(put("a.nii", n.bytes())), "");
}

struct Malformed {
  const char* name;
  std::string bytes;
  const char* says;  // a part of the message
};

TEST_F(ImageFiles, MalformedFilesGetOneLineThatNamesFileValueAndRule) {
  const auto nifti = [](auto&& change) {
    NiftiText n;
    change(n);
    return n.bytes();
  };
  const std::string good = NiftiText().bytes();
  const std::string meta =
      "NDims = 3\nDimSize = 4 5 6\nElementSpacing = 1 {} 1\nElementType = MET_SHORT\n"
      "ElementDataFile = LOCAL\n";
  const auto meta_spacing = [&](const char* s) {
    std::string text = meta;
    return text.replace(text.find("{}"), 2, s) + std::string(240, '\1');
  };
  const std::string nrrd =
      "NRRD0004\ntype: short\ndimension: 3\nsizes: 4 5 6\nendian: little\n"
      "encoding: raw\n";
  const std::vector<Malformed> cases = {
      {"empty.nii", "", "file is empty"},
      {"text.nii", std::string(400, 'x'), "NIfTI header"},
      {"header.nii", good.substr(0, 100), "NIfTI header"},
      {"short.nii", good.substr(0, 400), "cut short: 400 bytes"},
      {"zero.nii", nifti([](NiftiText& n) { n.pixdim[2] = 0; }),
       "spacing of axis 1 is not positive: 0"},
      {"negative.nii", nifti([](NiftiText& n) { n.pixdim[1] = -2; }), "spacing of axis 0"},
      {"nan.nii", nifti([](NiftiText& n) { n.pixdim[3] = std::nanf(""); }),
       "axis 2 is not positive: nan"},
      {"extent.nii", nifti([](NiftiText& n) { n.dim[2] = -5; }),
       "extent of axis 1 is not positive: -5"},
      {"huge.nii", nifti([](NiftiText& n) { n.dim = {3, 30000, 30000, 30000, 1, 1, 1, 1}; }),
       "cut short"},
      {"flat.nii", nifti([](NiftiText& n) { n.dim = {2, 4, 30, 1, 1, 1, 1, 1}; }),
       "image is 2-D: 4x30"},
      {"slab.nii", nifti([](NiftiText& n) { n.dim = {3, 4, 1, 30, 1, 1, 1, 1}; }),
       "image is 2-D: 4x1x30"},
      {"time.nii", nifti([](NiftiText& n) { n.dim = {4, 4, 5, 3, 2, 1, 1, 1}; }),
       "image is 4-D: 4x5x3x2"},
      {"colour.nii",
       nifti([](NiftiText& n) { n.datatype = 128, n.bits = 24, n.voxels.assign(360, 'a'); }),
       "voxels are vectors: 3 components"},
      {"short.mha", meta_spacing("1").substr(0, 200), "file is cut short"},
      {"zero.mha", meta_spacing("0"), "spacing is not positive: 1 0 1"},
      {"negative.mha", meta_spacing("-1"), "spacing is not positive: 1 -1 1"},
      {"nan.mha", meta_spacing("nan"), "spacing is not positive"},
      {"text.mha", "hello", "must give NDims"},
      {"lost.mhd",
       "NDims = 3\nDimSize = 4 5 6\nElementType = MET_SHORT\nElementDataFile = no.raw\n",
       "file of voxels is missing: no.raw"},
      {"short.nrrd", nrrd + "\n" + std::string(100, '\1'), "cannot be read as NRRD"},
      {"negative.nrrd", nrrd + "spacings: 1 -2 1\n\n" + std::string(240, '\1'),
       "spacing of axis 1"},
      {"shear.nrrd",
       nrrd + "space: left-posterior-superior\nspace directions: (1,0,0) (.4,1,0) (0,0,1)\n\n" +
           std::string(240, '\1'),
       "not orthogonal"},
      {"text.tif", "hello", "cannot be read as TIFF"},
      {"text.vti", "hello", "cannot be read as VTI"},
      {"text.dcm", "hello", "cannot be read as DICOM"},
      {"what.xyz", "hello", "not known by its suffix"}};
  for (const Malformed& m : cases) {
    const fs::path path = put(m.name, m.bytes);
    ::testing::internal::CaptureStderr();
    const std::string said = message(path);
    EXPECT_EQ(::testing::internal::GetCapturedStderr(), "") << m.name;  // the libraries keep quiet
    EXPECT_NE(said.find(m.says), std::string::npos) << m.name << ": " << said;
    EXPECT_EQ(said.rfind(path.string(), 0), 0U) << said;
    EXPECT_EQ(said.find('\n'), std::string::npos) << said;
  }
  EXPECT_NE(message(folder_ / "missing.nii").find("there is no such file"), std::string::npos);
}

TEST_F(ImageFiles, TruncatedGzipIsSeen) {
  Image<std::uint16_t> noise;
  noise.grid.size = {20, 20, 20};
  for (unsigned i = 0; i < 8000; ++i)
    noise.voxels.push_back(static_cast<std::uint16_t>(i * 2654435761U >> 8));
  ASSERT_TRUE(write_image(noise, folder_ / "a.nii.gz").has_value());
  const std::string bytes = *read_file(folder_ / "a.nii.gz");
  const std::string said = message(put("b.nii.gz", bytes.substr(0, bytes.size() / 2)));
  EXPECT_NE(said.find("file is cut short"), std::string::npos) << said;
}

TEST_F(ImageFiles, RefusesToWriteWhatItCannotAndLeavesNothingBehind) {
  const Image<std::uint8_t> image = pattern<std::uint8_t>(oblique_grid());
  for (const char* name : {"a.png", "a.dcm", "a", "no/such/folder/a.nii"}) {
    const auto written = write_image(image, folder_ / name);
    ASSERT_FALSE(written.has_value()) << name;
    EXPECT_EQ(written.error().kind, ErrorKind::kCannotWrite);
    EXPECT_NE(written.error().message().find(name), std::string::npos);
  }
  EXPECT_EQ(files(), 0U);
}

TEST_F(ImageFiles, FlatImagesAreReadOnRequest) {
  NiftiText n;
  n.dim = {2, 10, 12, 1, 1, 1, 1, 1};
  const fs::path path = put("a.nii", n.bytes());
  const auto flat = read_flat_image(path);
  ASSERT_TRUE(flat.has_value()) << flat.error().message();
  EXPECT_EQ(grid_of(flat->image).size, (Voxel{10, 12, 1}));
  EXPECT_FALSE(read_flat_image(put("b.nii", NiftiText().bytes())).has_value());
}

TEST_F(ImageFiles, DicomSlicesAreStackedByPositionNotByName) {
  const double heights[] = {4.5, 0, 1.5, 3};
  for (int k = 0; k < 4; ++k)
    put("series/" + std::to_string(k) + ".dcm", dicom_slice(heights[k], "1.2.3.4"));
  const auto read = read_image(folder_ / "series");
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(read->format, "DICOM series");
  EXPECT_EQ(grid_of(read->image).size, (Voxel{5, 4, 4}));
  EXPECT_EQ(pixel_type_name(read->image), "uint16");
  EXPECT_TRUE(grid_of(read->image).spacing_mm.isApprox(Vec3(0.25, 0.5, 1.5)));
  EXPECT_TRUE(grid_of(read->image).origin_mm.isApprox(Vec3(10, 20, 0)));
  for (int z = 0; z < 4; ++z) EXPECT_EQ(value_at(read->image, {2, 1, z}), 15 * z + 7);
}

TEST_F(ImageFiles, DicomScalingIsApplied) {
  for (int k = 0; k < 3; ++k)
    put("s/" + std::to_string(k) + ".dcm", dicom_slice(k, "1.2.3.4", 4, 0.5));
  const auto read = read_image(folder_ / "s");
  ASSERT_TRUE(read.has_value()) << read.error().message();
  EXPECT_EQ(value_at(read->image, {2, 1, 2}), 0.5 * (20 + 7));
}

TEST_F(ImageFiles, DicomFoldersThatAreNotOneSoundSeriesAreRefused) {
  for (const double z : {0.0, 1.0, 2.0, 4.0, 5.0})
    put("gap/" + std::to_string(z) + ".dcm", dicom_slice(z, "1.2.3.4"));
  EXPECT_NE(message(folder_ / "gap").find("not at even distances: 2 mm"), std::string::npos)
      << message(folder_ / "gap");
  for (int k = 0; k < 3; ++k) {
    put("twice/" + std::to_string(k) + ".dcm", dicom_slice(k, "1.2.3.4"));
    put("mixed/a" + std::to_string(k) + ".dcm", dicom_slice(k, "1.2.3.4"));
    put("mixed/b" + std::to_string(k) + ".dcm", dicom_slice(k, "1.2.3.5"));
    put("sizes/" + std::to_string(k) + ".dcm", dicom_slice(k, "1.2.3.4", 4 + k / 2));
  }
  put("twice/again.dcm", dicom_slice(1, "1.2.3.4"));
  EXPECT_NE(message(folder_ / "twice").find("two slices are at the same place"), std::string::npos)
      << message(folder_ / "twice");
  const std::string mixed = message(folder_ / "mixed");
  EXPECT_NE(mixed.find("several DICOM series: 2"), std::string::npos) << mixed;
  EXPECT_NE(mixed.find("1.2.3.5 (3 slices)"), std::string::npos) << mixed;
  ReadImageOptions one;
  one.series_uid = "1.2.3.5";
  EXPECT_TRUE(read_image(folder_ / "mixed", one).has_value());
  EXPECT_NE(message(folder_ / "sizes").find("another size: 5x5"), std::string::npos)
      << message(folder_ / "sizes");
  fs::create_directories(folder_ / "none");
  EXPECT_NE(message(folder_ / "none").find("folder holds no image"), std::string::npos);
}

// ---- real files -------------------------------------------------------------------------------

TEST_F(RealDataImages, AreReadWithTheirGeometry_real_data) {
  const char* data = std::getenv("ANGIOSPLINE_DATA");
  if (data == nullptr) GTEST_SKIP() << "ANGIOSPLINE_DATA is not set";
  const fs::path volumes = fs::path(data) / "volumes";
  const auto mra = read_image(volumes / "chris_MRA.nii.gz");
  ASSERT_TRUE(mra.has_value()) << mra.error().message();
  EXPECT_EQ(grid_of(mra->image).size, (Voxel{200, 256, 120}));
  EXPECT_EQ(pixel_type_name(mra->image), "uint8");
  const auto aorta = read_image(volumes / "vmtk_aorta.mha");
  ASSERT_TRUE(aorta.has_value()) << aorta.error().message();
  EXPECT_EQ(pixel_type_name(aorta->image), "float");
  EXPECT_TRUE(
      grid_of(aorta->image).direction.isApprox(Vec3(-1, -1, 1).asDiagonal().toDenseMatrix()));
  const auto series = read_image(volumes / "dicom_t1gd");
  ASSERT_TRUE(series.has_value()) << series.error().message();
  EXPECT_EQ(grid_of(series->image).size, (Voxel{512, 512, 48}));
  EXPECT_NEAR(grid_of(series->image).spacing_mm[2], 1.5, 1e-6);
}

}  // namespace
}  // namespace angiospline
