#include "base/result.h"

#include <algorithm>

namespace angiospline {

std::string Error::message() const {
  std::string text = where.empty() ? what : where + ": " + what;
  if (!value.empty()) text += ": " + value;
  if (!rule.empty()) text += " (" + rule + ")";
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c == '\n' || c == '\r' || c == '\t'; }, ' ');
  return text;
}

}  // namespace angiospline
