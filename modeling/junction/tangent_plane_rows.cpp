#include "modeling/junction/tangent_plane_rows.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "base/index.h"
#include "kernel/spline/binomial.h"

namespace angiospline {
namespace {

constexpr int kDegree = 5;
constexpr int kMostRatioDegree = 4;

// The weight of a_i b_j in coefficient i + j of the product of Bernstein forms of degrees m and n.
double product_weight(int m, int i, int n, int j) {
  return binomial(m, i) * binomial(n, j) / binomial(m + n, i + j);
}

// rho and nu of one edge with their fixed parts filled in.
struct Cofactors {
  std::array<double, kMostRatioDegree + 1> rho{};
  std::array<double, kMostRatioDegree + 2> nu{};
};

Cofactors cofactors(const SmoothEdge& edge, const Eigen::VectorXd& x) {
  Cofactors c;
  const int fixed = edge.from_opening ? 2 : 0;
  if (edge.from_opening) c.rho[0] = c.rho[1] = 1;
  for (int k = 0; k < edge.ratio_unknowns(); ++k)
    c.rho[index(fixed + k)] = x(edge.first_coefficient + k);
  const int fixed_shift = edge.from_opening ? 1 : 0;
  const int first = edge.first_coefficient + edge.ratio_unknowns();
  for (int k = 0; k < edge.shift_unknowns(); ++k) c.nu[index(fixed_shift + k)] = x(first + k);
  return c;
}

struct EdgePoints {
  std::array<Vec3, 6> h, f, g;
};

EdgePoints gather(const SmoothEdge& edge, const JunctionNet& net) {
  EdgePoints p;
  for (std::size_t i = 0; i < 6; ++i) {
    p.h[i] = net.points.col(edge.h[i]);
    p.f[i] = net.points.col(edge.f[i]) - p.h[i];
    p.g[i] = net.points.col(edge.g[i]) - p.h[i];
  }
  return p;
}

// Coefficient k of F' + rho G' - nu H' (each over 5).
Vec3 coefficient(const SmoothEdge& edge, const EdgePoints& p, const Cofactors& c, int k) {
  const int m = edge.ratio_degree;
  Vec3 sum = Vec3::Zero();

  // Products of Bernstein forms: coefficient k gathers the pairs whose indices add up to k (Farouki
  // & Rajan: Algorithms for polynomials in Bernstein form, CAGD 5, 1988).
  for (int i = 0; i <= kDegree; ++i) {
    if (k - i < 0 || k - i > m) continue;
    const double w = product_weight(m, k - i, kDegree, i);
    sum += w * (p.f[index(i)] + c.rho[index(k - i)] * p.g[index(i)]);
  }

  for (int i = 0; i < kDegree; ++i) {
    if (k - i < 0 || k - i > m + 1) continue;
    const double w = product_weight(m + 1, k - i, kDegree - 1, i);
    sum -= w * c.nu[index(k - i)] * (p.h[index(i + 1)] - p.h[index(i)]);
  }
  return sum;
}

// Calls `use(k, row, weight vectors)` for each equation group: one row along the axis for the
// second coefficient of an edge from an opening, three rows for the others.
template <typename Use>
void each_group(const SmoothEdge& edge, Use&& use) {
  const int last = edge.ratio_degree + kDegree;
  int row = edge.first_row;
  for (int k = edge.from_opening ? 1 : 0; k <= last; ++k) {
    const bool scalar = edge.from_opening && k == 1;
    use(k, row, scalar);
    row += scalar ? 1 : 3;
  }
}

// Writes the Jacobian's entries of one edge, one equation group at a time.
class RowWriter {
 public:
  RowWriter(const SmoothEdge& edge, const JunctionNet& net, std::vector<JacobianEntry>& entries)
      : edge_(edge), net_(net), entries_(entries) {}

  void start_group(int row, bool scalar) {
    row_ = row;
    scalar_ = scalar;
  }

  // The group's derivative by an unknown is the vector v.
  void put_vector(int column, const Vec3& v) {
    if (scalar_) {
      entries_.push_back({row_, column, edge_.axis.dot(v)});
    } else {
      for (int d = 0; d < 3; ++d) entries_.push_back({row_ + d, column, v(d)});
    }
  }

