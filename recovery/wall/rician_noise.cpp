#include "recovery/wall/rician_noise.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/contract.h"
#include "recovery/wall/rules.h"

namespace angiospline {
namespace {

using namespace wall_rules;

// exp(-x) I_n(x), n = 0 or 1.
double scaled_bessel(int n, double x) { return std::exp(-x) * std::cyl_bessel_i(n, x); }

// Mean and standard deviation.
struct Moments {
  double mean = 0.0;
  double deviation = 0.0;
};

Moments moments(const std::vector<double>& values) {
  Moments m;
  const auto count = static_cast<double>(values.size());
  for (const double v : values) m.mean += v / count;
  double squares = 0;
  for (const double v : values) squares += (v - m.mean) * (v - m.mean) / count;
  m.deviation = std::sqrt(squares);
  return m;
}

double log_normal_density(double value, double mean, double sigma) {
  const double t = (value - mean) / sigma;
  return -0.5 * t * t - std::log(sigma * std::sqrt(2 * std::numbers::pi));
}

// x / s^2 exp(-(x - A)^2 / (2 s^2)) exp(-z) I0(z), z = x A / s^2.
double log_rician_density(double value, double amplitude, double sigma) {
  const double x = value / sigma, a = amplitude / sigma, z = x * a;
  const double bessel = z < 100 ? std::log(scaled_bessel(0, z))
                                : -0.5 * std::log(2 * std::numbers::pi * z) + 1 / (8 * z);
  return std::log(std::max(x, kLeastGrey) / sigma) - 0.5 * (x - a) * (x - a) + bessel;
}

template <class Density>
double log_likelihood(const std::vector<double>& values, const Density& density) {
  double sum = 0;
  for (const double v : values) sum += density(v);
  return sum;
}

// At most so many values, evenly spread: more say nothing new.
std::vector<double> thinned(const std::vector<double>& values) {
  const std::size_t step = 1 + values.size() / kMostGreys;
  std::vector<double> some;
  for (std::size_t k = 0; k < values.size(); k += step) some.push_back(values[k]);
  return some;
}

// The argument of the largest value, to 1e-4 of the interval, by golden section.
template <class Function>
double best_between(double low, double high, const Function& value) {
  const double golden = (std::sqrt(5.0) - 1) / 2, exact = 1e-4 * (high - low);
  double a = high - golden * (high - low), b = low + golden * (high - low);
  double at_a = value(a), at_b = value(b);
  while (high - low > exact) {
    if (at_a < at_b) {
      low = a, a = b, at_a = at_b;
      b = low + golden * (high - low), at_b = value(b);
    } else {
      high = b, b = a, at_b = at_a;
      a = high - golden * (high - low), at_a = value(a);
    }
  }
  return (low + high) / 2;
}

}  // namespace

double rician_mean(double amplitude, double sigma) {
  EXPECTS(amplitude >= 0 && sigma > 0);
  const double a = amplitude / sigma;
  if (a > kFarAmplitude) return amplitude + sigma * (1 / (2 * a) + 1 / (8 * a * a * a));
  const double x = a * a / 4;
  return sigma * std::sqrt(std::numbers::pi / 2) *
         ((1 + 2 * x) * scaled_bessel(0, x) + 2 * x * scaled_bessel(1, x));
}

double rician_deviation(double amplitude, double sigma) {
  const double a = amplitude / sigma;
  if (a > kFarAmplitude) return sigma * std::sqrt(1 - 1 / (2 * a * a));
  const double mean = rician_mean(a, 1);
  return sigma * std::sqrt(a * a + 2 - mean * mean);
}

double rician_amplitude(double mean, double sigma) {
  if (mean <= rician_mean(0, sigma)) return 0;
  double low = 0, high = mean;  // the mean lies above the amplitude
  for (int k = 0; k < 60; ++k) {
    const double middle = (low + high) / 2;
    (rician_mean(middle, sigma) < mean ? low : high) = middle;
  }
  return (low + high) / 2;
}

NoiseVerdict noise_of(const std::vector<double>& all_inside,
                      const std::vector<double>& all_outside) {
  NoiseVerdict verdict;
  if (all_inside.size() < kFewestGreys || all_outside.size() < kFewestGreys) return verdict;

  const std::vector<double> inside = thinned(all_inside), outside = thinned(all_outside);
  const Moments in = moments(inside), out = moments(outside);
  const auto n = static_cast<double>(inside.size()), m = static_cast<double>(outside.size());
  const double common =
      std::sqrt((n * in.deviation * in.deviation + m * out.deviation * out.deviation) / (n + m));
  verdict.sigma = common;
  const bool positive = *std::min_element(inside.begin(), inside.end()) >= 0 &&
                        *std::min_element(outside.begin(), outside.end()) >= 0;
  if (!positive || !(in.deviation > 0) || !(out.deviation > 0)) return verdict;

  // White, one deviation for both, or one each.
  const auto white = [](const std::vector<double>& values, double mean, double sigma) {
    return log_likelihood(values, [&](double v) { return log_normal_density(v, mean, sigma); });
  };
  const double one = white(inside, in.mean, common) + white(outside, out.mean, common);
  const double each =
      white(inside, in.mean, in.deviation) + white(outside, out.mean, out.deviation);

  const auto rician = [&](double sigma) {
    const auto of = [sigma](const std::vector<double>& values, double mean) {
      const double amplitude = rician_amplitude(mean, sigma);
      return log_likelihood(values,
                            [&](double v) { return log_rician_density(v, amplitude, sigma); });
    };
    return of(inside, in.mean) + of(outside, out.mean);
  };

  // Rician, one sigma for both: sought about the deviation inside, where noise is nearly white.
  const double sigma = best_between(0.7 * in.deviation, 1.5 * in.deviation, rician);
  verdict.evidence = rician(sigma) - std::max(one, each);
  if (verdict.evidence >= kLeastLogLikelihood) {
    verdict.kind = NoiseKind::kRician;
    verdict.sigma = sigma;
  }
  return verdict;
}

}  // namespace angiospline
