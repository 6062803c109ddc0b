#include "recovery/thesis/edges/edge_detection.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include "recovery/thesis/edges/edge_masks.h"
#include "recovery/thesis/edges/rules.h"

namespace angiospline {
namespace {

using namespace edge_rules;

constexpr int kLanes = EdgeMaskBank::kLanes;
constexpr std::size_t kMostOffsets = 62;
constexpr int kSpared = -1;  // in place of a direction: the voxel cannot be an edge

struct Answer {
  float strength = 0;
  int normal = 0;  // pair m: m for its own direction, m + pairs for the opposite one
};

// All masks at one voxel.
template <typename T>
class Masks {
 public:
  explicit Masks(const Image<T>& image) : image_(image), bank_(image.grid) {
    for (const Voxel& o : bank_.offsets)
      steps_.push_back(o[0] + static_cast<std::ptrdiff_t>(image.grid.size[0]) *
                                  (o[1] + static_cast<std::ptrdiff_t>(image.grid.size[1]) * o[2]));
  }

  const EdgeMaskBank& bank() const { return bank_; }

  Answer at(const Voxel& v) const {
    float difference[kMostOffsets];
    differences(v, difference);
    return strongest(difference);
  }

  // As at(), or kSpared if no strength can reach `least`.
  Answer at_least(const Voxel& v, double least) const {
    float difference[kMostOffsets];
    differences(v, difference);
    double squares = 0;
    Vec3 first = Vec3::Zero();
    for (std::size_t k = 0; k < bank_.offsets.size(); ++k) {
      const double d = static_cast<double>(difference[k]);
      const Voxel& o = bank_.offsets[k];
      squares += d * d;
      first += d * Vec3(o[0], o[1], o[2]);
    }

    // Cauchy-Schwarz on the linear part of the differences and on the rest.
    const double rest = std::max(0.0, squares - first.squaredNorm() / bank_.moment);
    const double most = bank_.gradient_gain * first.norm() + bank_.rest_gain * std::sqrt(rest);
    if (most * (1 + kGateSlack) < least) return {0, kSpared};
    return strongest(difference);
  }

 private:
  void differences(const Voxel& v, float* out) const {
    const Voxel& size = image_.grid.size;
    const int depth = bank_.flat ? 0 : 2;
    const bool inner = v[0] >= 2 && v[1] >= 2 && v[2] >= depth && v[0] < size[0] - 2 &&
                       v[1] < size[1] - 2 && v[2] < size[2] - depth;
    if (inner) {
      const T* centre = image_.voxels.data() + image_.grid.offset(v);
      for (std::size_t k = 0; k < steps_.size(); ++k)
        out[k] = static_cast<float>(centre[steps_[k]]) - static_cast<float>(centre[-steps_[k]]);
      return;
    }

    // Beyond the border the border value goes on.
    const auto value = [&](const Voxel& o, int sign) {
      Voxel at;
      for (std::size_t i = 0; i < 3; ++i) at[i] = std::clamp(v[i] + sign * o[i], 0, size[i] - 1);
      return static_cast<float>(image_[at]);
    };
    for (std::size_t k = 0; k < steps_.size(); ++k)
      out[k] = value(bank_.offsets[k], 1) - value(bank_.offsets[k], -1);
  }

  Answer strongest(const float* difference) const {
    float sum[kLanes] = {};
    const float* w = bank_.weights.data();
    for (std::size_t k = 0; k < steps_.size(); ++k, w += kLanes) {
      const float d = difference[k];
      for (int m = 0; m < kLanes; ++m) sum[m] += d * w[m];
    }
    Answer best;
    for (int m = 0; m < bank_.pairs(); ++m) {
      if (std::abs(sum[m]) > best.strength)
        best = {std::abs(sum[m]), sum[m] > 0 ? m : m + bank_.pairs()};
    }
    return best;
  }

