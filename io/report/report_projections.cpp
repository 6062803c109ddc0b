#include <algorithm>
#include <array>
#include <cmath>

#include "io/report/report_html.h"

namespace angiospline {
namespace {

// Anatomical letters of an image axis, from its low to its high end, by the axis' largest
// component.
std::array<char, 2> ends_of_axis(const ImageGrid& grid, int axis) {
  Eigen::Index world = 0;
  grid.direction.col(axis).cwiseAbs().maxCoeff(&world);
  static constexpr std::array<std::array<char, 2>, 3> kEnds{{{'R', 'L'}, {'A', 'P'}, {'F', 'H'}}};
  std::array<char, 2> ends = kEnds[static_cast<std::size_t>(world)];
  if (grid.direction(world, axis) < 0) std::swap(ends[0], ends[1]);
  return ends;
}

// A picture's two image axes, and whether each runs against its voxel index: heads up, backs down,
// and the patient's right on the left side, as radiologists hang them.
struct Hanging {
  int across;
  int down;
  bool flip_across;
  bool flip_down;
};

Hanging hang(const ImageGrid& grid, int through) {
  int across = through == 0 ? 1 : 0;
  int down = 3 - through - across;
  const auto is = [&](int axis, char letter) {
    const auto ends = ends_of_axis(grid, axis);
    return ends[0] == letter || ends[1] == letter;
  };
  if (is(across, 'H') || (is(across, 'P') && !is(down, 'H'))) std::swap(across, down);
  const char right_side = ends_of_axis(grid, across)[1];
  const char bottom = ends_of_axis(grid, down)[1];
  return {across, down, right_side == 'R' || right_side == 'A' || right_side == 'F',
          bottom == 'H' || bottom == 'A' || bottom == 'L'};
}

std::vector<std::uint8_t> grey_of(const std::vector<float>& values) {
  std::vector<float> sorted = values;
  const auto rank = [&](double fraction) {
    const auto at =
        static_cast<std::ptrdiff_t>(std::ceil(fraction * static_cast<double>(sorted.size() - 1)));
    std::nth_element(sorted.begin(), sorted.begin() + at, sorted.end());
    return sorted[static_cast<std::size_t>(at)];
  };

  // A few bright or dark voxels, of implants or of air, must not take all of the contrast.
  const float low = rank(0.01);
  float high = rank(0.999);
  if (!(high > low)) high = *std::max_element(values.begin(), values.end());

  std::vector<std::uint8_t> grey;
  grey.reserve(values.size());
  for (const float v : values) {
    const float t = high > low ? (v - low) / (high - low) : 0.0F;
    grey.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(t, 0.0F, 1.0F))));
  }
  return grey;
}

template <typename T>
ReportImage project(const Image<T>& image, const CenterlineTree& tree, int through,
                    Polarity vessels) {
  const ImageGrid& grid = image.grid;
  const Hanging h = hang(grid, through);
  const auto size = [&](int axis) { return grid.size[static_cast<std::size_t>(axis)]; };
  ReportImage picture;
  picture.width = size(h.across);
  picture.height = size(h.down);
  picture.pixel_mm = {grid.spacing_mm[h.across], grid.spacing_mm[h.down]};

  // Titles name the axis of the world that is nearest to the one looked along.
  const auto ends = ends_of_axis(grid, through);
  const char axis = ends[0] == 'R' || ends[0] == 'L'   ? 'x'
                    : ends[0] == 'A' || ends[0] == 'P' ? 'y'
                                                       : 'z';
  picture.title = std::string(vessels == Polarity::kBright ? "maximum" : "minimum") +
                  " intensity along " + axis + ", with centerlines";

  const auto column = [&](int voxel) { return h.flip_across ? picture.width - 1 - voxel : voxel; };
  const auto row = [&](int voxel) { return h.flip_down ? picture.height - 1 - voxel : voxel; };
  const auto pixels =
      static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height);
  std::vector<float> best(pixels);
  std::vector<char> seen(pixels, 0);

  // Voxels are visited as they lie in memory; the picture is small enough to stay in the cache.
  Voxel v{};
  for (v[2] = 0; v[2] < size(2); ++v[2]) {
    for (v[1] = 0; v[1] < size(1); ++v[1]) {
      for (v[0] = 0; v[0] < size(0); ++v[0]) {
        const auto at = static_cast<std::size_t>(row(v[static_cast<std::size_t>(h.down)])) *
                            static_cast<std::size_t>(picture.width) +
                        static_cast<std::size_t>(column(v[static_cast<std::size_t>(h.across)]));
        const auto value = static_cast<float>(image[v]);
        const bool better = vessels == Polarity::kBright ? value > best[at] : value < best[at];
        if (seen[at] == 0 || better) best[at] = value;
        seen[at] = 1;
      }
    }
  }
  picture.grey = grey_of(best);

  // Centerlines in pixels, flipped as the picture is.
  for (const CenterlineBranch& branch : tree.branches) {
    std::vector<Vec2> line;
    for (const auto& p : branch.points_mm.colwise()) {
      const Vec3 index = grid.index_vox(p);
      const double x = index[h.across];
      const double y = index[h.down];
      line.emplace_back(h.flip_across ? picture.width - 1 - x : x,
                        h.flip_down ? picture.height - 1 - y : y);
    }
    picture.lines.push_back(std::move(line));
  }
  return picture;
}

}  // namespace

std::vector<ReportImage> projections(const AnyImage& image, const CenterlineTree& tree,
                                     Polarity vessels) {
  std::vector<ReportImage> pictures;
  if (grid_of(image).voxel_count() == 0) return pictures;
  for (const int through : {1, 0, 2}) {
    pictures.push_back(std::visit(
        [&](const auto& typed) { return project(typed, tree, through, vessels); }, image));
  }
  return pictures;
}

}  // namespace angiospline
