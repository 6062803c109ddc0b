#include "recovery/thesis/smoothing/corner_tangents.h"

#include <algorithm>
#include <cmath>
#include <set>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {

double flatten_corner(SurfaceNetwork& network, int corner) {
  Points3& points = network.control_points_mm;
  const Vec3 place = points.col(corner);

  // The mean of the normals of all patches with a corner here, each outward: along_u x along_v
  // turns over at two of a patch's four corners.
  std::set<int> neighbours;
  Vec3 normal = Vec3::Zero();
  for (const Patch& patch : network.patches) {
    const int rows = patch.u.control_point_count();
    const int across = patch.v.control_point_count();
    const auto column = [&](int i, int j) { return patch.control[index(i * across + j)]; };
    for (const bool last_u : {false, true}) {
      for (const bool last_v : {false, true}) {
        const int i = last_u ? rows - 1 : 0;
        const int j = last_v ? across - 1 : 0;
        if (column(i, j) != corner) continue;
        const int beside_u = column(last_u ? i - 1 : i + 1, j);
        const int beside_v = column(i, last_v ? j - 1 : j + 1);
        const Vec3 along_u = points.col(beside_u) - place;
        const Vec3 along_v = points.col(beside_v) - place;
        const double orientation = last_u == last_v ? 1.0 : -1.0;
        normal += orientation * along_u.cross(along_v).normalized();
        neighbours.insert({beside_u, beside_v});
      }
    }
  }
  EXPECTS(neighbours.size() >= 3);

  // The points beside the corner go straight down into that plane.
  normal.normalize();
  double farthest = 0;
  for (const int c : neighbours) {
    const double height = normal.dot(points.col(c) - place);
    points.col(c) -= height * normal;
    farthest = std::max(farthest, std::abs(height));
  }
  return farthest;
}

}  // namespace angiospline
