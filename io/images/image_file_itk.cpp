// The only file that knows ITK. It uses ITK's readers and writers one by one, without its image
// type and its factories: nothing is registered globally and the voxels exist once.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <limits>
#include <map>
#include <new>
#include <optional>

#include <fmt/format.h>
// Debian's ITK knows the one compiler it was built with; clang passes for it in the features asked.
#if defined(__clang__)
#pragma push_macro("__clang__")
#pragma push_macro("__GNUC__")
#undef __clang__
#undef __GNUC__
#define __GNUC__ 12
#include <itk_compiler_detection.h>
#pragma pop_macro("__GNUC__")
#pragma pop_macro("__clang__")
#endif

#include <itkGDCMImageIO.h>
#include <itkMetaImageIO.h>
#include <itkNiftiImageIO.h>
#include <itkNrrdImageIO.h>
#include <itkPNGImageIO.h>
#include <itkTIFFImageIO.h>

#include "io/images/image_file_formats.h"

namespace angiospline::image_formats {
namespace {

using Component = itk::IOComponentEnum;

itk::ImageIOBase::Pointer image_io(Format format) {
  itk::Object::SetGlobalWarningDisplay(false);  // failures are values here, not talk on stderr
  switch (format) {
    case Format::kNifti:
      return itk::NiftiImageIO::New().GetPointer();
    case Format::kNrrd:
      return itk::NrrdImageIO::New().GetPointer();
    case Format::kMeta:
      return itk::MetaImageIO::New().GetPointer();
    case Format::kTiff:
      return itk::TIFFImageIO::New().GetPointer();
    case Format::kPng:
      return itk::PNGImageIO::New().GetPointer();
    case Format::kDicom:
      return itk::GDCMImageIO::New().GetPointer();
  }
  return nullptr;
}

// ITK's descriptions run over several lines and name its source files and addresses; a user needs
// neither. NRRD's library tells the whole way it came: the last step says what is wrong.
std::string one_line(const itk::ExceptionObject& e) {
  std::string text = e.GetDescription();
  for (char& c : text)
    if (c == '\n' || c == '\r' || c == '\t') c = ' ';
  while (!text.empty() && text.back() == ' ') text.pop_back();
  for (const char* marker : {"ITK ERROR: ", "): ", "[nrrd] "}) {
    const auto at = text.rfind(marker);
    if (at != std::string::npos) text.erase(0, at + std::strlen(marker));
  }
  return text;
}

Error unreadable(const std::filesystem::path& path, Format format, std::string why) {
  return {ErrorKind::kBadInput, fmt::format("cannot be read as {}", title(format)), path.string(),
          std::move(why), "the file must be complete and of the kind its suffix says"};
}

// `body` with ITK's and the standard library's exceptions made errors.
template <typename F>
auto guarded(const std::filesystem::path& path, Format format, F&& body) -> decltype(body()) {
  try {
    return body();
  } catch (const itk::ExceptionObject& e) {
    return fail(unreadable(path, format, one_line(e)));
  } catch (const std::bad_alloc&) {
    return fail({ErrorKind::kFailed, "not enough memory for the image", path.string(), {}, {}});
  } catch (const std::exception& e) {
    return fail(unreadable(path, format, e.what()));
  }
}

// A DICOM file that is cut short would be read with whatever was in memory for the rest, and talk
// on the error stream: where its voxels' element is (PS3.5, 7.1), one that fits must be among what
// looks like it. Undefined length means compressed voxels, whose decoder finds the end missing.
Result<void> is_whole_dicom(const std::filesystem::path& path) {
  constexpr std::uintmax_t kSearched = std::uintmax_t{1} << 24;
  const std::uintmax_t size = std::filesystem::file_size(path);
  std::string bytes(static_cast<std::size_t>(std::min(size, kSearched)), '\0');
  std::ifstream(path, std::ios::binary)
      .read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (bytes.size() < 132 || bytes.compare(128, 4, "DICM") != 0) return {};

  const std::string tag("\xe0\x7f\x10\x00", 4);  // little endian; the other order is retired
  std::optional<std::uintmax_t> promised;
  for (std::size_t at = bytes.find(tag); at != std::string::npos; at = bytes.find(tag, at + 1)) {
    const bool explicit_type =
        bytes.compare(at + 4, 2, "OW") == 0 || bytes.compare(at + 4, 2, "OB") == 0;
    const std::size_t length_at = at + (explicit_type ? 8 : 4);
    if (length_at + 4 > bytes.size()) continue;
    std::uintmax_t length = 0;
    for (std::size_t k = 4; k-- > 0;)
      length = 256 * length + static_cast<unsigned char>(bytes[length_at + k]);
    promised = length_at + 4 + length;
    if (length == 0xffffffff || *promised <= size) return {};
  }

  if (!promised) return {};
  return fail({ErrorKind::kBadInput, "file is cut short", path.string(),
               fmt::format("{} bytes", size), fmt::format("its header promises {}", *promised)});
}

Result<itk::ImageIOBase::Pointer> open(const std::filesystem::path& path, Format format) {
  if (format == Format::kDicom)
    if (const auto whole = is_whole_dicom(path); !whole) return fail(whole.error());
  const itk::ImageIOBase::Pointer io = image_io(format);
  io->SetFileName(path.string());
  if (!io->CanReadFile(path.c_str()))
    return fail(unreadable(path, format, "its header is not one"));
  io->ReadImageInformation();
  return io;
}

Description description_of(const itk::ImageIOBase& io) {
  Description d;
  const unsigned dims = io.GetNumberOfDimensions();
  for (unsigned i = 0; i < dims; ++i) d.axes.push_back(static_cast<long long>(io.GetDimensions(i)));
  d.components = io.GetNumberOfComponents();
  d.grid.size = {1, 1, 1};

  for (unsigned i = 0; i < std::min(dims, 3U); ++i) {
    d.grid.size[i] =
        static_cast<int>(std::min<long long>(d.axes[i], std::numeric_limits<int>::max()));
    d.grid.spacing_mm[i] = io.GetSpacing(i);
    d.grid.origin_mm[i] = io.GetOrigin(i);
    const std::vector<double> axis = io.GetDirection(i);
    for (unsigned k = 0; k < 3; ++k) d.grid.direction(k, i) = k < axis.size() ? axis[k] : 0.0;
  }
  if (dims == 2) d.grid.direction.col(2) = d.grid.direction.col(0).cross(d.grid.direction.col(1));
  return d;
}

template <typename T>
Result<AnyImage> read_as(itk::ImageIOBase& io, const ImageGrid& grid) {
  Image<T> image(grid);
  io.Read(image.voxels.data());
  return AnyImage(std::move(image));
}

// 64-bit integers, which label images of scripts often are, as int32 where the values allow it.
template <typename Wide>
Result<AnyImage> read_narrowed(itk::ImageIOBase& io, const ImageGrid& grid,
                               const std::filesystem::path& path) {
  std::vector<Wide> wide(grid.voxel_count());
  io.Read(wide.data());
  Image<std::int32_t> image(grid);
  for (std::size_t i = 0; i < wide.size(); ++i) {
    if (!std::in_range<std::int32_t>(wide[i]))
      return fail({ErrorKind::kBadInput, "64-bit voxel value is too large", path.string(),
                   fmt::format("{}", wide[i]), "values must fit 32 bits"});
    image.voxels[i] = static_cast<std::int32_t>(wide[i]);
  }
  return AnyImage(std::move(image));
}

Result<AnyImage> read_component(itk::ImageIOBase& io, const ImageGrid& grid,
                                const std::filesystem::path& path) {
  switch (io.GetComponentType()) {
    case Component::UCHAR:
      return read_as<std::uint8_t>(io, grid);
    case Component::CHAR:
      return read_as<std::int8_t>(io, grid);
    case Component::USHORT:
      return read_as<std::uint16_t>(io, grid);
    case Component::SHORT:
      return read_as<std::int16_t>(io, grid);
    case Component::UINT:
      return read_as<std::uint32_t>(io, grid);
    case Component::INT:
      return read_as<std::int32_t>(io, grid);
    case Component::FLOAT:
      return read_as<float>(io, grid);
    case Component::DOUBLE:
      return read_as<double>(io, grid);
    case Component::LONG:
    case Component::LONGLONG:
      return read_narrowed<std::int64_t>(io, grid, path);
    case Component::ULONG:
    case Component::ULONGLONG:
      return read_narrowed<std::uint64_t>(io, grid, path);
    default:
      break;
  }
  return fail({ErrorKind::kBadInput, "pixel type is not supported", path.string(),
               itk::ImageIOBase::GetComponentTypeAsString(io.GetComponentType()),
               "integers up to 64 bits, float and double are"});
}

template <typename T>
Component component_of() {
  if constexpr (std::is_same_v<T, std::uint8_t>) return Component::UCHAR;
  if constexpr (std::is_same_v<T, std::int8_t>) return Component::CHAR;
  if constexpr (std::is_same_v<T, std::uint16_t>) return Component::USHORT;
  if constexpr (std::is_same_v<T, std::int16_t>) return Component::SHORT;
  if constexpr (std::is_same_v<T, std::uint32_t>) return Component::UINT;
  if constexpr (std::is_same_v<T, std::int32_t>) return Component::INT;
  if constexpr (std::is_same_v<T, float>) return Component::FLOAT;
  return Component::DOUBLE;
}

}  // namespace

Result<Description> describe(const std::filesystem::path& path, Format format) {
  return guarded(path, format, [&]() -> Result<Description> {
    return open(path, format).map([](const auto& io) { return description_of(*io); });
  });
}

Result<AnyImage> read_voxels(const std::filesystem::path& path, Format format) {
  return guarded(path, format, [&]() -> Result<AnyImage> {
    const auto io = open(path, format);
    if (!io) return fail(io.error());
    itk::ImageIOBase& reader = **io;
    const unsigned dims = reader.GetNumberOfDimensions();
    itk::ImageIORegion region(dims);
    for (unsigned i = 0; i < dims; ++i) region.SetSize(i, reader.GetDimensions(i));
    reader.SetIORegion(region);
    return checked(description_of(reader).grid, path).and_then([&](const ImageGrid& grid) {
      return read_component(reader, grid, path);
    });
  });
}

Result<std::vector<DicomSeries>> dicom_series(const std::filesystem::path& folder) {
  return guarded(folder, Format::kDicom, [&]() -> Result<std::vector<DicomSeries>> {
    std::map<std::string, std::vector<std::string>> files;
    const auto io = itk::GDCMImageIO::New();
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      const std::string name = entry.path().string();
      if (entry.is_regular_file())
        if (const auto whole = is_whole_dicom(entry.path()); !whole) return fail(whole.error());
      if (!entry.is_regular_file() || !io->CanReadFile(name.c_str())) continue;
      io->SetFileName(name);
      io->ReadImageInformation();
      std::string uid;
      io->GetValueFromTag("0020|000e", uid);
      while (!uid.empty() && (uid.back() == ' ' || uid.back() == '\0')) uid.pop_back();
      files[uid].push_back(name);
    }

    std::vector<DicomSeries> result;
    for (auto& [uid, names] : files) {
      std::sort(names.begin(), names.end());  // folders list in no order
      result.push_back({uid, std::move(names)});
    }
    return result;
  });
}

