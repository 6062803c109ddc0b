#include "modeling/tree/overlaps.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <unordered_map>

#include <fmt/format.h>

#include "base/disjoint_sets.h"
#include "base/index.h"
#include "modeling/tree/rules.h"

namespace angiospline {
namespace {

struct Capsule {
  Vec3 a;
  Vec3 b;
  double radius;
  double start_mm;  // along the branch
  int branch;
  int number;  // in the branch
};

// The nearest points of two segments (Ericson, Real-Time Collision Detection, 5.1.9).
std::pair<Vec3, Vec3> nearest_points(const Capsule& p, const Capsule& q) {
  const Vec3 d1 = p.b - p.a;
  const Vec3 d2 = q.b - q.a;
  const Vec3 r = p.a - q.a;
  const double a = d1.squaredNorm();
  const double e = d2.squaredNorm();
  const double f = d2.dot(r);
  if (!(a > 0) || !(e > 0)) return {p.a, q.a};  // paths have no still points

  // The nearest points of the two lines, the first held within its segment (Ericson, p. 149)...
  const double c = d1.dot(r);
  const double b = d1.dot(d2);
  const double denominator = a * e - b * b;
  double s = denominator > 0 ? std::clamp((b * f - c * e) / denominator, 0.0, 1.0) : 0.0;

  // ... and where the second then lies beyond its own, the first's nearest to that end.
  double t = (b * s + f) / e;
  if (t < 0) {
    t = 0;
    s = std::clamp(-c / a, 0.0, 1.0);
  } else if (t > 1) {
    t = 1;
    s = std::clamp((b - c) / a, 0.0, 1.0);
  }
  return {p.a + s * d1, q.a + t * d2};
}

using Cell = std::array<std::int64_t, 3>;

struct CellHash {
  std::size_t operator()(const Cell& c) const {
    std::uint64_t h = 0x9E3779B97F4A7C15ULL;
    for (const std::int64_t x : c) {
      h ^= static_cast<std::uint64_t>(x) + 0x9E3779B97F4A7C15ULL + (h << 6) + (h >> 2);
      h *= 0xBF58476D1CE4E5B9ULL;
    }
    return static_cast<std::size_t>(h ^ (h >> 31));
  }
};

// Capsules by their middles, in one grid for each octave of reach.
class OctaveGrids {
 public:
  explicit OctaveGrids(const std::vector<Capsule>& capsules, double clearance)
      : capsules_(capsules), clearance_(clearance) {
    for (std::size_t i = 0; i < capsules.size(); ++i) {
      const int octave = octave_of(capsules[i]);
      grids_[octave][cell_of(middle(capsules[i]), octave)].push_back(static_cast<int>(i));
    }
  }

  // Calls act(j) for every capsule at least as large as capsule i (by octave, then by number) that
  // may touch it.
  template <typename Act>
  void for_larger(int i, const Act& act) const {
    const Capsule& own = capsules_[index(i)];
    const int own_octave = octave_of(own);
    for (auto grid = grids_.lower_bound(own_octave); grid != grids_.end(); ++grid) {
      // Grids of larger octaves hold larger capsules only: each pair is met once, from the smaller.
      const Cell center = cell_of(middle(own), grid->first);
      for (std::int64_t dx = -1; dx <= 1; ++dx) {
        for (std::int64_t dy = -1; dy <= 1; ++dy) {
          for (std::int64_t dz = -1; dz <= 1; ++dz) {
            const auto found = grid->second.find({center[0] + dx, center[1] + dy, center[2] + dz});
            if (found == grid->second.end()) continue;
            for (const int j : found->second) {
              if (grid->first > own_octave || j > i) act(j);
            }
          }
        }
      }
    }
  }

