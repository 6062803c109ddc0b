// VTK's ImageData files (.vti). The only file of images that knows VTK.
#include <algorithm>

#include <fmt/format.h>
#include <vtkDataArray.h>
#include <vtkDataArraySelection.h>
#include <vtkImageData.h>
#include <vtkMatrix3x3.h>
#include <vtkNew.h>
#include <vtkObject.h>
#include <vtkPointData.h>
#include <vtkXMLImageDataReader.h>
#include <vtkXMLImageDataWriter.h>

#include "io/images/image_file_formats.h"

namespace angiospline::image_formats {
namespace {

Error unreadable(const std::filesystem::path& path, std::string value, std::string rule) {
  return {ErrorKind::kBadInput, "cannot be read as VTI", path.string(), std::move(value),
          std::move(rule)};
}

template <typename T>
Result<AnyImage> voxels_of(vtkDataArray& array, const ImageGrid& grid) {
  Image<T> image(grid);
  const T* first = static_cast<const T*>(array.GetVoidPointer(0));
  std::copy(first, first + image.voxels.size(), image.voxels.begin());
  return AnyImage(std::move(image));
}

Result<AnyImage> voxels_of(vtkDataArray& array, const ImageGrid& grid,
                           const std::filesystem::path& path) {
  switch (array.GetDataType()) {
    case VTK_UNSIGNED_CHAR:
      return voxels_of<std::uint8_t>(array, grid);
    case VTK_CHAR:
    case VTK_SIGNED_CHAR:
      return voxels_of<std::int8_t>(array, grid);
    case VTK_UNSIGNED_SHORT:
      return voxels_of<std::uint16_t>(array, grid);
    case VTK_SHORT:
      return voxels_of<std::int16_t>(array, grid);
    case VTK_UNSIGNED_INT:
      return voxels_of<std::uint32_t>(array, grid);
    case VTK_INT:
      return voxels_of<std::int32_t>(array, grid);
    case VTK_FLOAT:
      return voxels_of<float>(array, grid);
    case VTK_DOUBLE:
      return voxels_of<double>(array, grid);
    default:
      break;
  }
  return fail(unreadable(path, array.GetDataTypeAsString(),
                         "the array must hold integers up to 32 bits, float or double"));
}

template <typename T>
int vtk_type() {
  if constexpr (std::is_same_v<T, std::uint8_t>) return VTK_UNSIGNED_CHAR;
  if constexpr (std::is_same_v<T, std::int8_t>) return VTK_SIGNED_CHAR;
  if constexpr (std::is_same_v<T, std::uint16_t>) return VTK_UNSIGNED_SHORT;
  if constexpr (std::is_same_v<T, std::int16_t>) return VTK_SHORT;
  if constexpr (std::is_same_v<T, std::uint32_t>) return VTK_UNSIGNED_INT;
  if constexpr (std::is_same_v<T, std::int32_t>) return VTK_INT;
  if constexpr (std::is_same_v<T, float>) return VTK_FLOAT;
  return VTK_DOUBLE;
}

}  // namespace

Result<AnyImage> read_vti(const std::filesystem::path& path) {
  vtkObject::GlobalWarningDisplayOff();
  vtkNew<vtkXMLImageDataReader> reader;
  reader->SetFileName(path.c_str());
  if (!reader->CanReadFile(path.c_str()))
    return fail(unreadable(path, {}, "the file must be VTK XML ImageData"));
  reader->Update();
  vtkImageData* data = reader->GetOutput();
  if (reader->GetErrorCode() != 0 || data == nullptr)
    return fail(unreadable(path, {}, "the file must be complete"));

  // The active scalars are the image; a file that names none is clear if it has one array.
  vtkDataArray* array = data->GetPointData()->GetScalars();
  if (array == nullptr && data->GetPointData()->GetNumberOfArrays() == 1)
    array = data->GetPointData()->GetArray(0);
  if (array == nullptr)
    return fail(unreadable(path, fmt::format("{}", data->GetPointData()->GetNumberOfArrays()),
                           "point data must name active scalars or hold exactly one array"));
  if (array->GetNumberOfComponents() != 1)
    return fail({ErrorKind::kBadInput, "voxels are vectors", path.string(),
                 fmt::format("{} components", array->GetNumberOfComponents()),
                 "an image has one value a voxel"});

  ImageGrid grid;
  int extent[6];
  data->GetExtent(extent);
  Vec3 first_index;
  for (int i = 0; i < 3; ++i) {
    grid.size[i] = extent[2 * i + 1] - extent[2 * i] + 1;
    grid.spacing_mm[i] = data->GetSpacing()[i];
    first_index[i] = extent[2 * i];
    for (int k = 0; k < 3; ++k) grid.direction(i, k) = data->GetDirectionMatrix()->GetElement(i, k);
  }

  // VTK's origin belongs to index 0, not to the extent.
  grid.origin_mm = Vec3(data->GetOrigin());
  grid.origin_mm = grid.world_mm(first_index);

  if (static_cast<std::size_t>(array->GetNumberOfTuples()) != grid.voxel_count())
    return fail(unreadable(path, fmt::format("{} values", array->GetNumberOfTuples()),
                           "the file must be complete"));
  return checked(grid, path).and_then([&](const ImageGrid& sound) {
    return voxels_of(*array, sound, path);
  });
}

template <typename T>
Result<void> write_vti(const Image<T>& image, const std::filesystem::path& path) {
  vtkObject::GlobalWarningDisplayOff();
  const ImageGrid& grid = image.grid;
  vtkNew<vtkImageData> data;
  data->SetDimensions(grid.size[0], grid.size[1], grid.size[2]);
  data->SetSpacing(grid.spacing_mm.data());
  data->SetOrigin(grid.origin_mm.data());
  vtkNew<vtkMatrix3x3> direction;
  for (int i = 0; i < 3; ++i)
    for (int k = 0; k < 3; ++k) direction->SetElement(i, k, grid.direction(i, k));
  data->SetDirectionMatrix(direction);

  // The writer only reads: the array borrows our voxels (last argument 1: VTK does not free them).
  const auto array =
      vtkSmartPointer<vtkDataArray>::Take(vtkDataArray::CreateDataArray(vtk_type<T>()));
  array->SetName("ImageScalars");
  array->SetVoidArray(const_cast<T*>(image.voxels.data()),
                      static_cast<vtkIdType>(image.voxels.size()), 1);
  data->GetPointData()->SetScalars(array);

  vtkNew<vtkXMLImageDataWriter> writer;
  writer->SetFileName(path.c_str());
  writer->SetInputData(data);
  writer->SetCompressorTypeToZLib();
  if (writer->Write() == 0 || writer->GetErrorCode() != 0)
    return fail({ErrorKind::kCannotWrite, "cannot write", path.string(), {}, {}});
  return {};
}

template Result<void> write_vti(const Image<std::uint8_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<std::int8_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<std::uint16_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<std::int16_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<std::uint32_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<std::int32_t>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<float>&, const std::filesystem::path&);
template Result<void> write_vti(const Image<double>&, const std::filesystem::path&);

}  // namespace angiospline::image_formats
