#include "kernel/reduce_engine.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>

#include "base/contract.h"
#include "kernel/banded.h"
#include "kernel/basis.h"
#include "kernel/fit.h"
#include "kernel/reduce.h"
#include "kernel/refinement.h"

namespace angiospline {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::size_t at(int i) { return static_cast<std::size_t>(i); }

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

double largest_squared(const double* block, int stride, int group) {
  double largest = 0;
  for (int k = 0; k < stride; k += group) {
    double sum = 0;
    for (int c = 0; c < group; ++c) sum += block[k + c] * block[k + c];
    largest = std::max(largest, sum);
  }
  return largest;
}

double largest_norm(const std::vector<double>& blocks, int stride, int group) {
  double largest = 0;
  for (std::size_t k = 0; k < blocks.size(); k += at(stride)) {
    largest = std::max(largest, largest_squared(blocks.data() + k, stride, group));
  }
  return std::sqrt(largest);
}

// Cuts in four every span that one of the marked functions reaches.
KnotVector quartered(const KnotVector& knots, const std::vector<int>& functions) {
  std::vector<double> added;
  int next = 0;  // spans before this one are done
  for (const int i : functions) {
    for (int k = std::max(i, next); k <= i + knots.degree(); ++k, next = k) {
      const double from = std::max(knots[k], knots.first());
      const double to = std::min(knots[k + 1], knots.last());
      for (int part = 1; part < 4; ++part) {
        const double t = from + 0.25 * part * (to - from);
        if (t > from && t < to) added.push_back(t);
      }
    }
  }
  Result<KnotVector> fine = with_knots(knots, std::move(added));
  EXPECTS(fine.has_value());
  return std::move(*fine);
}

// A choice of interior knots, increasing; equal values are a multiple knot.
using Interior = std::vector<double>;

struct Trial {
  Interior interior;
  KnotVector knots;
  std::vector<double> points;
  double error;
};

class Reducer {
 public:
  explicit Reducer(const ReductionProblem& problem);
  DirectionResult run();
  std::optional<DirectionResult> fit(const Interior& interior);

 private:
  int interior_count() const { return static_cast<int>(interior_.size()); }
  int best_count() const {
    return best_ ? static_cast<int>(best_->interior.size()) : interior_count();
  }
  int sampling_step(int wanted) const;

  Trial attempt(const Interior& interior, int step, const std::vector<double>& weights);
  bool solve(Trial& trial, const CompactRows& A, int step,
             const std::vector<double>& weights) const;
  void measure(Trial& trial, const CompactRows& A, int step);
  void hold_ends(const KnotVector& knots, std::vector<double>& points) const;
  bool confirm(const Interior& interior);

  void weigh_knots();
  Interior with_required(Interior interior) const;
  Interior equal_shares(const std::vector<double>& share, int wanted) const;
  Interior heaviest(int wanted) const;
  void search_shares(const std::vector<double>& share);
  void search_heaviest();
  void search_ranks();
  bool improve(int fewer);
  void improve_while_it_pays();
  bool hopeless() const;
  DirectionResult unreduced() const;
  std::vector<double> largest_errors(const Interior& interior, int step) const;
  std::vector<double> moved_to_error(const std::vector<double>& share, const Interior& interior,
                                     std::vector<double> errors) const;
  std::vector<double> shares_of_best() const;

