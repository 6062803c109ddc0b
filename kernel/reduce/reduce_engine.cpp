#include "kernel/reduce/reduce_engine.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>

#include "base/index.h"
#include "kernel/reduce/reduce.h"

namespace angiospline {
namespace {

constexpr int kMostPasses = 3;  // least squares over the same knots, with new weights

// The best so far and the ways to better ones.
class Reducer {
 public:
  explicit Reducer(const ReductionProblem& problem);
  DirectionResult run();
  std::optional<DirectionResult> fit(const Interior& interior);

 private:
  int interior_count() const { return static_cast<int>(interior_.size()); }
  int best_count() const {
    return best_ ? static_cast<int>(best_->trial.interior.size()) : interior_count();
  }
  int sampling_step(int wanted) const;
  int search_passes() const;
  int resolution(int count) const;
  Trial attempt(const Interior& interior, int step);
  bool confirm(Trial trial) { return confirm(std::move(trial), search_passes()); }
  bool confirm(Trial trial, int passes);
  bool confirm(const Interior& interior);
  DirectionResult result();

  void weigh_knots();
  Interior with_required(Interior interior) const;
  Interior equal_shares(const std::vector<double>& share, int wanted) const;
  Interior heaviest(int wanted) const;
  std::optional<Trial> least_by_shares(const std::vector<double>& share, int guess);
  void search_shares(const std::vector<double>& share, int guess);
  void search_heaviest();
  void search_ranks();
  bool improve(int fewer);
  void improve_while_it_pays();
  bool hopeless() const;
  std::vector<double> largest_errors(const Trial& trial) const;
  std::vector<double> moved_to_error(const std::vector<double>& share, const Trial& trial) const;
  std::vector<double> shares_of_best() const;

