// A report a person can look at: one page that needs nothing else, and the same facts as JSON.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/result.h"
#include "kernel/geometry/triangle_mesh.h"
#include "modeling/check/certificate.h"
#include "modeling/network/model.h"
#include "recovery/imaging/image/any_image.h"
#include "recovery/imaging/segment/region_growing.h"

namespace angiospline {

// A grey picture with the centerlines drawn over it; row by row from the top.
struct ReportImage {
  std::string title;
  int width = 0;
  int height = 0;
  Vec2 pixel_mm = Vec2::Ones();          // width and height of a pixel
  std::vector<std::uint8_t> grey;        // width * height
  std::vector<std::vector<Vec2>> lines;  // in pixels; (0, 0) is the centre of the first
};

// The maximum (`bright`) or minimum intensity projections of an image along its three axes, with
// the tree's centerlines. Grey runs from the 1st to the 99.9th percentile of the picture. Titles
// name the axis.
std::vector<ReportImage> projections(const AnyImage& image, const CenterlineTree& tree,
                                     Polarity vessels = Polarity::kBright);

// What a report shows besides the model; all of it may be left out.
struct ReportExtras {
  std::optional<Certificate> certificate = {};
  std::vector<MeshField> fields = {};  // on the mesh given; the page colours by them
  std::vector<ReportImage> images = {};
  std::vector<std::pair<std::string, double>> seconds = {};  // stage and time
  std::vector<std::string> files = {};                       // that were written beside the report
};

// Facts: name, source, version, assumptions, warnings, failed, summary, branches with radii along
// their length, junctions, faces with areas and colours, certificate, seconds, files. Requires a
// sound mesh whose parts are the model's regions and rims, such as tessellate(model.network).
std::string report_json(const Model& model, const TriangleMesh& mesh,
                        const ReportExtras& extras = {});

// The page: a 3-D view (WebGL 2) with a legend, projections, plots and tables. It loads nothing
// from anywhere. Points are rounded to 1/65535 of the bounding box. About 20 bytes a triangle.
std::string report_html(const Model& model, const TriangleMesh& mesh,
                        const ReportExtras& extras = {});

// Writes `path` (the page) and, beside it, the facts as <stem>_facts.json; the facts first.
Result<void> write_report(const std::filesystem::path& path, const Model& model,
                          const TriangleMesh& mesh, const ReportExtras& extras = {});

}  // namespace angiospline