  // The group contains `weight` times this control point.
  void put_point(int id, double weight) {
    const ControlSlot& slot = net_.slots[index(id)];
    if (slot.count == 1) put_vector(slot.first, weight * slot.along);
    if (slot.count != 3) return;
    for (int d = 0; d < 3; ++d) {
      entries_.push_back(
          {scalar_ ? row_ : row_ + d, slot.first + d, scalar_ ? weight * edge_.axis(d) : weight});
    }
  }

 private:
  const SmoothEdge& edge_;
  const JunctionNet& net_;
  std::vector<JacobianEntry>& entries_;
  int row_ = 0;
  bool scalar_ = false;
};

// What the edge's own control points get in one group, gathered before it is written: each of them
// occurs in F, G and H'.
struct OnEdge {
  std::array<double, 6> weight{};
  std::array<bool, 6> used{};
};

// One edge's part of the Jacobian. f_i, g_i are the differences of the rows beside the edge from
// it, so that each of them takes its weight from h_i too.
class EdgeJacobian {
 public:
  EdgeJacobian(const SmoothEdge& edge, const JunctionNet& net, const Eigen::VectorXd& coefficients,
               std::vector<JacobianEntry>& entries)
      : edge_(edge),
        p_(gather(edge, net)),
        c_(cofactors(edge, coefficients)),
        writer_(edge, net, entries),
        rho_column_(net.unknowns + edge.first_coefficient - (edge.from_opening ? 2 : 0)),
        nu_column_(net.unknowns + edge.first_coefficient + edge.ratio_unknowns() -
                   (edge.from_opening ? 1 : 0)) {}

  void write_group(int k, int row, bool scalar) {
    writer_.start_group(row, scalar);
    OnEdge h;
    on_f_g(k, h);
    on_nu(k, h);
    for (int i = 0; i <= kDegree; ++i) {
      if (h.used[index(i)]) writer_.put_point(edge_.h[index(i)], h.weight[index(i)]);
    }
  }

 private:
  // sum_i w (f_i + rho_j g_i), j = k - i
  void on_f_g(int k, OnEdge& h) {
    const int m = edge_.ratio_degree;
    for (int i = 0; i <= kDegree; ++i) {
      const int j = k - i;
      if (j < 0 || j > m) continue;
      const double w = product_weight(m, j, kDegree, i) / edge_.scale;
      writer_.put_point(edge_.f[index(i)], w);
      writer_.put_point(edge_.g[index(i)], w * c_.rho[index(j)]);
      h.weight[index(i)] -= w * (1 + c_.rho[index(j)]);
      h.used[index(i)] = true;
      // rho_0 and rho_1 are fixed on an edge from an opening.
      if (!edge_.from_opening || j >= 2) writer_.put_vector(rho_column_ + j, w * p_.g[index(i)]);
    }
  }

  // - sum_i w nu_j (h_{i+1} - h_i), j = k - i
  void on_nu(int k, OnEdge& h) {
    const int m = edge_.ratio_degree;
    for (int i = 0; i < kDegree; ++i) {
      const int j = k - i;
      if (j < 0 || j > m + 1) continue;
      const double w = product_weight(m + 1, j, kDegree - 1, i) / edge_.scale;
      h.weight[index(i)] += w * c_.nu[index(j)];
      h.weight[index(i + 1)] -= w * c_.nu[index(j)];
      h.used[index(i)] = h.used[index(i + 1)] = true;
      // nu_0 is fixed on an edge from an opening.
      if (!edge_.from_opening || j >= 1) {
        writer_.put_vector(nu_column_ + j, -w * (p_.h[index(i + 1)] - p_.h[index(i)]));
      }
    }
  }

