#include "base/atomic_file.h"
#include "io/images/image_file.h"
#include "io/images/image_file_formats.h"

namespace angiospline {
namespace fs = std::filesystem;
using namespace image_formats;

namespace {

template <typename T>
Result<void> write_by_suffix(const Image<T>& image, const fs::path& path) {
  const ImageSuffix* s = suffix_of(path);
  if (!is_vti(path) && (s == nullptr || !s->writes))
    return fail({ErrorKind::kCannotWrite,
                 "image format is not written",
                 path.string(),
                 {},
                 ".nii .nii.gz .nrrd .mha .vti .tif .tiff are"});
  return write_atomically(path, [&](const fs::path& temporary) {
    Result<void> written =
        is_vti(path) ? write_vti(image, temporary) : write(image, temporary, s->format);
    if (!written) written.error().where = path.string();
    return written;
  });
}

}  // namespace

template <typename T>
Result<void> write_image(const Image<T>& image, const fs::path& path) {
  return write_by_suffix(image, path);
}

Result<void> write_image(const AnyImage& image, const fs::path& path) {
  return std::visit([&](const auto& i) { return write_by_suffix(i, path); }, image);
}

template Result<void> write_image(const Image<std::uint8_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int8_t>&, const fs::path&);
template Result<void> write_image(const Image<std::uint16_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int16_t>&, const fs::path&);
template Result<void> write_image(const Image<std::uint32_t>&, const fs::path&);
template Result<void> write_image(const Image<std::int32_t>&, const fs::path&);
template Result<void> write_image(const Image<float>&, const fs::path&);
template Result<void> write_image(const Image<double>&, const fs::path&);

}  // namespace angiospline
