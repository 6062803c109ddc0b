// Failure as a value: Result<T> holds a T or an Error that names what, where, which value and which
// rule.
#pragma once

#include <string>

#include <tl/expected.hpp>

namespace angiospline {

enum class ErrorKind {
  kBadInput,     // the data or the request is wrong: exit code 2
  kCannotWrite,  // a result could not be written: exit code 2
  kFailed,       // the input is sound but this library could not do it: exit code 1
  kCancelled,    // the caller asked to stop: exit code 130
};

// One failure, for one line of text. Empty parts are left out of the message.
struct Error {
  ErrorKind kind = ErrorKind::kBadInput;
  std::string what;   // "radius is negative"
  std::string where;  // "tree.swc:12", "junction_7", "seed 3"
  std::string value;  // "-0.5"
  std::string rule;   // "radii must be positive"

  // "tree.swc:12: radius is negative: -0.5 (radii must be positive)"; always a single line.
  std::string message() const;
};

template <typename T>
using Result = tl::expected<T, Error>;

// Shorthand for `return fail({...});` in a function that returns a Result.
inline tl::unexpected<Error> fail(Error error) { return tl::unexpected<Error>(std::move(error)); }

}  // namespace angiospline
