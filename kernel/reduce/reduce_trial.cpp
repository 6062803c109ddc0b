#include "kernel/reduce/reduce_trial.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "base/contract.h"
#include "base/index.h"
#include "kernel/fit/fit.h"
#include "kernel/refine/difference_bound.h"
#include "kernel/refine/periodic.h"
#include "kernel/spline/basis.h"

namespace angiospline {
namespace {

// target += factor * block; points of the world are worth a case of their own.
inline void add_scaled(double factor, const double* block, int stride, double* target) {
  if (stride == 3) {
    target[0] += factor * block[0];
    target[1] += factor * block[1];
    target[2] += factor * block[2];
    return;
  }
  for (int c = 0; c < stride; ++c) target[c] += factor * block[c];
}

}  // namespace

TrialSolver::TrialSolver(const ReductionProblem& problem)
    : problem_(problem), p_(problem.knots.degree()), stride_(problem.stride) {
  const KnotVector& U = problem.knots;
  const int count = problem.closed ? *periodic_count(U) : U.control_point_count();
  struct Node {
    double t;
    double weight;
  };

  // Samples at the Greville points, each weighted with its function's mean support: the discrete
  // norm of Lyche & Morken 1988.
  std::vector<Node> nodes;
  for (int i = 0; i < count; ++i) {
    double t = U.greville(i);
    if (problem.closed && t < U.first()) t += U.last() - U.first();
    if (problem.closed && t > U.last()) t -= U.last() - U.first();
    nodes.push_back({std::clamp(t, U.first(), U.last()), (U[i + p_ + 1] - U[i]) / (p_ + 1)});
  }
  if (problem.closed) {
    std::stable_sort(nodes.begin(), nodes.end(),
                     [](const Node& a, const Node& b) { return a.t < b.t; });
  }

  for (const Node& node : nodes) {
    nodes_.push_back(node.t);
    norm_.push_back(node.weight);
  }

  values_.resize(nodes_.size() * index(stride_));
  collocate(U, nodes_, matrix_);
  matrix_.apply_blocks(problem.points, stride_, values_.data());
}

int TrialSolver::sample(int row, int step) const {
  return std::min(row * step, static_cast<int>(nodes_.size()) - 1);
}

KnotVector TrialSolver::trial_knots(const Interior& interior) const {
  const KnotVector& original = problem_.knots;
  Result<KnotVector> knots = [&] {
    if (problem_.closed) {
      std::vector<Knot> period{{original.first(), original.multiplicity(original.first())}};
      for (const double t : interior) {
        if (t == period.back().value) {
          ++period.back().multiplicity;
        } else {
          period.push_back({t, 1});
        }
      }
      return periodic_knots(p_, period, original.last());
    }

    const std::vector<double>& U = original.knots();
    std::vector<double> flat(U.begin(), std::upper_bound(U.begin(), U.end(), original.first()));
    flat.insert(flat.end(), interior.begin(), interior.end());
    flat.insert(flat.end(), std::lower_bound(U.begin(), U.end(), original.last()), U.end());
    return KnotVector::make(p_, std::move(flat));
  }();
  EXPECTS(knots.has_value());
  return std::move(*knots);
}

// The first `held` derivatives at a clamped end fix as many coefficients: a triangular system.
void TrialSolver::hold_ends(const KnotVector& knots, std::vector<double>& points) const {
  const auto hold = [&](double t, int held, bool first_end) {
    if (held == 0) return;
    const BasisValues old_basis = basis_at(problem_.knots, t, held - 1);
    const BasisValues new_basis = basis_at(knots, t, held - 1);
    const auto block = [&](int j) {
      return points.data() + static_cast<std::ptrdiff_t>(new_basis.first + j) * stride_;
    };

    std::vector<double> value(index(stride_));
    for (int r = 0; r < held; ++r) {
      std::fill(value.begin(), value.end(), 0.0);
      for (int j = 0; j <= p_; ++j) {
        add_scaled(old_basis.values(r, j),
                   problem_.points + static_cast<std::ptrdiff_t>(old_basis.first + j) * stride_,
                   stride_, value.data());
      }
      for (int k = 0; k < r; ++k) {
        const int j = first_end ? k : p_ - k;
        add_scaled(-new_basis.values(r, j), block(j), stride_, value.data());
      }
      const int j = first_end ? r : p_ - r;
      for (int c = 0; c < stride_; ++c) block(j)[c] = value[index(c)] / new_basis.values(r, j);
    }
  };
  hold(knots.first(), problem_.held_first, true);
  hold(knots.last(), problem_.held_last, false);
}

namespace {

// Adds weight * a a' to the lower band (row i: (i, i), (i, i - 1), ...) and weight * a value' to
// the right-hand side, for a sample all of whose functions are free. `backwards` is a in that
// order.
template <int kOrder>
void add_sample(double weight, const double* a, const double* value, double* band,
                std::ptrdiff_t width, double* right) {
  std::array<double, kOrder> backwards;
  for (std::size_t k = 0; k < kOrder; ++k) backwards[k] = a[kOrder - 1 - k];
  for (int i = 0; i < kOrder; ++i) {
    const double scaled = weight * a[i];
    const double* from = backwards.data() + (kOrder - 1 - i);
    double* row = band + i * width;
    for (int d = 0; d <= i; ++d) row[d] += scaled * from[d];
    for (int c = 0; c < 3; ++c) right[3 * i + c] += scaled * value[c];
  }
}

}  // namespace

bool TrialSolver::solve(Trial& trial, const std::vector<double>& weights) {
  const CompactRows& A = matrix_;
  const int head = problem_.held_first;
  const int free = A.columns() - head - problem_.held_last;
  trial.points.assign(index(A.columns()) * index(stride_), 0.0);
  hold_ends(trial.knots, trial.points);
  if (free <= 0) return free == 0;

  // The normal equations of the free control points, sample by sample.
  BandedCholesky N(free, std::min(p_ + 1, free));
  double* right = trial.points.data() + static_cast<std::ptrdiff_t>(head) * stride_;
  std::vector<double> rest(index(stride_));
  for (int r = 0; r < A.rows(); ++r) {
    const double* a = A.row(r);
    const int first = A.first(r) - head;
    const int i_sample = sample(r, trial.step);
    const double* value = values_.data() + static_cast<std::ptrdiff_t>(i_sample) * stride_;
    if (first < 0 || first + p_ >= free) {  // held control points go to the right-hand side
      std::copy_n(value, stride_, rest.data());
      for (int j = 0; j <= p_; ++j) {
        const int column = first + j;
        if (column >= 0 && column < free) continue;
        add_scaled(-a[j],
                   trial.points.data() + static_cast<std::ptrdiff_t>(column + head) * stride_,
                   stride_, rest.data());
      }
      value = rest.data();
    }
    if (p_ == 5 && stride_ == 3 && first >= 0 && first + p_ < free) {  // quintics of the world
      add_sample<6>(weights[index(i_sample)], a, value, &N.at(first, first), 6,
                    right + static_cast<std::ptrdiff_t>(first) * stride_);
      continue;
    }

    const int low = std::max(0, -first);
    const int high = std::min(p_, free - 1 - first);
    for (int i = low; i <= high; ++i) {
      const double scaled = weights[index(i_sample)] * a[i];
      add_scaled(scaled, value, stride_, right + static_cast<std::ptrdiff_t>(first + i) * stride_);
      double* row = &N.at(first + i, first + i);  // (i, i), (i, i - 1), ...
      for (int j = low; j <= i; ++j) row[i - j] += scaled * a[j];
    }
  }

  if (N.factor() >= 0) return false;
  N.solve_blocks(right, stride_);
  return true;
}

// The columns wrap: column j is distinct control point j % count.
bool TrialSolver::solve_closed(Trial& trial, const std::vector<double>& weights) const {
  const CompactRows& A = matrix_;
  const int count = *periodic_count(trial.knots);
  const int width = std::min(p_ + 1, count);
  trial.points.assign(index(A.columns()) * index(stride_), 0.0);

  CyclicCholesky N(count, width);
  for (int r = 0; r < A.rows(); ++r) {
    std::array<double, KnotVector::kMaxDegree + 1> a{};  // wrapped: fewer where the circle is short
    for (int j = 0; j <= p_; ++j) a[index(j % count)] += A.row(r)[j];
    const int i_sample = sample(r, trial.step);
    const double* value = values_.data() + static_cast<std::ptrdiff_t>(i_sample) * stride_;
    for (int i = 0; i < width; ++i) {
      const int column = (A.first(r) + i) % count;
      const double scaled = weights[index(i_sample)] * a[index(i)];
      add_scaled(scaled, value, stride_,
                 trial.points.data() + static_cast<std::ptrdiff_t>(column) * stride_);
      for (int j = 0; j <= i; ++j) N.add(column, (A.first(r) + j) % count, scaled * a[index(j)]);
    }
  }

  if (!N.factor()) return false;
  N.solve_blocks(trial.points.data(), stride_);
  for (std::size_t k = index(count) * index(stride_); k < trial.points.size(); ++k) {
    trial.points[k] = trial.points[k - index(count) * index(stride_)];
  }
  return true;
}

Trial TrialSolver::attempt(const Interior& interior, int step, const std::vector<double>& weights) {
  ++trials_;
  Trial trial{interior, trial_knots(interior), {}, step, std::numeric_limits<double>::infinity(),
              {}};
  const int count = static_cast<int>(nodes_.size());
  const int samples = (count + step - 2) / step + 1;  // every step-th, and the last
  work_ += samples;

  const bool known = matrix_knots_ && matrix_step_ == step && *matrix_knots_ == trial.knots;
  if (!known) {
    parameters_.clear();
    for (int k = 0; k < samples; ++k) parameters_.push_back(nodes_[index(sample(k, step))]);
    collocate(trial.knots, parameters_, matrix_);
    matrix_knots_ = trial.knots;
    matrix_step_ = step;
  }
  if (problem_.closed ? solve_closed(trial, weights) : solve(trial, weights)) measure(trial);
  return trial;
}

void TrialSolver::measure(Trial& trial) {
  difference_.resize(index(stride_));
  trial.errors.assign(nodes_.size(), 0.0);
  double largest = 0;
  for (int r = 0; r < matrix_.rows(); ++r) {
    const int i = sample(r, trial.step);
    matrix_.apply_row(r, trial.points.data(), stride_, difference_.data());
    const double* value = values_.data() + static_cast<std::ptrdiff_t>(i) * stride_;
    for (int c = 0; c < stride_; ++c) difference_[index(c)] -= value[c];
    trial.errors[index(i)] = largest_squared(difference_.data(), stride_, problem_.group);
    largest = std::max(largest, trial.errors[index(i)]);
  }
  trial.error = std::sqrt(largest);
}

std::optional<TrialSolver::Confirmed> TrialSolver::confirm(Trial trial, int passes) {
  EXPECTS(trial.step == 1);
  if (dense(static_cast<int>(trial.interior.size()))) passes = 1;
  constexpr double kWithinReach = 1.25;  // of the tolerance: what new weights may gain
  std::vector<double> weights = norm_;
  for (int pass = 1;; ++pass) {
    if (trial.error <= problem_.tolerance) {
      const double bound =
          problem_.proof == Proof::kSamples
              ? trial.error
              : difference_bound(problem_.knots, problem_.points, trial.knots, trial.points.data(),
                                 stride_, problem_.group, problem_.tolerance);
      if (bound <= problem_.tolerance) return Confirmed{std::move(trial), bound};
    }

    // Lawson 1961: weights follow the squared error, so that least squares goes towards least
    // maximum.
    const double before = trial.error;
    const bool hopeless = !(before < kWithinReach * problem_.tolerance);
    if (pass == passes || hopeless) return std::nullopt;
    for (std::size_t i = 0; i < weights.size(); ++i) {
      weights[i] *= 0.1 + trial.errors[i] / (before * before);
    }
    trial = attempt(trial.interior, 1, weights);
    if (!(trial.error < before)) return std::nullopt;
  }
}

}  // namespace angiospline
