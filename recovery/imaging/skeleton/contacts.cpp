#include "recovery/imaging/skeleton/contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "base/index.h"
#include "recovery/imaging/mask/distance_transform.h"
#include "recovery/imaging/skeleton/rules.h"

namespace angiospline {
namespace {

using namespace contact_rules;

double voxel_mm(const ImageGrid& grid) { return grid.spacing_mm.maxCoeff(); }

// Where a branch comes out of a junction.
struct Exit {
  Vec3 at, outward;
  double radius;
};

double radius_at(const Mask& mask, const Voxel& v) {
  return boundary_distances_mm(mask, {mask.grid.offset(v)})[0];
}

std::optional<Exit> exit_of(const VesselArc& arc, bool from_front, double lumen_mm,
                            const Mask& mask) {
  const std::size_t count = arc.voxels.size();
  const auto voxel = [&](std::size_t i) { return arc.voxels[from_front ? i : count - 1 - i]; };
  const auto point = [&](std::size_t i) { return mask.grid.world_mm(voxel(i)); };
  // In the waist between two vessels the way to the wall is short; it grows on the way out.
  double widest = lumen_mm, radius = lumen_mm;
  std::size_t out = 0;
  while (out + 1 < count && (point(out) - point(0)).norm() < kExit * widest) {
    radius = radius_at(mask, voxel(++out));
    widest = std::max(widest, radius);
  }
  std::size_t far = out;
  while (far + 1 < count &&
         (point(far) - point(out)).norm() < std::max(radius, 3 * voxel_mm(mask.grid)))
    ++far;
  // A branch that ends within the lumen still shows where it leads, from the junction on.
  const Vec3 way = far > out ? Vec3(point(far) - point(out)) : Vec3(point(out) - point(0));
  if (way.norm() == 0) return std::nullopt;
  return Exit{point(out), way.normalized(), radius};
}

double bend(const Exit& a, const Exit& b) {
  return std::acos(std::clamp(-a.outward.dot(b.outward), -1.0, 1.0));
}

// How unlike one vessel two exits are: by the chord between them, which is sure even where the axis
// is drawn towards the contact, and by their radii.
double unlikeness(const Exit& a, const Exit& b) {
  const Vec3 chord = (b.at - a.at).stableNormalized();
  const auto angle = [](double cosine) { return std::acos(std::clamp(cosine, -1.0, 1.0)); };
  return angle(-a.outward.dot(chord)) + angle(b.outward.dot(chord)) +
         std::abs(std::log(a.radius / b.radius));
}

bool goes_through(const Exit& a, const Exit& b) {
  const double ratio = std::max(a.radius, b.radius) / std::min(a.radius, b.radius);
  return bend(a, b) <= kMostBend && ratio <= kRadiusRatio;
}

ContactVessel vessel_through(const Exit& a, const Exit& b, double step_mm) {
  const double length = (b.at - a.at).norm();
  // Over two radii the curve takes up the chord's direction: side by side, vessels run straight.
  const double pull = std::min(length, a.radius + b.radius);
  const int n = std::max(2, static_cast<int>(std::ceil(length / step_mm)));

  std::vector<Vec3> points;
  const auto onward = [&](const Exit& e, int k) { return e.at + k * step_mm * e.outward; };
  const auto steps = [&](const Exit& e) {
    return static_cast<int>(std::ceil(kOnward * e.radius / step_mm));
  };
  for (int k = steps(a); k > 0; --k) points.push_back(onward(a, k));
  for (int i = 0; i <= n; ++i) {  // Hermite's cubic; a's outward direction is against the way
    const double t = static_cast<double>(i) / n;
    const double h = t * t * (3 - 2 * t), u = t * (1 - t) * (1 - t), w = t * t * (1 - t);
    points.push_back((1 - h) * a.at + h * b.at - pull * u * a.outward - pull * w * b.outward);
  }
  for (int k = 1; k <= steps(b); ++k) points.push_back(onward(b, k));

  ContactVessel vessel;
  vessel.axis_mm.resize(3, std::ssize(points));
  for (Eigen::Index i = 0; i < vessel.axis_mm.cols(); ++i)
    vessel.axis_mm.col(i) = points[static_cast<std::size_t>(i)];
  vessel.radius_mm = 0.5 * (a.radius + b.radius);
  return vessel;
}

// Sets where two axes are nearest to each other.
void measure(MaskContact& contact) {
  contact.distance_mm = std::numeric_limits<double>::infinity();
  for (Eigen::Index i = 0; i < contact.a.axis_mm.cols(); ++i)
    for (Eigen::Index k = 0; k < contact.b.axis_mm.cols(); ++k) {
      const double d = (contact.a.axis_mm.col(i) - contact.b.axis_mm.col(k)).norm();
      if (d >= contact.distance_mm) continue;
      contact.distance_mm = d;
      contact.at_mm = 0.5 * (contact.a.axis_mm.col(i) + contact.b.axis_mm.col(k));
    }
}

// The contact if the exits belong together as listed, two and two. `bridge_mm` is the least radius
// of the branch between; none for a junction of four.
std::optional<MaskContact> contact_of(const std::array<Exit, 4>& e, std::optional<double> bridge_mm,
                                      double voxel) {
  if (!goes_through(e[0], e[1]) || !goes_through(e[2], e[3])) return std::nullopt;
  MaskContact contact;
  contact.a = vessel_through(e[0], e[1], 0.5 * voxel);
  contact.b = vessel_through(e[2], e[3], 0.5 * voxel);
  measure(contact);
  const double both = contact.a.radius_mm + contact.b.radius_mm;
  if (contact.distance_mm < kCrossing * both) return std::nullopt;
  if (contact.distance_mm <= both + kTouchVoxels * voxel) return contact;
  const double thin = kThinBridge * std::min(contact.a.radius_mm, contact.b.radius_mm);
  if (contact.distance_mm > kLongestBridge * both || !bridge_mm || *bridge_mm >= thin)
    return std::nullopt;
  contact.kind = ContactKind::kBridge;
  return contact;
}

// Whether the mask is thinner between the two vessels than `share` of the thinner one.
bool has_waist(const Mask& mask, const MaskContact& contact, double share) {
  const Vec3 at = mask.grid.index_vox(contact.at_mm);
  const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                static_cast<int>(std::lround(at[2]))};
  if (!mask.grid.contains(v) || mask[v] == 0) return true;
  return radius_at(mask, v) < share * std::min(contact.a.radius_mm, contact.b.radius_mm);
}

// Of the three ways to pair four exits the likeliest that is a contact. Where vessels run side by
// side, to cross looks as straight as to stay: only there the waist between them must show.
std::optional<MaskContact> contact_of(const std::vector<Exit>& e, std::optional<double> bridge_mm,
                                      const Mask& mask) {
  std::array<std::array<Exit, 4>, 3> ways{
      {{e[0], e[1], e[2], e[3]}, {e[0], e[2], e[1], e[3]}, {e[0], e[3], e[1], e[2]}}};
  const auto cost = [](const std::array<Exit, 4>& w) {
    return unlikeness(w[0], w[1]) + unlikeness(w[2], w[3]);
  };
  std::stable_sort(ways.begin(), ways.end(),
                   [&](const auto& p, const auto& q) { return cost(p) < cost(q); });
  for (std::size_t k = 0; k < ways.size(); ++k) {
    auto contact = contact_of(ways[k], bridge_mm, voxel_mm(mask.grid));
    if (contact && (k == 0 || has_waist(mask, *contact, kThinBridge))) return contact;
  }
  return std::nullopt;
}

// One of more than four exits joins the vessel of whose axis it is the fewer radii away.
void add_branch(MaskContact& contact, const Exit& e, double step_mm) {
  const auto nearest = [&](const ContactVessel& vessel) {
    Eigen::Index at = 0;
    (vessel.axis_mm.colwise() - e.at).colwise().squaredNorm().minCoeff(&at);
    return Vec3(vessel.axis_mm.col(at));
  };
  const Vec3 of_a = nearest(contact.a), of_b = nearest(contact.b);
  const bool is_of_a =
      (e.at - of_a).norm() * contact.b.radius_mm <= (e.at - of_b).norm() * contact.a.radius_mm;
  const Vec3 from = is_of_a ? of_a : of_b;
  const double length = (e.at - from).norm();
  const int inside = static_cast<int>(std::ceil(length / step_mm));
  const int beyond = static_cast<int>(std::ceil(kOnward * e.radius / step_mm));
  Points3& axis = (is_of_a ? contact.a : contact.b).axis_mm;
  const Eigen::Index first = axis.cols();
  axis.conservativeResize(3, first + inside + beyond);
  for (int k = 1; k <= inside; ++k) axis.col(first + k - 1) = from + k * (e.at - from) / inside;
  for (int k = 1; k <= beyond; ++k)
    axis.col(first + inside + k - 1) = e.at + k * step_mm * e.outward;
}

// Of all ways to take two pairs out of five exits or more the likeliest that is a contact with a
// waist.
std::optional<MaskContact> contact_among(const std::vector<Exit>& e,
                                         std::optional<double> bridge_mm, const Mask& mask) {
  struct Way {
    std::array<std::size_t, 4> of;
    double cost;
  };

  // All ways to pair two and two of the exits, the likeliest first.
  std::vector<Way> ways;
  const std::size_t n = e.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = i + 1; j < n; ++j)
      for (std::size_t k = i + 1; k < n; ++k)
        for (std::size_t l = k + 1; l < n; ++l)
          if (k != j && l != j)
            ways.push_back({{i, j, k, l}, unlikeness(e[i], e[j]) + unlikeness(e[k], e[l])});
  std::stable_sort(ways.begin(), ways.end(),
                   [](const Way& p, const Way& q) { return p.cost < q.cost; });