  const ReductionProblem& problem_;
  int p_;
  TrialSolver solver_;
  Interior interior_;           // the original interior knots
  std::vector<double> weight_;  // of each
  Interior required_;           // must stay
  std::optional<TrialSolver::Confirmed> best_;
  std::vector<double> best_share_;  // the shares the best one was drawn from
  Interior refused_;                // what was tried last and could not be confirmed
  int refused_passes_ = 0;          // after so many passes; 0: there was none
  double optimism_ = 1;  // how much larger the error at all samples was than at some of them
};

Reducer::Reducer(const ReductionProblem& problem)
    : problem_(problem), p_(problem.knots.degree()), solver_(problem) {
  for (const double t : problem.knots.knots()) {
    if (t > problem.knots.first() && t < problem.knots.last()) interior_.push_back(t);
  }
}

// While searching, every step-th sample is enough for about five of them a knot; 1 uses all.
int Reducer::sampling_step(int wanted) const {
  constexpr double kSamplesAKnot = 5;
  const double samples = static_cast<double>(solver_.nodes().size());
  return std::clamp(static_cast<int>(std::lround(samples / (kSamplesAKnot * (wanted + p_ + 1)))), 1,
                    16);
}

// Counts nearer than this are not told apart: one in a hundred, or, where noise decides, in thirty.
int Reducer::resolution(int count) const { return 1 + count / (solver_.dense(count) ? 30 : 100); }

Trial Reducer::attempt(const Interior& interior, int step) {
  return solver_.attempt(interior, step, solver_.norm());
}

// New weights are for polishing, but few knots are cheap.
int Reducer::search_passes() const {
  constexpr int kFew = 64;
  return interior_count() > kFew || problem_.polish == 0 ? 1 : kMostPasses;
}

// Makes the trial the best if all samples and then the proof agree.
bool Reducer::confirm(Trial trial, int passes) {
  if (trial.interior == refused_ && passes <= refused_passes_) return false;
  if (trial.step != 1) {
    const double seen = trial.error;
    trial = attempt(trial.interior, 1);
    if (seen > 0) optimism_ = std::max(optimism_, trial.error / seen);
  }
  Interior interior = trial.interior;
  if (auto confirmed = solver_.confirm(std::move(trial), passes)) {
    best_ = std::move(confirmed);
    return true;
  }
  refused_ = std::move(interior);
  refused_passes_ = passes;
  return false;
}

bool Reducer::confirm(const Interior& interior) {
  if (interior == refused_ && refused_passes_ > 0) return false;
  return confirm(attempt(interior, 1));
}

DirectionResult Reducer::result() {
  if (best_) {
    return {std::move(best_->trial.knots), std::move(best_->trial.points), best_->bound,
            solver_.trials()};
  }
  const std::size_t size = index(problem_.knots.control_point_count()) * index(problem_.stride);
  return {problem_.knots, std::vector<double>(problem_.points, problem_.points + size), 0,
          solver_.trials()};
}

// A knot whose removal alone costs far more than the tolerance (2^degree covers the condition of
// the basis) stays, and so do those the caller wants.
void Reducer::weigh_knots() {
  weight_ = knot_weights(problem_.knots, problem_.points, problem_.stride, problem_.group);
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
  for (int k = 0; k < wanted; ++k) chosen.push_back(interior_[order[index(k)]]);
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
  const int count = static_cast<int>(chosen.size());
  if (count >= best_count()) return;
  Trial trial = attempt(chosen, sampling_step(count));
  if (trial.error <= problem_.tolerance && confirm(std::move(trial))) best_share_ = weight_;
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

// The smallest trial that does, at the samples used, of those drawn from these shares. error(m)
// falls like m^-(p+1): a few steps of that law bracket the least m. Where noise hides the law,
// halving does.
std::optional<Trial> Reducer::least_by_shares(const std::vector<double>& share, int guess) {
  struct Point {
    int count;
    double error;  // in tolerances
  };
  int low = static_cast<int>(required_.size()) - 1;  // does not do
  int high = best_count();
  std::optional<Trial> least;
  std::optional<Point> before;
  bool tried_most = best_.has_value();

  while (high - low > resolution(high)) {
    guess = std::clamp(guess, low + 1, high - 1);
    // If nine knots of ten will not do there is nothing worth having.
    const bool most = !tried_most && !least && guess > interior_count() / 2;
    if (most) {
      guess = std::max(guess, interior_count() * 9 / 10);
      tried_most = true;
    }
    Trial trial = attempt(equal_shares(share, guess), sampling_step(guess));
    const Point now{guess, std::max(trial.error / problem_.tolerance, 1e-12)};
    const bool does = now.error <= 1 && static_cast<int>(trial.interior.size()) < best_count();
    if (!does && most) return std::nullopt;
    (does ? high : low) = guess;
    if (does) least = std::move(trial);

    // The law: error goes like count^-(p + 1), from this trial and, where there is one, the last.
    const double by_law =
        before ? (p_ + 1) * std::log((before->count + p_ + 1.0) / (now.count + p_ + 1.0)) : 0.0;
    const double seen = before ? std::log(now.error / before->error) : 0.0;
    const bool lawful = std::abs(by_law) < 0.1 || seen / by_law > 0.5;
    const double law = (guess + p_ + 1) * std::pow(now.error, 1.0 / (p_ + 1)) - (p_ + 1);
    const int next = static_cast<int>(std::ceil(std::min(law, 1.0 * interior_count())));

    guess = does ? std::min(next, guess - 1) : std::max(next, guess + 1);
    if (!lawful || guess <= low || guess >= high) guess = (low + high) / 2;
    before = now;
  }
  return least;
}

void Reducer::search_shares(const std::vector<double>& share, int guess) {
  std::optional<Trial> least = least_by_shares(share, guess);
  if (!least) return;
  const int start = static_cast<int>(least->interior.size());
  bool found = confirm(std::move(*least));
  for (int extra = resolution(start); !found && start + extra < best_count() && extra <= start;
       extra = 2 * extra + 1) {
    found = confirm(equal_shares(share, start + extra));
  }
  if (found) best_share_ = share;
}

// The squared largest error of a trial in each span of its knots.
std::vector<double> Reducer::largest_errors(const Trial& trial) const {
  std::vector<double> errors(trial.interior.size() + 1, 0.0);
  std::size_t cell = 0;
  for (std::size_t i = 0; i < trial.errors.size(); ++i) {
    while (cell < trial.interior.size() && trial.interior[cell] <= solver_.nodes()[i]) ++cell;
    errors[cell] = std::max(errors[cell], trial.errors[i]);
  }
  return errors;
}

// Where the error is large the share of knots grows by a root of it.
std::vector<double> Reducer::moved_to_error(const std::vector<double>& share,
                                            const Trial& trial) const {
  std::vector<double> errors = largest_errors(trial);
  const double most = *std::max_element(errors.begin(), errors.end());
  if (!(most > 0)) return share;
  for (double& e : errors) e = std::pow(std::max(e / most, 1e-8), 0.25 / (p_ + 1));
  std::vector<double> result = share;
  std::size_t cell = 0;
  for (std::size_t k = 0; k < interior_.size(); ++k) {
    while (cell < trial.interior.size() && trial.interior[cell] <= interior_[k]) ++cell;
    result[k] *= errors[cell];
  }
  return result;
}

// The shares that the best spline so far, which has lost the noise, gives to the original knots:
// each of its knots carries one, half of it to either side, spread evenly.
std::vector<double> Reducer::shares_of_best() const {
  const KnotVector& knots = best_->trial.knots;
  std::vector<double> own =
      knot_weights(knots, best_->trial.points.data(), problem_.stride, problem_.group);
  for (double& s : own) s = std::pow(s / problem_.tolerance, 1.0 / (p_ + 1));

  // The mass of each span: half of either knot at its ends.
  std::vector<double> breaks{knots.first()};
  std::vector<double> mass{0.0};
  for (std::size_t k = 0; k < own.size(); ++k) {
    if (best_->trial.interior[k] != breaks.back()) {
      breaks.push_back(best_->trial.interior[k]);
      mass.push_back(0.0);
    }
    mass[mass.size() - 2] += 0.5 * own[k];
    mass.back() += 0.5 * own[k];
  }
  mass.front() *= 2;  // the end spans have a knot on one side only
  mass.back() *= 2;
  breaks.push_back(knots.last());

  // The original knots share it by the length of their cells.
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
  constexpr double kUneven = 9.0;   // squared ratio of the largest error to the median over spans
  constexpr double kFar = 2.5;      // tolerances that even errors are not moved away from
  constexpr double kInReach = 1.1;  // tolerances that new weights may gain
  const int step = sampling_step(wanted);

  std::vector<double> current = best_share_;
  std::vector<double> nearest_share;
  std::optional<Trial> nearest;
  int moves = problem_.polish;
  for (int move = 0; move <= moves; ++move) {
    const Interior chosen = equal_shares(current, wanted);
    if (static_cast<int>(chosen.size()) > wanted) return false;
    Trial trial = attempt(chosen, step);

    // The first trial says whether moving knots can help: not where errors are even already and far
    // too large.
    if (move == 0) {
      std::vector<double> sorted = largest_errors(trial);
      const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
      std::nth_element(sorted.begin(), middle, sorted.end());
      const bool uneven = trial.error * trial.error > kUneven * *middle;
      if (!uneven && trial.error > kFar * problem_.tolerance) return false;
      if (uneven) moves = 2 * problem_.polish + 2;
    }

    std::vector<double> next = moved_to_error(current, trial);
    const double gain = nearest ? trial.error / nearest->error : 1.0;
    if (!nearest || gain < 1) {
      nearest = std::move(trial);
      nearest_share = std::move(current);
    }

    const double likely = step == 1 ? nearest->error : optimism_ * nearest->error;
    if (likely <= problem_.tolerance &&
        (nearest->interior != refused_ || refused_passes_ < kMostPasses)) {
      break;
    }
    // No further than the last gain, repeated, would bring it within reach.
    const double hoped = likely * std::pow(std::min(gain, 1.0), moves - move);
    if (move > 0 && hoped > kInReach * problem_.tolerance) return false;
    current = std::move(next);
  }

  if (!nearest || nearest->error > kInReach * problem_.tolerance ||
      !confirm(std::move(*nearest), kMostPasses)) {
    return false;
  }
  best_share_ = std::move(nearest_share);
  return true;
}

// Fewer and fewer knots in growing steps, then in steps of one: about three eighths as much work
// again as the search took, and as much again for every step of more than one that succeeds.
void Reducer::improve_while_it_pays() {
  const long allowance = solver_.work() * 3 / 8;
  long enough = solver_.work() + allowance;
  for (int fewer = 1; solver_.work() < enough;) {
    if (improve(fewer)) {
      if (fewer > 1) enough = solver_.work() + allowance;
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

DirectionResult Reducer::run() {
  if (interior_count() == 0) return result();
  weigh_knots();
  search_heaviest();
  if (hopeless()) return result();
  std::vector<double> share = weight_;
  for (double& s : share) s = std::pow(s / problem_.tolerance, 1.0 / (p_ + 1));
  // What smooth curves of any tolerance need, measured; noise makes more of it.
  constexpr double kKnotsAShare = 0.38;
  const double total = std::accumulate(share.begin(), share.end(), 0.0);
  search_shares(share, static_cast<int>(std::min(kKnotsAShare * total, best_count() / 8.0)));
  if (!best_) search_ranks();
  if (best_ && !best_share_.empty() && problem_.polish > 0 && !solver_.dense(best_count())) {
    if (best_count() > 0) search_shares(shares_of_best(), best_count() - 1);
    improve_while_it_pays();
  }
  return result();
}

std::optional<DirectionResult> Reducer::fit(const Interior& interior) {
  if (!confirm(interior)) return std::nullopt;
  return result();
}

// Of a spline with very many knots, which is smooth on the scale of four of them, a copy with every
// fourth knot, within a hundredth of the tolerance: the work is then linear in the knots with a
// small factor, and weights are not lost in rounding (a knot's weight is its span to the power of
// the order). Multiple knots and those the caller wants stay.
std::optional<DirectionResult> coarsened(const ReductionProblem& problem) {
  constexpr std::size_t kMany = 2000;
  constexpr double kShare = 0.01;  // of the tolerance
  const std::vector<double>& U = problem.knots.knots();
  Interior all(std::upper_bound(U.begin(), U.end(), problem.knots.first()),
               std::lower_bound(U.begin(), U.end(), problem.knots.last()));
  if (all.size() <= kMany) return std::nullopt;

  Interior chosen;
  for (std::size_t k = 0; k < all.size(); ++k) {
    const bool multiple =
        (k > 0 && all[k - 1] == all[k]) || (k + 1 < all.size() && all[k + 1] == all[k]);
    const bool wanted = std::any_of(problem.kept.begin(), problem.kept.end(),
                                    [&](const Knot& kept) { return kept.value == all[k]; });
    if (multiple || wanted || k % 4 == 3) chosen.push_back(all[k]);
  }

  if (2 * chosen.size() > all.size()) return std::nullopt;
  ReductionProblem strict = problem;
  strict.tolerance = kShare * problem.tolerance;
  return fit_direction(strict, chosen);
}

ReductionProblem with_knots_of(const ReductionProblem& problem, const DirectionResult& coarse) {
  return {.knots = coarse.knots,
          .points = coarse.points.data(),
          .stride = problem.stride,
          .group = problem.group,
          .tolerance = problem.tolerance - coarse.error_bound,
          .held_first = problem.held_first,
          .held_last = problem.held_last,
          .kept = problem.kept,
          .polish = problem.polish,
          .closed = problem.closed,
          .proof = problem.proof};
}

}  // namespace

DirectionResult reduce_direction(const ReductionProblem& problem) {
  const std::optional<DirectionResult> coarse = coarsened(problem);
  if (!coarse) return Reducer(problem).run();
  ReductionProblem smaller = with_knots_of(problem, *coarse);
  DirectionResult result = reduce_direction(smaller);
  result.error_bound += coarse->error_bound;
  result.trials += coarse->trials;
  return result;
}

std::optional<DirectionResult> fit_direction(const ReductionProblem& problem,
                                             const Interior& interior) {
  return Reducer(problem).fit(interior);
}

}  // namespace angiospline
