// What the format libraries pass over in silence: files cut short, spacing of zero made 1, scaling
// that is not a number. The headers are read here first.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <optional>
#include <sstream>

#include <fmt/format.h>
#include <zlib.h>

#include "io/images/image_file_formats.h"

namespace angiospline::image_formats {
namespace fs = std::filesystem;

namespace {

// ---- NIfTI ------------------------------------------------------------------------------------

// Plain and gzipped files alike: zlib passes plain bytes through.
struct GzClose {
  void operator()(gzFile file) const { gzclose(file); }
};
using GzFile = std::unique_ptr<std::remove_pointer_t<gzFile>, GzClose>;

template <typename T>
T number_at(const std::vector<unsigned char>& bytes, std::size_t offset, bool swapped) {
  std::array<unsigned char, sizeof(T)> raw;
  std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(offset), sizeof(T), raw.begin());
  if (swapped) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

struct NiftiHeader {
  std::array<long long, 8> dim{};
  std::array<double, 8> pixdim{};
  int bits = 0;
  int datatype = 0;
  bool swapped = false;
  double voxels_at = 0, slope = 1, intercept = 0;
  int qform = 0, sform = 0;

  unsigned long long bytes() const {
    unsigned long long n = static_cast<unsigned long long>(bits) / 8;
    for (int i = 1; i <= dim[0]; ++i)
      n *= static_cast<unsigned long long>(dim[static_cast<std::size_t>(i)]);
    return n + static_cast<unsigned long long>(voxels_at);
  }
};

// Fields of NIfTI-1 (348 bytes) and NIfTI-2 (540), by their published offsets.
std::optional<NiftiHeader> parse_nifti(const std::vector<unsigned char>& b) {
  NiftiHeader h;
  for (const bool swapped : {false, true}) {
    if (b.size() >= 348 && number_at<std::int32_t>(b, 0, swapped) == 348) {
      for (std::size_t i = 0; i < 8; ++i) {
        h.dim[i] = number_at<std::int16_t>(b, 40 + 2 * i, swapped);
        h.pixdim[i] = static_cast<double>(number_at<float>(b, 76 + 4 * i, swapped));
      }
      h.swapped = swapped;
      h.datatype = number_at<std::int16_t>(b, 70, swapped);
      h.bits = number_at<std::int16_t>(b, 72, swapped);
      h.voxels_at = static_cast<double>(number_at<float>(b, 108, swapped));
      h.slope = static_cast<double>(number_at<float>(b, 112, swapped));
      h.intercept = static_cast<double>(number_at<float>(b, 116, swapped));
      h.qform = number_at<std::int16_t>(b, 252, swapped);
      h.sform = number_at<std::int16_t>(b, 254, swapped);
      return h;
    }

    // NIfTI-2, which has room for larger numbers.
    if (b.size() >= 540 && number_at<std::int32_t>(b, 0, swapped) == 540) {
      for (std::size_t i = 0; i < 8; ++i) {
        h.dim[i] = number_at<std::int64_t>(b, 16 + 8 * i, swapped);
        h.pixdim[i] = number_at<double>(b, 104 + 8 * i, swapped);
      }
      h.swapped = swapped;
      h.datatype = number_at<std::int16_t>(b, 12, swapped);
      h.bits = number_at<std::int16_t>(b, 14, swapped);
      h.voxels_at = static_cast<double>(number_at<std::int64_t>(b, 168, swapped));
      h.slope = number_at<double>(b, 176, swapped);
      h.intercept = number_at<double>(b, 184, swapped);
      h.qform = number_at<std::int32_t>(b, 344, swapped);
      h.sform = number_at<std::int32_t>(b, 348, swapped);
      return h;
    }
  }
  return std::nullopt;
}

bool is_gzip(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return file.get() == 0x1f && file.get() == 0x8b;
}

// Bytes of the file when unpacked. A gzip file says so in its last four bytes (modulo 2^32); only
// if they do not agree with `expected` is the file unpacked, to count.
Result<unsigned long long> unpacked_size(const fs::path& path, unsigned long long expected) {
  if (!is_gzip(path)) return fs::file_size(path);
  std::ifstream file(path, std::ios::binary);
  file.seekg(-4, std::ios::end);
  std::vector<unsigned char> tail(4);
  for (auto& byte : tail) byte = static_cast<unsigned char>(file.get());
  if (number_at<std::uint32_t>(tail, 0, std::endian::native == std::endian::big) ==
      static_cast<std::uint32_t>(expected))
    return expected;

  const GzFile gz(gzopen(path.c_str(), "rb"));
  std::vector<char> buffer(1 << 20);
  unsigned long long total = 0;
  int got = 0;
  while (gz && (got = gzread(gz.get(), buffer.data(), static_cast<unsigned>(buffer.size()))) > 0)
    total += static_cast<unsigned long long>(got);
  return total;
}

std::optional<NiftiHeader> nifti_header(const fs::path& path) {
  std::vector<unsigned char> bytes(540);
  const GzFile gz(gzopen(path.c_str(), "rb"));
  const int got = gz ? gzread(gz.get(), bytes.data(), static_cast<unsigned>(bytes.size())) : 0;
  bytes.resize(static_cast<std::size_t>(std::max(got, 0)));
  return parse_nifti(bytes);
}

template <typename T>
void restore(std::vector<T>& voxels, const NiftiHeader& header, gzFile gz) {
  std::vector<unsigned char> bytes(sizeof(T) << 16);
  for (std::size_t i = 0; i < voxels.size();) {
    const int got = gzread(gz, bytes.data(), static_cast<unsigned>(bytes.size()));
    if (got <= 0) return;
    for (std::size_t k = 0; k + sizeof(T) <= static_cast<std::size_t>(got) && i < voxels.size();
         k += sizeof(T), ++i) {
      const T value = number_at<T>(bytes, k, header.swapped);
      if (!std::isfinite(value)) voxels[i] = value;
    }
  }
}

}  // namespace

void restore_non_finite(AnyImage& image, const fs::path& path) {
  constexpr int kFloat = 16, kDouble = 64;  // NIfTI's codes
  const auto header = nifti_header(path);
  const bool floating = header && (header->datatype == kFloat || header->datatype == kDouble);
  const GzFile gz(floating ? gzopen(path.c_str(), "rb") : nullptr);
  if (!gz || gzseek(gz.get(), static_cast<z_off_t>(header->voxels_at), SEEK_SET) < 0) return;
  if (auto* f = std::get_if<Image<float>>(&image); f && header->datatype == kFloat)
    restore(f->voxels, *header, gz.get());
  if (auto* d = std::get_if<Image<double>>(&image); d && header->datatype == kDouble)
    restore(d->voxels, *header, gz.get());
}

Result<std::vector<std::string>> check_nifti(const fs::path& path) {
  const auto header = nifti_header(path);
  if (!header)
    return bad_image(path, "cannot be read as NIfTI", {},
                     "the file must start with a NIfTI header");
  if (header->dim[0] < 1 || header->dim[0] > 7)
    return bad_image(path, "number of dimensions is not usable", fmt::format("{}", header->dim[0]),
                     "NIfTI has 1 to 7");
  for (std::size_t i = 1; i <= static_cast<std::size_t>(header->dim[0]); ++i)
    if (header->dim[i] < 1)
      return bad_image(path, fmt::format("extent of axis {} is not positive", i - 1),
                       fmt::format("{}", header->dim[i]), "every extent must be positive");
  for (std::size_t i = 1; i <= static_cast<std::size_t>(std::min(3LL, header->dim[0])); ++i)
    if (!(header->pixdim[i] > 0) || !std::isfinite(header->pixdim[i]))
      return bad_image(path, fmt::format("spacing of axis {} is not positive", i - 1),
                       fmt::format("{}", header->pixdim[i]), "spacing must be positive");

  const unsigned long long expected = header->bytes();
  return unpacked_size(path, expected)
      .and_then([&](unsigned long long size) -> Result<std::vector<std::string>> {
        // Of a header in a file of its own (.hdr) nothing is known here; .nii holds its voxels.
        if (size < expected)
          return bad_image(path, "file is cut short", fmt::format("{} bytes", size),
                           fmt::format("its header promises {}", expected));
        std::vector<std::string> notes;
        if (!std::isfinite(header->slope))
          notes.push_back("intensity slope is not finite: 1 is taken");
        if (!std::isfinite(header->intercept))
          notes.push_back("intensity intercept is not finite: 0 is taken");
        if (header->qform <= 0 && header->sform <= 0)
          notes.push_back("the file states no orientation: axes are taken as right, front, up");
        return notes;
      });
}

// ---- MetaImage --------------------------------------------------------------------------------

namespace {

const std::map<std::string, unsigned long long> kMetaBytes = {
    {"MET_CHAR", 1},  {"MET_UCHAR", 1},  {"MET_SHORT", 2},     {"MET_USHORT", 2},
    {"MET_INT", 4},   {"MET_UINT", 4},   {"MET_LONG", 4},      {"MET_ULONG", 4},
    {"MET_FLOAT", 4}, {"MET_DOUBLE", 8}, {"MET_LONG_LONG", 8}, {"MET_ULONG_LONG", 8}};

std::string trimmed(const std::string& s) {
  const auto first = s.find_first_not_of(" \t\r\n"), last = s.find_last_not_of(" \t\r\n");
  return first == std::string::npos ? "" : s.substr(first, last - first + 1);
}

std::vector<double> numbers(const std::string& text) {
  std::istringstream in(text);
  std::vector<double> out;
  for (std::string word; in >> word;) {
    char* end = nullptr;
    out.push_back(std::strtod(word.c_str(), &end));
    if (end == word.c_str() || *end != '\0') out.back() = std::nan("");
  }
  return out;
}

struct MetaHeader {
  std::map<std::string, std::string> fields;
  unsigned long long voxels_at = 0;