  const ReductionProblem& problem_;
  int p_;
  int n_;
  int stride_;
  std::vector<double> nodes_;   // Greville points of the original knots
  std::vector<double> values_;  // of the original there
  std::vector<double> norm_;    // weights of the discrete norm
  Interior interior_;           // the original interior knots
  std::vector<double> weight_;  // of each
  Interior required_;           // must stay
  std::vector<double> errors_;  // squared, at the nodes of the last trial
  int trials_ = 0;
  std::optional<Trial> best_;
  double best_bound_ = 0;
  std::vector<double> best_share_;  // the shares the best one was drawn from
};

Reducer::Reducer(const ReductionProblem& problem)
    : problem_(problem),
      p_(problem.knots.degree()),
      n_(problem.knots.control_point_count()),
      stride_(problem.stride),
      nodes_(problem.knots.greville()),
      values_(at(n_) * at(stride_)),
      norm_(at(n_)),
      errors_(at(n_)) {
  const KnotVector& U = problem.knots;
  for (double& node : nodes_) node = std::clamp(node, U.first(), U.last());
  collocation_matrix(U, nodes_).apply_blocks(problem.points, stride_, values_.data());
  for (int i = 0; i < n_; ++i) norm_[at(i)] = (U[i + p_ + 1] - U[i]) / (p_ + 1);
  for (const double t : U.knots()) {
    if (t > U.first() && t < U.last()) interior_.push_back(t);
  }
}

// While searching, every step-th node is enough for six of them a knot; 1 uses all.
int Reducer::sampling_step(int wanted) const {
  constexpr int kSamplesAKnot = 6;
  return std::clamp(n_ / (kSamplesAKnot * (wanted + p_ + 1)), 1, 16);
}

// The first `held` derivatives at a clamped end fix as many coefficients: a triangular system.
void Reducer::hold_ends(const KnotVector& knots, std::vector<double>& points) const {
  const auto hold = [&](double t, int held, bool first_end) {
    if (held == 0) return;
    const BasisValues old_basis = basis_at(problem_.knots, t, held - 1);
    const BasisValues new_basis = basis_at(knots, t, held - 1);
    std::vector<double> value(at(stride_));
    for (int r = 0; r < held; ++r) {
      std::fill(value.begin(), value.end(), 0.0);
      const auto add = [&](double factor, const double* block) {
        for (int c = 0; c < stride_; ++c) value[at(c)] += factor * block[c];
      };
      for (int j = 0; j <= p_; ++j) {
        add(old_basis.values(r, j),
            problem_.points + static_cast<std::ptrdiff_t>(old_basis.first + j) * stride_);
      }
      for (int k = 0; k < r; ++k) {
        const int j = first_end ? k : p_ - k;
        add(-new_basis.values(r, j),
            points.data() + static_cast<std::ptrdiff_t>(new_basis.first + j) * stride_);
      }
      const int j = first_end ? r : p_ - r;
      double* target = points.data() + static_cast<std::ptrdiff_t>(new_basis.first + j) * stride_;
      for (int c = 0; c < stride_; ++c) target[c] = value[at(c)] / new_basis.values(r, j);
    }
  };
  hold(knots.first(), problem_.held_first, true);
  hold(knots.last(), problem_.held_last, false);
}

bool Reducer::solve(Trial& trial, const CompactRows& A, int step,
                    const std::vector<double>& weights) const {
  const int m = A.columns();
  const int head = problem_.held_first;
  const int free = m - head - problem_.held_last;
  trial.points.assign(at(m) * at(stride_), 0.0);
  hold_ends(trial.knots, trial.points);
  if (free <= 0) return free == 0;
  BandedCholesky N(free, std::min(p_ + 1, free));
  double* right = trial.points.data() + static_cast<std::ptrdiff_t>(head) * stride_;
  std::vector<double> rest(at(stride_));
  for (int r = 0; r < A.rows(); ++r) {
    const double* a = A.row(r);
    const int first = A.first(r) - head;
    const int sample = std::min(r * step, n_ - 1);
    const double* value = values_.data() + static_cast<std::ptrdiff_t>(sample) * stride_;
    if (first < 0 || first + p_ >= free) {  // held control points go to the right-hand side
      std::copy_n(value, stride_, rest.data());
      for (int j = 0; j <= p_; ++j) {
        const int column = first + j;
        if (column >= 0 && column < free) continue;
        const double* block =
            trial.points.data() + static_cast<std::ptrdiff_t>(column + head) * stride_;
        for (int c = 0; c < stride_; ++c) rest[at(c)] -= a[j] * block[c];
      }
      value = rest.data();
    }
    const int low = std::max(0, -first);
    const int high = std::min(p_, free - 1 - first);
    for (int i = low; i <= high; ++i) {
      const double scaled = weights[at(sample)] * a[i];
      double* target = right + static_cast<std::ptrdiff_t>(first + i) * stride_;
      add_scaled(scaled, value, stride_, target);
      double* row = &N.at(first + i, first + i);  // (i, i), (i, i - 1), ...
      for (int j = low; j <= i; ++j) row[i - j] += scaled * a[j];
    }
  }
  if (N.factor() >= 0) return false;
  N.solve_blocks(right, stride_);
  return true;
}

// Least squares at every step-th node (the last one always), and the largest error at those.
Trial Reducer::attempt(const Interior& interior, int step, const std::vector<double>& weights) {
  ++trials_;
  const std::vector<double>& U = problem_.knots.knots();
  std::vector<double> flat(U.begin(), std::upper_bound(U.begin(), U.end(), problem_.knots.first()));
  flat.insert(flat.end(), interior.begin(), interior.end());
  flat.insert(flat.end(), std::lower_bound(U.begin(), U.end(), problem_.knots.last()), U.end());
  Result<KnotVector> knots = KnotVector::make(p_, std::move(flat));
  EXPECTS(knots.has_value());
  Trial trial{interior, std::move(*knots), {}, kInfinity};
  std::vector<double> parameters;
  for (int i = 0; i < n_ - 1 + step; i += step)
    parameters.push_back(nodes_[at(std::min(i, n_ - 1))]);
  const CompactRows A = collocation_matrix(trial.knots, parameters);
  if (solve(trial, A, step, weights)) measure(trial, A, step);
  return trial;
}

void Reducer::measure(Trial& trial, const CompactRows& A, int step) {
  std::vector<double> difference(at(A.rows()) * at(stride_));
  A.apply_blocks(trial.points.data(), stride_, difference.data());
  double largest = 0;
  for (int r = 0; r < A.rows(); ++r) {
    const int sample = std::min(r * step, n_ - 1);
    double* block = difference.data() + static_cast<std::ptrdiff_t>(r) * stride_;
    const double* value = values_.data() + static_cast<std::ptrdiff_t>(sample) * stride_;
    for (int c = 0; c < stride_; ++c) block[c] -= value[c];
    errors_[at(sample)] = largest_squared(block, stride_, problem_.group);
    largest = std::max(largest, errors_[at(sample)]);
  }
  trial.error = std::sqrt(largest);
}

// All samples, one step of weights towards the uniform norm if that is needed, then the bound.
bool Reducer::confirm(const Interior& interior) {
  std::vector<double> weights = norm_;
  for (int pass = 0; pass < 3; ++pass) {
    Trial trial = attempt(interior, 1, weights);
    if (trial.error <= problem_.tolerance) {
      const double bound =
          difference_bound(problem_.knots, problem_.points, trial.knots, trial.points.data(),
                           stride_, problem_.group, problem_.tolerance);
      if (bound <= problem_.tolerance) {
        best_ = std::move(trial);
        best_bound_ = bound;
        return true;
      }
    }
    if (problem_.polish == 0 || !(trial.error < 1.25 * problem_.tolerance)) return false;
    const double most = trial.error * trial.error;
    for (int i = 0; i < n_; ++i) weights[at(i)] *= 0.1 + errors_[at(i)] / most;
  }
  return false;
}

// A knot whose removal alone costs far more than the tolerance (2^degree covers the condition of
// the basis) stays, and so do those the caller wants.
void Reducer::weigh_knots() {
  weight_ = knot_weights(problem_.knots, problem_.points, stride_, problem_.group);
  const double heavy = std::ldexp(problem_.tolerance, p_);
  std::vector<char> stays(interior_.size(), 0);
  for (std::size_t k = 0; k < interior_.size(); ++k) stays[k] = weight_[k] > heavy;
  for (const Knot& kept : problem_.kept) {
    int left = kept.multiplicity;
    for (std::size_t k = 0; k < interior_.size() && left > 0; ++k) {
      if (interior_[k] != kept.value) continue;
      stays[k] = 1;
      --left;
    }
  }
  for (std::size_t k = 0; k < interior_.size(); ++k) {
    if (stays[k]) required_.push_back(interior_[k]);
  }
}

// The union with the required knots, each with the higher multiplicity.
Interior Reducer::with_required(Interior interior) const {
  Interior merged;
  std::set_union(interior.begin(), interior.end(), required_.begin(), required_.end(),
                 std::back_inserter(merged));
  return merged;
}

// `wanted` knots at equal shares of the sum. A knot that carries half a share or more is taken as
// it is, as often as its copies are hit; between lighter ones the place is free.
Interior Reducer::equal_shares(const std::vector<double>& share, int wanted) const {
  Interior chosen;
  const double total = std::accumulate(share.begin(), share.end(), 0.0);
  const double step = total / (wanted + 1);
  double before = 0;  // sum of the shares before `k`
  std::size_t k = 0;
  for (int i = 1; i <= wanted && k < share.size(); ++i) {
    const double target = step * i;
    while (k + 1 < share.size() && before + share[k] < target) before += share[k++];
    if (share[k] >= 0.5 * step) {
      chosen.push_back(interior_[k]);
      before += share[k++];
      continue;
    }
    // The share of knot k is spread over its cell, from midpoint to midpoint.
    const double low = k > 0 ? interior_[k - 1] : problem_.knots.first();
    const double high = k + 1 < interior_.size() ? interior_[k + 1] : problem_.knots.last();
    const double fraction = share[k] > 0 ? std::clamp((target - before) / share[k], 0.0, 1.0) : 0.5;
    const double from = 0.5 * (low + interior_[k]);
    const double to = 0.5 * (interior_[k] + high);
    const double t = from + fraction * (to - from);
    if (t > problem_.knots.first() && t < problem_.knots.last() &&
        (chosen.empty() || t > chosen.back())) {
      chosen.push_back(t);
    }
  }
  return with_required(std::move(chosen));
}

// The knots whose removal costs most.
Interior Reducer::heaviest(int wanted) const {
  std::vector<std::size_t> order(interior_.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return weight_[a] > weight_[b]; });
  Interior chosen;
  for (int k = 0; k < wanted; ++k) chosen.push_back(interior_[order[at(k)]]);
  std::sort(chosen.begin(), chosen.end());
  return with_required(std::move(chosen));
}

