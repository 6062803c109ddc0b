// DICOM by hand, for tests of reading it.
#pragma once

#include <cmath>
#include <cstring>
#include <string>

namespace angiospline::test {

// One slice in explicit little-endian DICOM.
inline std::string dicom_slice(double z_mm, const std::string& series, int rows = 4,
                               double slope = 1) {
  const auto element = [](int group, int tag, const char* vr, std::string value) {
    if (value.size() % 2) value.push_back(std::strcmp(vr, "UI") == 0 ? '\0' : ' ');
    std::string e;
    const auto put16 = [&](std::size_t v) {
      e.push_back(static_cast<char>(v & 255));
      e.push_back(static_cast<char>(v >> 8 & 255));
    };
    put16(static_cast<std::size_t>(group));
    put16(static_cast<std::size_t>(tag));
    e += vr;
    const bool wide = std::strcmp(vr, "OW") == 0 || std::strcmp(vr, "OB") == 0;
    if (wide) put16(0);
    put16(value.size() & 65535);
    if (wide) put16(value.size() >> 16);
    return e + value;
  };
  const auto us = [](int v) {
    return std::string{static_cast<char>(v & 255), static_cast<char>(v >> 8)};
  };
  const std::string instance = series + "." + std::to_string(static_cast<int>(z_mm * 100) + 10000);
  const std::string meta = element(2, 1, "OB", std::string("\0\1", 2)) +
                           element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.4") +
                           element(2, 3, "UI", instance) +
                           element(2, 0x10, "UI", "1.2.840.10008.1.2.1");
  std::string length(4, '\0');
  length[0] = static_cast<char>(meta.size() & 255);
  length[1] = static_cast<char>(meta.size() >> 8);
  std::string out = std::string(128, '\0') + "DICM" + element(2, 0, "UL", length) + meta;
  out += element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.4") + element(8, 0x18, "UI", instance) +
         element(8, 0x60, "CS", "MR") + element(0x20, 0xd, "UI", "1.2.3") +
         element(0x20, 0xe, "UI", series) +
         element(0x20, 0x32, "DS", "10\\20\\" + std::to_string(z_mm)) +
         element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0") + element(0x28, 2, "US", us(1)) +
         element(0x28, 4, "CS", "MONOCHROME2") + element(0x28, 0x10, "US", us(rows)) +
         element(0x28, 0x11, "US", us(5)) + element(0x28, 0x30, "DS", "0.5\\0.25") +
         element(0x28, 0x100, "US", us(16)) + element(0x28, 0x101, "US", us(16)) +
         element(0x28, 0x102, "US", us(15)) + element(0x28, 0x103, "US", us(0)) +
         element(0x28, 0x1052, "DS", "0") + element(0x28, 0x1053, "DS", std::to_string(slope));
  std::string pixels;
  for (int i = 0; i < rows * 5; ++i) pixels += us(static_cast<int>(std::lround(z_mm * 10)) + i);
  return out + element(0x7fe0, 0x10, "OW", pixels);
}

}  // namespace angiospline::test
