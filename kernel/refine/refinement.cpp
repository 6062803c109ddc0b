#include "kernel/refine/refinement.h"

#include <algorithm>
#include <array>
#include <string>

#include "base/contract.h"
#include "kernel/spline/blossom.h"

namespace angiospline {
namespace {

constexpr int kMaxOrder = KnotVector::kMaxDegree + 1;

// Knots with `degree` copies of the end knots beyond each end, so that windows at floating ends
// stay in range; whatever the copies contribute belongs to columns that do not exist.
class PaddedKnots {
 public:
  explicit PaddedKnots(const KnotVector& knots) : pad_(knots.degree() + 1) {
    const std::vector<double>& U = knots.knots();
    padded_.reserve(U.size() + 2 * static_cast<std::size_t>(pad_));
    padded_.insert(padded_.end(), static_cast<std::size_t>(pad_), U.front());
    padded_.insert(padded_.end(), U.begin(), U.end());
    padded_.insert(padded_.end(), static_cast<std::size_t>(pad_), U.back());
  }
  const double* at(int i) const { return padded_.data() + pad_ + i; }

 private:
  int pad_;
  std::vector<double> padded_;
};

// One step of the discrete B-spline recurrence: `row` goes from degree d - 1 to d. left[d - 1 - j]
// walks down from the interval, right[j] up; x is the knot of the fine vector for this level.
inline void discrete_step(const double* left, const double* right, double x, int d, double* row) {
  double carried = 0;
  for (int j = 0; j < d; ++j) {
    const double l = left[j - d];
    const double r = right[j];
    const double share = row[j] / (r - l);
    row[j] = carried + share * (r - x);
    carried = share * (x - l);
  }
  row[d] = carried;
}

}  // namespace

Result<KnotVector> with_knots(const KnotVector& knots, std::vector<double> added) {
  std::sort(added.begin(), added.end());
  for (const double t : added) {
    if (!(t >= knots.first() && t <= knots.last())) {
      return fail({ErrorKind::kBadInput, "new knot is outside the domain", "knot vector",
                   std::to_string(t),
                   "must be in [" + std::to_string(knots.first()) + ", " +
                       std::to_string(knots.last()) + "]"});
    }
  }
  std::vector<double> merged(knots.knots().size() + added.size());
  std::merge(knots.knots().begin(), knots.knots().end(), added.begin(), added.end(),
             merged.begin());
  return KnotVector::make(knots.degree(), std::move(merged));
}

bool is_refinement(const KnotVector& coarse, const KnotVector& fine) {
  return coarse.degree() == fine.degree() && coarse.first() == fine.first() &&
         coarse.last() == fine.last() && coarse.knots().front() <= fine.knots().front() &&
         fine.knots().back() <= coarse.knots().back() &&
         std::includes(fine.knots().begin(), fine.knots().end(), coarse.knots().begin(),
                       coarse.knots().end());
}

CompactRows refinement_matrix_oslo(const KnotVector& coarse, const KnotVector& fine) {
  EXPECTS(is_refinement(coarse, fine));
  const int p = coarse.degree();
  const PaddedKnots tau(coarse);
  CompactRows A(fine.control_point_count(), coarse.control_point_count(), p + 1);
  std::array<double, kMaxOrder> row;
  int mu = 0;
  for (int i = 0; i < A.rows(); ++i) {
    while (coarse[mu + 1] <= fine[i]) ++mu;  // tau(mu) <= fine(i) < tau(mu + 1)
    row[0] = 1;
    for (int d = 1; d <= p; ++d) {
      discrete_step(tau.at(mu + 1), tau.at(mu + 1), fine[i + d], d, row.data());
    }
    A.set_row(i, mu - p, row.data(), p + 1);
  }
  return A;
}

namespace {

// Rows of discrete B-splines of degree nu over the same old knots: what is divided by is divided by
// once for all of them.
class DiscreteRows {
 public:
  // `left` and `right` as in discrete_step.
  void prepare(const double* left, const double* right, int nu) {
    if (left == left_ && nu == nu_) return;
    left_ = left;
    right_ = right;
    nu_ = nu;
    double* next = reciprocals_.data();
    for (int d = 1; d <= nu; ++d) {
      for (int j = 0; j < d; ++j) *next++ = 1 / (right[j] - left[j - d]);
    }
  }

