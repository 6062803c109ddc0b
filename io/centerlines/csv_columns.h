// Which column of a table of points holds what.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.h"

namespace angiospline {

inline constexpr int kNoColumn = -1;

struct CsvColumns {
  std::size_t count = 0;  // of all columns
  std::array<int, 3> xyz = {kNoColumn, kNoColumn, kNoColumn};
  int radius = kNoColumn;
  int id = kNoColumn;
  int parent = kNoColumn;
  int branch = kNoColumn;
  int inlet = kNoColumn;
  int unnamed = kNoColumn;  // of a table without a header: the parent or the branch
  bool diameters = false;   // `radius` is a column of diameters
  std::string unit;         // of positions and radii, as the header writes it; may be empty
};

// By the names in a header line, whatever their case, underscores, and a unit behind them ("Pos_X
// [mm]", "radius_um"). A radius is taken before a diameter; columns of other names are passed over.
// Errors, at `line` of `file`: two columns of one meaning; no x, y, z or radius.
Result<CsvColumns> columns_by_name(const std::vector<std::string_view>& header,
                                   std::string_view file, int line);

// Without a header: x, y, z, radius and perhaps one more. Error: another number of columns.
Result<CsvColumns> columns_by_order(std::size_t count, std::string_view file, int line);

}  // namespace angiospline
