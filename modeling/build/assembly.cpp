#include "modeling/build/assembly.h"

#include <algorithm>
#include <array>
#include <map>

#include "base/contract.h"
#include "base/index.h"

namespace angiospline {
namespace {

// Arc a of an opening in the body's order: which sector it is and whether it runs against it. A
// body that leaves runs clockwise about the opening's axis, one that arrives counter-clockwise.
int sector_of_arc(int arc, int sectors, bool leaving) { return leaving ? sectors - 1 - arc : arc; }

// The six pool columns of each arc of a circle, in the body's order.
using ArcColumns = std::vector<std::array<int, 6>>;

class Assembler {
 public:
  SurfaceNetwork run(const std::vector<Junction>& junctions, const std::vector<BodyPiece>& bodies,
                     const std::vector<ClosedOpening>& closed) {
    for (const Junction& junction : junctions) add_junction(junction);
    for (const BodyPiece& piece : bodies) add_body(junctions, piece);
    for (const ClosedOpening& opening : closed) close_opening(junctions, opening);
    network_.control_points_mm =
        Eigen::Map<const Points3>(pool_.data()->data(), 3, static_cast<Eigen::Index>(pool_.size()));
    return std::move(network_);
  }

 private:
  void add_junction(const Junction& junction) {
    const SurfaceNetwork& part = junction.network;
    const AppendOffsets offset{static_cast<int>(pool_.size()),
                               static_cast<int>(network_.patches.size())};
    const int region = static_cast<int>(network_.regions.size());
    for (Eigen::Index c = 0; c < part.control_points_mm.cols(); ++c) {
      pool_.push_back(part.control_points_mm.col(c));
    }

    // Its numbers go up by what the network has already.
    network_.regions.insert(network_.regions.end(), part.regions.begin(), part.regions.end());
    for (Patch patch : part.patches) {
      for (int& c : patch.control) c += offset.point;
      patch.region += region;
      network_.patches.push_back(std::move(patch));
    }
    for (Join join : part.joins) {
      join.a.patch += offset.patch;
      join.b.patch += offset.patch;
      network_.joins.push_back(join);
    }
    for (Dependency dependency : part.dependencies) {
      dependency.point += offset.point;
      for (auto& [master, weight] : dependency.masters) master += offset.point;
      network_.dependencies.push_back(std::move(dependency));
    }
    first_patch_.push_back(offset.patch);
  }

  int add_point(const Vec3& point) {
    pool_.push_back(point);
    return static_cast<int>(pool_.size()) - 1;
  }

  int region_named(const std::string& name, double radius_mm) {
    const auto [at, added] = regions_.try_emplace(name, static_cast<int>(network_.regions.size()));
    if (added) {
      network_.regions.push_back({name, RegionKind::kBody, radius_mm});
    } else {
      double& radius = network_.regions[index(at->second)].radius_mm;
      radius = std::min(radius, radius_mm);
    }
    return at->second;
  }

  ArcColumns opening_columns(const Junction& junction, const BodyLink& link, bool leaving) const {
    const JunctionOpening& opening = junction.openings[index(link.opening)];
    const int sectors = static_cast<int>(opening.patches.size());
    ArcColumns columns(opening.patches.size());
    for (int a = 0; a < sectors; ++a) {
      const int sector = sector_of_arc(a, sectors, leaving);
      const int number = first_patch_[index(link.junction)] + opening.patches[index(sector)];
      const Patch& patch = network_.patches[index(number)];
      for (int j = 0; j < 6; ++j) {
        columns[index(a)][index(j)] = patch.control[index(leaving ? 5 - j : j)];
      }
    }
    return columns;
  }

  // A circle of its own: shared by the two bodies that name it.
  const ArcColumns& circle_columns(int circle, const BodyEnd& end) {
    const auto [at, added] = circles_.try_emplace(circle);
    if (added) {
      const std::size_t n = end.arcs.size();
      at->second.resize(n);
      for (std::size_t a = 0; a < n; ++a) {
        for (int j = 0; j < 5; ++j) at->second[a][index(j)] = add_point(end.arcs[a].col(j));
      }
      for (std::size_t a = 0; a < n; ++a) at->second[a][5] = at->second[(a + 1) % n][0];
    }
    return at->second;
  }