// Knots that carry nothing at all: what a refined spline is full of.
void Reducer::search_heaviest() {
  constexpr double kNothing = 1e-3;  // of the tolerance
  const auto carrying = std::count_if(weight_.begin(), weight_.end(),
                                      [&](double w) { return w > kNothing * problem_.tolerance; });
  if (carrying >= best_count() || carrying == interior_count()) return;
  const Interior chosen = heaviest(static_cast<int>(carrying));
  if (static_cast<int>(chosen.size()) < best_count() && confirm(chosen)) best_share_ = weight_;
}

// What is left where shares find nothing, for instance in noise at the size of the tolerance: ranks
// alone, by halving, unless nearly all knots are needed.
void Reducer::search_ranks() {
  int high = interior_count();
  int low = high / 2;
  for (int guess = high * 97 / 100; high - low > 1 + interior_count() / 100;
       guess = (low + high) / 2) {
    const Interior chosen = heaviest(guess);
    const bool does = static_cast<int>(chosen.size()) < best_count() && confirm(chosen);
    if (!does && high == interior_count()) return;
    (does ? high : low) = guess;
  }
}

// error(m) falls like m^-(p+1): a few steps of that law bracket the least m that will do.
void Reducer::search_shares(const std::vector<double>& share) {
  int low = static_cast<int>(required_.size()) - 1;  // does not do
  int high = best_count();
  int guess = std::clamp(high / 8, low + 1, std::max(high - 1, low + 1));
  std::vector<Interior> good;  // the last one is the smallest
  bool tried_most = false;
  while (high - low > 1 + high / 100) {
    guess = std::clamp(guess, low + 1, high - 1);
    // If nine knots of ten will not do there is nothing worth having.
    const bool hopeless_check = !tried_most && good.empty() && guess > interior_count() / 2;
    if (hopeless_check) {
      guess = std::max(guess, interior_count() * 9 / 10);
      tried_most = true;
    }
    Interior chosen = equal_shares(share, guess);
    const Trial trial = attempt(chosen, sampling_step(guess), norm_);
    const bool does =
        trial.error <= problem_.tolerance && static_cast<int>(chosen.size()) < best_count();
    if (!does && hopeless_check) return;
    const double ratio = std::max(trial.error / problem_.tolerance, 1e-12);
    const double law = (guess + p_ + 1) * std::pow(ratio, 1.0 / (p_ + 1)) - (p_ + 1);
    const int next = static_cast<int>(std::ceil(std::min(law, 1.0 * interior_count())));
    if (does) {
      high = guess;
      good.push_back(std::move(chosen));
      guess = std::min(next, guess - 1);
      if (guess <= low) guess = (low + high) / 2;
    } else {
      low = guess;
      guess = std::max(next, guess + 1);
      if (guess >= high) guess = (low + high) / 2;
    }
  }
  if (good.empty()) return;
  const int start = static_cast<int>(good.back().size());
  for (int extra = 0; start + extra < best_count() && extra <= start; extra = 2 * extra + 1) {
    if (confirm(equal_shares(share, start + extra))) {
      best_share_ = share;
      return;
    }
  }
}

