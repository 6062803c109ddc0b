#include "io/cad/split_joins.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

#include "base/contract.h"
#include "base/index.h"
#include "io/cad/rules.h"

namespace angiospline {
namespace {

const KnotVector& knots_along(const Patch& patch, PatchSide side) {
  return side == PatchSide::kU0 || side == PatchSide::kU1 ? patch.v : patch.u;
}

PatchSide opposite(PatchSide side) {
  switch (side) {
    case PatchSide::kU0:
      return PatchSide::kU1;
    case PatchSide::kU1:
      return PatchSide::kU0;
    case PatchSide::kV0:
      return PatchSide::kV1;
    case PatchSide::kV1:
      break;
  }
  return PatchSide::kV0;
}

// A patch's counter-clockwise loop runs along v0 and u1, and against v1 and u0.
bool runs_along_loop(PatchSide side) { return side == PatchSide::kV0 || side == PatchSide::kU1; }

class Splitter {
 public:
  Splitter(const SurfaceNetwork& network, const SplitOptions& options)
      : network_(network), options_(options) {
    surfaces_.reserve(network.patches.size());
    for (std::size_t p = 0; p < network.patches.size(); ++p) {
      surfaces_.push_back(patch_surface(network, static_cast<int>(p)));
    }
  }

  // Whether the rim's sides follow each other as their patches' loops run.
  bool runs_with_loop(const Rim& rim) const {
    const Side& first = rim.sides.front();
    const Side& next = rim.sides[rim.sides.size() > 1 ? 1 : 0];
    const auto end = [&](const Side& side, bool last) {
      return point_on(side, side.side, runs_along_loop(side.side) == last ? side.to : side.from);
    };
    return (end(first, true) - end(next, false)).norm() <=
           (end(first, false) - end(next, true)).norm();
  }

  // Where to cut side `a`, as ascending fractions in (0, 1); `join` is the one it belongs to, if
  // any.
  std::vector<double> cuts(const Side& a, const Join* join) const {
    const std::vector<double> measure = measure_along(a, join);
    const double total = measure.back();
    const int pieces = std::max(1, static_cast<int>(std::ceil(total - kPieceSlack)));
    std::vector<double> fractions;
    std::size_t k = 0;
    for (int i = 1; i < pieces; ++i) {
      const double wanted = total * i / pieces;
      while (measure[k + 1] < wanted) ++k;
      const double f = (wanted - measure[k]) / (measure[k + 1] - measure[k]);
      fractions.push_back((static_cast<double>(k) + f) / static_cast<double>(measure.size() - 1));
    }
    return fractions;
  }

 private:
  // How many pieces there are up to each of many even steps along the side.
  std::vector<double> measure_along(const Side& a, const Join* join) const {
    const Patch& patch = network_.patches[index(a.patch)];
    const int samples =
        kSideSamplesPerSpan * static_cast<int>(knots_along(patch, a.side).breakpoints().size());
    std::vector<double> measure{0.0};

    Vec3 last = point_on(a, a.side, a.from);
    Vec3 last_step = Vec3::Zero();
    for (int k = 1; k <= samples; ++k) {
      const double s = static_cast<double>(k) / samples;
      const double t = a.from + s * (a.to - a.from);
      const Vec3 place = point_on(a, a.side, t);
      const Vec3 step = place - last;
      double width = width_at(a, t, place);
      if (join != nullptr) {
        width = std::min(width, width_at(join->b, join_parameter_b(*join, s), place));
      }

      // A piece is used up by its length in widths or by its turn, whichever is more.
      const double turn = std::atan2(last_step.cross(step).norm(), last_step.dot(step));
      const double by_length = width > 0 ? step.norm() / (options_.widths * width) : 0.0;
      const double by_turn = turn * 180 / std::numbers::pi / options_.turn_deg;
      measure.push_back(measure.back() + std::max(by_length, by_turn));
      last = place;
      last_step = step;
    }
    return measure;
  }

  Vec3 point_on(const Side& side, PatchSide which, double t) const {
    const Vec2 uv = side_parameters(network_.patches[index(side.patch)], which, t);
    return surfaces_[index(side.patch)].at(uv.x(), uv.y());
  }
  double width_at(const Side& side, double t, const Vec3& place) const {
    return (point_on(side, opposite(side.side), t) - place).norm();
  }

  const SurfaceNetwork& network_;
  const SplitOptions& options_;
  std::vector<BSplineSurface<3>> surfaces_;
};

// The pieces of a join, in its order; each ends where the next begins, on both sides.
void append_pieces(const Join& join, const std::vector<double>& fractions,
                   std::vector<Join>& joins) {
  Join rest = join;
  for (const double s : fractions) {
    Join piece = rest;
    piece.a.to = rest.a.from = join_parameter_a(join, s);
    if (join.reversed) {
      piece.b.from = rest.b.to = join_parameter_b(join, s);
    } else {
      piece.b.to = rest.b.from = join_parameter_b(join, s);
    }
    joins.push_back(piece);
  }
  joins.push_back(rest);
}

// The pieces of a side in growing parameter.
std::vector<Side> pieces_of(const Side& side, const std::vector<double>& fractions) {
  std::vector<Side> pieces{side};
  for (const double s : fractions) {
    Side rest = pieces.back();
    pieces.back().to = rest.from = side.from + s * (side.to - side.from);
    pieces.push_back(rest);
  }
  return pieces;
}

}  // namespace

SurfaceNetwork split_joins(SurfaceNetwork network, const SplitOptions& options) {
  EXPECTS(options.widths > 0 && options.turn_deg > 0);
  const Splitter splitter(network, options);
  std::vector<Join> joins;
  for (const Join& join : network.joins) {
    append_pieces(join, splitter.cuts(join.a, &join), joins);
  }

  // Rims keep their order round the hole, whatever direction their sides run in.
  std::vector<std::vector<Side>> rims;
  for (const Rim& rim : network.rims) {
    std::vector<Side>& sides = rims.emplace_back();
    if (rim.sides.empty()) continue;
    const bool with_loop = splitter.runs_with_loop(rim);
    for (const Side& side : rim.sides) {
      std::vector<Side> pieces = pieces_of(side, splitter.cuts(side, nullptr));
      if (with_loop != runs_along_loop(side.side)) std::reverse(pieces.begin(), pieces.end());
      sides.insert(sides.end(), pieces.begin(), pieces.end());
    }
  }

  network.joins = std::move(joins);
  for (std::size_t r = 0; r < rims.size(); ++r) network.rims[r].sides = std::move(rims[r]);
  return network;
}

}  // namespace angiospline
