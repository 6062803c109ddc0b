// The triple curve Phi = F' . (G' x H') of two surfaces that share a boundary (thesis 3.2.1): they
// meet with a common tangent plane there if and only if Phi is zero.
#pragma once

#include <vector>

#include "base/vector.h"
#include "kernel/continuity/edge_curves.h"
#include "kernel/spline/curve.h"
#include "kernel/spline/surface.h"

namespace angiospline {

// The knots of Phi. (3.6): its order is the sum of the degrees plus one. (3.7): at each knot its
// multiplicity is n - (n_c - m_c) for the factor c of least continuity; in general form, as factors
// may differ in order and knots. Requires equal domains. Its greville() are the nodes at which Phi
// must vanish: they satisfy Schoenberg-Whitney, so zero there is zero everywhere.
KnotVector triple_knots(const KnotVector& f, const KnotVector& g, const KnotVector& h);

// One way to Phi is to evaluate the factors; two others give its coefficients, and check it.
//   triple_product: B-spline coefficients by two exact products (3.5; Morken).
//   triple_derose: Bernstein coefficients of three Bezier factors by the sums (3.3); requires
//   clamped single spans over the same domain. (DeRose, CAGD 7, 1990.)
double triple_value(const BSplineCurve<3>& f, const BSplineCurve<3>& g, const BSplineCurve<3>& h,
                    double t);
BSplineCurve<1> triple_product(const BSplineCurve<3>& f, const BSplineCurve<3>& g,
                               const BSplineCurve<3>& h);
BSplineCurve<1> triple_derose(const BSplineCurve<3>& f, const BSplineCurve<3>& g,
                              const BSplineCurve<3>& h);

// How the second side runs against the first.
enum class SideDirection { kSame, kReversed };

// d Phi(node) / d (control point `point` of surface 0 or 1), as a vector.
struct TripleGradient {
  int node;
  int surface;
  Eigen::Index point;
  Vec3 gradient;
};

struct TripleValues {
  Eigen::VectorXd values;                // one for each node
  std::vector<TripleGradient> gradient;  // by node, then surface, then point; zeros are kept, so
                                         // the pattern depends on the knots alone
};

// Phi along side_a of surface a and side_b of surface b: F' and H from a, G' from b, whose
// parameter is mapped onto that of side_a. The knots and nodes are fixed at construction; values
// may be asked for other control points over the same knots. Requires ends clamped across the
// sides.
class TripleCurve {
 public:
  TripleCurve(const BSplineSurface<3>& a, SurfaceSide side_a, const BSplineSurface<3>& b,
              SurfaceSide side_b, SideDirection direction);

  const KnotVector& knots() const { return knots_; }
  const std::vector<double>& nodes() const { return nodes_; }

  // Requires the knots given at construction. O(nodes * degree).
  TripleValues evaluate(const BSplineSurface<3>& a, const BSplineSurface<3>& b) const;

 private:
  double parameter_on_b(double t) const;

  SurfaceSide side_a_;
  SurfaceSide side_b_;
  SideDirection direction_;
  KnotVector along_a_;
  KnotVector along_b_;
  KnotVector knots_;
  std::vector<double> nodes_;
};

}  // namespace angiospline