  // The row for new knots t[at[0]], t[at[1]], ...
  void row(const double* t, const int* at, double* row) const {
    switch (nu_) {
      case 3:
        return fill<3>(t, at, row);
      case 5:
        return fill<5>(t, at, row);
      default:
        return fill<-1>(t, at, row);
    }
  }

 private:
  template <int kFixed>
  void fill(const double* t, const int* at, double* row) const {
    const int nu = kFixed >= 0 ? kFixed : nu_;
    const double* next = reciprocals_.data();
    row[0] = 1;
    for (int d = 1; d <= nu; ++d) {
      const double x = t[at[d - 1]];
      double carried = 0;
      for (int j = 0; j < d; ++j) {
        const double share = row[j] * *next++;
        row[j] = carried + share * (right_[j] - x);
        carried = share * (x - left_[j - d]);
      }
      row[d] = carried;
    }
  }

  const double* left_ = nullptr;
  const double* right_ = nullptr;
  int nu_ = -1;
  std::array<double, kMaxOrder*(kMaxOrder - 1) / 2> reciprocals_;
};

// In blossom terms row i is f[t(i+1) .. t(i+p)] written in the coarse control points
// f[tau(j+1) .. tau(j+p)]. Old knots tau(q+1) .. tau(q+p-nu) inside the window stay as arguments of
// every point involved; over the other nu arguments it is a blossom of degree nu, whose knots are
// the nu old ones before and after the fixed ones. Calls visit(i, first column, entries, nu + 1).
template <typename Visit>
void for_each_row(const KnotVector& coarse, const KnotVector& fine, const Visit& visit) {
  const int p = coarse.degree();
  const PaddedKnots tau(coarse);
  const double* t = fine.knots().data();
  const int rows = fine.control_point_count();
  const int coarse_total = static_cast<int>(coarse.knots().size());
  std::array<double, kMaxOrder> row;
  DiscreteRows discrete;

  // Equal values are matched in order. `q` is the last old knot at or before position i, `ahead`
  // the last one at or before position i + p.
  int q = -1;
  int ahead = -1;
  int added = 0;  // positions of new knots among t(0) .. t(i + p) are added_at[0 .. added - 1]
  std::vector<int> added_at;
  added_at.reserve(fine.knots().size() - coarse.knots().size());
  std::size_t behind = 0;  // new knots at or before position i
  int position = 0;

  for (int i = 0; i < rows; ++i) {
    for (; position <= i + p; ++position) {
      if (ahead + 1 < coarse_total && t[position] == coarse[ahead + 1]) {
        ++ahead;
      } else {
        added_at.push_back(position);
        ++added;
      }
    }

    while (behind < added_at.size() && added_at[behind] <= i) ++behind;
    q = i - static_cast<int>(behind);
    const int nu = added - static_cast<int>(behind);
    discrete.prepare(tau.at(q + 1), tau.at(q + 1 + p - nu), nu);
    discrete.row(t, added_at.data() + behind, row.data());
    visit(i, q - nu, row.data(), nu + 1);
  }
}

}  // namespace

CompactRows refinement_matrix(const KnotVector& coarse, const KnotVector& fine) {
  EXPECTS(is_refinement(coarse, fine));
  CompactRows A(fine.control_point_count(), coarse.control_point_count(), coarse.order());
  for_each_row(coarse, fine, [&](int i, int first, const double* entries, int count) {
    A.set_row(i, first, entries, count);
  });
  return A;
}

void add_refined(double factor, const KnotVector& coarse, const KnotVector& fine,
                 const double* blocks, int stride, double* out) {
  EXPECTS(is_refinement(coarse, fine));
  const int last = coarse.control_point_count() - 1;
  for_each_row(coarse, fine, [&](int i, int first, const double* entries, int count) {
    double* sum = out + static_cast<std::ptrdiff_t>(i) * stride;
    for (int k = std::max(0, -first); k < count && first + k <= last; ++k) {
      const double share = factor * entries[k];
      const double* block = blocks + static_cast<std::ptrdiff_t>(first + k) * stride;
      for (int c = 0; c < stride; ++c) sum[c] += share * block[c];
    }
  });
}

CompactRows refinement_matrix_boehm(const KnotVector& coarse, const KnotVector& fine) {
  EXPECTS(is_refinement(coarse, fine));
  const int p = coarse.degree();
  const int n = coarse.control_point_count();
  std::vector<double> added;
  std::set_difference(fine.knots().begin(), fine.knots().end(), coarse.knots().begin(),
                      coarse.knots().end(), std::back_inserter(added));

  std::vector<Eigen::RowVectorXd> rows;
  for (int i = 0; i < n; ++i) rows.push_back(Eigen::RowVectorXd::Unit(n, i));
  std::vector<double> U = coarse.knots();
  for (const double z : added) {
    // The new knot goes behind its equals: U(mu) <= z < U(mu + 1), or to the very end.
    const int mu = static_cast<int>(std::upper_bound(U.begin(), U.end(), z) - U.begin()) - 1;
    std::vector<Eigen::RowVectorXd> next;
    const int count = static_cast<int>(rows.size());
    for (int i = 0; i <= count; ++i) {
      const auto old = [&](int k) -> Eigen::RowVectorXd {
        return k >= 0 && k < count ? rows[static_cast<std::size_t>(k)]
                                   : Eigen::RowVectorXd::Zero(n);
      };
      if (i <= mu - p) {
        next.push_back(old(i));
      } else if (i > mu) {
        next.push_back(old(i - 1));
      } else {
        const auto knot = [&](int k) { return U[static_cast<std::size_t>(k)]; };
        const int high = std::min(i + p, static_cast<int>(U.size()) - 1);
        const double share = (z - knot(i)) / (knot(high) - knot(i));
        next.push_back((1 - share) * old(i - 1) + share * old(i));
      }
    }
    rows = std::move(next);
    U.insert(U.begin() + mu + 1, z);
  }

  CompactRows A(fine.control_point_count(), n, p + 1);
  for (int i = 0; i < A.rows(); ++i) {
    const Eigen::RowVectorXd& row = rows[static_cast<std::size_t>(i)];
    int first = 0;
    while (first < n - 1 && row(first) == 0) ++first;
    int last = n - 1;
    while (last > first && row(last) == 0) --last;
    A.set_row(i, first, row.data() + first, last - first + 1);
  }
  return A;
}

CompactRows rewriting_matrix(const KnotVector& from, const KnotVector& to) {
  EXPECTS(from.degree() == to.degree() && from.first() == to.first() && from.last() == to.last());
  const auto interior = [](const KnotVector& knots) {
    const std::vector<double>& U = knots.knots();
    return std::pair{std::upper_bound(U.begin(), U.end(), knots.first()),
                     std::lower_bound(U.begin(), U.end(), knots.last())};
  };
  const auto [from_begin, from_end] = interior(from);
  const auto [to_begin, to_end] = interior(to);
  EXPECTS(std::includes(to_begin, to_end, from_begin, from_end));
  CompactRows A(to.control_point_count(), from.control_point_count(), from.order());
  std::array<double, kMaxOrder> row;
  for (int i = 0; i < A.rows(); ++i) {
    const int span = span_inside_support(from, to, i);
    blossom_row(from, span, to.knots().data() + i + 1, row.data());
    A.set_row(i, span - from.degree(), row.data(), from.order());
  }
  return A;
}

template <int D>
BSplineCurve<D> rewrite(const BSplineCurve<D>& curve, const KnotVector& knots) {
  return BSplineCurve<D>(
      knots, rewriting_matrix(curve.knots(), knots).template apply<D>(curve.control_points()));
}

// The rows of the matrix, applied as they come. `fine` is known to be a refinement.
template <int D>
BSplineCurve<D> refined(const BSplineCurve<D>& curve, KnotVector fine) {
  const int last = curve.knots().control_point_count() - 1;
  typename BSplineCurve<D>::ControlPoints points(D, fine.control_point_count());
  const double* old = curve.control_points().data();
  double* out = points.data();
  for_each_row(curve.knots(), fine, [&](int i, int first, const double* entries, int count) {
    double* sum = out + static_cast<std::ptrdiff_t>(D) * i;
    if (count == 1) {
      std::copy_n(old + static_cast<std::ptrdiff_t>(D) * first, D, sum);
      return;
    }
    std::array<double, D> total{};
    for (int k = std::max(0, -first); k < count && first + k <= last; ++k) {
      const double* point = old + static_cast<std::ptrdiff_t>(D) * (first + k);
      for (std::size_t c = 0; c < D; ++c) total[c] += entries[k] * point[c];
    }
    std::copy_n(total.begin(), D, sum);
  });
  return BSplineCurve<D>(std::move(fine), std::move(points));
}

template <int D>
BSplineCurve<D> refine(const BSplineCurve<D>& curve, KnotVector fine) {
  EXPECTS(is_refinement(curve.knots(), fine));
  return refined(curve, std::move(fine));
}

template <int D>
BSplineSurface<D> transform_u(const BSplineSurface<D>& surface, const CompactRows& A,
                              KnotVector u) {
  EXPECTS(A.columns() == surface.u_count() && A.rows() == u.control_point_count());
  const Eigen::Index stride = static_cast<Eigen::Index>(D) * surface.v_count();
  typename BSplineSurface<D>::ControlPoints points(
      D, static_cast<Eigen::Index>(A.rows()) * surface.v_count());
  A.apply_blocks(surface.control_points().data(), stride, points.data());
  return BSplineSurface<D>(std::move(u), surface.v(), std::move(points));
}

template <int D>
BSplineSurface<D> transform_v(const BSplineSurface<D>& surface, const CompactRows& A,
                              KnotVector v) {
  EXPECTS(A.columns() == surface.v_count() && A.rows() == v.control_point_count());
  typename BSplineSurface<D>::ControlPoints points(
      D, static_cast<Eigen::Index>(surface.u_count()) * A.rows());
  for (int i = 0; i < surface.u_count(); ++i) {
    const double* in = surface.control_points().data() + D * surface.index(i, 0);
    A.apply_blocks(in, D, points.data() + static_cast<Eigen::Index>(D) * i * A.rows());
  }
  return BSplineSurface<D>(surface.u(), std::move(v), std::move(points));
}

// v first: its short blocks are cheap on the coarse net, and u then runs over long contiguous rows.
template <int D>
BSplineSurface<D> refine(const BSplineSurface<D>& surface, const KnotVector& fine_u,
                         const KnotVector& fine_v) {
  const auto along_u = [&](const BSplineSurface<D>& s) {
    return transform_u(s, refinement_matrix(s.u(), fine_u), fine_u);
  };
  if (fine_v == surface.v()) return along_u(surface);
  const BSplineSurface<D> finer =
      transform_v(surface, refinement_matrix(surface.v(), fine_v), fine_v);
  return fine_u == surface.u() ? finer : along_u(finer);
}

template <int D>
Result<BSplineCurve<D>> insert_knots(const BSplineCurve<D>& curve, std::vector<double> added) {
  Result<KnotVector> fine = with_knots(curve.knots(), std::move(added));
  if (!fine) return fail(fine.error());
  return refined(curve, std::move(*fine));
}

#define ANGIOSPLINE_INSTANTIATE(D)                                                     \
  template BSplineCurve<D> refine(const BSplineCurve<D>&, KnotVector);                 \
  template BSplineCurve<D> rewrite(const BSplineCurve<D>&, const KnotVector&);         \
  template BSplineSurface<D> refine(const BSplineSurface<D>&, const KnotVector&,       \
                                    const KnotVector&);                                \
  template BSplineSurface<D> transform_u(const BSplineSurface<D>&, const CompactRows&, \
                                         KnotVector);                                  \
  template BSplineSurface<D> transform_v(const BSplineSurface<D>&, const CompactRows&, \
                                         KnotVector);                                  \
  template Result<BSplineCurve<D>> insert_knots(const BSplineCurve<D>&, std::vector<double>);
ANGIOSPLINE_INSTANTIATE(1)
ANGIOSPLINE_INSTANTIATE(2)
ANGIOSPLINE_INSTANTIATE(3)
ANGIOSPLINE_INSTANTIATE(4)
#undef ANGIOSPLINE_INSTANTIATE

}  // namespace angiospline
