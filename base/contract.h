// EXPECTS(condition): a caller's bug ends the program with the place and the broken condition.
// It stays on in release builds; bad data is never reported this way (see base/result.h).
#pragma once

namespace angiospline {

[[noreturn]] void contract_violation(const char* condition, const char* file, int line) noexcept;

}  // namespace angiospline

#define EXPECTS(condition)            \
  ((condition) ? static_cast<void>(0) \
               : ::angiospline::contract_violation(#condition, __FILE__, __LINE__))
