// The voxels of a central axis named: end, normal, junction (thesis 4.3 and 7.1.3).
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "recovery/imaging/image/image.h"
#include "recovery/imaging/mask/neighborhood.h"

namespace angiospline {

enum class PointLabel {
  kIsolated,  // no neighbour
  kEnd,       // one
  kNormal,    // two
  kMutual,    // three or more, but not the heaviest of its cluster
  kJunction,  // three or more, and the main point of its cluster
};

// A junction: the connected voxels with three or more neighbours, and the voxels by which it is
// left. All indices are into SkeletonLabels::voxels.
struct JunctionCluster {
  int junction = -1;  // the heaviest; of several the one nearest to the centroid of the members;
                      // of several of these the first in the image
  std::vector<int> members;  // in the order of the search that found them
  std::vector<int> weights;  // of each member: face 5, edge 3, vertex 1, over all its neighbours
  std::vector<int> exits;    // neighbours with one or two neighbours: 3 in a bifurcation
  int cycles = 0;            // tunnels among the members themselves, which a graph cannot show,
  int cavities = 0;          // and cavities: an axis of a hollow body is a closed sheet
};

// An axis as its voxels, their neighbours and their labels. Memory follows the axis, not the image.
struct SkeletonLabels {
  ImageGrid grid;
  Connectivity connectivity = Connectivity::k26;
  std::vector<std::size_t> voxels;  // offsets, in growing order
  std::vector<std::size_t>
      first;                   // neighbours of i: neighbors[first[i]] to neighbors[first[i + 1]]
  std::vector<int> neighbors;  // in the order of kNeighbors
  std::vector<PointLabel> labels;
  std::vector<int> cluster;  // of a mutual or junction voxel, otherwise -1
  std::vector<JunctionCluster> clusters;

  Voxel voxel(int i) const { return grid.voxel(voxels[static_cast<std::size_t>(i)]); }
  std::span<const int> neighbors_of(int i) const {
    const auto k = static_cast<std::size_t>(i);
    return {neighbors.data() + first[k], first[k + 1] - first[k]};
  }
  int index_of(std::size_t offset) const;  // -1 if the voxel is not on the axis
};

// The labels of a thinned mask. Any mask is legal: where it is thick, all is one cluster.
// With Connectivity::k6 only voxels across a face are neighbours. O(voxels of the axis), after one
// pass over the image, which is saved if the axis' offsets (in growing order) are at hand.
SkeletonLabels label_skeleton(const Mask& skeleton, Connectivity connectivity = Connectivity::k26);
SkeletonLabels label_skeleton(const Mask& skeleton, std::vector<std::size_t> offsets,
                              Connectivity connectivity = Connectivity::k26);

// The labels as an image: 0 background, 1 end or isolated, 2 normal, 3 mutual, 4 junction.
Image<std::uint8_t> label_image(const SkeletonLabels& labels);

}  // namespace angiospline