  const double voxel = voxel_mm(mask.grid);
  for (const Way& way : ways) {
    const auto& [i, j, k, l] = way.of;
    auto contact = contact_of(std::array{e[i], e[j], e[k], e[l]}, bridge_mm, voxel);
    if (!contact || !has_waist(mask, *contact, kWaist)) continue;

    const double thinner = std::min(contact->a.radius_mm, contact->b.radius_mm);
    if (bridge_mm && *bridge_mm >= kWaist * thinner) continue;
    for (std::size_t m = 0; m < n; ++m)
      if (std::find(way.of.begin(), way.of.end(), m) == way.of.end())
        add_branch(*contact, e[m], 0.5 * voxel);
    return contact;
  }
  return std::nullopt;
}

class ContactFinder {
 public:
  ContactFinder(const VesselGraph& graph, const Mask& mask) : graph_(graph), mask_(mask) {
    std::vector<std::size_t> places;
    for (const VesselNode& node : graph.nodes) places.push_back(graph.grid.offset(node.voxel));
    lumen_mm_ = boundary_distances_mm(mask, places);
  }

  std::vector<MaskContact> find() {
    const auto count = static_cast<int>(graph_.nodes.size());
    found_.assign(graph_.nodes.size(), 0);
    for (int n = 0; n < count; ++n) {
      const std::vector<int>& arcs = graph_.nodes[index(n)].arcs;
      if (arcs.size() >= 4) look({{n, -1}}, std::nullopt);
      if (arcs.size() < 3) continue;
      for (const int a : arcs) {
        const VesselArc& arc = graph_.arcs[index(a)];
        const int other = arc.from == n ? arc.to : arc.from;
        if (other <= n || graph_.nodes[index(other)].arcs.size() < 3) continue;
        if (found_alone(n) || found_alone(other)) continue;
        look({{n, a}, {other, a}}, thinnest(arc));
      }
    }
    for (int n = 0; n < count; ++n)
      if (found_[index(n)] == 0 && graph_.nodes[index(n)].arcs.size() == 3) look_for_end(n);
    return std::move(contacts_);
  }