// The squared largest error of the last trial in each span of its knots.
std::vector<double> Reducer::largest_errors(const Interior& interior, int step) const {
  std::vector<double> errors(interior.size() + 1, 0.0);
  std::size_t cell = 0;
  for (int i = 0; i < n_ - 1 + step; i += step) {
    const int sample = std::min(i, n_ - 1);
    while (cell < interior.size() && interior[cell] <= nodes_[at(sample)]) ++cell;
    errors[cell] = std::max(errors[cell], errors_[at(sample)]);
  }
  return errors;
}

// Where the error is large the share of knots grows by a root of it.
std::vector<double> Reducer::moved_to_error(const std::vector<double>& share,
                                            const Interior& interior,
                                            std::vector<double> errors) const {
  const double most = *std::max_element(errors.begin(), errors.end());
  if (!(most > 0)) return share;
  for (double& e : errors) e = std::pow(std::max(e / most, 1e-8), 0.25 / (p_ + 1));
  std::vector<double> result = share;
  std::size_t cell = 0;
  for (std::size_t k = 0; k < interior_.size(); ++k) {
    while (cell < interior.size() && interior[cell] <= interior_[k]) ++cell;
    result[k] *= errors[cell];
  }
  return result;
}

// The shares that the best spline so far, which has lost the noise, gives to the original knots:
// each of its knots carries one, half of it to either side, spread evenly.
std::vector<double> Reducer::shares_of_best() const {
  const KnotVector& knots = best_->knots;
  std::vector<double> own = knot_weights(knots, best_->points.data(), stride_, problem_.group);
  for (double& s : own) s = std::pow(s / problem_.tolerance, 1.0 / (p_ + 1));
  std::vector<double> breaks{knots.first()};
  std::vector<double> mass{0.0};
  for (std::size_t k = 0; k < own.size(); ++k) {
    if (best_->interior[k] != breaks.back()) {
      breaks.push_back(best_->interior[k]);
      mass.push_back(0.0);
    }
    mass[mass.size() - 2] += 0.5 * own[k];
    mass.back() += 0.5 * own[k];
  }
  mass.front() *= 2;  // the end spans have a knot on one side only
  mass.back() *= 2;
  breaks.push_back(knots.last());
  std::vector<double> share(interior_.size());
  std::size_t span = 0;
  for (std::size_t k = 0; k < share.size(); ++k) {
    while (span + 1 < mass.size() && breaks[span + 1] <= interior_[k]) ++span;
    const double low = k > 0 ? interior_[k - 1] : knots.first();
    const double high = k + 1 < share.size() ? interior_[k + 1] : knots.last();
    share[k] = mass[span] / (breaks[span + 1] - breaks[span]) * 0.5 * (high - low);
  }
  return share;
}

