#include "recovery/contacts.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>

#include "recovery/distance_transform.h"

namespace angiospline {
namespace {

constexpr double kMostBend = std::numbers::pi / 3;
constexpr double kRadiusRatio = 1.7;
constexpr double kCrossing = 0.55;    // of both radii: axes nearer than that do meet
constexpr double kTouchVoxels = 1.5;  // between walls that still touch in the mask
constexpr double kLongestBridge = 2.0;
constexpr double kThinBridge = 0.6;
constexpr double kOnward = 3.0;  // radii that an axis goes on straight beyond its exits
constexpr double kExit = 1.5;    // lumen radii from a junction to where a branch is itself

std::size_t index(int i) { return static_cast<std::size_t>(i); }

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
void measure(VesselContact& contact) {
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
std::optional<VesselContact> contact_of(const std::array<Exit, 4>& e,
                                        std::optional<double> bridge_mm, double voxel) {
  if (!goes_through(e[0], e[1]) || !goes_through(e[2], e[3])) return std::nullopt;
  VesselContact contact;
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

// Whether the mask is thinner between the two vessels than they are.
bool has_waist(const Mask& mask, const VesselContact& contact) {
  const Vec3 at = mask.grid.index_vox(contact.at_mm);
  const Voxel v{static_cast<int>(std::lround(at[0])), static_cast<int>(std::lround(at[1])),
                static_cast<int>(std::lround(at[2]))};
  if (!mask.grid.contains(v) || mask[v] == 0) return true;
  return radius_at(mask, v) < kThinBridge * std::min(contact.a.radius_mm, contact.b.radius_mm);
}

// Of the three ways to pair four exits the likeliest that is a contact. Where vessels run side by
// side, to cross looks as straight as to stay: only there the waist between them must show.
std::optional<VesselContact> contact_of(const std::vector<Exit>& e, std::optional<double> bridge_mm,
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
    if (contact && (k == 0 || has_waist(mask, *contact))) return contact;
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

  std::vector<VesselContact> find() {
    for (std::size_t n = 0; n < graph_.nodes.size(); ++n) {
      const std::vector<int>& arcs = graph_.nodes[n].arcs;
      if (arcs.size() == 4) look({{static_cast<int>(n), -1}}, std::nullopt);
      if (arcs.size() != 3) continue;
      for (const int a : arcs) {
        const VesselArc& arc = graph_.arcs[index(a)];
        const int other = arc.from == static_cast<int>(n) ? arc.to : arc.from;
        if (other <= static_cast<int>(n) || graph_.nodes[index(other)].arcs.size() != 3) continue;
        look({{static_cast<int>(n), a}, {other, a}}, thinnest(arc));
      }
    }
    return std::move(contacts_);
  }

 private:
  double thinnest(const VesselArc& arc) const {
    std::vector<std::size_t> places;
    for (const Voxel& v : arc.voxels) places.push_back(graph_.grid.offset(v));
    const std::vector<double> r = boundary_distances_mm(mask_, places);
    return *std::min_element(r.begin(), r.end());
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
    if (exits.size() != 4) return;
    auto contact = contact_of(exits, bridge_mm, mask_);
    if (contact) contacts_.push_back(std::move(*contact));
  }

  const VesselGraph& graph_;
  const Mask& mask_;
  std::vector<double> lumen_mm_;
  std::vector<VesselContact> contacts_;
};

struct Nearest {
  double distance_mm;
  Eigen::Index sample;
};

Nearest nearest(const Points3& axis, const Vec3& p) {
  Eigen::Index at = 0;
  const double squared = (axis.colwise() - p).colwise().squaredNorm().minCoeff(&at);
  return {std::sqrt(squared), at};
}

// The voxels around a contact and whose they are.
class Parting {
 public:
  Parting(const Mask& mask, const VesselContact& contact) : mask_(mask), c_(contact) {
    const double both = c_.a.radius_mm + c_.b.radius_mm;
    const double voxel = voxel_mm(mask.grid);
    zone_mm_ = std::max(both, c_.distance_mm) + 2.5 * voxel;
    // Walls of vessels apart by more than the zone do not touch.
    const Vec3 reach = Vec3::Constant(std::max(c_.a.radius_mm, c_.b.radius_mm) + 2 * voxel)
                           .cwiseQuotient(mask.grid.spacing_mm);
    for (std::size_t k = 0; k < 3; ++k) low_[k] = mask.grid.size[k], high_[k] = -1;
    for (const Points3* axis : {&c_.a.axis_mm, &c_.b.axis_mm})
      for (Eigen::Index i = 0; i < axis->cols(); ++i) {
        const Vec3 at = mask.grid.index_vox(axis->col(i));
        for (std::size_t k = 0; k < 3; ++k) {
          const auto m = static_cast<Eigen::Index>(k);
          low_[k] = std::min(low_[k], std::max(0, static_cast<int>(at[m] - reach[m])));
          high_[k] = std::max(high_[k], std::min(mask.grid.size[k] - 1,
                                                 static_cast<int>(std::ceil(at[m] + reach[m]))));
        }
      }
    for (std::size_t k = 0; k < 3; ++k) owner_.grid.size[k] = high_[k] - low_[k] + 1;
    owner_.voxels.assign(owner_.grid.voxel_count(), kNone);
    assign();
  }

  // Offsets in the mask of the wider vessel's voxels that touch the other's.
  std::vector<std::size_t> between() const {
    const bool a_is_wider = c_.a.radius_mm >= c_.b.radius_mm;
    const Owner loses = a_is_wider ? kA : kB, keeps = a_is_wider ? kB : kA;
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < owner_.voxels.size(); ++i) {
      if (owner_.voxels[i] != loses) continue;
      const Voxel v = owner_.grid.voxel(i);
      bool touches = false;
      for (int n = 0; n < 27 && !touches; ++n) {
        const Voxel u{v[0] + n % 3 - 1, v[1] + n / 3 % 3 - 1, v[2] + n / 9 - 1};
        touches = owner_.grid.contains(u) && owner_[u] == keeps;
      }
      if (touches) out.push_back(mask_.grid.offset(in_mask(v)));
    }
    return out;
  }

 private:
  enum Owner : std::uint8_t { kNone, kA, kB };

  Voxel in_mask(const Voxel& v) const { return {v[0] + low_[0], v[1] + low_[1], v[2] + low_[2]}; }

  void assign() {
    for (std::size_t i = 0; i < owner_.voxels.size(); ++i) {
      const Voxel v = in_mask(owner_.grid.voxel(i));
      if (mask_[v] == 0) continue;
      const Vec3 p = mask_.grid.world_mm(v);
      const Nearest a = nearest(c_.a.axis_mm, p), b = nearest(c_.b.axis_mm, p);
      if ((c_.a.axis_mm.col(a.sample) - c_.b.axis_mm.col(b.sample)).norm() > zone_mm_) continue;
      owner_.voxels[i] = a.distance_mm * c_.b.radius_mm <= b.distance_mm * c_.a.radius_mm ? kA : kB;
    }
  }

  const Mask& mask_;
  const VesselContact& c_;
  double zone_mm_ = 0;
  Voxel low_{}, high_{};
  Mask owner_;
};

}  // namespace

std::vector<VesselContact> find_contacts(const VesselGraph& graph, const Mask& mask) {
  EXPECTS(graph.grid.size == mask.grid.size);
  return ContactFinder(graph, mask).find();
}

Mask cut_contacts(Mask mask, const std::vector<VesselContact>& contacts) {
  std::vector<std::size_t> cut;
  for (const VesselContact& contact : contacts) {
    const std::vector<std::size_t> between = Parting(mask, contact).between();
    cut.insert(cut.end(), between.begin(), between.end());
  }
  for (const std::size_t o : cut) mask.voxels[o] = 0;
  return mask;
}

}  // namespace angiospline
