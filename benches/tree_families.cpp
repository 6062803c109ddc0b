#include "benches/tree_families.h"

#include <cmath>
#include <functional>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/contract.h"
#include "modeling/tree/point_graph.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

Vec3 gaussian(Random& random) { return {random.gaussian(), random.gaussian(), random.gaussian()}; }

Vec3 across(const Vec3& direction, Random& random) {
  const Vec3 g = gaussian(random);
  return (g - g.dot(direction) * direction).normalized();
}

Vec3 turned(const Vec3& direction, const Vec3& side, double angle) {
  return (std::cos(angle) * direction + std::sin(angle) * side).normalized();
}

// Grows a graph line by line.
class Grower {
 public:
  int point(const Vec3& p, double radius) {
    graph_.points.push_back({fmt::format("{}", graph_.points.size()), p, radius});
    return static_cast<int>(graph_.points.size()) - 1;
  }
  const Vec3& at(int point) const {
    return graph_.points[static_cast<std::size_t>(point)].position_mm;
  }
  void edge(int a, int b) { graph_.edges.emplace_back(a, b); }

  // From a point along `way` (0 to 1), `count` new points; the last one.
  int run(int from, int count, const std::function<Vec3(double)>& way,
          const std::function<double(double)>& radius) {
    int before = from;
    for (int k = 1; k <= count; ++k) {
      const double t = static_cast<double>(k) / count;
      const int here = point(way(t), radius(t));
      edge(before, here);
      before = here;
    }
    return before;
  }
  int line(int from, const Vec3& to, double radius, int count) {
    const Vec3 a = at(from);
    return run(
        from, count, [=](double t) { return Vec3((1 - t) * a + t * to); },
        [=](double) { return radius; });
  }

  PointGraph& graph() { return graph_; }
  CenterlineTree tree(const char* source) {
    graph_.roots = {0};
    Result<CenterlineTree> made = tree_from_points(graph_);
    EXPECTS(made.has_value());
    made->source = source;
    return *std::move(made);
  }

 private:
  PointGraph graph_;
};

// ---------------------------------------------------------------- Murray's trees

struct TreeShape {
  int levels = 4;
  double root_radius = 3.0;
  double length_radii = 14.0;
  int points = 14;           // a branch
  double least_angle = 0.5;  // of a daughter from its parent, radians
  double largest_angle = 0.9;
  double wander = 0.15;   // by which the course turns at every point, radians
  double jitter = 0.0;    // of points, in radii
  double grid_mm = 0.0;   // coordinates are rounded to its multiples
  double daughter = 0.0;  // over the parent's radius; 0: Murray's law
  bool radius_steps = false;
};

CenterlineTree branching(const TreeShape& shape, Random& random, const char* source) {
  Grower grower;
  struct Tip {
    int point;
    Vec3 direction;
    double radius;
    int level;
  };
  const auto placed = [&](const Vec3& p, double radius) {
    Vec3 q = p + shape.jitter * radius * gaussian(random);
    if (shape.grid_mm > 0) q = (q / shape.grid_mm).array().round().matrix() * shape.grid_mm;
    return q;
  };
  std::vector<Tip> tips{
      {grower.point(Vec3::Zero(), shape.root_radius), Vec3::UnitZ(), shape.root_radius, 0}};
  for (std::size_t k = 0; k < tips.size(); ++k) {
    const Tip tip = tips[k];
    Vec3 direction = tip.direction;
    Vec3 p = grower.at(tip.point);
    int before = tip.point;
    const double length = shape.length_radii * tip.radius * random.uniform(0.7, 1.4);
    for (int i = 1; i <= shape.points; ++i) {
      direction = turned(direction, across(direction, random), shape.wander * random.uniform());
      p += length / shape.points * direction;
      const double step = shape.radius_steps && i > shape.points / 2 ? 0.7 : 1.0;
      const int here = grower.point(placed(p, tip.radius), step * tip.radius);
      grower.edge(before, here);
      before = here;
    }
    if (tip.level + 1 >= shape.levels) continue;
    const double share = random.uniform(0.3, 0.7);
    const Vec3 side = across(direction, random);
    for (const int which : {0, 1}) {
      const double part = which == 0 ? share : 1 - share;
      const double radius = tip.radius * (shape.daughter > 0 ? shape.daughter : std::cbrt(part));
      const double angle = random.uniform(shape.least_angle, shape.largest_angle);
      tips.push_back({before, turned(direction, which == 0 ? side : Vec3(-side), angle), radius,
                      tip.level + 1});
    }
  }
  return grower.tree(source);
}

