#include "modeling/layout/topology.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {
namespace {

using Polygon = std::vector<int>;
using DirectedEdge = std::pair<int, int>;

// A hull thinner than this (of unit directions) is a flat polygon.
constexpr double kFlat = 1e-7;

struct Face {
  std::array<int, 3> corners;
  Vec3 normal;
};

Face make_face(const std::vector<Vec3>& d, int a, int b, int c) {
  return {{a, b, c}, (d[index(b)] - d[index(a)]).cross(d[index(c)] - d[index(a)]).normalized()};
}

// Corners in counter-clockwise order about `normal`, seen from outside.
Polygon sorted_around(const std::vector<Vec3>& d, const Vec3& normal) {
  Vec3 middle = Vec3::Zero();
  for (const Vec3& p : d) middle += p / static_cast<double>(d.size());
  const Vec3 x = (d[0] - middle - normal * normal.dot(d[0] - middle)).normalized();
  const Vec3 y = normal.cross(x);
  Polygon order(d.size());
  std::vector<double> angle(d.size());
  for (std::size_t i = 0; i < d.size(); ++i) {
    order[i] = static_cast<int>(i);
    angle[i] = std::atan2(y.dot(d[i] - middle), x.dot(d[i] - middle));
  }
  std::sort(order.begin(), order.end(),
            [&](int a, int b) { return angle[index(a)] < angle[index(b)]; });
  return order;
}

// Beneath-beyond: each point sees some faces, which give way to a fan over their horizon.
std::vector<Face> triangle_hull(const std::vector<Vec3>& d, const std::array<int, 4>& first) {
  std::vector<Face> faces;
  for (int skip = 0; skip < 4; ++skip) {
    std::array<int, 3> c{};
    for (int k = 0, n = 0; k < 4; ++k) {
      if (k != skip) c[index(n++)] = first[index(k)];
    }
    Face face = make_face(d, c[0], c[1], c[2]);
    if (face.normal.dot(d[index(first[index(skip)])] - d[index(c[0])]) > 0)
      face = make_face(d, c[0], c[2], c[1]);
    faces.push_back(face);
  }

  for (int p = 0; p < static_cast<int>(d.size()); ++p) {
    if (std::find(first.begin(), first.end(), p) != first.end()) continue;

    std::vector<Face> kept;
    std::vector<DirectedEdge> open;
    for (const Face& face : faces) {
      if (face.normal.dot(d[index(p)] - d[index(face.corners[0])]) <= 1e-12) {
        kept.push_back(face);
        continue;
      }
      for (int k = 0; k < 3; ++k)
        open.emplace_back(face.corners[index(k)], face.corners[index((k + 1) % 3)]);
    }

    // Edges that occur in one direction alone are the horizon.
    for (const auto& [a, b] : open) {
      if (std::find(open.begin(), open.end(), DirectedEdge{b, a}) == open.end()) {
        kept.push_back(make_face(d, a, b, p));
      }
    }

    faces = std::move(kept);
  }
  return faces;
}

// Four points that span the most volume, greedily; a flat set when the last height is below kFlat.
std::pair<std::array<int, 4>, double> first_tetrahedron(const std::vector<Vec3>& d) {
  const int n = static_cast<int>(d.size());
  const auto farthest = [&](auto&& distance) {
    int best = 0;
    for (int i = 1; i < n; ++i) {
      if (distance(i) > distance(best) + 1e-12) best = i;
    }
    return best;
  };

  const int a = 0;
  const int b = farthest([&](int i) { return (d[index(i)] - d[index(a)]).norm(); });
  const Vec3 line = (d[index(b)] - d[index(a)]).normalized();
  const int c = farthest([&](int i) { return line.cross(d[index(i)] - d[index(a)]).norm(); });
  const Vec3 normal = line.cross(d[index(c)] - d[index(a)]).normalized();
  const auto height = [&](int i) { return std::abs(normal.dot(d[index(i)] - d[index(a)])); };
  const int e = farthest(height);
  return {{a, b, c, e}, height(e)};
}

struct MergedFace {
  Polygon corners;
  Vec3 normal;
};

// Triangles joined across edges at which their normals differ by less than the merge angle.
std::vector<MergedFace> merged_faces(const std::vector<Face>& faces, double merge_angle_rad) {
  std::map<DirectedEdge, int> left;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    for (int k = 0; k < 3; ++k) {
      left[{faces[f].corners[index(k)], faces[f].corners[index((k + 1) % 3)]}] =
          static_cast<int>(f);
    }
  }

  std::vector<int> group(faces.size(), -1);
  std::vector<MergedFace> merged;
  for (std::size_t f = 0; f < faces.size(); ++f) {
    if (group[f] >= 0) continue;
    const int g = static_cast<int>(merged.size());
    std::vector<int> stack{static_cast<int>(f)};
    group[f] = g;
    Vec3 normal = Vec3::Zero();
    std::map<int, int> next;  // boundary corner -> the corner after it

    // Flood over the triangles of one group; edges that are not crossed are its boundary.
    while (!stack.empty()) {
      const Face& face = faces[index(stack.back())];
      stack.pop_back();
      normal += face.normal;
      for (int k = 0; k < 3; ++k) {
        const int a = face.corners[index(k)];
        const int b = face.corners[index((k + 1) % 3)];
        const int other = left.at({b, a});
        // Compared with the first face, so that a chain of small bends does not close around.
        if (faces[index(other)].normal.dot(faces[f].normal) < std::cos(merge_angle_rad) ||
            (group[index(other)] >= 0 && group[index(other)] != g)) {
          next[a] = b;
        } else if (group[index(other)] < 0) {
          group[index(other)] = g;
          stack.push_back(other);
        }
      }
    }

    Polygon corners{next.begin()->first};
    while (next.at(corners.back()) != corners.front()) corners.push_back(next.at(corners.back()));
    merged.push_back({std::move(corners), normal.normalized()});
  }
  return merged;
}