  const Image<T>& image_;
  EdgeMaskBank bank_;
  std::vector<std::ptrdiff_t> steps_;
};

// An upper bound on every mask's answer at each voxel of a slice, from the sums of I, I^2 and x I
// over 5 x 5 x 5 voxels: differences d = I(x) - I(-x) have sum d^2 <= 2 sum (I - mean)^2.
template <typename T>
class SliceBounds {
 public:
  SliceBounds(const Image<T>& image, const EdgeMaskBank& bank)
      : image_(image), bank_(bank), width_(static_cast<std::size_t>(image.grid.size[0])) {
    for (auto* plane : {&sum_, &ramp_, &square_})
      plane->resize(width_ * static_cast<std::size_t>(image.grid.size[1]));
    for (auto& row : rows_) row.resize(width_ + 4);
    bounds_.resize(width_);
  }

  void load(int z) {
    std::fill(sum_.begin(), sum_.end(), 0.0);
    std::fill(ramp_.begin(), ramp_.end(), 0.0);
    std::fill(square_.begin(), square_.end(), 0.0);
    const std::size_t count = sum_.size();

    // About this value sums of squares lose few digits.
    const auto middle = static_cast<double>(image_.voxels[static_cast<std::size_t>(z) * count]);
    for (int o = -2; o <= 2; ++o) {
      const int at = std::clamp(z + o, 0, image_.grid.size[2] - 1);
      const T* in = image_.voxels.data() + static_cast<std::size_t>(at) * count;
      for (std::size_t i = 0; i < count; ++i) {
        const double value = static_cast<double>(in[i]) - middle;
        sum_[i] += value;
        ramp_[i] += o * value;
        square_[i] += value * value;
      }
    }
  }

  // Bounds along row y of the slice loaded.
  const std::vector<double>& row(int y) {
    for (auto& row : rows_) std::fill(row.begin(), row.end(), 0.0);
    for (int o = -2; o <= 2; ++o) {
      const int at = std::clamp(y + o, 0, image_.grid.size[1] - 1);
      const std::size_t from = static_cast<std::size_t>(at) * width_;
      for (std::size_t x = 0; x < width_; ++x) {
        rows_[0][x + 2] += sum_[from + x];
        rows_[1][x + 2] += o * sum_[from + x];
        rows_[2][x + 2] += ramp_[from + x];
        rows_[3][x + 2] += square_[from + x];
      }
    }

    // The border's values go on, so that every box is whole.
    for (auto& row : rows_) {
      row[0] = row[1] = row[2];
      row[width_ + 2] = row[width_ + 3] = row[width_ + 1];
    }
    for (std::size_t x = 0; x < width_; ++x) bounds_[x] = bound(x);
    return bounds_;
  }

 private:
  double bound(std::size_t x) const {
    const auto box = [x](const std::vector<double>& r) {
      return r[x] + r[x + 1] + r[x + 2] + r[x + 3] + r[x + 4];
    };

    // First moments of the differences, and what is left of their squares.
    const std::vector<double>& s = rows_[0];
    const double gx = 2 * (s[x + 4] - s[x]) + s[x + 3] - s[x + 1];
    const double gy = box(rows_[1]), gz = box(rows_[2]), total = box(s);
    const double gradient_squared = gx * gx + gy * gy + gz * gz;
    const double spread = box(rows_[3]) - total * total / 125;
    const double rest = std::max(0.0, 2 * spread - gradient_squared / bank_.moment);
    return bank_.gradient_gain * std::sqrt(gradient_squared) + bank_.rest_gain * std::sqrt(rest);
  }

