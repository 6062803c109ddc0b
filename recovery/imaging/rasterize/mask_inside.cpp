#include "recovery/imaging/rasterize/mask_inside.h"

#include <algorithm>
#include <cmath>

namespace angiospline {
namespace {

// Where rows of voxels cross a surface: x of each crossing, by row.
class Rows {
 public:
  explicit Rows(const ImageGrid& grid)
      : grid_(grid), crossings_(static_cast<std::size_t>(grid.size[1] * grid.size[2])) {}

  void cross(int y, int z, double x) {
    crossings_[static_cast<std::size_t>(z * grid_.size[1] + y)].push_back(x);
  }

  Mask inside() {
    Mask mask(grid_);
    for (std::size_t row = 0; row < crossings_.size(); ++row) {
      auto& at = crossings_[row];
      std::sort(at.begin(), at.end());
      for (std::size_t k = 0; k + 1 < at.size(); k += 2) {
        const int first = std::max(0, static_cast<int>(std::ceil(at[k])));
        const int last = std::min(grid_.size[0] - 1, static_cast<int>(std::floor(at[k + 1])));
        for (int x = first; x <= last; ++x)
          mask.voxels[row * static_cast<std::size_t>(grid_.size[0]) + static_cast<std::size_t>(x)] =
              1;
      }
    }
    return mask;
  }

 private:
  ImageGrid grid_;
  std::vector<std::vector<double>> crossings_;
};

// Twice the signed area of (a, b, p) in the plane of y and z. Its sign for the edge (a, b) is minus
// that for (b, a), also in floating point: neighbours agree on which of them has a row.
double side(const Vec3& a, const Vec3& b, double y, double z) {
  const bool forward = a[1] < b[1] || (a[1] == b[1] && a[2] < b[2]);
  const Vec3 &p = forward ? a : b, &q = forward ? b : a;
  const double area = (q[1] - p[1]) * (z - p[2]) - (q[2] - p[2]) * (y - p[1]);
  return forward ? area : -area;
}

}  // namespace

Mask mask_inside(const TriangleMesh& mesh, const ImageGrid& grid) {
  // Rows run a hair beside the voxels' centres, so that no vertex of a tidy mesh lies on one.
  constexpr double kBeside_y = 1.3e-7, kBeside_z = 2.9e-7;
  Rows rows(grid);
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    std::array<Vec3, 3> p;
    for (int k = 0; k < 3; ++k)
      p[static_cast<std::size_t>(k)] =
          grid.index_vox(Vec3(mesh.points_mm.col(mesh.triangles(k, t))));
    const auto [low_y, high_y] = std::minmax({p[0][1], p[1][1], p[2][1]});
    const auto [low_z, high_z] = std::minmax({p[0][2], p[1][2], p[2][2]});
    const int first_y = std::max(0, static_cast<int>(std::floor(low_y)));
    const int first_z = std::max(0, static_cast<int>(std::floor(low_z)));
    for (int z = first_z; z <= std::min<double>(high_z, grid.size[2] - 1); ++z)
      for (int y = first_y; y <= std::min<double>(high_y, grid.size[1] - 1); ++y) {
        const double at_y = y + kBeside_y, at_z = z + kBeside_z;
        const Vec3 area(side(p[1], p[2], at_y, at_z), side(p[2], p[0], at_y, at_z),
                        side(p[0], p[1], at_y, at_z));
        const bool all = (area.array() > 0).all() || (area.array() < 0).all();
        if (!all) continue;
        rows.cross(y, z, area.dot(Vec3(p[0][0], p[1][0], p[2][0])) / area.sum());
      }
  }
  return rows.inside();
}

Mask mask_inside(const Points3& outline_mm, const ImageGrid& grid) {
  EXPECTS(grid.size[2] == 1);
  Rows rows(grid);
  const Eigen::Index n = outline_mm.cols();
  for (Eigen::Index k = 0; k < n; ++k) {
    const Vec3 a = grid.index_vox(Vec3(outline_mm.col(k)));
    const Vec3 b = grid.index_vox(Vec3(outline_mm.col((k + 1) % n)));
    const int first = std::max(0, static_cast<int>(std::ceil(std::min(a[1], b[1]))));
    const int last = std::min(grid.size[1] - 1, static_cast<int>(std::floor(std::max(a[1], b[1]))));
    for (int y = first; y <= last; ++y)
      if ((a[1] > y) != (b[1] > y))
        rows.cross(y, 0, a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]));
  }
  return rows.inside();
}

}  // namespace angiospline