CenterlineTree murray(Random& random) { return branching({}, random, "murray"); }

CenterlineTree jagged(Random& random) {
  TreeShape shape;
  shape.jitter = 0.2;
  shape.grid_mm = 0.5;
  return branching(shape, random, "jagged");
}

CenterlineTree coarse(Random& random) {
  TreeShape shape;
  shape.points = 1;
  return branching(shape, random, "two points a branch");
}

CenterlineTree thick_daughters(Random& random) {
  TreeShape shape;
  shape.levels = 3;
  shape.daughter = random.uniform(1.0, 1.3);
  shape.least_angle = 0.7;
  shape.largest_angle = 1.1;
  shape.root_radius = 1.5;
  return branching(shape, random, "daughters thicker than parents");
}

CenterlineTree radius_steps(Random& random) {
  TreeShape shape;
  shape.radius_steps = true;
  return branching(shape, random, "steps of radius");
}

CenterlineTree short_branches(Random& random) {
  TreeShape shape;
  shape.levels = 4;
  shape.length_radii = random.uniform(0.6, 2.5);
  shape.points = 3;
  return branching(shape, random, "branches as short as their radius");
}

CenterlineTree acute(Random& random) {
  TreeShape shape;
  shape.levels = 3;
  shape.least_angle = 0.12;
  shape.largest_angle = 0.3;
  shape.length_radii = 22;
  shape.points = 30;
  return branching(shape, random, "acute forks");
}

CenterlineTree capillary(Random& random) {
  TreeShape shape;
  shape.root_radius = 3e-3;
  return branching(shape, random, "capillaries");
}

CenterlineTree whale(Random& random) {
  TreeShape shape;
  shape.root_radius = 3e3;
  return branching(shape, random, "a whale's aorta");
}

// ---------------------------------------------------------------- single courses

// A course and a twig half-way along it, so that there is a junction, too.
CenterlineTree with_twig(Grower& grower, int start, int count, double radius,
                         const std::function<Vec3(double)>& way, const Vec3& away,
                         const char* source) {
  const auto constant = [=](double) { return radius; };
  const int middle = grower.run(
      start, count, [&](double t) { return way(t / 2); }, constant);
  grower.run(
      middle, count, [&](double t) { return way(0.5 + t / 2); }, constant);
  grower.line(middle, grower.at(middle) + 9 * radius * away, 0.6 * radius, 8);
  return grower.tree(source);
}

// Legs of twelve radii and a half turn whose bend is 0.6 to 1.6 radii.
CenterlineTree hairpin(Random& random) {
  Grower grower;
  const double bend = random.uniform(0.6, 1.6);
  const double leg = 12;
  const double whole = 2 * leg + kPi * bend;
  const auto way = [=](double t) -> Vec3 {
    const double s = t * whole;
    if (s < leg) return {0, 0, s};
    if (s > leg + kPi * bend) return {2 * bend, 0, whole - s};
    const double angle = (s - leg) / bend;
    return {bend * (1 - std::cos(angle)), 0, leg + bend * std::sin(angle)};
  };
  const int start = grower.point(Vec3::Zero(), 1.0);
  grower.run(start, random.below(40) + 20, way, [](double) { return 1.0; });
  return grower.tree("hairpin");
}

