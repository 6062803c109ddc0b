// Repeatable random numbers: the same seed gives the same numbers on every machine and compiler.
#pragma once

#include <cstdint>

namespace angiospline {

// SplitMix64 (Steele, Lea, Flood 2014): 64 bits of state, period 2^64. Not for cryptography.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t bits();
  double uniform();                         // in [0, 1)
  double uniform(double low, double high);  // in [low, high)
  int below(int count);                     // in {0, ..., count - 1}; count > 0
  double gaussian();  // mean 0, standard deviation 1 (Marsaglia's polar method)

 private:
  std::uint64_t state_;
  double spare_ = 0.0;
  bool has_spare_ = false;
};

}  // namespace angiospline
