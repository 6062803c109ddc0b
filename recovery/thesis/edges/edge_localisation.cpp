#include "recovery/thesis/edges/edge_localisation.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Eigenvalues>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/imaging/image/gaussian.h"
#include "recovery/thesis/edges/edge_masks.h"
#include "recovery/thesis/edges/rules.h"
#include "recovery/wall/wall_profile.h"

namespace angiospline {
namespace {

using namespace edge_rules;

class Localiser {
 public:
  Localiser(const Image<float>& image, const EdgeField& field)
      : image_(image),
        bank_(image.grid),
        voxel_mm_(std::cbrt(image.grid.spacing_mm.prod())),
        smooth_image_(smoothed(image, voxel_mm_)),
        grey_(image_),
        smooth_(smooth_image_),
        field_(field) {}

  // Where the answers of the edge's own mask are largest along its direction.
  EdgePlace peak(const Edge& edge) const {
    EdgePlace place;
    const Vec3 inward = field_.normals[static_cast<std::size_t>(edge.normal)];
    place.normal = -inward;
    place.strength = static_cast<double>(edge.strength);

    const Vec3 centre = image_.grid.world_mm(edge.voxel);
    const Image<float> answers = answers_around(edge);
    const GreyField between(answers);

    // One voxel along the direction, each way.
    const double step = kPeakStep * grey_.width_mm(inward);
    const int count = static_cast<int>(1 / kPeakStep);
    std::vector<double> value;
    for (int k = -count; k <= count; ++k) value.push_back(between.at(centre + k * step * inward));

    // The top of the parabola through the largest and its two neighbours.
    const auto best = std::max_element(value.begin(), value.end()) - value.begin();
    double at = static_cast<double>(best) - count;
    if (best > 0 && best + 1 < std::ssize(value)) {
      const auto i = static_cast<std::size_t>(best);
      const double bend = value[i - 1] - 2 * value[i] + value[i + 1];
      if (bend < 0) at += 0.5 * (value[i - 1] - value[i + 1]) / bend;
    }
    place.point_mm = centre + at * step * inward;
    return place;
  }

  // The place moved by profile sums, or `raw` if that cannot be.
  EdgePlace corrected(const EdgePlace& raw) const {
    EdgePlace place = raw;
    for (int round = 0; round < kRounds; ++round) {
      if (!bend(place)) return raw;

      // Levels on both sides of the wall, or where there is no room for them the greys there.
      const WallPoint at{place.point_mm, place.normal, place.largest_curvature,
                         place.smallest_curvature};
      WallLevels levels;
      const WallSides sides = wall_sides(grey_, at, raw.strength * kLevelShare);
      const double far = kPlateau * grey_.width_mm(place.normal);
      levels.inside =
          sides.inside_weight > 0 ? sides.inside : grey_.at(place.point_mm - far * place.normal);
      levels.outside =
          sides.outside_weight > 0 ? sides.outside : grey_.at(place.point_mm + far * place.normal);

      const WallOffset offset = wall_offset(grey_, at, levels, {kHalfWindow, 0.0});
      if (!offset.measured) return raw;
      place.point_mm += offset.offset_mm * place.normal;
      if ((place.point_mm - raw.point_mm).norm() > kFarthest * grey_.width_mm(place.normal))
        return raw;
    }
    place.corrected = bend(place);
    return place.corrected ? place : raw;
  }

