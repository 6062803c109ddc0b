// Text for formats that insist on an encoding.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace angiospline {

// `text` with every byte that is not part of well-formed UTF-8 replaced by U+FFFD.
std::string valid_utf8(std::string_view text);

// A word for formats whose names are single words (OpenFOAM, SimVascular, STL): letters, digits,
// '_', '-' and '.' are kept, anything else becomes '_'; never empty, never starting with a digit,
// '-' or '.'.
std::string word(std::string_view text);

// Bytes as text (RFC 4648, section 4): four digits for three bytes, padded with `=`, no line ends.
std::string base64(std::string_view bytes);

// The bytes from the front of `text`, blanks skipped; padding ends a group and the next goes on, as
// VTK writes header and data. Stops at the first other character or when `most` bytes are there.
std::string base64_decoded(std::string_view text, std::size_t most);

}  // namespace angiospline
