#include "base/random.h"

#include <cmath>

#include "base/contract.h"

namespace angiospline {

std::uint64_t Random::bits() {
  std::uint64_t z = (state_ += 0x9e3779b97f4a7c15ULL);
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
  return z ^ (z >> 31);
}

double Random::uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }

double Random::uniform(double low, double high) { return low + (high - low) * uniform(); }

int Random::below(int count) {
  EXPECTS(count > 0);
  return static_cast<int>(uniform() * count);
}

double Random::gaussian() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  double x = 0, y = 0, s = 0;
  do {
    x = uniform(-1, 1);
    y = uniform(-1, 1);
    s = x * x + y * y;
  } while (s >= 1 || s == 0);
  const double factor = std::sqrt(-2 * std::log(s) / s);
  spare_ = y * factor;
  has_spare_ = true;
  return x * factor;
}

}  // namespace angiospline