// Turns of 60 to 150 degrees from one point to the next, three to ten radii apart.
CenterlineTree kinks(Random& random) {
  Grower grower;
  Vec3 direction = Vec3::UnitZ();
  int before = grower.point(Vec3::Zero(), 1.0);
  for (int k = 0; k < 8; ++k) {
    before = grower.line(before, grower.at(before) + random.uniform(4, 10) * direction, 1.0,
                         1 + random.below(4));
    const Vec3 side = across(direction, random);
    direction = turned(direction, (side + 0.3 * direction).normalized(), random.uniform(0.9, 1.7));
    if (k % 3 == 2) direction = (direction + Vec3(1.5, 0, 0)).normalized();
  }
  return grower.tree("kinks");
}

CenterlineTree helix(Random& random) {
  Grower grower;
  const double around = random.uniform(2.2, 4);
  const double rise = random.uniform(3, 6);
  const auto way = [=](double t) -> Vec3 {
    const double a = 6 * kPi * t;
    return {around * std::cos(a), around * std::sin(a), rise * a / (2 * kPi)};
  };
  const int start = grower.point(way(0), 1.0);
  return with_twig(grower, start, 40, 1.0, way, Vec3(-1, 0.2, 0).normalized(), "helix");
}

CenterlineTree lengths(Random& random) {
  Grower grower;
  const int start = grower.point(Vec3::Zero(), 1.0);
  const int far = grower.line(start, Vec3(0, 0, random.uniform(400, 900)), 1.0, 30);
  const int near = grower.line(far, grower.at(far) + Vec3(3, 0, 4), 0.7, 2);
  grower.line(far, grower.at(far) + Vec3(-2, 0.5, 2.5), 0.8, 1);
  grower.line(near, grower.at(near) + Vec3(4, 3, 3), 0.5, 3);
  grower.line(near, grower.at(near) + Vec3(5, -4, 4), 0.5, 200);
  return grower.tree("very long and very short");
}

CenterlineTree repeated_points(Random& random) {
  TreeShape shape;
  shape.levels = 3;
  CenterlineTree tree = branching(shape, random, "repeated points");
  for (CenterlineBranch& branch : tree.branches) {
    Points3 points(3, branch.points_mm.cols() + 2);
    Eigen::VectorXd radii(points.cols());
    const Eigen::Index middle = branch.points_mm.cols() / 2;
    for (Eigen::Index i = 0; i < points.cols(); ++i) {
      const Eigen::Index from = i <= middle ? i : std::max(middle, i - 2);
      points.col(i) = branch.points_mm.col(from);
      radii(i) = branch.radii_mm(from);
    }
    branch.points_mm = points;
    branch.radii_mm = radii;
  }
  return tree;
}

// ---------------------------------------------------------------- many branches at one point

CenterlineTree star(Random& random, int arms, bool planar, const char* source) {
  Grower grower;
  std::vector<Vec3> directions;
  while (static_cast<int>(directions.size()) < arms) {
    const double a = 2 * kPi * static_cast<double>(directions.size()) / arms;
    Vec3 d = planar ? Vec3(std::cos(a), std::sin(a), 0) : gaussian(random).normalized();
    d = (d + 0.05 * gaussian(random)).normalized();
    bool apart = true;
    for (const Vec3& other : directions) apart = apart && d.dot(other) < std::cos(0.55);
    if (apart) directions.push_back(d);
  }
  const auto arm_radius = [&] { return random.uniform(0.6, 1.1); };
  const double first = arm_radius();
  const int start = grower.point(14 * directions[0], first);
  const int center = grower.line(start, Vec3::Zero(), first, 10);
  for (std::size_t k = 1; k < directions.size(); ++k) {
    grower.line(center, 14 * directions[k], arm_radius(), 10);
  }
  return grower.tree(source);
}

CenterlineTree trifurcation(Random& random) {
  return star(random, 4, random.below(2) == 0, "trifurcation");
}
CenterlineTree star_of_8(Random& random) {
  return star(random, 8, random.below(2) == 0, "star of eight");
}

