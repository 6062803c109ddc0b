#include "recovery/phantoms/phantom.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/random.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/phantoms/phantom_tree.h"

namespace angiospline {
namespace {

constexpr double kPi = std::numbers::pi;

// A phantom before it is sampled: solids and centerlines in the grid's own frame.
struct Scene {
  Vec3 field_mm;
  std::vector<Shape> shapes;
  CenterlineTree tree;
  std::string description;
};

// Adds a branch along a curve, with nodes at its ends unless they are given.
void add_branch(CenterlineTree& tree, std::string name, int from, int to,
                const std::vector<Vec3>& points, const std::vector<double>& radii) {
  CenterlineBranch b;
  b.name = std::move(name);
  b.from = from;
  b.to = to;
  b.points_mm.resize(3, std::ssize(points));
  b.radii_mm.resize(std::ssize(radii));
  for (std::size_t k = 0; k < points.size(); ++k) {
    b.points_mm.col(static_cast<Eigen::Index>(k)) = points[k];
    b.radii_mm[static_cast<Eigen::Index>(k)] = radii[k];
  }
  tree.branches.push_back(std::move(b));
}

void add_tubes(Scene& scene) {
  for (const CenterlineBranch& b : scene.tree.branches)
    for (Eigen::Index k = 0; k + 1 < b.points_mm.cols(); ++k)
      scene.shapes.push_back(
          round_cone(b.points_mm.col(k), b.radii_mm[k], b.points_mm.col(k + 1), b.radii_mm[k + 1]));
}

Scene rings() {
  Scene scene{Vec3::Constant(128), {}, {}, "three interlocking orthogonal rings"};
  const char* names[] = {"ring_xy", "ring_yz", "ring_zx"};
  int k = 0;
  for (const Ring& ring : phantom_rings()) {
    scene.shapes.push_back(
        torus(ring.centre_mm, ring.axis, ring.ring_radius_mm, ring.tube_radius_mm));

    constexpr int kPoints = 180;
    std::vector<Vec3> points;
    for (int i = 0; i <= kPoints; ++i) points.push_back(ring.at(2 * kPi * (i % kPoints) / kPoints));

    scene.tree.nodes.push_back({fmt::format("{}_start", names[k]), points.front()});
    add_branch(scene.tree, names[k], k, k, points,
               std::vector<double>(points.size(), ring.tube_radius_mm));
    ++k;
  }
  return scene;
}

Scene cylinder() {
  Scene scene{Vec3::Constant(64), {}, {}, "right cylinder, radius 10 mm, length 50 mm"};
  const Vec3 centre = Vec3::Constant(31.5);
  const Vec3 a = centre - 25 * Vec3::UnitZ(), b = centre + 25 * Vec3::UnitZ();
  scene.shapes.push_back(flat_cylinder(a, b, 10));
  scene.tree.nodes = {{"bottom", a}, {"top", b}};
  scene.tree.inlets = {0};
  add_branch(scene.tree, "cylinder", 0, 1, {a, centre, b}, {10, 10, 10});
  return scene;
}

Scene potato() {
  Scene scene{Vec3::Constant(64), {}, {}, "star-shaped solid with five bulges"};
  const Vec3 centre = potato_center_mm();
  const auto inside = [centre](const Vec3& p) {
    const Vec3 d = p - centre;
    const double r = d.norm();
    return r == 0 ? -13.0 : r - potato_radius_mm(d / r);
  };
  // The slope of r - R(direction) is at most sqrt(1 + (R'/r)^2), below 2 wherever it is near zero.
  scene.shapes.push_back({inside, centre.array() - 20, centre.array() + 20, 2.0});
  return scene;
}

Scene bifurcation() {
  Scene scene{Vec3::Constant(128),
              {},
              {},
              "bifurcation: parent radius 14 mm, daughters 11 and 9 mm at 30 and 45 degrees"};
  const Vec3 crotch(63.5, 63.5, 60);
  const auto along = [&](double degrees, double length) -> Vec3 {
    const double a = degrees * kPi / 180;
    return crotch + length * Vec3(std::sin(a), 0, std::cos(a));
  };

  const std::vector<Vec3> ends = {crotch - 42 * Vec3::UnitZ(), along(-30, 50), along(45, 52)};
  const double radii[] = {14, 11, 9};
  const char* names[] = {"parent", "left", "right"};

  scene.tree.nodes.push_back({"junction", crotch});
  for (std::size_t k = 0; k < 3; ++k) {
    scene.tree.nodes.push_back({fmt::format("{}_end", names[k]), ends[k]});
    const int node = static_cast<int>(k) + 1;
    if (k == 0)
      add_branch(scene.tree, names[k], node, 0, {ends[k], crotch}, {radii[k], radii[k]});
    else
      add_branch(scene.tree, names[k], 0, node, {crotch, ends[k]}, {radii[k], radii[k]});
  }

  scene.tree.inlets = {1};
  add_tubes(scene);
  return scene;
}

Scene bent_vessel() {
  Scene scene{Vec3(32, 32, 48), {}, {}, "S-bent tube of radius 2.5 mm"};
  std::vector<Vec3> points;
  constexpr int kPoints = 61;
  for (int k = 0; k < kPoints; ++k) {
    const double t = static_cast<double>(k) / (kPoints - 1);
    points.push_back(
        Vec3(15.5 + 9 * std::sin(2 * kPi * t), 15.5 + 6 * std::cos(kPi * t), 5 + 37 * t));
  }
  scene.tree.nodes = {{"bottom", points.front()}, {"top", points.back()}};
  scene.tree.inlets = {0};
  add_branch(scene.tree, "vessel", 0, 1, points, std::vector<double>(points.size(), 2.5));
  add_tubes(scene);
  return scene;
}

Result<Scene> tree(const PhantomOptions& o) {
  return random_tree(o).map([&](CenterlineTree t) {
    Scene scene{Vec3::Constant(o.field_mm), {}, std::move(t), {}};
    scene.description = fmt::format("random tree, {} branches", scene.tree.branches.size());
    add_tubes(scene);
    return scene;
  });
}

Result<Scene> scene_of(PhantomKind kind, const PhantomOptions& options) {
  switch (kind) {
    case PhantomKind::kRings:
      return rings();
    case PhantomKind::kCylinder:
      return cylinder();
    case PhantomKind::kPotato:
      return potato();
    case PhantomKind::kBifurcation:
      return bifurcation();
    case PhantomKind::kBentVessel:
      return bent_vessel();
    case PhantomKind::kRandomTree:
      return tree(options);
  }
  return fail({ErrorKind::kBadInput, "no such phantom", {}, {}, {}});
}

Result<void> check(const PhantomOptions& o) {
  const auto bad = [](const char* what, double value, const char* rule) {
    return fail({ErrorKind::kBadInput, what, "phantom", fmt::format("{}", value), rule});
  };
  if (!(o.spacing_mm.minCoeff() > 0) || !o.spacing_mm.allFinite())
    return bad("spacing is not positive", o.spacing_mm.minCoeff(), "spacing is in mm, above 0");

  if (o.snr && !(*o.snr > 0))
    return bad("SNR is not positive", *o.snr, "leave it out for no noise");

  if (!(o.field_mm > 0)) return bad("field of view is not positive", o.field_mm, "in mm, above 0");
  if (!(o.radius_min_mm > 0) || !(o.radius_max_mm >= o.radius_min_mm))
    return bad("radii are not usable", o.radius_min_mm, "0 < smallest <= largest");
  if (o.ends < 1) return bad("number of ends is not usable", o.ends, "at least 1");

  if (!(o.loss_deg >= 0 && o.loss_deg < 45))
    return bad("stretch of lost signal is not usable", o.loss_deg, "0 to below 45 degrees");
  if (!(o.loss_depth >= 0 && o.loss_depth <= 1))
    return bad("share of lost signal is not usable", o.loss_depth, "0 to 1");
  return {};
}

ImageGrid grid_for(const Vec3& field_mm, const PhantomOptions& o) {
  ImageGrid grid;
  for (int i = 0; i < 3; ++i)
    grid.size[static_cast<std::size_t>(i)] =
        std::max(1, static_cast<int>(std::lround(field_mm[i] / o.spacing_mm[i])));
  grid.spacing_mm = o.spacing_mm;
  grid.origin_mm = o.origin_mm;
  grid.direction = o.direction;
  return grid;
}

// 1 where the ring carries signal, less where it is lost; smooth over a quarter of the stretch.
double ring_signal(const Ring& ring, const Vec3& p, const PhantomOptions& o) {
  const Vec3 d = p - ring.centre_mm;
  const double angle = std::atan2(d.dot(ring.axis.cross(ring.start)), d.dot(ring.start));
  double from_loss = std::fmod(angle * 180 / kPi - o.loss_phase_deg, 45.0);
  if (from_loss < 0) from_loss += 45;
  from_loss = std::min(from_loss, 45 - from_loss);
  const double t = std::clamp((from_loss - o.loss_deg * 3 / 8) / (o.loss_deg / 4), 0.0, 1.0);
  return 1 - o.loss_depth * (1 - t * t * (3 - 2 * t));
}

void lose_signal(Image<float>& filled, const PhantomOptions& o) {
  const std::vector<Ring> all = phantom_rings();
  for (std::size_t i = 0; i < filled.voxels.size(); ++i) {
    if (filled.voxels[i] == 0) continue;
    const Voxel v = filled.grid.voxel(i);
    const Vec3 p = filled.grid.spacing_mm.cwiseProduct(Vec3(v[0], v[1], v[2]));

    const Ring* nearest = nullptr;
    double least = std::numeric_limits<double>::infinity();
    for (const Ring& ring : all) {
      const double d =
          torus(ring.centre_mm, ring.axis, ring.ring_radius_mm, ring.tube_radius_mm).inside(p);
      if (d < least) least = d, nearest = &ring;
    }

    filled.voxels[i] *= static_cast<float>(ring_signal(*nearest, p, o));
  }
}

void move_to_world(CenterlineTree& tree, const ImageGrid& grid) {
  const auto world = [&](const Vec3& p) -> Vec3 { return grid.origin_mm + grid.direction * p; };
  for (CenterlineNode& n : tree.nodes) n.position_mm = world(n.position_mm);
  for (CenterlineBranch& b : tree.branches)
    for (Eigen::Index k = 0; k < b.points_mm.cols(); ++k)
      b.points_mm.col(k) = world(b.points_mm.col(k));
}

}  // namespace

Vec3 Ring::at(double angle_rad) const {
  return centre_mm +
         ring_radius_mm * (std::cos(angle_rad) * start + std::sin(angle_rad) * axis.cross(start));
}

Vec3 potato_center_mm() { return Vec3::Constant(31.5); }

double potato_radius_mm(const Vec3& direction) {
  struct Bulge {
    Vec3 direction;
    double height_mm, sharpness;
  };
  static const std::array<Bulge, 5> kBulges = {{{Vec3(1, 0.2, 0.5).normalized(), 4.0, 6},
                                                {Vec3(-0.8, 0.7, -0.3).normalized(), 3.5, 8},
                                                {Vec3(0.1, -1, 0.3).normalized(), 3.0, 7},
                                                {Vec3(0.2, 0.3, 1).normalized(), 4.5, 5},
                                                {Vec3(-0.3, -0.2, -1).normalized(), 4.0, 5}}};

  double radius = 13.0;
  for (const Bulge& b : kBulges) {
    radius += b.height_mm * std::exp(b.sharpness * (b.direction.dot(direction) - 1));
  }
  return radius;
}

std::vector<Ring> phantom_rings() {
  // Each centre is moved half a ring radius along the next axis: every two rings are linked, and
  // no two come nearer than a third of the ring radius.
  const double radius = 40, tube = 4, shift = radius / 2;
  const Vec3 middle = Vec3::Constant(63.5 - shift / 2);
  return {{middle + shift * Vec3::UnitX(), Vec3::UnitZ(), Vec3::UnitX(), radius, tube},
          {middle + shift * Vec3::UnitY(), Vec3::UnitX(), Vec3::UnitY(), radius, tube},
          {middle + shift * Vec3::UnitZ(), Vec3::UnitY(), Vec3::UnitZ(), radius, tube}};
}

std::optional<PhantomKind> phantom_kind(const std::string& name) {
  if (name == "rings") return PhantomKind::kRings;
  if (name == "cylinder") return PhantomKind::kCylinder;
  if (name == "potato") return PhantomKind::kPotato;
  if (name == "bifurcation") return PhantomKind::kBifurcation;
  if (name == "bent-vessel") return PhantomKind::kBentVessel;
  if (name == "tree") return PhantomKind::kRandomTree;
  return std::nullopt;
}

Result<Phantom> make_phantom(PhantomKind kind, const PhantomOptions& options) {
  if (const auto ok = check(options); !ok) return fail(ok.error());
  Result<Scene> scene = scene_of(kind, options);
  if (!scene) return fail(scene.error());

  const ImageGrid grid = grid_for(scene->field_mm, options);
  Image<float> filled = coverage(grid, scene->shapes);
  Phantom out{Image<std::int16_t>(grid), Mask(grid), std::move(scene->tree), scene->description};
  for (std::size_t i = 0; i < filled.voxels.size(); ++i)
    out.truth.voxels[i] = filled.voxels[i] >= 0.5F;

  if (options.edges == PhantomEdges::kSteps)
    for (float& f : filled.voxels) f = f >= 0.5F ? 1.0F : 0.0F;
  if (kind == PhantomKind::kRings && options.loss_deg > 0) lose_signal(filled, options);

  // Noise last, so that the same seed gives the same noise whatever the edges.
  const double contrast = options.vessel - options.background;
  const double noise = options.snr ? std::abs(contrast) / *options.snr : 0.0;
  Random random(options.seed);
  for (std::size_t i = 0; i < filled.voxels.size(); ++i) {
    double grey = options.background + contrast * static_cast<double>(filled.voxels[i]);
    if (noise > 0) grey += noise * random.gaussian();
    out.image.voxels[i] =
        static_cast<std::int16_t>(std::lround(std::clamp(grey, -32768.0, 32767.0)));
  }

  move_to_world(out.tree, grid);
  return out;
}

}  // namespace angiospline