 private:
  double thinnest(const VesselArc& arc) const {
    std::vector<std::size_t> places;
    for (const Voxel& v : arc.voxels) places.push_back(graph_.grid.offset(v));
    const std::vector<double> r = boundary_distances_mm(mask_, places);
    return *std::min_element(r.begin(), r.end());
  }

  bool found_alone(int n) const {
    return found_[index(n)] != 0 && graph_.nodes[index(n)].arcs.size() > 3;
  }

  // Nodes, each with the arc that does not lead away from the contact.
  void look(const std::vector<std::pair<int, int>>& nodes, std::optional<double> bridge_mm) {
    std::vector<Exit> exits;
    for (const auto& [n, bridge] : nodes) {
      int before = -1;
      for (const int a : graph_.nodes[index(n)].arcs) {
        if (a == bridge) continue;
        const VesselArc& arc = graph_.arcs[index(a)];
        // An arc onto its own node is listed twice and leaves by both its ends.
        const bool front = arc.from == n && before != a;
        const auto exit = exit_of(arc, front, lumen_mm_[index(n)], mask_);
        before = a;
        if (exit) exits.push_back(*exit);
      }
    }
    if (exits.size() < 4 || exits.size() > kMostExits) return;
    auto contact = exits.size() == 4 ? contact_of(exits, bridge_mm, mask_)
                                     : contact_among(exits, bridge_mm, mask_);
    if (!contact) return;
    contacts_.push_back(std::move(*contact));
    for (const auto& node : nodes) found_[index(node.first)] = 1;
  }

  // A branch from its junction on: places of its axis and the distances to the wall there.
  struct Branch {
    std::vector<Vec3> points;
    std::vector<double> radii;
    double rest_mm = 0;  // of its length, beyond these points
  };