std::vector<MergedFace> hull_faces(const std::vector<Vec3>& d, double merge_angle_rad) {
  const auto [first, height] = first_tetrahedron(d);
  if (d.size() > 3 && height > kFlat) return merged_faces(triangle_hull(d, first), merge_angle_rad);
  const Vec3 normal = make_face(d, first[0], first[1], first[2]).normal;
  Polygon front = sorted_around(d, normal);
  Polygon back(front.rbegin(), front.rend());
  return {{std::move(front), normal}, {std::move(back), -normal}};
}

// Patches around one branch follow each other.
void link_neighbours(JunctionTopology& t) {
  for (const std::vector<int>& around : t.sectors) {
    for (std::size_t k = 0; k < around.size(); ++k) {
      const int next = around[(k + 1) % around.size()];
      t.patches[index(around[k])].next = next;
      t.patches[index(next)].previous = around[k];
    }
  }
}

// Each hull edge is seen from both of its ends: two patches, one saddle.
void add_saddles(const std::map<DirectedEdge, int>& patch_of, JunctionTopology& t) {
  for (const auto& [edge, patch] : patch_of) {
    const auto [a, b] = edge;
    if (a > b) continue;
    const int other = patch_of.at({b, a});
    t.patches[index(patch)].saddle = t.patches[index(other)].saddle =
        static_cast<int>(t.saddles.size());
    const JunctionPatch& p = t.patches[index(patch)];
    t.saddles.push_back({a, b, p.from, p.to, patch, other});
  }
}

}  // namespace

JunctionTopology junction_topology(const std::vector<Vec3>& directions, double merge_angle_rad) {
  EXPECTS(directions.size() >= 3);
  JunctionTopology t;

  std::map<DirectedEdge, int> pole_left_of;  // the pole on the left of the hull edge a -> b
  std::map<DirectedEdge, int> turn;          // around corner b of a face: edge (b, c) for (a, b)
  for (const MergedFace& face : hull_faces(directions, merge_angle_rad)) {
    const int pole = static_cast<int>(t.poles.size());
    const int count = static_cast<int>(face.corners.size());
    for (int k = 0; k < count; ++k) {
      const int a = face.corners[index(k)];
      const int b = face.corners[index((k + 1) % count)];
      pole_left_of[{a, b}] = pole;
      turn[{a, b}] = face.corners[index((k + count - 1) % count)];
    }
    t.poles.push_back({face.normal, face.corners});
  }

  // Around branch a, after the edge a -> b comes the edge to the corner before a in the face left
  // of it.
  std::map<DirectedEdge, int> patch_of;
  for (int a = 0; a < static_cast<int>(directions.size()); ++a) {
    t.sectors.emplace_back();
    const auto start = pole_left_of.lower_bound({a, -1});
    EXPECTS(start != pole_left_of.end() && start->first.first == a);
    int b = start->first.second;
    do {
      const int patch = static_cast<int>(t.patches.size());
      patch_of[{a, b}] = patch;
      t.sectors.back().push_back(patch);
      t.patches.push_back({a, -1, pole_left_of.at({b, a}), pole_left_of.at({a, b}), -1, -1});
      b = turn.at({a, b});
    } while (b != start->first.second);
  }

  link_neighbours(t);
  add_saddles(patch_of, t);
  return t;
}

SharedGrid::SharedGrid(const JunctionTopology& topology, int size)
    : poles_(static_cast<int>(topology.poles.size())),
      saddles_(static_cast<int>(topology.saddles.size())),
      size_(size) {
  EXPECTS(size >= 2);
  for (int p = 0; p < static_cast<int>(topology.patches.size()); ++p) {
    const JunctionPatch& patch = topology.patches[static_cast<std::size_t>(p)];
    const bool is_a = topology.saddles[static_cast<std::size_t>(patch.saddle)].patch_a == p;
    patches_.push_back({patch.saddle, patch.from, patch.to, patch.next, is_a});
  }
  const int patches = static_cast<int>(patches_.size());
  count_ = poles_ + saddles_ * (size - 2) + patches * (size - 1) * (size - 1);
}

int SharedGrid::at(int patch, int i, int j) const {
  const Corner& p = patches_[static_cast<std::size_t>(patch)];
  const int last = size_ - 1;
  if (i == last) {
    if (j == 0) return p.from;
    if (j == last) return p.to;
    return poles_ + p.saddle * (size_ - 2) + (p.is_a ? j - 1 : last - 1 - j);
  }
  // Each patch owns its leg v = 0 and its inside; its leg v = 1 belongs to the next patch.
  const int owner = j == last ? p.next : patch;
  return poles_ + saddles_ * (size_ - 2) + (owner * last + i) * last + (j == last ? 0 : j);
}

}  // namespace angiospline