  const Image<T>& image_;
  const EdgeMaskBank& bank_;
  std::size_t width_;
  std::vector<double> sum_, ramp_, square_;  // along z
  std::array<std::vector<double>, 4> rows_;  // along z and y, with two voxels at each end
  std::vector<double> bounds_;
};

template <typename T>
Result<void> check(const Image<T>& image, const EdgeOptions& options) {
  const auto bad = [](const char* what, double value, const char* rule) {
    return fail({ErrorKind::kBadInput, what, "edges", fmt::format("{}", value), rule});
  };
  if (const auto* contrast = std::get_if<EdgeContrast>(&options.threshold);
      contrast != nullptr && !(contrast->least > 0 && std::isfinite(contrast->least)))
    return bad("contrast is not usable", contrast->least, "grey values above 0");
  if (const auto* p = std::get_if<EdgePercentile>(&options.threshold);
      p != nullptr && !(p->percent >= 0 && p->percent < 100))
    return bad("percentile is not usable", p->percent, "from 0 to below 100");
  if (image.voxels.empty()) return bad("image is empty", 0, "at least one voxel");

  bool constant = true;
  for (std::size_t i = 0; i < image.voxels.size(); ++i) {
    if constexpr (std::is_floating_point_v<T>) {
      if (!std::isfinite(image.voxels[i])) {
        const Voxel v = image.grid.voxel(i);
        return fail({ErrorKind::kBadInput, "voxel is not finite",
                     fmt::format("voxel {},{},{}", v[0], v[1], v[2]),
                     fmt::format("{}", image.voxels[i]),
                     "edges need a finite grey value everywhere"});
      }
    }
    constant = constant && image.voxels[i] == image.voxels.front();
  }
  if (constant)
    return bad("image is constant", static_cast<double>(image.voxels.front()),
               "edges need two grey values");
  return {};
}

// The strength that `percent` of a regular sample of voxels stay below.
template <typename T>
double percentile_strength(const Image<T>& image, const Masks<T>& masks, double percent) {
  const std::size_t count = image.voxels.size();
  std::size_t stride = (count + kPercentileSample - 1) / kPercentileSample;
  // Not along with the rows: a stride that shares no factor with them visits all columns.
  const auto nx = static_cast<std::size_t>(image.grid.size[0]);
  while (stride > 1 && std::gcd(stride, nx) != 1) ++stride;

  std::vector<float> strengths((count + stride - 1) / stride);
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, strengths.size(), 1024),
                    [&](const tbb::blocked_range<std::size_t>& r) {
                      for (std::size_t i = r.begin(); i != r.end(); ++i)
                        strengths[i] = masks.at(image.grid.voxel(i * stride)).strength;
                    });

  const auto rank = static_cast<std::size_t>(percent / 100 * static_cast<double>(strengths.size()));
  const auto nth = strengths.begin() + static_cast<std::ptrdiff_t>(rank);
  std::nth_element(strengths.begin(), nth, strengths.end());
  // Where that many voxels see no step at all, a step is what counts.
  return std::max(static_cast<double>(*nth), std::numeric_limits<double>::min());
}

// Edges of one slice, x fastest, and how many voxels saw all masks.
struct SliceEdges {
  std::vector<Edge> edges;
  std::size_t examined = 0;
};

template <typename T>
SliceEdges edges_of_slice(const Image<T>& image, const Masks<T>& masks, SliceBounds<T>* bounds,
                          int z, double least) {
  SliceEdges out;
  if (bounds != nullptr) bounds->load(z);
  bool look_closer = bounds != nullptr;  // the tighter bound paid on the last row that it was tried
  for (int y = 0; y < image.grid.size[1]; ++y) {
    const double* bound = bounds != nullptr ? bounds->row(y).data() : nullptr;
    if (y % kRowsBetweenTries == 0) look_closer = bounds != nullptr;

    int tried = 0, spared = 0;
    for (int x = 0; x < image.grid.size[0]; ++x) {
      if (bound != nullptr && bound[x] * (1 + kGateSlack) < least) continue;
      const Voxel v{x, y, z};
      ++tried;
      const Answer a = look_closer ? masks.at_least(v, least) : masks.at(v);
      if (a.normal == kSpared)
        ++spared;
      else if (static_cast<double>(a.strength) >= least && a.strength > 0)
        out.edges.push_back({v, a.strength, static_cast<std::int16_t>(a.normal)});
    }

    out.examined += static_cast<std::size_t>(tried - spared);
    look_closer = look_closer && kWorthwhileSparing * spared >= tried;
  }
  return out;
}

