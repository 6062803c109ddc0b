#include "benches/fit_phantoms.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <memory>

#include <Eigen/Geometry>
#include <vtkFloatArray.h>
#include <vtkFlyingEdges3D.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPointData.h>
#include <vtkPolyData.h>
#include <vtkPolyDataConnectivityFilter.h>

#include "base/index.h"
#include "base/random.h"
#include "recovery/imaging/image/gaussian.h"
#include "recovery/imaging/rasterize/shapes.h"
#include "recovery/imaging/rasterize/voxelize.h"

namespace angiospline {
namespace {

constexpr double kMargin = 2.0;  // voxels from an open end

double distance_to_tree(const CenterlineTree& tree, const Vec3& p) {
  double least = 1e300;
  for (const CenterlineBranch& b : tree.branches) {
    for (Eigen::Index k = 0; k + 1 < b.points_mm.cols(); ++k) {
      const Vec3 a = b.points_mm.col(k), d = b.points_mm.col(k + 1) - a;
      const double t = std::clamp(d.dot(p - a) / d.squaredNorm(), 0.0, 1.0);
      const double r = (1 - t) * b.radii_mm(k) + t * b.radii_mm(k + 1);
      least = std::min(least, (p - a - t * d).norm() - r);
    }
  }
  return least;
}

// Of the surface where `level` is zero, to first order: exact there.
double distance_to_level(const std::function<double(const Vec3&)>& level, const Vec3& p) {
  constexpr double kStep = 1e-4;
  Vec3 slope;
  for (int i = 0; i < 3; ++i) {
    slope(i) = (level(p + kStep * Vec3::Unit(i)) - level(p - kStep * Vec3::Unit(i))) / (2 * kStep);
  }
  return level(p) / slope.norm();
}

double distance_to_potato(const Vec3& p) {
  const auto level = [](const Vec3& q) -> double {
    const Vec3 d = q - potato_center_mm();
    return d.norm() - potato_radius_mm(d.normalized());
  };
  return distance_to_level(level, p);
}

void find_ends(FitPhantom& phantom) {
  const auto at_node = branches_at_nodes(phantom.tree);
  for (std::size_t n = 0; n < at_node.size(); ++n) {
    if (at_node[n].size() != 1) continue;
    const CenterlineBranch& b = phantom.tree.branches[index(at_node[n].front())];
    const Eigen::Index last = b.points_mm.cols() - 1;
    const bool start = b.from == static_cast<int>(n);
    const Vec3 end = b.points_mm.col(start ? 0 : last);
    const Vec3 next = b.points_mm.col(start ? 1 : last - 1);
    phantom.ends_mm.push_back(end);
    phantom.ends_out.push_back((end - next).normalized());
    phantom.end_radii_mm.push_back(b.radii_mm(start ? 0 : last));
  }
}

bool at_an_end(const FitPhantom& phantom, const Vec3& p) {
  for (std::size_t e = 0; e < phantom.ends_mm.size(); ++e) {
    const Vec3 d = p - phantom.ends_mm[e];
    if (d.dot(phantom.ends_out[e]) > -kMargin * phantom.voxel_mm &&
        d.norm() < 2 * phantom.end_radii_mm[e] + kMargin * phantom.voxel_mm) {
      return true;
    }
  }
  return false;
}

bool at_a_rim(const FitPhantom& phantom, const std::vector<Rim>& rims, const Vec3& p) {
  for (const Rim& rim : rims) {
    const Vec3 d = p - rim.center_mm;
    if (std::abs(d.dot(rim.normal)) < kMargin * phantom.voxel_mm && d.norm() < 2 * rim.radius_mm) {
      return true;
    }
  }
  return false;
}

double grey(float share) { return kBackground + kContrast * static_cast<double>(share); }

}  // namespace

FitPhantom fit_phantom(PhantomKind kind, const Vec3& spacing) {
  PhantomOptions options;
  options.spacing_mm = spacing;
  options.background = kBackground;
  options.vessel = kBackground + kContrast;
  if (kind == PhantomKind::kRandomTree) {
    options.ends = 11;
    options.field_mm = 144;
    options.seed = 3;
  }
  auto made = make_phantom(kind, options);
  if (!made) {
    std::printf("%s\n", made.error().message().c_str());
    std::exit(1);
  }
  FitPhantom phantom;
  phantom.clean = Image<float>(made->image.grid);
  for (std::size_t i = 0; i < phantom.clean.voxels.size(); ++i) {
    phantom.clean.voxels[i] = made->image.voxels[i];
  }
  phantom.truth = std::move(made->truth);
  phantom.tree = made->tree;
  phantom.voxel_mm = std::cbrt(spacing.prod());
  if (kind == PhantomKind::kPotato) {
    phantom.distance = distance_to_potato;
  } else {
    phantom.distance = [tree = made->tree](const Vec3& p) { return distance_to_tree(tree, p); };
    find_ends(phantom);
  }
  return phantom;
}

FitPhantom bent_pair() {
  FitPhantom phantom = fit_phantom(PhantomKind::kBentVessel);
  // The second runs beside the first, 4 radii from axis to axis, in a wider field.
  const double radius = phantom.tree.branches[0].radii_mm(0);
  const Vec3 beside(0, 4 * radius, 0);
  ImageGrid grid = phantom.clean.grid;
  grid.size[1] += static_cast<int>(std::ceil(beside.y()));
  std::vector<Shape> shapes;
  for (const Vec3& shift : {Vec3(Vec3::Zero()), beside}) {
    const CenterlineBranch& b = phantom.tree.branches[0];
    for (Eigen::Index k = 0; k + 1 < b.points_mm.cols(); ++k) {
      shapes.push_back(
          round_cone(b.points_mm.col(k) + shift, radius, b.points_mm.col(k + 1) + shift, radius));
    }
  }
  const Image<float> share = coverage(grid, shapes);
  phantom.clean = Image<float>(grid);
  phantom.truth = Mask(grid);  // of both; not used for figures
  for (std::size_t i = 0; i < share.voxels.size(); ++i) {
    phantom.clean.voxels[i] = static_cast<float>(grey(share.voxels[i]));
  }
  return phantom;
}

LocalPhantom local_phantom(LocalKind kind) {
  const Vec3 middle(24.2, 23.9, 30.3);
  const double radius = kind == LocalKind::kBulge ? 11 : 6, from = 4, to = 57;
  const auto bell = [](double squared, double deviation) {
    return std::exp(-squared / (2 * deviation * deviation));
  };
  const auto level = [=](const Vec3& p) -> double {
    const Vec3 d = p - middle;
    if (kind == LocalKind::kBulge) {
      const double angle = std::acos(std::clamp(d.normalized().x(), -1.0, 1.0));
      return d.norm() - radius - 2.5 * bell(angle * angle, 10 * std::acos(-1.0) / 180);
    }
    const double away = std::hypot(d.x(), d.y());
    if (kind == LocalKind::kThroat) return away - radius + 2.5 * bell(d.z() * d.z(), 2.5);
    const double around = radius * std::atan2(d.y(), d.x());
    return away - radius - 2 * bell(around * around + d.z() * d.z(), 2);
  };
  LocalPhantom local;
  FitPhantom& phantom = local.phantom;
  ImageGrid grid;
  grid.size = {48, 48, 62};
  Shape shape{level, Vec3::Zero(), Vec3(47, 47, 61), 2.5};
  if (kind != LocalKind::kBulge) {
    shape.inside = [=](const Vec3& p) {
      return std::max(level(p), std::max(from - p.z(), p.z() - to));
    };
    CenterlineBranch axis;
    axis.name = "vessel";
    axis.from = 0;
    axis.to = 1;
    axis.points_mm.resize(3, 2);
    axis.points_mm << middle.x(), middle.x(), middle.y(), middle.y(), from, to;
    axis.radii_mm = Vec2::Constant(radius);
    phantom.tree.nodes = {{"bottom", axis.points_mm.col(0)}, {"top", axis.points_mm.col(1)}};
    phantom.tree.inlets = {0};
    phantom.tree.branches = {axis};
    find_ends(phantom);
  }
  const Image<float> share = coverage(grid, {shape});
  phantom.clean = Image<float>(grid);
  phantom.truth = Mask(grid);
  for (std::size_t i = 0; i < share.voxels.size(); ++i) {
    phantom.clean.voxels[i] = static_cast<float>(grey(share.voxels[i]));
    phantom.truth.voxels[i] = share.voxels[i] >= 0.5F;
  }
  phantom.distance = [level](const Vec3& p) { return distance_to_level(level, p); };
  local.there = [=](const Vec3& p) {
    const Vec3 d = p - middle;
    if (kind == LocalKind::kBulge) return d.normalized().x() > 0.9;  // 26 degrees
    if (kind == LocalKind::kThroat) return std::abs(d.z()) < 6;
    return std::abs(d.z()) < 4 && std::abs(radius * std::atan2(d.y(), d.x())) < 4;
  };
  return local;
}

Image<float> with_noise(const FitPhantom& phantom, double snr, std::uint64_t seed) {
  Image<float> image = phantom.clean;
  if (snr <= 0) return image;
  Random random(seed);
  for (float& v : image.voxels) v += static_cast<float>(kContrast / snr * random.gaussian());
  return image;
}

Image<float> with_rician_noise(const FitPhantom& phantom, double snr, std::uint64_t seed) {
  Image<float> image = phantom.clean;
  Random random(seed);
  const double noise = kContrast / snr;
  for (float& v : image.voxels) {
    const double real = static_cast<double>(v) + noise * random.gaussian();
    v = static_cast<float>(std::hypot(real, noise * random.gaussian()));
  }
  return image;
}

Image<float> with_ramp(const FitPhantom& phantom, double snr, std::uint64_t seed) {
  FitPhantom ramped = phantom;
  const ImageGrid& grid = phantom.clean.grid;
  for (std::size_t i = 0; i < ramped.clean.voxels.size(); ++i) {
    const Voxel v = grid.voxel(i);
    double along = 0;
    for (std::size_t a = 0; a < 3; ++a) along += static_cast<double>(v[a]) / grid.size[a] / 3;
    const double share = (static_cast<double>(phantom.clean.voxels[i]) - kBackground) / kContrast;
    ramped.clean.voxels[i] += static_cast<float>(0.5 * kContrast * along * (1 - share));
  }
  return with_noise(ramped, snr, seed);
}

Accuracy accuracy(const FitPhantom& phantom, const TriangleMesh& mesh, const std::vector<Rim>& rims,
                  const std::function<bool(const Vec3&)>& where) {
  std::vector<double> distance(index(mesh.points_mm.cols()));
  for (std::size_t i = 0; i < distance.size(); ++i) {
    distance[i] = phantom.distance(mesh.points_mm.col(static_cast<Eigen::Index>(i)));
  }
  std::vector<std::pair<double, double>> all;
  double area = 0, sum = 0, bias = 0;
  for (Eigen::Index t = 0; t < mesh.triangles.cols(); ++t) {
    if (!is_wall(mesh.parts[index(mesh.part_of[index(t)])].kind)) continue;
    const Eigen::Vector3i c = mesh.triangles.col(t);
    const Vec3 a = mesh.points_mm.col(c(0)), b = mesh.points_mm.col(c(1)),
               d = mesh.points_mm.col(c(2));
    const Vec3 middle = (a + b + d) / 3;
    if (at_an_end(phantom, middle) || at_a_rim(phantom, rims, middle)) continue;
    if (where && !where(middle)) continue;
    const double weight = (b - a).cross(d - a).norm() / 2;
    double size = 0, offset = 0;
    for (const int p : c) {
      size += std::abs(distance[index(p)]) / 3;
      offset += distance[index(p)] / 3;
    }
    all.emplace_back(size, weight);
    sum += weight * size;
    bias += weight * offset;
    area += weight;
  }
  std::sort(all.begin(), all.end());
  double seen = 0, p95 = 0;
  for (const auto& [size, weight] : all) {
    seen += weight;
    p95 = size;
    if (seen >= 0.95 * area) break;
  }
  const double v = phantom.voxel_mm;
  return {sum / area / v, p95 / v, bias / area / v};
}

double missed_percent(const FitPhantom& phantom, const TriangleMesh& mesh) {
  const Mask mask = voxelized(mesh, phantom.truth.grid);
  double missed = 0, all = 0;
  for (std::size_t i = 0; i < mask.voxels.size(); ++i) {
    const bool one = phantom.truth.voxels[i] != 0, other = mask.voxels[i] != 0;
    if (!one && !other) continue;
    const Voxel v = mask.grid.voxel(i);
    if (at_an_end(phantom, mask.grid.world_mm(Vec3(v[0], v[1], v[2])))) continue;
    all += one ? 1 : 0;
    missed += one != other ? 1 : 0;
  }
  return 100 * missed / all;
}

MarchingCubes marching_cubes(const FitPhantom& phantom, const Image<float>& image) {
  const Image<float> smooth = smoothed(Image<float>(image), 0.6 * phantom.voxel_mm);
  const ImageGrid& grid = smooth.grid;
  vtkNew<vtkFloatArray> values;
  values->SetArray(const_cast<float*>(smooth.voxels.data()),
                   static_cast<vtkIdType>(smooth.voxels.size()), 1);
  vtkNew<vtkImageData> data;
  data->SetDimensions(grid.size[0], grid.size[1], grid.size[2]);
  data->SetSpacing(grid.spacing_mm.x(), grid.spacing_mm.y(), grid.spacing_mm.z());
  data->SetOrigin(grid.origin_mm.x(), grid.origin_mm.y(), grid.origin_mm.z());
  data->GetPointData()->SetScalars(values);

  MarchingCubes best;
  best.accuracy.mean_vox = 1e300;
  for (int k = 0; k < 15; ++k) {
    const double share = 0.36 + 0.02 * k;
    vtkNew<vtkFlyingEdges3D> cubes;
    cubes->SetInputData(data);
    cubes->ComputeNormalsOff();
    cubes->ComputeGradientsOff();
    cubes->ComputeScalarsOff();
    cubes->SetValue(0, kBackground + share * kContrast);
    vtkNew<vtkPolyDataConnectivityFilter> largest;
    largest->SetInputConnection(cubes->GetOutputPort());
    largest->SetExtractionModeToLargestRegion();
    largest->Update();
    vtkPolyData* found = largest->GetOutput();
    TriangleMesh mesh;
    mesh.parts = {{"wall", PartKind::kBody, 0.0}};
    mesh.points_mm.resize(3, found->GetNumberOfPoints());
    for (vtkIdType p = 0; p < found->GetNumberOfPoints(); ++p) {
      found->GetPoint(p, mesh.points_mm.col(p).data());
    }
    mesh.triangles.resize(3, found->GetNumberOfCells());
    mesh.part_of.assign(index(found->GetNumberOfCells()), 0);
    for (vtkIdType t = 0; t < found->GetNumberOfCells(); ++t) {
      vtkIdType count = 0;
      const vtkIdType* ids = nullptr;
      found->GetCellPoints(t, count, ids);
      for (int i = 0; i < 3; ++i) mesh.triangles(i, t) = static_cast<int>(ids[i]);
    }
    const Accuracy now = accuracy(phantom, mesh);
    if (!(now.mean_vox < best.accuracy.mean_vox)) continue;
    std::vector<char> used(index(mesh.points_mm.cols()), 0);
    for (Eigen::Index i = 0; i < mesh.triangles.size(); ++i) used[index(mesh.triangles.data()[i])] = 1;
    best = {now, share, std::count(used.begin(), used.end(), 1),
            static_cast<long>(mesh.triangles.cols())};
  }
  return best;
}

}  // namespace angiospline