  Branch branch_from(int n, const VesselArc& arc) const {
    Branch branch;
    std::vector<std::size_t> places;
    const std::size_t count = arc.voxels.size();
    const double reach = kSearched * lumen_mm_[index(n)];
    for (std::size_t i = 0; i < count; ++i) {
      const Voxel& v = arc.voxels[arc.from == n ? i : count - 1 - i];
      const Vec3 p = mask_.grid.world_mm(v);
      if (!branch.points.empty() && (p - branch.points.front()).norm() > reach) {
        branch.rest_mm = static_cast<double>(count - i) * mask_.grid.spacing_mm.minCoeff();
        break;
      }
      branch.points.push_back(p);
      places.push_back(mask_.grid.offset(v));
    }
    branch.radii = boundary_distances_mm(mask_, places);
    return branch;
  }

  // Whether a vessel ends at the side of another in this junction of three.
  void look_for_end(int n) {
    const std::vector<int>& arcs = graph_.nodes[index(n)].arcs;
    std::vector<std::optional<Exit>> exits;
    for (const int a : arcs) {
      const VesselArc& arc = graph_.arcs[index(a)];
      if (arc.from == arc.to) return;
      exits.push_back(exit_of(arc, arc.from == n, lumen_mm_[index(n)], mask_));
      if (!exits.back()) return;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const Exit &a = *exits[(k + 1) % 3], &b = *exits[(k + 2) % 3];
      if (!goes_through(a, b)) continue;
      MaskContact contact;
      contact.kind = ContactKind::kEndToSide;
      contact.a = vessel_through(a, b, 0.5 * voxel_mm(mask_.grid));
      if (!end_of(branch_from(n, graph_.arcs[index(arcs[k])]), contact)) continue;
      contacts_.push_back(std::move(contact));
      return;
    }
  }

  // Completes the contact if the branch comes out of a neck at the wall of the contact's vessel.
  bool end_of(const Branch& branch, MaskContact& contact) const {
    const double voxel = voxel_mm(mask_.grid), a = contact.a.radius_mm;
    const auto from_axis = [&](const Vec3& p) {
      return std::sqrt((contact.a.axis_mm.colwise() - p).colwise().squaredNorm().minCoeff());
    };

    // The neck: the thinnest place while the branch is still at the other vessel's wall.
    std::size_t neck = 0;
    for (std::size_t i = 1; i < branch.points.size(); ++i)
      if (branch.radii[i] < branch.radii[neck] &&
          from_axis(branch.points[i]) <= a + kTouchVoxels * voxel)
        neck = i;

    double length = branch.rest_mm, radius = 0;
    for (std::size_t i = neck + 1; i < branch.points.size(); ++i) {
      length += (branch.points[i] - branch.points[i - 1]).norm();
      radius = std::max(radius, branch.radii[i]);
    }
    if (neck == 0 || branch.radii[neck] > radius - voxel || length < kGoesOn * radius ||
        branch.radii[neck] >= kNeck * std::min(a, radius))
      return false;

    // Its axis from where it is itself, so far as it is straight.
    std::vector<Vec3> axis;
    for (std::size_t i = neck; i < branch.points.size(); ++i) {
      const double away = (branch.points[i] - branch.points[neck]).norm();
      if (away >= kEndToAxis * radius && away <= kOnward * radius) axis.push_back(branch.points[i]);
    }
    if (axis.empty()) return false;

    contact.b.radius_mm = radius;
    contact.b.axis_mm.resize(3, std::ssize(axis));
    for (Eigen::Index i = 0; i < contact.b.axis_mm.cols(); ++i)
      contact.b.axis_mm.col(i) = axis[static_cast<std::size_t>(i)];
    measure(contact);
    contact.at_mm = branch.points[neck];
    return true;
  }

  const VesselGraph& graph_;
  const Mask& mask_;
  std::vector<double> lumen_mm_;
  std::vector<char> found_;  // nodes of a contact
  std::vector<MaskContact> contacts_;
};

}  // namespace

std::string_view name_of(ContactKind kind) {
  constexpr std::array<std::string_view, 3> kNames{"kissing", "bridge", "end_to_side"};
  return kNames[static_cast<std::size_t>(kind)];
}

std::string_view words_for(ContactKind kind) {
  constexpr std::array<std::string_view, 3> kWords{
      "two vessels touch", "a bridge thinner than both its vessels",
      "the end of a vessel touches the side of another, or a branch is narrow where it leaves"};
  return kWords[static_cast<std::size_t>(kind)];
}

std::vector<MaskContact> find_contacts(const VesselGraph& graph, const Mask& mask) {
  EXPECTS(graph.grid.size == mask.grid.size);
  return ContactFinder(graph, mask).find();
}

}  // namespace angiospline