// Keeps the edges that are strongest across, by Nevatia and Babu's rule.
std::vector<Edge> thinned(const EdgeField& field, const ImageGrid& grid) {
  const auto rank = [&](const Edge& e) { return grid.offset(e.voxel); };
  const auto at = [&](const Voxel& v) -> const Edge* {
    if (!grid.contains(v)) return nullptr;
    const std::size_t wanted = grid.offset(v);
    const auto i = std::lower_bound(field.edges.begin(), field.edges.end(), wanted,
                                    [&](const Edge& e, std::size_t w) { return rank(e) < w; });
    return i != field.edges.end() && rank(*i) == wanted ? &*i : nullptr;
  };

  const double same_way = std::cos(std::numbers::pi / 6) - kSameWayRounding;
  const auto normal = [&](const Edge& e) {
    return field.normals[static_cast<std::size_t>(e.normal)];
  };
  std::vector<Edge> kept;
  for (const Edge& e : field.edges) {
    // The step to the neighbours: the normal in voxels, its largest component made 1.
    Vec3 step = (grid.direction.transpose() * normal(e)).cwiseQuotient(grid.spacing_mm);
    step /= step.cwiseAbs().maxCoeff();

    // Against both of them; those that run another way belong to another edge.
    bool strongest = true;
    for (const int sign : {-1, 1}) {
      Voxel v = e.voxel;
      for (std::size_t i = 0; i < 3; ++i)
        v[i] += sign * static_cast<int>(std::lround(step[static_cast<int>(i)]));
      const Edge* other = at(v);
      if (other == nullptr || normal(e).dot(normal(*other)) < same_way) continue;
      strongest = strongest && (e.strength > other->strength ||
                                (e.strength == other->strength && rank(e) < rank(*other)));
    }
    if (strongest) kept.push_back(e);
  }
  return kept;
}

}  // namespace

template <typename T>
Result<EdgeField> find_edges(const Image<T>& image, const EdgeOptions& options,
                             const Progress& progress) {
  if (const auto ok = check(image, options); !ok) return fail(ok.error());

  // Both directions of each pair of masks, in the world's frame.
  const Masks<T> masks(image);
  EdgeField field;
  for (const double sign : {1.0, -1.0})
    for (const Vec3& n : masks.bank().normals)
      field.normals.push_back(sign * (image.grid.direction * n));
  if (const auto* contrast = std::get_if<EdgeContrast>(&options.threshold)) {
    field.threshold = contrast->least;
  } else {
    field.threshold =
        percentile_strength(image, masks, std::get<EdgePercentile>(options.threshold).percent);
  }

  // Slice by slice on all cores; put together in order, so that threads change nothing.
  const bool gated = options.gate == EdgeGate::kMoments && !masks.bank().flat;
  const int depth = image.grid.size[2];
  std::vector<SliceEdges> slices(static_cast<std::size_t>(depth));
  std::atomic<int> done = 0;
  std::atomic<bool> stop = false;
  tbb::parallel_for(tbb::blocked_range<int>(0, depth, 1), [&](const tbb::blocked_range<int>& r) {
    std::optional<SliceBounds<T>> bounds;
    if (gated) bounds.emplace(image, masks.bank());
    for (int z = r.begin(); z != r.end(); ++z) {
      if (stop || progress.should_stop()) stop = true;
      if (stop) return;
      slices[static_cast<std::size_t>(z)] =
          edges_of_slice(image, masks, bounds ? &*bounds : nullptr, z, field.threshold);
      progress.at("finding edges", static_cast<double>(++done) / depth);
    }
  });
  if (stop) return fail(cancelled("finding edges"));

  for (const SliceEdges& s : slices) {
    field.edges.insert(field.edges.end(), s.edges.begin(), s.edges.end());
    field.examined += s.examined;
  }
  if (options.thinning == EdgeThinning::kAcross) field.edges = thinned(field, image.grid);
  for (const Edge& e : field.edges)
    field.strongest = std::max(field.strongest, static_cast<double>(e.strength));
  return field;
}

Result<EdgeField> find_edges(const AnyImage& image, const EdgeOptions& options,
                             const Progress& progress) {
  return std::visit([&](const auto& i) { return find_edges(i, options, progress); }, image);
}

template Result<EdgeField> find_edges(const Image<std::uint8_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<std::int8_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<std::uint16_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<std::int16_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<std::uint32_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<std::int32_t>&, const EdgeOptions&,
                                      const Progress&);
template Result<EdgeField> find_edges(const Image<float>&, const EdgeOptions&, const Progress&);
template Result<EdgeField> find_edges(const Image<double>&, const EdgeOptions&, const Progress&);

}  // namespace angiospline