// Moves knots to the error a few times, and confirms what comes near.
bool Reducer::improve(int fewer) {
  const int wanted = best_count() - fewer;
  if (wanted < static_cast<int>(required_.size())) return false;
  constexpr double kUneven = 9.0;  // squared ratio of the largest error to the median over spans
  const int step = sampling_step(wanted);
  std::vector<double> current = best_share_;
  std::vector<double> nearest_share;
  Interior nearest;
  double least = kInfinity;
  int moves = problem_.polish;
  for (int move = 0; move <= moves; ++move) {
    const Interior chosen = equal_shares(current, wanted);
    if (static_cast<int>(chosen.size()) > wanted) return false;
    const Trial trial = attempt(chosen, step, norm_);
    if (trial.error < least) {
      least = trial.error;
      nearest = chosen;
      nearest_share = current;
    }
    if (least <= problem_.tolerance) break;
    std::vector<double> errors = largest_errors(chosen, step);
    if (move == 0) {
      // Even errors far above the tolerance are not moved away; uneven ones take a few more moves.
      std::vector<double> sorted = errors;
      const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
      std::nth_element(sorted.begin(), middle, sorted.end());
      const bool uneven = trial.error * trial.error > kUneven * *middle;
      if (!uneven && least > 2.5 * problem_.tolerance) break;
      if (uneven) moves = 2 * problem_.polish + 2;
    }
    current = moved_to_error(current, chosen, std::move(errors));
  }
  if (least > 1.1 * problem_.tolerance || !confirm(nearest)) return false;
  best_share_ = std::move(nearest_share);
  return true;
}

