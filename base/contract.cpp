#include "base/contract.h"

#include <cstdio>
#include <cstdlib>

namespace angiospline {

void contract_violation(const char* condition, const char* file, int line) noexcept {
  std::fprintf(stderr, "angiospline: contract violated at %s:%d: %s\n", file, line, condition);
  std::abort();
}

}  // namespace angiospline