 private:
  static Vec3 middle(const Capsule& c) { return 0.5 * (c.a + c.b); }
  double reach(const Capsule& c) const {
    return (1 + clearance_) * c.radius + 0.5 * (c.b - c.a).norm();
  }
  // Two capsules touch only if their middles are closer than the sum of their reaches, which is no
  // more than the cell of the larger one's octave.
  int octave_of(const Capsule& c) const {
    return static_cast<int>(std::ceil(std::log2(2 * reach(c))));
  }
  static Cell cell_of(const Vec3& p, int octave) {
    const double size = std::ldexp(1.0, octave);
    Cell cell{};
    for (std::size_t k = 0; k < 3; ++k) {
      cell[k] = static_cast<std::int64_t>(
          std::floor(std::clamp(p(static_cast<Eigen::Index>(k)) / size, -1e18, 1e18)));
    }
    return cell;
  }

  const std::vector<Capsule>& capsules_;
  double clearance_;
  std::map<int, std::unordered_map<Cell, std::vector<int>, CellHash>> grids_;
};

std::vector<Capsule> capsules_of(const SmoothedTree& tree) {
  std::vector<Capsule> capsules;
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    // As long as the thinnest of five places asks.
    const BSplineCurve<4>& path = tree.paths[b];
    const double length = path.knots().last();
    double radius = path.at(0.0)(3);
    for (const double part : {0.25, 0.5, 0.75, 1.0})
      radius = std::min(radius, path.at(part * length)(3));
    const int count =
        static_cast<int>(std::clamp(std::ceil(length / (OverlapRules::kCapsuleRadii * radius)), 1.0,
                                    static_cast<double>(OverlapRules::kMostCapsules)));

    Vec4 before = path.at(0.0);
    for (int k = 1; k <= count; ++k) {
      const Vec4 here = path.at(length * k / count);
      capsules.push_back({before.head<3>(), here.head<3>(), 0.5 * (before(3) + here(3)),
                          length * (k - 1) / count, static_cast<int>(b), k - 1});
      before = here;
    }
  }
  return capsules;
}

// Nodes that short branches join are one: by node, the lowest of its cluster.
std::vector<int> clusters(const SmoothedTree& tree) {
  std::vector<double> width(tree.tree.nodes.size(), 0.0);
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    const CenterlineBranch& branch = tree.tree.branches[b];
    const double last = tree.paths[b].knots().last();
    width[index(branch.from)] = std::max(width[index(branch.from)], tree.paths[b].at(0.0)(3));
    width[index(branch.to)] = std::max(width[index(branch.to)], tree.paths[b].at(last)(3));
  }

  // Branches that are no longer than their junctions are wide.
  DisjointSets joined(width.size());
  for (std::size_t b = 0; b < tree.paths.size(); ++b) {
    const CenterlineBranch& branch = tree.tree.branches[b];
    const double wide = width[index(branch.from)] + width[index(branch.to)];
    if (tree.paths[b].knots().last() > OverlapRules::kShortBranch * wide) continue;
    joined.join(branch.from, branch.to);
  }

  std::vector<int> lowest;
  for (std::size_t n = 0; n < width.size(); ++n) lowest.push_back(joined.root(static_cast<int>(n)));
  return lowest;
}

struct Contact {
  int number_a;
  int number_b;
  PathContact vessels;
};

// Contacts that hang together with an end of the branch, along it, are that end's junction.
std::vector<bool> beyond_junction(const std::vector<Contact>& contacts, int Contact::*number,
                                  int count, bool at_start, bool at_end) {
  std::vector<bool> touched(index(count), false);
  for (const Contact& c : contacts) touched[index(c.*number)] = true;

  // One capsule without contact is within the accuracy of capsules; the node's own is always
  // passed.
  int first = 0;
  while (at_start && first < count && (touched[index(first)] || first < OverlapRules::kAccuracy))
    ++first;
  int last = count;
  while (at_end && last > first &&
         (touched[index(last - 1)] || last > count - OverlapRules::kAccuracy))
    --last;
  std::vector<bool> beyond;
  for (const Contact& c : contacts) beyond.push_back(c.*number >= first && c.*number < last);
  return beyond;
}

