// Which voxels part the vessels of a contact.
#include <algorithm>
#include <cmath>
#include <vector>

#include "recovery/imaging/skeleton/contacts.h"

namespace angiospline {
namespace {

double voxel_mm(const ImageGrid& grid) { return grid.spacing_mm.maxCoeff(); }

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
  Parting(const Mask& mask, const MaskContact& contact) : mask_(mask), c_(contact) {
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
  const MaskContact& c_;
  double zone_mm_ = 0;
  Voxel low_{}, high_{};
  Mask owner_;
};

}  // namespace

Mask cut_contacts(Mask mask, const std::vector<MaskContact>& contacts) {
  std::vector<std::size_t> cut;
  for (const MaskContact& contact : contacts) {
    const std::vector<std::size_t> between = Parting(mask, contact).between();
    cut.insert(cut.end(), between.begin(), between.end());
  }
  for (const std::size_t o : cut) mask.voxels[o] = 0;
  return mask;
}

}  // namespace angiospline
