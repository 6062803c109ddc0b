#include "modeling/patch_grid.h"

#include "base/contract.h"

namespace angiospline {

PatchGrid evaluate_grid(const BSplineSurface<3>& surface, const std::vector<double>& us,
                        const std::vector<double>& vs, int order) {
  EXPECTS(order >= 0 && order <= 2);
  PatchGrid grid;
  grid.order = order;
  for (std::size_t k = 0; k < grid.values.size(); ++k) {
    if (static_cast<int>(k) < (order + 1) * (order + 2) / 2) {
      grid.values[k].resize(3, static_cast<Eigen::Index>(us.size() * vs.size()));
    }
  }
  std::vector<BasisValues> along_v;
  along_v.reserve(vs.size());
  for (const double v : vs) along_v.push_back(basis_at(surface.v(), v, order));
  const int nv = surface.v_count();
  std::array<Points3, 3> line;  // the v curve through u, and its derivatives in u
  for (std::size_t i = 0; i < us.size(); ++i) {
    const BasisValues bu = basis_at(surface.u(), us[i], order);
    for (int a = 0; a <= order; ++a) {
      Points3& sum = line[static_cast<std::size_t>(a)];
      sum = Points3::Zero(3, nv);
      for (int k = 0; k < surface.u().order(); ++k) {
        sum += bu.values(a, k) *
               surface.control_points().middleCols(surface.index(bu.first + k, 0), nv);
      }
    }
    for (std::size_t j = 0; j < vs.size(); ++j) {
      const BasisValues& bv = along_v[j];
      const auto column = static_cast<Eigen::Index>(i * vs.size() + j);
      for (int a = 0; a <= order; ++a) {
        const auto part =
            line[static_cast<std::size_t>(a)].middleCols(bv.first, surface.v().order());
        for (int b = 0; a + b <= order; ++b) {
          const int n = a + b;
          grid.values[static_cast<std::size_t>(n * (n + 1) / 2 + b)].col(column) =
              part * bv.values.row(b).transpose();
        }
      }
    }
  }
  return grid;
}

}  // namespace angiospline