 private:
  // Answers of the edge's own mask on 5 x 5 x 5 voxels around it; beyond the border its values go
  // on.
  Image<float> answers_around(const Edge& edge) const {
    ImageGrid grid = image_.grid;
    grid.size = {2 * kAnswerReach + 1, 2 * kAnswerReach + 1, 2 * kAnswerReach + 1};
    const Voxel& c = edge.voxel;
    grid.origin_mm =
        image_.grid.world_mm(Voxel{c[0] - kAnswerReach, c[1] - kAnswerReach, c[2] - kAnswerReach});

    Image<float> out(grid);
    const int pairs = bank_.pairs();
    const auto mask = static_cast<std::size_t>(edge.normal % pairs);
    const float sign = edge.normal < pairs ? 1.0F : -1.0F;
    for (std::size_t i = 0; i < out.voxels.size(); ++i) {
      const Voxel o = grid.voxel(i);
      const Voxel at{c[0] - kAnswerReach + o[0], c[1] - kAnswerReach + o[1],
                     c[2] - kAnswerReach + o[2]};
      float sum = 0;
      for (std::size_t k = 0; k < bank_.offsets.size(); ++k)
        sum += bank_.weights[k * EdgeMaskBank::kLanes + mask] *
               (value(at, bank_.offsets[k], 1) - value(at, bank_.offsets[k], -1));
      out.voxels[i] = sign * sum;
    }
    return out;
  }

  float value(const Voxel& at, const Voxel& offset, int sign) const {
    Voxel v;
    for (std::size_t i = 0; i < 3; ++i)
      v[i] = std::clamp(at[i] + sign * offset[i], 0, image_.grid.size[i] - 1);
    return image_[v];
  }

  // Normal and curvatures of the level surface at the place. False where the image is flat.
  bool bend(EdgePlace& place) const {
    const double h = kDifference * voxel_mm_;
    const Vec3& p = place.point_mm;
    const auto f = [&](const Vec3& off) { return smooth_.at(p + h * off); };
    const double middle = f(Vec3::Zero());
    Vec3 gradient;
    Mat3 hessian;
    for (int i = 0; i < 3; ++i) {
      const Vec3 x = Vec3::Unit(i);
      const double after = f(x), before = f(-x);
      gradient[i] = (after - before) / (2 * h);
      hessian(i, i) = (after - 2 * middle + before) / (h * h);
      for (int j = 0; j < i; ++j) {
        const Vec3 y = Vec3::Unit(j);
        hessian(i, j) = hessian(j, i) = (f(x + y) - f(x - y) - f(y - x) + f(-x - y)) / (4 * h * h);
      }
    }

    // Shape operator of a level surface: the Hessian along it over the gradient's length.
    const double slope = gradient.norm();
    if (!(slope > 0)) return false;
    place.normal = -gradient / slope;
    const Mat3 along = Mat3::Identity() - place.normal * place.normal.transpose();
    const Mat3 shape = -(along * hessian * along) / slope;
    // Its eigenvalues are the two curvatures and 0 along the normal.
    const Eigen::SelfAdjointEigenSolver<Mat3> eigen(shape);
    Eigen::Index normal = 0;
    (eigen.eigenvectors().transpose() * place.normal).cwiseAbs().maxCoeff(&normal);
    place.smallest_curvature = eigen.eigenvalues()[normal == 0 ? 1 : 0];
    place.largest_curvature = eigen.eigenvalues()[normal == 2 ? 1 : 2];
    return true;
  }

  const Image<float>& image_;
  EdgeMaskBank bank_;
  double voxel_mm_;
  Image<float> smooth_image_;
  GreyField grey_, smooth_;
  const EdgeField& field_;
};

}  // namespace

std::vector<EdgePlace> localise_edges(const Image<float>& image, const EdgeField& field,
                                      EdgeCorrection correction) {
  for (const int n : image.grid.size) EXPECTS(n >= 2);
  const Localiser localiser(image, field);
  std::vector<EdgePlace> places(field.edges.size());
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, places.size(), 64),
                    [&](const tbb::blocked_range<std::size_t>& r) {
                      for (std::size_t i = r.begin(); i != r.end(); ++i) {
                        places[i] = localiser.peak(field.edges[i]);
                        if (correction == EdgeCorrection::kCurvature)
                          places[i] = localiser.corrected(places[i]);
                      }
                    });
  return places;
}

}  // namespace angiospline
