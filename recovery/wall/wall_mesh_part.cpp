#include "recovery/wall/wall_mesh_part.h"

#include <tbb/parallel_for.h>

#include "base/index.h"
#include "kernel/geometry/point_index.h"

namespace angiospline {

Points3 node_points(const FitMesh& mesh) {
  Points3 points(3, mesh.size());
  for (int k = 0; k < mesh.size(); ++k) points.col(k) = mesh.nodes[index(k)].point_mm;
  return points;
}

Eigen::VectorXd FitMeshPart::spread(const Eigen::VectorXd& values, int whole) const {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(whole);
  for (std::size_t k = 0; k < nodes.size(); ++k) {
    all(nodes[k]) = values(static_cast<Eigen::Index>(k));
  }
  return all;
}

FitMeshPart part_near(const FitMesh& whole, const Points3& places, double reach) {
  const PointIndex places_index(places);
  std::vector<char> near(whole.nodes.size(), 0);
  tbb::parallel_for(std::size_t{0}, near.size(), [&](std::size_t k) {
    near[k] = places_index.nearest(whole.nodes[k].point_mm).distance <= reach;
  });

  // Triangles whose corners are all near; nodes in the order in which these come to them.
  FitMeshPart part;
  std::vector<int> node_of(near.size(), -1);
  std::vector<Eigen::Vector3i> kept;
  for (Eigen::Index t = 0; t < whole.triangles.cols(); ++t) {
    Eigen::Vector3i triangle = whole.triangles.col(t);
    if (!near[index(triangle(0))] || !near[index(triangle(1))] || !near[index(triangle(2))])
      continue;
    for (int& k : triangle) {
      int& node = node_of[index(k)];
      if (node < 0) {
        node = static_cast<int>(part.nodes.size());
        part.nodes.push_back(k);
        part.mesh.nodes.push_back(whole.nodes[index(k)]);
        part.mesh.points.push_back(whole.points[index(k)]);
        part.mesh.origins.push_back(whole.origins[index(k)]);
        part.mesh.regions.push_back(whole.regions[index(k)]);
        part.mesh.radii_mm.push_back(whole.radii_mm[index(k)]);
        part.mesh.near_rim.push_back(whole.near_rim[index(k)]);
      }
      k = node;
    }
    kept.push_back(triangle);
  }

  part.mesh.triangles.resize(3, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t t = 0; t < kept.size(); ++t) {
    part.mesh.triangles.col(static_cast<Eigen::Index>(t)) = kept[t];
  }
  return part;
}

std::vector<int> nearest_nodes(const FitMesh& of, const FitMesh& to) {
  const PointIndex places_index(node_points(of));
  std::vector<int> nearest(to.nodes.size());
  tbb::parallel_for(std::size_t{0}, nearest.size(), [&](std::size_t k) {
    nearest[k] = static_cast<int>(places_index.nearest(to.nodes[k].point_mm).point);
  });
  return nearest;
}

}  // namespace angiospline