  // The columns of a body's end row on the arcs of a circle.
  std::vector<int> row_on_arcs(const BodyPiece& piece, const ArcColumns& arcs, bool at_start) {
    std::vector<int> row;
    const Body& body = piece.body;
    const int first = at_start ? 0 : (body.rows() - 1) * body.ring();
    for (std::size_t k = 0; k < body.strips.size(); ++k) {
      const ArcPart& part = at_start ? body.strips[k].start : body.strips[k].end;
      const std::array<int, 6>& masters = arcs[index(part.arc)];
      const Eigen::Matrix<double, 6, 6> weights = arc_part_weights(part.from, part.to);

      // A column that is none of the arc's own is what subdividing the arc gives there: it moves
      // with them, as a Dependency (thesis 3.2).
      for (int j = 0; j < 5; ++j) {
        if (part.whole() || (j == 0 && part.from == 0.0)) {
          row.push_back(masters[index(j)]);
          continue;
        }
        Dependency dependency;
        dependency.point = add_point(body.net.col(first + static_cast<int>(5 * k) + j));
        for (int m = 0; m < 6; ++m) {
          if (weights(j, m) != 0) dependency.masters.emplace_back(masters[index(m)], weights(j, m));
        }
        row.push_back(dependency.point);
        network_.dependencies.push_back(std::move(dependency));
      }
    }
    return row;
  }

  std::vector<int> own_row(const Body& body, int i) {
    std::vector<int> row;
    for (int c = 0; c < body.ring(); ++c)
      row.push_back(add_point(body.net.col(i * body.ring() + c)));
    return row;
  }

  std::vector<int> end_row(const std::vector<Junction>& junctions, const BodyPiece& piece,
                           bool at_start) {
    const BodyLink& link = at_start ? piece.start_link : piece.end_link;
    switch (link.kind) {
      case BodyLink::Kind::kOpening:
        return row_on_arcs(piece, opening_columns(junctions[index(link.junction)], link, at_start),
                           at_start);
      case BodyLink::Kind::kCircle:
        return row_on_arcs(piece, circle_columns(link.circle, at_start ? piece.start : piece.end),
                           at_start);
      case BodyLink::Kind::kRim:
        break;
    }
    return own_row(piece.body, at_start ? 0 : piece.body.rows() - 1);
  }

  void add_body(const std::vector<Junction>& junctions, const BodyPiece& piece) {
    const Body& body = piece.body;
    const int region = region_named(piece.name, piece.radius_mm);
    const int first_patch = static_cast<int>(network_.patches.size());
    const int strips = static_cast<int>(body.strips.size());

    // Rows are numbered in the pool first: those at the ends may be a junction's own.
    std::vector<std::vector<int>> rows;
    rows.push_back(end_row(junctions, piece, true));
    for (int i = 1; i + 1 < body.rows(); ++i) rows.push_back(own_row(body, i));
    rows.push_back(end_row(junctions, piece, false));

    for (int k = 0; k < strips; ++k) {
      Patch patch{body.u, KnotVector::bezier(5), {}, region};
      for (const std::vector<int>& row : rows) {
        for (int j = 0; j <= 5; ++j) {
          patch.control.push_back(row[index((5 * k + j) % body.ring())]);
        }
      }
      network_.patches.push_back(std::move(patch));
      network_.joins.push_back(
          {{first_patch + k, PatchSide::kV1, body.u.first(), body.u.last()},
           {first_patch + (k + 1) % strips, PatchSide::kV0, body.u.first(), body.u.last()},
           false});
    }

    close_end(junctions, piece, first_patch, true);
    close_end(junctions, piece, first_patch, false);
  }

