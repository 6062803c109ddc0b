#include "io/images/xray_geometry_file.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "io/images/image_file.h"
#include "io/images/rules.h"

namespace angiospline {
namespace {

using Json = nlohmann::json;

// One view's object, with errors that say which field of which view of which file.
class Fields {
 public:
  Fields(const Json& object, std::string where) : object_(object), where_(std::move(where)) {}

  bool has(const char* key) const { return object_.contains(key); }

  Error error(const char* key, std::string what, std::string rule) const {
    return {ErrorKind::kBadInput, std::move(what), fmt::format("{}: {}", where_, key),
            has(key) ? object_.at(key).dump() : std::string(), std::move(rule)};
  }

  template <int N>
  Result<Eigen::Matrix<double, N, 1>> vector(const char* key) const {
    const auto bad = [&] {
      return fail(error(key, has(key) ? "field is not usable" : "field is missing",
                        fmt::format("it must be an array of {} finite numbers", N)));
    };
    if (!has(key) || !object_.at(key).is_array() || object_.at(key).size() != N) return bad();
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i) {
      const Json& x = object_.at(key).at(static_cast<std::size_t>(i));
      if (!x.is_number() || !std::isfinite(x.get<double>())) return bad();
      v[i] = x.get<double>();
    }
    return v;
  }

  Result<double> number(const char* key, bool positive) const {
    const bool sound = has(key) && object_.at(key).is_number() &&
                       std::isfinite(object_.at(key).get<double>()) &&
                       (!positive || object_.at(key).get<double>() > 0);
    if (!sound)
      return fail(error(key, has(key) ? "field is not usable" : "field is missing",
                        positive ? "it must be a number above 0" : "it must be a finite number"));
    return object_.at(key).get<double>();
  }

  Result<std::string> text(const char* key) const {
    if (!has(key) || !object_.at(key).is_string())
      return fail(error(key, "field is missing", "it must be a text"));
    return object_.at(key).get<std::string>();
  }

 private:
  const Json& object_;
  std::string where_;
};

Result<XrayGeometry> c_arm_of(const Fields& f, int pixels) {
  CArm arm;
  const auto angle = f.number("angle_deg", false);
  const auto centre = f.vector<3>("centre_mm");
  const auto to_centre = f.number("source_to_centre_mm", true);
  const auto to_detector = f.number("source_to_detector_mm", true);
  const auto pixel = f.number("pixel_mm", true);
  if (!angle) return fail(angle.error());
  if (!centre) return fail(centre.error());
  if (!to_centre) return fail(to_centre.error());
  if (!to_detector) return fail(to_detector.error());
  if (!pixel) return fail(pixel.error());
  return c_arm_geometry({*centre, *angle, *to_centre, *to_detector, *pixel, pixels});
}

Result<XrayGeometry> full_geometry_of(const Fields& f) {
  XrayGeometry g;
  for (auto [key, target] : {std::pair{"source_mm", &g.source_mm},
                             {"first_pixel_mm", &g.first_pixel_mm},
                             {"column_axis", &g.column_axis},
                             {"row_axis", &g.row_axis}}) {
    const auto v = f.vector<3>(key);
    if (!v) return fail(v.error());
    *target = *v;
  }

  const auto pixel = f.vector<2>("pixel_mm");
  if (!pixel) return fail(pixel.error());
  if (!(pixel->minCoeff() > 0))
    return fail(f.error("pixel_mm", "pixel is not positive", "above 0"));
  g.pixel_mm = *pixel;

  const double sine = g.column_axis.normalized().cross(g.row_axis.normalized()).norm();
  if (!(sine > image_formats::kSmallestAxisSine))
    return fail(f.error("row_axis", "axes span no plane", "column_axis and row_axis differ"));
  g.column_axis.normalize();
  g.row_axis.normalize();
  return g;
}

Result<XrayView> view_of(const Json& object, const std::filesystem::path& path, std::size_t index) {
  const Fields f(object, fmt::format("{}: view {}", path.string(), index + 1));
  const auto name = f.text("image");
  if (!name) return fail(name.error());
  Result<ImageFile> file = read_flat_image(path.parent_path() / *name);
  if (!file) return fail(file.error());

  XrayView view;
  std::visit(
      [&](const auto& in) {
        view.image = Image<float>(in.grid);
        std::transform(in.voxels.begin(), in.voxels.end(), view.image.voxels.begin(),
                       [](auto v) { return static_cast<float>(v); });
      },
      file->image);

  // A C-arm's axis meets the middle of its detector: the number of pixels is the image's.
  const Voxel size = view.image.grid.size;
  Result<XrayGeometry> geometry = f.has("angle_deg") ? c_arm_of(f, size[0]) : full_geometry_of(f);
  if (!geometry) return fail(geometry.error());
  if (f.has("angle_deg") && size[0] != size[1])
    return fail(f.error("image", "image is not square", "a C-arm's detector is: give it in full"));
  view.geometry = *geometry;
  view.geometry.size = {size[0], size[1]};
  return view;
}

}  // namespace

Result<std::vector<XrayView>> read_xray_views(const std::filesystem::path& path) {
  const Result<std::string> bytes = read_file(path);
  if (!bytes) return fail(bytes.error());
  const Json json = Json::parse(*bytes, nullptr, false);
  if (json.is_discarded() || !json.is_object() || !json.contains("views") ||
      !json.at("views").is_array() || json.at("views").empty())
    return fail({ErrorKind::kBadInput,
                 "is not a file of X-ray views",
                 path.string(),
                 {},
                 "it must be JSON with a non-empty array \"views\""});

  std::vector<XrayView> views;
  for (std::size_t k = 0; k < json.at("views").size(); ++k) {
    Result<XrayView> view = view_of(json.at("views").at(k), path, k);
    if (!view) return fail(view.error());
    views.push_back(std::move(*view));
  }
  return views;
}

Result<void> write_xray_views(const std::vector<XrayView>& views,
                              const std::filesystem::path& path) {
  const auto list = [](const auto& v) { return std::vector<double>(v.begin(), v.end()); };
  Json json{{"schema", 1}, {"views", Json::array()}};
  for (std::size_t k = 0; k < views.size(); ++k) {
    const XrayGeometry& g = views[k].geometry;
    const std::string name = fmt::format("{}_{}.mha", path.stem().string(), k + 1);
    if (const auto written = write_image(views[k].image, path.parent_path() / name); !written)
      return fail(written.error());
    json["views"].push_back({{"image", name},
                             {"source_mm", list(g.source_mm)},
                             {"first_pixel_mm", list(g.first_pixel_mm)},
                             {"column_axis", list(g.column_axis)},
                             {"row_axis", list(g.row_axis)},
                             {"pixel_mm", list(g.pixel_mm)}});
  }
  return write_file(path, json.dump(2) + "\n");
}

}  // namespace angiospline
