#include "recovery/imaging/rasterize/voxelize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include <Eigen/LU>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {
namespace {

// Where a line along x meets the surface: +1 where it enters, -1 where it leaves.
struct Crossing {
  std::int64_t line;
  double x;
  int turn;
};

// Twice the signed area of (a, b, p) in the plane of y and z, with the same bits for (b, a, p)
// reversed: an edge has one answer for both its triangles.
double side_of(const Vec3& a, const Vec3& b, double y, double z) {
  const bool swap = a.y() > b.y() || (a.y() == b.y() && a.z() > b.z());
  const Vec3& p = swap ? b : a;
  const Vec3& q = swap ? a : b;
  const double area = (q.y() - p.y()) * (z - p.z()) - (q.z() - p.z()) * (y - p.y());
  return swap ? -area : area;
}

// Whether p is to the left of a -> b, with lines through an edge given to one of its sides.
bool is_left(const Vec3& a, const Vec3& b, double y, double z) {
  const double area = side_of(a, b, y, z);
  if (area != 0) return area > 0;
  return b.z() < a.z() || (b.z() == a.z() && b.y() > a.y());
}

class LineCaster {
 public:
  LineCaster(const ImageGrid& grid, int rows)
      : rows_(rows), lines_y_(grid.size[1] * rows), lines_z_(grid.size[2] * rows) {}

  // A triangle in voxel indices.
  void add(const std::array<Vec3, 3>& t) {
    const double area = (t[1].y() - t[0].y()) * (t[2].z() - t[0].z()) -
                        (t[1].z() - t[0].z()) * (t[2].y() - t[0].y());
    if (area == 0) return;

    // Seen along x the outside of an entering triangle faces back: its area is negative.
    const int turn = area < 0 ? 1 : -1;
    const std::array<Vec3, 3> c = area > 0 ? t : std::array<Vec3, 3>{t[0], t[2], t[1]};
    const auto [y0, y1] = range(t[0].y(), t[1].y(), t[2].y(), lines_y_);
    const auto [z0, z1] = range(t[0].z(), t[1].z(), t[2].z(), lines_z_);

    for (int k = z0; k <= z1; ++k) {
      const double z = place(k);
      for (int j = y0; j <= y1; ++j) {
        const double y = place(j);
        if (!is_left(c[0], c[1], y, z) || !is_left(c[1], c[2], y, z) ||
            !is_left(c[2], c[0], y, z)) {
          continue;
        }

        const double w0 = side_of(c[1], c[2], y, z), w1 = side_of(c[2], c[0], y, z),
                     w2 = side_of(c[0], c[1], y, z);
        const double x = (w0 * c[0].x() + w1 * c[1].x() + w2 * c[2].x()) / (w0 + w1 + w2);
        crossings_.push_back({static_cast<std::int64_t>(k) * lines_y_ + j, x, turn});
      }
    }
  }

  Image<float> fill(const ImageGrid& grid) {
    Image<float> share(grid, 0.0F);
    const float weight = 1.0F / static_cast<float>(rows_ * rows_);
    for_each_stretch([&](int j, int k, double from, double to) {
      add_stretch(share.voxels.data() + grid.offset({0, j, k}), grid.size[0], from, to, weight);
    });
    for (float& v : share.voxels) v = std::min(v, 1.0F);
    return share;
  }

  Mask centres(const ImageGrid& grid) {
    Mask mask(grid);
    for_each_stretch([&](int j, int k, double from, double to) {
      const int first = std::max(0, static_cast<int>(std::ceil(from)));
      const int last = std::min(grid.size[0] - 1, static_cast<int>(std::floor(to)));
      for (int i = first; i <= last; ++i) mask[{i, j, k}] = 1;
    });
    return mask;
  }

 private:
  double place(int line) const { return (line + 0.5) / rows_ - 0.5; }

  // The lines between the least and the largest of three coordinates.
  std::pair<int, int> range(double a, double b, double c, int count) const {
    const double low = std::min({a, b, c}), high = std::max({a, b, c});
    const double first = std::ceil((low + 0.5) * rows_ - 0.5);
    const double last = std::floor((high + 0.5) * rows_ - 0.5);
    return {static_cast<int>(std::max(first, 0.0)),
            static_cast<int>(std::min(last, static_cast<double>(count - 1)))};
  }

  // Calls f(y, z, from, to) for each stretch of a line inside the surface: where the crossings
  // before it enter more often than they leave, so that overlaps count once.
  template <typename F>
  void for_each_stretch(F&& f) {
    std::sort(crossings_.begin(), crossings_.end(), [](const Crossing& a, const Crossing& b) {
      return std::tie(a.line, a.x, a.turn) < std::tie(b.line, b.x, b.turn);
    });

    std::size_t i = 0;
    while (i < crossings_.size()) {
      const std::int64_t line = crossings_[i].line;
      const int j = static_cast<int>(line % lines_y_) / rows_;
      const int k = static_cast<int>(line / lines_y_) / rows_;
      int depth = 0;
      double from = 0;
      for (; i < crossings_.size() && crossings_[i].line == line; ++i) {
        const int before = depth;
        depth += crossings_[i].turn;
        if (before <= 0 && depth > 0) from = crossings_[i].x;
        if (before > 0 && depth <= 0) f(j, k, from, crossings_[i].x);
      }
    }
  }

  static void add_stretch(float* row, int size, double from, double to, float weight) {
    const double low = std::max(from + 0.5, 0.0),
                 high = std::min(to + 0.5, static_cast<double>(size));
    for (int i = static_cast<int>(low); i < size && i < high; ++i) {
      const double part = std::min(high, i + 1.0) - std::max(low, static_cast<double>(i));
      if (part > 0) row[i] += weight * static_cast<float>(part);
    }
  }

  int rows_;
  int lines_y_;
  int lines_z_;
  std::vector<Crossing> crossings_;
};

// The mesh's crossings with `rows` x `rows` lines along x through each voxel.
LineCaster cast(const TriangleMesh& mesh, const ImageGrid& grid, int rows) {
  LineCaster caster(grid, rows);
  std::vector<Vec3> points;
  for (Eigen::Index p = 0; p < mesh.points_mm.cols(); ++p) {
    points.push_back(grid.index_vox(mesh.points_mm.col(p)));
  }

  // A mirrored grid turns triangles round.
  const bool mirrored = grid.direction.determinant() < 0;
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    const auto corner = [&](int k) { return points[index(mesh.triangles(k, t))]; };
    caster.add({corner(0), corner(mirrored ? 2 : 1), corner(mirrored ? 1 : 2)});
  }
  return caster;
}

}  // namespace

Image<float> filled_share(const TriangleMesh& mesh, const ImageGrid& grid, int rows) {
  EXPECTS(rows >= 1 && rows <= 16);
  return cast(mesh, grid, rows).fill(grid);
}

Mask voxelized(const TriangleMesh& mesh, const ImageGrid& grid) {
  const Image<float> share = filled_share(mesh, grid);
  Mask mask(grid);
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) mask.voxels[i] = share.voxels[i] >= 0.5F;
  return mask;
}

Mask mask_inside(const TriangleMesh& mesh, const ImageGrid& grid) {
  return cast(mesh, grid, 1).centres(grid);
}

}  // namespace angiospline
