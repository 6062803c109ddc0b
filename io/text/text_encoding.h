// Text for formats that insist on an encoding.
#pragma once

#include <string>
#include <string_view>

namespace angiospline {

// `text` with every byte that is not part of well-formed UTF-8 replaced by U+FFFD.
std::string valid_utf8(std::string_view text);

// A word for formats whose names are single words (OpenFOAM, SimVascular, STL): letters, digits,
// '_', '-' and '.' are kept, anything else becomes '_'; never empty, never starting with a digit,
// '-' or '.'.
std::string word(std::string_view text);

}  // namespace angiospline