  // Joins each strip's side at one end to what lies beyond it; a rim takes all of them.
  void close_end(const std::vector<Junction>& junctions, const BodyPiece& piece, int first_patch,
                 bool at_start) {
    const BodyLink& link = at_start ? piece.start_link : piece.end_link;
    const BodyEnd& end = at_start ? piece.start : piece.end;
    const PatchSide side = at_start ? PatchSide::kU0 : PatchSide::kU1;
    Rim rim{link.rim_name, link.rim_kind,
            end.center_mm, at_start ? Vec3(-end.tangent) : end.tangent,
            end.radius_mm, {}};
    for (std::size_t k = 0; k < piece.body.strips.size(); ++k) {
      const ArcPart& part = at_start ? piece.body.strips[k].start : piece.body.strips[k].end;
      const Side own{first_patch + static_cast<int>(k), side, 0.0, 1.0};
      if (link.kind == BodyLink::Kind::kRim) {
        rim.sides.push_back(own);
      } else if (link.kind == BodyLink::Kind::kOpening) {
        const JunctionOpening& opening =
            junctions[index(link.junction)].openings[index(link.opening)];
        const int sector =
            sector_of_arc(part.arc, static_cast<int>(opening.patches.size()), at_start);
        const int patch = first_patch_[index(link.junction)] + opening.patches[index(sector)];

        // A body that starts here runs against the opening's own direction.
        Side other{patch, PatchSide::kU0, part.from, part.to};
        if (at_start) {
          other.from = 1 - part.to;
          other.to = 1 - part.from;
        }
        network_.joins.push_back({own, other, at_start});
      } else {
        join_on_circle(link.circle, part.arc, own);
      }
    }

    if (link.kind == BodyLink::Kind::kRim) network_.rims.push_back(std::move(rim));
  }

  void close_opening(const std::vector<Junction>& junctions, const ClosedOpening& closed) {
    const JunctionOpening& opening =
        junctions[index(closed.junction)].openings[index(closed.opening)];
    Rim rim{closed.rim_name, closed.rim_kind,   opening.center_mm,
            opening.axis,    opening.radius_mm, {}};
    for (const int patch : opening.patches) {
      rim.sides.push_back({first_patch_[index(closed.junction)] + patch, PatchSide::kU0, 0.0, 1.0});
    }
    network_.rims.push_back(std::move(rim));
  }

  // The second body to name an arc of a circle is joined to the first.
  void join_on_circle(int circle, int arc, const Side& side) {
    const auto [at, added] = waiting_.try_emplace({circle, arc}, side);
    if (!added) network_.joins.push_back({at->second, side, false});
  }

  SurfaceNetwork network_;
  std::vector<Vec3> pool_;
  std::vector<int> first_patch_;        // of each junction
  std::map<std::string, int> regions_;  // of bodies
  std::map<int, ArcColumns> circles_;
  std::map<std::pair<int, int>, Side> waiting_;
};

}  // namespace

BodyEnd opening_end(const Junction& junction, int number, bool leaving) {
  const JunctionOpening& opening = junction.openings[index(number)];
  const int sectors = static_cast<int>(opening.patches.size());
  BodyEnd end{
      opening.center_mm, leaving ? opening.axis : Vec3(-opening.axis), opening.radius_mm, {}, true};
  for (int a = 0; a < sectors; ++a) {
    const int patch = opening.patches[index(sector_of_arc(a, sectors, leaving))];
    const BSplineSurface<3> surface = patch_surface(junction.network, patch);
    EXPECTS(surface.v_count() == 6);
    Arc arc = surface.control_points().leftCols<6>();
    end.arcs.push_back(leaving ? Arc(arc.rowwise().reverse()) : arc);
  }
  return end;
}

SurfaceNetwork assemble(const std::vector<Junction>& junctions,
                        const std::vector<BodyPiece>& bodies,
                        const std::vector<ClosedOpening>& closed) {
  EXPECTS(!junctions.empty() || !bodies.empty());
  return Assembler().run(junctions, bodies, closed);
}

}  // namespace angiospline
