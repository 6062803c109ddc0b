// SISL's curves and surfaces with owners; only where SISL is there.
#pragma once

#ifdef ANGIOSPLINE_HAS_SISL
#include <memory>
#include <vector>

#include <sisl.h>

#include "benches/kernel_samples.h"

namespace angiospline::bench {

struct FreeCurve {
  void operator()(SISLCurve* curve) const { freeCurve(curve); }
};
struct FreeSurface {
  void operator()(SISLSurf* surface) const { freeSurf(surface); }
};
using SislCurve = std::unique_ptr<SISLCurve, FreeCurve>;
using SislSurface = std::unique_ptr<SISLSurf, FreeSurface>;

// SISL copies what it is given.
inline SislCurve to_sisl(const BSplineCurve<3>& curve) {
  std::vector<double> knots = curve.knots().knots();
  Eigen::Matrix3Xd points = curve.control_points();
  return SislCurve(newCurve(static_cast<int>(points.cols()), curve.knots().order(), knots.data(),
                            points.data(), 1, 3, 1));
}

inline SislSurface to_sisl(const BSplineSurface<3>& surface) {
  std::vector<double> u = surface.u().knots();
  std::vector<double> v = surface.v().knots();
  std::vector<double> net = u_fastest(surface);
  return SislSurface(newSurf(surface.u_count(), surface.v_count(), surface.u().order(),
                             surface.v().order(), u.data(), v.data(), net.data(), 1, 3, 1));
}

inline BSplineCurve<3> from_sisl(const SISLCurve& curve) {
  const KnotVector knots = *KnotVector::make(
      curve.ik - 1, std::vector<double>(curve.et, curve.et + curve.in + curve.ik));
  return BSplineCurve<3>(knots, Eigen::Map<const Eigen::Matrix3Xd>(curve.ecoef, 3, curve.in));
}

inline BSplineSurface<3> from_sisl(const SISLSurf& s) {
  const KnotVector u =
      *KnotVector::make(s.ik1 - 1, std::vector<double>(s.et1, s.et1 + s.in1 + s.ik1));
  const KnotVector v =
      *KnotVector::make(s.ik2 - 1, std::vector<double>(s.et2, s.et2 + s.in2 + s.ik2));
  return from_u_fastest(u, v, s.ecoef);
}

}  // namespace angiospline::bench
#endif
