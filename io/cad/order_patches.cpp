#include "io/cad/order_patches.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "base/index.h"

namespace angiospline {
namespace {

// A spanning forest of the regions, joined where their patches are.
class RegionForest {
 public:
  explicit RegionForest(const SurfaceNetwork& network)
      : patches_(network.regions.size()),
        neighbours_(network.regions.size()),
        parents_(network.regions.size(), -1),
        children_(network.regions.size()) {
    for (std::size_t p = 0; p < network.patches.size(); ++p) {
      patches_[index(network.patches[p].region)].push_back(static_cast<int>(p));
    }

    for (const Join& join : network.joins) {
      const int a = network.patches[index(join.a.patch)].region;
      const int b = network.patches[index(join.b.patch)].region;
      if (a == b) continue;
      neighbours_[index(a)].push_back(b);
      neighbours_[index(b)].push_back(a);
    }
    grow();
  }

  // The patches, tree by tree.
  std::vector<int> patches_in_order() const {
    std::vector<int> order;
    std::vector<int> ahead;
    for (const int root : roots_) {
      ahead.push_back(root);
      while (!ahead.empty()) {
        const int region = ahead.back();
        ahead.pop_back();
        order.insert(order.end(), patches_[index(region)].begin(), patches_[index(region)].end());
        const std::vector<int>& children = children_[index(region)];
        ahead.insert(ahead.end(), children.rbegin(), children.rend());
      }
    }
    return order;
  }

 private:
  // Depth first from the region of each component's first patch; then children by size.
  void grow() {
    std::vector<int> starts;
    for (std::size_t r = 0; r < patches_.size(); ++r) {
      if (!patches_[r].empty()) starts.push_back(static_cast<int>(r));
    }
    std::sort(starts.begin(), starts.end(), [&](int a, int b) {
      return patches_[index(a)].front() < patches_[index(b)].front();
    });

    // Depth first, so that a region stands near the one it was reached from.
    std::vector<bool> is_met(patches_.size(), false);
    std::vector<int> met;
    std::vector<std::pair<int, int>> ahead;  // region and where it is come to from
    for (const int start : starts) {
      if (!is_met[index(start)]) roots_.push_back(start);
      ahead.emplace_back(start, -1);
      while (!ahead.empty()) {
        const auto [region, from] = ahead.back();
        ahead.pop_back();
        if (is_met[index(region)]) continue;
        is_met[index(region)] = true;
        parents_[index(region)] = from;
        met.push_back(region);
        for (const int next : neighbours_[index(region)]) {
          if (!is_met[index(next)]) ahead.emplace_back(next, region);
        }
      }
    }

    // Children before parents: each adds what hangs on it to its parent.
    std::vector<std::size_t> sizes(patches_.size());
    for (std::size_t r = 0; r < sizes.size(); ++r) sizes[r] = patches_[r].size();
    std::for_each(met.rbegin(), met.rend(), [&](int region) {
      const int parent = parents_[index(region)];
      if (parent < 0) return;
      sizes[index(parent)] += sizes[index(region)];
      children_[index(parent)].push_back(region);
    });

    // Small subtrees first: the way to a neighbour then jumps over small branches only.
    for (std::vector<int>& children : children_) {
      std::sort(children.begin(), children.end(), [&](int a, int b) {
        return std::pair(sizes[index(a)], a) < std::pair(sizes[index(b)], b);
      });
    }
  }

  std::vector<std::vector<int>> patches_;     // of each region
  std::vector<std::vector<int>> neighbours_;  // as often as they share a join
  std::vector<int> parents_;
  std::vector<std::vector<int>> children_;
  std::vector<int> roots_;
};

}  // namespace

SurfaceNetwork order_by_neighbours(SurfaceNetwork network) {
  const std::vector<int> order = RegionForest(network).patches_in_order();
  std::vector<int> place(order.size());
  std::vector<Patch> patches;
  patches.reserve(order.size());
  for (const int p : order) {
    place[index(p)] = static_cast<int>(patches.size());
    patches.push_back(std::move(network.patches[index(p)]));
  }
  network.patches = std::move(patches);

  const auto move = [&](Side& side) { side.patch = place[index(side.patch)]; };
  for (Join& join : network.joins) {
    move(join.a);
    move(join.b);
  }
  for (Rim& rim : network.rims) std::for_each(rim.sides.begin(), rim.sides.end(), move);

  // Rims follow the patches they lie on.
  const auto first_patch = [](const Rim& rim) {
    int first = rim.sides.empty() ? -1 : rim.sides.front().patch;
    for (const Side& side : rim.sides) first = std::min(first, side.patch);
    return first;
  };
  std::stable_sort(network.rims.begin(), network.rims.end(),
                   [&](const Rim& a, const Rim& b) { return first_patch(a) < first_patch(b); });
  return network;
}

}  // namespace angiospline