// Fewer and fewer knots in growing steps, then in steps of one.
void Reducer::improve_while_it_pays() {
  constexpr int kMostTrials = 60;
  const int last = trials_ + kMostTrials;
  for (int fewer = 1; trials_ < last;) {
    if (improve(fewer)) {
      fewer *= 2;
    } else if (fewer > 1) {
      fewer = 1;
    } else {
      return;
    }
  }
}

// Half of all knots cost several tolerances each to remove: noise above the tolerance.
bool Reducer::hopeless() const {
  constexpr double kSeveral = 4.0;
  std::vector<double> sorted = weight_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return !best_ && *middle > kSeveral * problem_.tolerance;
}

DirectionResult Reducer::unreduced() const {
  const std::size_t size = at(n_) * at(stride_);
  return {problem_.knots, std::vector<double>(problem_.points, problem_.points + size), 0, trials_};
}

DirectionResult Reducer::run() {
  if (interior_count() > 0) {
    weigh_knots();
    search_heaviest();
    std::vector<double> share = weight_;
    for (double& s : share) s = std::pow(s / problem_.tolerance, 1.0 / (p_ + 1));
    if (hopeless()) return unreduced();
    search_shares(share);
    if (!best_) search_ranks();
    if (best_ && !best_share_.empty() && problem_.polish > 0) {
      if (!best_->interior.empty()) search_shares(shares_of_best());
      improve_while_it_pays();
    }
  }
  if (!best_) return unreduced();
  return {std::move(best_->knots), std::move(best_->points), best_bound_, trials_};
}

std::optional<DirectionResult> Reducer::fit(const Interior& interior) {
  if (!confirm(interior)) return std::nullopt;
  return DirectionResult{std::move(best_->knots), std::move(best_->points), best_bound_, trials_};
}

}  // namespace

DirectionResult reduce_direction(const ReductionProblem& problem) { return Reducer(problem).run(); }

std::optional<DirectionResult> fit_direction(const ReductionProblem& problem,
                                             const std::vector<double>& interior) {
  return Reducer(problem).fit(interior);
}

double difference_bound(const KnotVector& a_knots, const double* a, const KnotVector& b_knots,
                        const double* b, int stride, int group, double enough) {
  const KnotVector both = merged_knots(a_knots, b_knots);
  std::vector<double> difference(at(both.control_point_count()) * at(stride));
  std::vector<double> other(difference.size());
  refinement_matrix(a_knots, both).apply_blocks(a, stride, difference.data());
  refinement_matrix(b_knots, both).apply_blocks(b, stride, other.data());
  for (std::size_t k = 0; k < difference.size(); ++k) difference[k] -= other[k];
  const double bound = largest_norm(difference, stride, group);
  if (bound <= enough) return bound;
  std::vector<int> beyond;
  for (int i = 0; i < both.control_point_count(); ++i) {
    if (largest_squared(difference.data() + static_cast<std::ptrdiff_t>(i) * stride, stride,
                        group) > enough * enough) {
      beyond.push_back(i);
    }
  }
  const KnotVector fine = quartered(both, beyond);
  std::vector<double> finer(at(fine.control_point_count()) * at(stride));
  refinement_matrix(both, fine).apply_blocks(difference.data(), stride, finer.data());
  return std::min(bound, largest_norm(finer, stride, group));
}

std::optional<Error> reduction_option_error(const KnotVector& knots, double tolerance,
                                            int held_first, int held_last) {
  const auto error = [](std::string what, std::string value, std::string rule) {
    return Error{ErrorKind::kBadInput, std::move(what), "data reduction", std::move(value),
                 std::move(rule)};
  };
  if (!(tolerance > 0) || !std::isfinite(tolerance)) {
    return error("tolerance is not positive", std::to_string(tolerance), "must be above 0");
  }
  const int most = knots.order() / 2;
  if (held_first < 0 || held_last < 0 || held_first > most || held_last > most) {
    return error("wrong number of held derivatives",
                 std::to_string(held_first) + " and " + std::to_string(held_last),
                 "0 to half the order, " + std::to_string(most) + ", at each end");
  }
  const bool clamped_first = knots.knots().front() == knots.first();
  const bool clamped_last = knots.knots().back() == knots.last();
  if ((held_first > 0 && !clamped_first) || (held_last > 0 && !clamped_last)) {
    return error("an end is held on floating knots", {}, "clamp the ends, or hold nothing there");
  }
  return std::nullopt;
}

}  // namespace angiospline
