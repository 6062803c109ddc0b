#include "recovery/imaging/skeleton/labels.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/index.h"
#include "recovery/imaging/mask/topology_numbers.h"
#include "recovery/imaging/skeleton/thinning.h"

namespace angiospline {
namespace {

// A walk over offsets in growing order finds each neighbour by a cursor that only moves forward.
void find_neighbors(SkeletonLabels& s) {
  const auto count = static_cast<unsigned>(neighbor_count(s.connectivity));
  std::array<std::size_t, 26> cursor{};
  s.first.assign(s.voxels.size() + 1, 0);
  s.neighbors.reserve(3 * s.voxels.size());
  for (std::size_t i = 0; i < s.voxels.size(); ++i) {
    const Voxel v = s.grid.voxel(s.voxels[i]);
    for (unsigned k = 0; k < count; ++k) {
      const Voxel& d = kNeighbors[k];
      const Voxel u{v[0] + d[0], v[1] + d[1], v[2] + d[2]};
      if (!s.grid.contains(u)) continue;
      const std::size_t offset = s.grid.offset(u);
      std::size_t& c = cursor[k];
      while (c < s.voxels.size() && s.voxels[c] < offset) ++c;
      if (c < s.voxels.size() && s.voxels[c] == offset) s.neighbors.push_back(static_cast<int>(c));
    }
    s.first[i + 1] = s.neighbors.size();
  }
}

int weight(const SkeletonLabels& s, int i) {
  const Voxel v = s.voxel(i);
  int sum = 0;
  for (const int j : s.neighbors_of(i)) {
    const Voxel u = s.voxel(j);
    const int axes = (u[0] != v[0]) + (u[1] != v[1]) + (u[2] != v[2]);
    sum += axes == 1 ? 5 : axes == 2 ? 3 : 1;
  }
  return sum;
}

// Tunnels and cavities of the members alone.
TopologyNumbers topology_of(const SkeletonLabels& s, const std::vector<int>& members) {
  if (members.size() < 4) return {1, 0, 0, 1};  // fewer voxels close neither ring nor shell
  Voxel low = s.voxel(members[0]);
  Voxel high = low;
  for (const int i : members) {
    const Voxel v = s.voxel(i);
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], v[a]);
      high[a] = std::max(high[a], v[a]);
    }
  }
  Mask box;
  for (std::size_t a = 0; a < 3; ++a) box.grid.size[a] = high[a] - low[a] + 1;
  box.voxels.assign(box.grid.voxel_count(), 0);
  for (const int i : members) {
    const Voxel v = s.voxel(i);
    box[{v[0] - low[0], v[1] - low[1], v[2] - low[2]}] = 1;
  }
  return topology_numbers(box, s.connectivity);
}

// `counted` holds for each voxel the last cluster of which it was found to be an exit.
JunctionCluster grow_cluster(SkeletonLabels& s, int seed, int number, std::vector<int>& counted) {
  JunctionCluster c;
  c.members.push_back(seed);
  s.cluster[index(seed)] = number;
  for (std::size_t head = 0; head < c.members.size(); ++head)
    for (const int j : s.neighbors_of(c.members[head])) {
      if (s.neighbors_of(j).size() < 3) {
        if (counted[index(j)] != number) c.exits.push_back(j);
        counted[index(j)] = number;
      } else if (s.cluster[index(j)] < 0) {
        s.cluster[index(j)] = number;
        c.members.push_back(j);
      }
    }
  for (const int i : c.members) c.weights.push_back(weight(s, i));
  const TopologyNumbers t = topology_of(s, c.members);
  c.cycles = static_cast<int>(t.cycles);
  c.cavities = static_cast<int>(t.cavities);
  return c;
}

// Heaviest, then nearest to the centroid, then first in the image. Distances to the centroid are
// compared exactly, in integers: count * voxel - sum of voxels.
int main_point(const SkeletonLabels& s, const JunctionCluster& c) {
  std::array<std::int64_t, 3> sum{};
  for (const int i : c.members)
    for (std::size_t a = 0; a < 3; ++a) sum[a] += s.voxel(i)[a];
  const auto count = static_cast<std::int64_t>(c.members.size());

  int best = -1;
  int best_weight = -1;
  std::int64_t best_distance = std::numeric_limits<std::int64_t>::max();
  for (std::size_t m = 0; m < c.members.size(); ++m) {
    const Voxel v = s.voxel(c.members[m]);
    std::int64_t distance = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::int64_t d = count * v[a] - sum[a];
      distance += d * d;
    }
    const int i = c.members[m];
    const bool better = c.weights[m] != best_weight ? c.weights[m] > best_weight
                        : distance != best_distance ? distance < best_distance
                                                    : i < best;
    if (!better) continue;
    best = i;
    best_weight = c.weights[m];
    best_distance = distance;
  }
  return best;
}

}  // namespace

int SkeletonLabels::index_of(std::size_t offset) const {
  const auto at = std::lower_bound(voxels.begin(), voxels.end(), offset);
  return at != voxels.end() && *at == offset ? static_cast<int>(at - voxels.begin()) : -1;
}

SkeletonLabels label_skeleton(const Mask& skeleton, Connectivity connectivity) {
  return label_skeleton(skeleton, foreground_offsets(skeleton), connectivity);
}

SkeletonLabels label_skeleton(const Mask& skeleton, std::vector<std::size_t> offsets,
                              Connectivity connectivity) {
  EXPECTS(std::is_sorted(offsets.begin(), offsets.end()));
  EXPECTS(offsets.size() < static_cast<std::size_t>(std::numeric_limits<int>::max()));

  SkeletonLabels s;
  s.grid = skeleton.grid;
  s.connectivity = connectivity;
  s.voxels = std::move(offsets);
  find_neighbors(s);

  s.labels.resize(s.voxels.size(), PointLabel::kMutual);
  s.cluster.assign(s.voxels.size(), -1);
  std::vector<int> counted(s.voxels.size(), -1);
  for (std::size_t i = 0; i < s.voxels.size(); ++i) {
    const std::size_t n = s.first[i + 1] - s.first[i];
    if (n < 3) {
      s.labels[i] = n == 0   ? PointLabel::kIsolated
                    : n == 1 ? PointLabel::kEnd
                             : PointLabel::kNormal;
    } else if (s.cluster[i] < 0) {
      const auto number = static_cast<int>(s.clusters.size());
      s.clusters.push_back(grow_cluster(s, static_cast<int>(i), number, counted));
      JunctionCluster& c = s.clusters.back();
      c.junction = main_point(s, c);
      s.labels[index(c.junction)] = PointLabel::kJunction;
    }
  }
  return s;
}

Image<std::uint8_t> label_image(const SkeletonLabels& labels) {
  Image<std::uint8_t> image(labels.grid);
  for (std::size_t i = 0; i < labels.voxels.size(); ++i) {
    const PointLabel l = labels.labels[i];
    image.voxels[labels.voxels[i]] = l == PointLabel::kNormal     ? 2
                                     : l == PointLabel::kMutual   ? 3
                                     : l == PointLabel::kJunction ? 4
                                                                  : 1;
  }
  return image;
}

}  // namespace angiospline