template <typename T>
Result<void> write(const Image<T>& image, const std::filesystem::path& path, Format format) {
  const auto failure = [&](std::string why) {
    return fail({ErrorKind::kCannotWrite, "cannot write", path.string(), std::move(why), {}});
  };
  try {
    const itk::ImageIOBase::Pointer io = image_io(format);
    io->SetFileName(path.string());
    io->SetNumberOfDimensions(3);
    itk::ImageIORegion region(3);
    for (unsigned i = 0; i < 3; ++i) {
      const Vec3 axis = image.grid.direction.col(i);
      io->SetDimensions(i, static_cast<itk::SizeValueType>(image.grid.size[i]));
      io->SetSpacing(i, image.grid.spacing_mm[i]);
      io->SetOrigin(i, image.grid.origin_mm[i]);
      io->SetDirection(i, std::vector<double>(axis.data(), axis.data() + 3));
      region.SetSize(i, static_cast<itk::SizeValueType>(image.grid.size[i]));
    }

    io->SetIORegion(region);
    io->SetNumberOfComponents(1);
    io->SetPixelType(itk::IOPixelEnum::SCALAR);
    io->SetComponentType(component_of<T>());
    io->SetUseCompression(true);
    io->Write(image.voxels.data());
  } catch (const itk::ExceptionObject& e) {
    return failure(one_line(e));
  } catch (const std::exception& e) {
    return failure(e.what());
  }
  return {};
}

template Result<void> write(const Image<std::uint8_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<std::int8_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<std::uint16_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<std::int16_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<std::uint32_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<std::int32_t>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<float>&, const std::filesystem::path&, Format);
template Result<void> write(const Image<double>&, const std::filesystem::path&, Format);

}  // namespace angiospline::image_formats
