#include "modeling/network/tessellation_draft.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "modeling/network/rules.h"

namespace angiospline {
namespace {

using namespace network_rules;

// A loop of mesh points as a polygon that is run through by the share of its segments.
struct Outline {
  const std::vector<int>& loop;
  const std::vector<Vec3>& points;

  Vec3 at(double share) const {
    const double k = share * static_cast<double>(loop.size());
    const auto i = std::min(static_cast<std::size_t>(k), loop.size() - 1);
    const Vec3 a = points[index(loop[i])];
    return a + (k - static_cast<double>(i)) * (points[index(loop[(i + 1) % loop.size()])] - a);
  }
};

// Rings towards the middle, one segment's length apart, with ever fewer points; then a fan.
void add_cap(const std::vector<int>& loop, const Vec3& normal, int part, TessellationDraft& draft) {
  const auto count = static_cast<double>(loop.size());
  Vec3 center = Vec3::Zero();
  for (const int p : loop) center += draft.points[index(p)] / count;
  MeshChain outer;
  for (std::size_t k = 0; k <= loop.size(); ++k) {
    outer.push(static_cast<double>(k) / count, loop[k % loop.size()]);
  }

  // A circle of n segments has a radius of n / 2 pi of them.
  const int rings = std::max(1, static_cast<int>(std::lround(count / (2 * std::numbers::pi))));
  for (int ring = 1; ring <= rings; ++ring) {
    const double inward = static_cast<double>(ring) / rings;
    const int points =
        ring == rings ? 1 : std::max(kLeastRing, static_cast<int>(count * (1 - inward)));
    MeshChain inner;
    for (int k = 0; k < points; ++k) {
      const double s = static_cast<double>(k) / points;
      const Vec3 on_loop = Outline{loop, draft.points}.at(s);
      inner.push(s, draft.add_point({}, center + (1 - inward) * (on_loop - center)));
      draft.normals.back() = normal;
    }
    if (points > 1) inner.push(1.0, inner.points.front());
    draft.add_strip(outer, inner, part);
    outer = std::move(inner);
  }
}

}  // namespace

void TessellationDraft::add_cell(const std::array<int, 4>& c, int part) {
  const double first = (points[index(c[0])] - points[index(c[2])]).squaredNorm();
  const double second = (points[index(c[1])] - points[index(c[3])]).squaredNorm();
  // A hair in favour of the first keeps the choice from depending on the last bit.
  if (first <= second * (1 + kDiagonalHair)) {
    add_triangle(c[0], c[1], c[2], part);
    add_triangle(c[0], c[2], c[3], part);
  } else {
    add_triangle(c[0], c[1], c[3], part);
    add_triangle(c[1], c[2], c[3], part);
  }
}

void add_caps(const std::vector<Rim>& rims, const std::vector<std::vector<int>>& loops,
              int first_part, TessellationDraft& draft) {
  for (std::size_t r = 0; r < rims.size(); ++r) {
    add_cap(loops[r], rims[r].normal, first_part + static_cast<int>(r), draft);
  }
}

}  // namespace angiospline