  const SmoothEdge& edge_;
  EdgePoints p_;
  Cofactors c_;
  RowWriter writer_;
  int rho_column_;
  int nu_column_;
};

}  // namespace

SmoothEdges smooth_edges(const JunctionTopology& topology, const JunctionLayout& layout,
                         const JunctionNet& net, const EdgeDegrees& degrees) {
  SmoothEdges all;
  const auto add = [&](SmoothEdge edge) {
    double scale = 0;
    for (const int id : edge.h) scale += net.scale[index(id)] / 6;
    edge.scale = scale;
    edge.first_coefficient = all.coefficients;
    edge.first_row = all.rows;
    all.coefficients += edge.coefficient_count();
    all.rows += edge.row_count();
    all.edges.push_back(edge);
  };

  // Legs run from an opening to a pole, between two patches of one branch.
  const int legs = degrees.leg > 0 ? static_cast<int>(topology.patches.size()) : 0;
  for (int p = 0; p < legs; ++p) {
    const JunctionPatch& patch = topology.patches[index(p)];
    SmoothEdge edge;
    edge.ratio_degree = degrees.leg;
    edge.from_opening = true;
    edge.axis = layout.openings[index(patch.branch)].axis;
    for (int i = 0; i < 6; ++i) {
      edge.h[index(i)] = net.grid.at(p, i, 0);
      edge.f[index(i)] = net.grid.at(patch.previous, i, 4);
      edge.g[index(i)] = net.grid.at(p, i, 1);
    }
    add(edge);
  }

  // Saddles run from pole to pole, between patches of two branches; their u = 1 sides are opposed.
  for (const JunctionSaddle& saddle : topology.saddles) {
    SmoothEdge edge;
    edge.ratio_degree = degrees.saddle;
    for (int j = 0; j < 6; ++j) {
      edge.h[index(j)] = net.grid.at(saddle.patch_a, 5, j);
      edge.f[index(j)] = net.grid.at(saddle.patch_a, 4, j);
      edge.g[index(j)] = net.grid.at(saddle.patch_b, 4, 5 - j);
    }
    add(edge);
  }
  return all;
}

Eigen::VectorXd best_coefficients(const SmoothEdges& edges, const JunctionNet& net) {
  Eigen::VectorXd x = Eigen::VectorXd::Zero(edges.coefficients);
  for (const SmoothEdge& edge : edges.edges) {
    const EdgePoints p = gather(edge, net);
    const int last = edge.ratio_degree + kDegree;
    const auto stacked = [&](const Eigen::VectorXd& at_x) {
      const Cofactors c = cofactors(edge, at_x);
      Eigen::VectorXd value(3 * (last + 1));
      for (int k = 0; k <= last; ++k) value.segment<3>(3 * k) = coefficient(edge, p, c, k);
      return value;
    };

    // The left-hand side is affine in the coefficients: its columns are differences.
    const Eigen::VectorXd base = stacked(x);
    Eigen::MatrixXd A(base.size(), edge.coefficient_count());
    for (int k = 0; k < edge.coefficient_count(); ++k) {
      x(edge.first_coefficient + k) = 1;
      A.col(k) = stacked(x) - base;
      x(edge.first_coefficient + k) = 0;
    }
    x.segment(edge.first_coefficient, edge.coefficient_count()) =
        -A.colPivHouseholderQr().solve(base);
  }
  return x;
}

Eigen::VectorXd tangent_plane_residual(const SmoothEdges& edges, const JunctionNet& net,
                                       const Eigen::VectorXd& coefficients) {
  Eigen::VectorXd residual(edges.rows);
  for (const SmoothEdge& edge : edges.edges) {
    const EdgePoints p = gather(edge, net);
    const Cofactors c = cofactors(edge, coefficients);

    each_group(edge, [&](int k, int row, bool scalar) {
      const Vec3 value = coefficient(edge, p, c, k) / edge.scale;
      if (scalar) {
        residual(row) = edge.axis.dot(value);
      } else {
        residual.segment<3>(row) = value;
      }
    });
  }
  return residual;
}

void tangent_plane_jacobian(const SmoothEdges& edges, const JunctionNet& net,
                            const Eigen::VectorXd& coefficients,
                            std::vector<JacobianEntry>& entries) {
  entries.clear();
  for (const SmoothEdge& edge : edges.edges) {
    EdgeJacobian jacobian(edge, net, coefficients, entries);
    each_group(edge, [&](int k, int row, bool scalar) { jacobian.write_group(k, row, scalar); });
  }
}

}  // namespace angiospline