// Of contacts of which some belong to a common junction along both branches: those that hang
// together with such a one from capsule to capsule, on both branches at once. A branch that leaves
// the junction, turns and comes back through what of the other belongs to it does not.
std::vector<bool> hang_together(const std::vector<Contact>& contacts,
                                const std::vector<bool>& beyond_a,
                                const std::vector<bool>& beyond_b) {
  std::map<std::pair<int, int>, std::size_t> places;
  std::vector<bool> reached(contacts.size(), false);
  std::vector<std::size_t> front;
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    places.emplace(std::pair(contacts[k].number_a, contacts[k].number_b), k);
    if (beyond_a[k] || beyond_b[k]) continue;
    reached[k] = true;
    front.push_back(k);
  }

  // One capsule between two is within the accuracy of capsules.
  constexpr int kNear = OverlapRules::kAccuracy;
  while (!front.empty()) {
    const Contact& from = contacts[front.back()];
    front.pop_back();
    for (int a = from.number_a - kNear; a <= from.number_a + kNear; ++a) {
      for (int b = from.number_b - kNear; b <= from.number_b + kNear; ++b) {
        const auto found = places.find({a, b});
        if (found == places.end() || reached[found->second]) continue;
        reached[found->second] = true;
        front.push_back(found->second);
      }
    }
  }
  return reached;
}

// The shortest way between the two places through a node at which both branches end, over the sum
// of the radii there; 0 if there is no such node.
double way_over_radii(const SmoothedTree& tree, const PathContact& c) {
  const CenterlineBranch& a = tree.tree.branches[index(c.first)];
  const CenterlineBranch& b = tree.tree.branches[index(c.second)];
  const BSplineCurve<4>& path_a = tree.paths[index(c.first)];
  const BSplineCurve<4>& path_b = tree.paths[index(c.second)];

  double way = std::numeric_limits<double>::infinity();
  for (const auto& [node_a, way_a] :
       {std::pair(a.from, c.first_along), {a.to, path_a.knots().last() - c.first_along}}) {
    for (const auto& [node_b, way_b] :
         {std::pair(b.from, c.second_along), {b.to, path_b.knots().last() - c.second_along}}) {
      if (node_a == node_b) way = std::min(way, way_a + way_b);
    }
  }
  if (!std::isfinite(way)) return 0.0;
  return way / (path_a.at(c.first_along)(3) + path_b.at(c.second_along)(3));
}

// All capsules of different vessels, or of one after some way, that are nearer than they may be: by
// pairs of branches, the lower first.
std::map<std::pair<int, int>, std::vector<Contact>> contacts_by_pair(
    const std::vector<Capsule>& capsules, double clearance) {
  const OctaveGrids grids(capsules, clearance);
  std::map<std::pair<int, int>, std::vector<Contact>> contacts;
  const auto along = [](const Capsule& c, const Vec3& at) {
    return c.start_mm + (at - c.a).norm();
  };
  const auto compare = [&](const Capsule* p, const Capsule* q) {
    if (std::pair(p->branch, p->number) > std::pair(q->branch, q->number)) std::swap(p, q);
    const double sum = p->radius + q->radius;
    const double way = q->start_mm - p->start_mm;
    if (p->branch == q->branch && way < 0.5 * OverlapRules::kReturnRadii * sum) return;

    // Walls, so radii count; the clearance is in those of the thinner vessel.
    const auto [u, v] = nearest_points(*p, *q);
    const double depth = sum + clearance * std::min(p->radius, q->radius) - (u - v).norm();
    if (depth <= 0) return;
    contacts[{p->branch, q->branch}].push_back(
        {p->number, q->number, {p->branch, q->branch, along(*p, u), along(*q, v), u, v, depth}});
  };

  for (std::size_t i = 0; i < capsules.size(); ++i) {
    grids.for_larger(static_cast<int>(i),
                     [&](int j) { compare(&capsules[i], &capsules[index(j)]); });
  }
  return contacts;
}

