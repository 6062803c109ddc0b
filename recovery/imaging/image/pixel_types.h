// The pixel types of AnyImage, for templates that are compiled in their own file. Not installed.
#pragma once

#include <cstdint>

// do_for(T) for each of them.
#define ANGIOSPLINE_FOR_PIXEL_TYPES(do_for)                                           \
  do_for(std::uint8_t) do_for(std::int8_t) do_for(std::uint16_t) do_for(std::int16_t) \
      do_for(std::uint32_t) do_for(std::int32_t) do_for(float) do_for(double)