CenterlineTree twigs(Random& random) {
  Grower grower;
  int trunk = grower.point(Vec3::Zero(), 5.0);
  for (int k = 1; k <= 5; ++k) {
    trunk = grower.line(trunk, Vec3(0, 0, 25.0 * k), 5.0, 10);
    const Vec3 out =
        turned(across(Vec3::UnitZ(), random), Vec3::UnitZ(), random.uniform(-0.6, 0.9));
    grower.line(trunk, grower.at(trunk) + random.uniform(9, 20) * out, random.uniform(0.4, 1.2), 8);
  }
  grower.line(trunk, Vec3(0, 0, 150), 5.0, 10);
  return grower.tree("twigs on a trunk");
}

// ---------------------------------------------------------------- loops

CenterlineTree ring(Random& random, int junctions, const char* source) {
  Grower grower;
  const double radius = random.uniform(8, 20) * junctions / 4.0;
  const auto on_ring = [=](double turn, double tilt) {
    const double a = 2 * kPi * turn;
    return Vec3(radius * std::cos(a), radius * std::sin(a), tilt * std::sin(2 * a));
  };
  const double tilt = random.uniform(0, 3);
  const double thick = random.uniform(0.7, 1.2);
  const auto constant = [=](double) { return thick; };
  std::vector<int> nodes;
  nodes.push_back(grower.point(1.8 * on_ring(0, tilt), thick));
  nodes[0] = grower.line(nodes[0], on_ring(0, tilt), thick, 6);
  int before = nodes[0];
  for (int k = 0; k < junctions; ++k) {
    const double from = static_cast<double>(k) / junctions;
    const bool last = k + 1 == junctions;
    const int count = 12;
    const int end = grower.run(
        before, last ? count - 1 : count,
        [&](double t) {
          const double part = last ? t * (count - 1) / count : t;
          return on_ring(from + part / junctions, tilt);
        },
        constant);
    if (last) {
      grower.edge(end, nodes[0]);
    } else {
      nodes.push_back(end);
      before = end;
    }
  }
  for (std::size_t k = 1; k < nodes.size(); ++k) {
    const Vec3 p = grower.at(nodes[k]);
    grower.line(nodes[k], 1.7 * p + Vec3(0, 0, random.uniform(-2, 2)), thick * 0.8, 6);
  }
  return grower.tree(source);
}

CenterlineTree ring_of_four(Random& random) { return ring(random, 4, "ring of four junctions"); }
CenterlineTree ring_of_two(Random& random) { return ring(random, 2, "ring of two junctions"); }

// Rungs between two rails: as many loops as there are rungs but one.
CenterlineTree ladder(Random& random) {
  Grower grower;
  const double gap = random.uniform(7, 12);
  int left = grower.point(Vec3(0, 0, -12), 1.0);
  left = grower.line(left, Vec3::Zero(), 1.0, 5);
  int right = -1;
  const int rungs = 3 + random.below(3);
  for (int k = 0; k < rungs; ++k) {
    const Vec3 l(0, random.uniform(-1, 1), 10.0 * k);
    const Vec3 r(gap, random.uniform(-1, 1), 10.0 * k + 3);
    if (k > 0) left = grower.line(left, l, 1.0, 6);
    if (right < 0) {
      right = grower.line(left, r, 0.8, 6);
    } else {
      right = grower.line(right, r, 1.0, 6);
      const int near = grower.line(left, grower.at(left) + 0.8 * (r - grower.at(left)), 0.8, 5);
      grower.edge(near, right);
    }
  }
  grower.line(right, grower.at(right) + Vec3(2, 0, 12), 1.0, 6);
  return grower.tree("ladder");
}

CenterlineTree willis(Random&) { return circle_of_willis(); }

}  // namespace