// What each contact of a pair of branches has to do with a junction of both.
struct Standing {
  std::vector<bool> beyond_first;   // behind the first gap along the first branch
  std::vector<bool> beyond_second;  // and along the second
  std::vector<bool> of_junction;    // hangs together with the junction's own
};

// `count`: capsules of the two branches.
Standing standing_of(const SmoothedTree& tree, const std::vector<int>& cluster,
                     const std::array<int, 2>& count, const std::vector<Contact>& found) {
  const int first = found.front().vessels.first;
  const int second = found.front().vessels.second;
  const CenterlineBranch& a = tree.tree.branches[index(first)];
  const CenterlineBranch& b = tree.tree.branches[index(second)];
  const auto meets = [&](int node, const CenterlineBranch& other) {
    return cluster[index(node)] == cluster[index(other.from)] ||
           cluster[index(node)] == cluster[index(other.to)];
  };

  // A branch that comes back to itself has no junction with itself, unless it is a ring.
  Standing standing;
  if (first == second) {
    standing.beyond_first.assign(found.size(), a.from != a.to);
    standing.beyond_second = standing.beyond_first;
  } else {
    standing.beyond_first =
        beyond_junction(found, &Contact::number_a, count[0], meets(a.from, b), meets(a.to, b));
    standing.beyond_second =
        beyond_junction(found, &Contact::number_b, count[1], meets(b.from, a), meets(b.to, a));
  }
  standing.of_junction = hang_together(found, standing.beyond_first, standing.beyond_second);
  return standing;
}

}  // namespace

std::vector<PathContact> find_path_contacts(const SmoothedTree& tree,
                                            const OverlapOptions& options) {
  const std::vector<Capsule> capsules = capsules_of(tree);
  std::vector<int> count(tree.paths.size(), 0);
  for (const Capsule& c : capsules) ++count[index(c.branch)];
  const std::vector<int> cluster = clusters(tree);

  std::vector<PathContact> result;
  for (const auto& [pair, found] : contacts_by_pair(capsules, options.clearance)) {
    const std::array<int, 2> counts{count[index(pair.first)], count[index(pair.second)]};
    const Standing standing = standing_of(tree, cluster, counts, found);
    for (std::size_t k = 0; k < found.size(); ++k) {
      const PathContact& vessels = found[k].vessels;
      const bool beyond_both = standing.beyond_first[k] && standing.beyond_second[k];
      const bool comes_back = !standing.of_junction[k] &&
                              way_over_radii(tree, vessels) > 0.5 * OverlapRules::kBackRadii;
      if (beyond_both || comes_back) result.push_back(vessels);
    }
  }
  return result;
}

std::vector<Overlap> find_overlaps(const SmoothedTree& tree, const OverlapOptions& options) {
  std::vector<Overlap> overlaps;
  for (const PathContact& c : find_path_contacts(tree, options)) {  // ordered by pairs
    if (overlaps.empty() || overlaps.back().first != c.first ||
        overlaps.back().second != c.second) {
      overlaps.push_back({c.first, c.second, Vec3::Zero(), 0.0});
    }
    Overlap& worst = overlaps.back();
    if (c.depth_mm <= worst.depth_mm) continue;
    worst.depth_mm = c.depth_mm;
    worst.at_mm = 0.5 * (c.first_mm + c.second_mm);
  }
  return overlaps;
}

std::string overlap_text(const SmoothedTree& tree, const Overlap& overlap) {
  const std::string& first = tree.tree.branches[index(overlap.first)].name;
  const std::string& second = tree.tree.branches[index(overlap.second)].name;
  const std::string who = overlap.first == overlap.second
                              ? fmt::format("branch {} overlaps itself", first)
                              : fmt::format("branches {} and {} overlap", first, second);
  return fmt::format("{} by {:.3g} mm near ({:.4g}, {:.4g}, {:.4g})", who, overlap.depth_mm,
                     overlap.at_mm.x(), overlap.at_mm.y(), overlap.at_mm.z());
}

}  // namespace angiospline