  std::string get(const std::string& key) const {
    const auto found = fields.find(key);
    return found == fields.end() ? "" : found->second;
  }
};

MetaHeader parse_meta(const fs::path& path) {
  MetaHeader h;
  std::ifstream file(path, std::ios::binary);
  // A header is a few hundred bytes; the bound keeps a file of something else from being slurped.
  constexpr std::streamoff kLongestHeader = 1 << 20;
  for (std::string line; file.tellg() < kLongestHeader && std::getline(file, line);) {
    const auto equals = line.find('=');
    if (equals == std::string::npos) break;
    const std::string key = trimmed(line.substr(0, equals));
    h.fields[key] = trimmed(line.substr(equals + 1));
    h.voxels_at = static_cast<unsigned long long>(file.tellg());
    if (key == "ElementDataFile") break;
  }
  return h;
}

bool is_true(const std::string& s) {
  return !s.empty() && (s[0] == 'T' || s[0] == 't' || s[0] == '1');
}

// Bytes that hold the voxels, in this file or the one it names.
Result<unsigned long long> meta_data_bytes(const MetaHeader& h, const fs::path& path) {
  const std::string name = h.get("ElementDataFile");
  if (name == "LOCAL" || name == "Local" || name == "local")
    return fs::file_size(path) - h.voxels_at;
  if (name.find('%') != std::string::npos || name.rfind("LIST", 0) == 0)
    return ~0ULL;  // a list of slice files: left to the library
  const fs::path data = path.parent_path() / name;
  std::error_code error;
  const auto size = fs::file_size(data, error);
  if (error)
    return bad_image(path, "file of voxels is missing", name,
                     "ElementDataFile must name a file beside it");
  return size;
}

}  // namespace

Result<MetaScaling> check_meta(const fs::path& path) {
  const MetaHeader h = parse_meta(path);
  for (const char* key : {"NDims", "DimSize", "ElementType", "ElementDataFile"})
    if (h.get(key).empty())
      return bad_image(path, "cannot be read as MetaImage", {},
                       fmt::format("its header must give {}", key));
  const std::vector<double> dims = numbers(h.get("DimSize"));
  unsigned long long count = 1;
  for (const double n : dims) {
    if (!(n >= 1) || n != std::floor(n) || n > 1e9)
      return bad_image(path, "DimSize is not usable", h.get("DimSize"),
                       "extents are positive integers");
    count *= static_cast<unsigned long long>(n);
  }

  for (const char* key : {"ElementSpacing", "ElementSize"})
    for (const double s : numbers(h.get(key)))
      if (!(s > 0) || !std::isfinite(s))
        return bad_image(path, "spacing is not positive", h.get(key), "spacing must be positive");

  // What the header promises, against what there is; a type that is not known promises nothing.
  const Result<unsigned long long> size = meta_data_bytes(h, path);
  if (!size) return fail(size.error());
  const auto bytes = kMetaBytes.find(h.get("ElementType"));
  const std::vector<double> channels = numbers(h.get("ElementNumberOfChannels"));
  unsigned long long expected = bytes == kMetaBytes.end() ? 0 : count * bytes->second;
  if (!channels.empty() && channels[0] > 1)
    expected *= static_cast<unsigned long long>(channels[0]);

  if (is_true(h.get("CompressedData"))) {
    const std::vector<double> packed = numbers(h.get("CompressedDataSize"));
    expected = packed.empty() || !(packed[0] > 0) ? 1 : static_cast<unsigned long long>(packed[0]);
  }
  if (*size < expected)
    return bad_image(path, "file is cut short", fmt::format("{} bytes of voxels", *size),
                     fmt::format("its header promises {}", expected));

  MetaScaling scaling;
  const auto slope = numbers(h.get("ElementToIntensityFunctionSlope"));
  const auto offset = numbers(h.get("ElementToIntensityFunctionOffset"));
  if (!slope.empty()) scaling.slope = slope[0];
  if (!offset.empty()) scaling.offset = offset[0];
  if (!std::isfinite(scaling.slope) || !std::isfinite(scaling.offset) || scaling.slope == 0)
    return bad_image(path, "intensity scaling is not usable",
                     fmt::format("slope {}, offset {}", scaling.slope, scaling.offset),
                     "they are finite, the slope is not 0");
  return scaling;
}

}  // namespace angiospline::image_formats