CenterlineTree comb_tree(int branches) {
  EXPECTS(branches >= 1);
  constexpr int kPoints = 4;
  constexpr double kStep = 10.0;
  Grower grower;
  int trunk = grower.point(Vec3::Zero(), 1.0);
  for (int k = 0; 2 * k < branches; ++k) {
    const double z = kStep * (k + 1);
    trunk =
        grower.line(trunk, Vec3(4 * std::sin(z / 60), 4 * std::cos(z / 60) - 4, z), 1.0, kPoints);
    if (2 * k + 1 >= branches) break;
    const double turn = 2.4 * k;
    const Vec3 out(std::cos(turn), std::sin(turn), 0.3);
    grower.line(trunk, grower.at(trunk) + 9 * out, 0.6, kPoints);
  }
  return grower.tree("comb");
}

CenterlineTree circle_of_willis() {
  Grower grower;
  const auto bent = [&](int from, const Vec3& to, const Vec3& sag, double radius, int count) {
    const Vec3 a = grower.at(from);
    return grower.run(
        from, count, [=](double t) { return Vec3((1 - t) * a + t * to + 4 * t * (1 - t) * sag); },
        [=](double) { return radius; });
  };
  const auto close = [&](int from, int to, const Vec3& sag, double radius, int count) {
    const Vec3 a = grower.at(from);
    const Vec3 b = grower.at(to);
    const int near = grower.run(
        from, count,
        [=](double s) {
          const double t = s * count / (count + 1);
          return Vec3((1 - t) * a + t * b + 4 * t * (1 - t) * sag);
        },
        [=](double) { return radius; });
    grower.edge(near, to);
  };
  const int basilar = grower.point(Vec3(0, 22, -22), 1.6);
  const int tip = bent(basilar, Vec3(0, 14, 0), Vec3(0, 1, 0), 1.6, 14);
  int anterior[2];
  for (const int side : {0, 1}) {
    const double x = side == 0 ? -1 : 1;
    const int pcom = bent(tip, Vec3(8 * x, 11, 1), Vec3(x, 1, 1), 1.05, 8);       // P1
    bent(pcom, Vec3(24 * x, 26, 6), Vec3(4 * x, -1, 0), 1.0, 14);                 // P2
    const int carotid = bent(pcom, Vec3(9 * x, -4, 0), Vec3(0, 0, -1), 0.7, 12);  // communicating
    bent(carotid, Vec3(12 * x, 2, -26), Vec3(0, -3, 0), 2.0, 16);                 // carotid
    bent(carotid, Vec3(32 * x, -6, 4), Vec3(0, -1, 2), 1.4, 16);                  // middle cerebral
    anterior[side] = bent(carotid, Vec3(2.5 * x, -14, 3), Vec3(x, -1, 1), 1.1, 10);
  }
  close(anterior[0], anterior[1], Vec3(0, -0.4, 0), 0.7, 3);
  for (const int side : {0, 1}) {
    const double x = side == 0 ? -1 : 1;
    bent(anterior[side], Vec3(3 * x, -24, 26), Vec3(0, -6, 0), 1.0, 16);
  }
  return grower.tree("circle of Willis");
}

const std::vector<TreeFamily>& tree_families() {
  static const std::vector<TreeFamily> families{
      {"murray", murray, true},
      {"jagged", jagged, true},
      {"two points a branch", coarse, true},
      {"thick daughters", thick_daughters, true},
      {"radius steps", radius_steps, true},
      {"short branches", short_branches, true},
      {"acute forks", acute, true},
      {"capillaries", capillary, true},
      {"whale", whale, true},
      {"hairpin", hairpin, true},
      {"kinks", kinks, true},
      {"helix", helix},
      {"lengths", lengths},
      {"repeated points", repeated_points, true},
      {"trifurcation", trifurcation},
      {"star of eight", star_of_8},
      {"twigs", twigs},
      {"ring of two", ring_of_two},
      {"ring of four", ring_of_four},
      {"ladder", ladder},
      {"circle of Willis", willis},
  };
  return families;
}

}  // namespace angiospline
