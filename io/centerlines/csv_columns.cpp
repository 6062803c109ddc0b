#include "io/centerlines/csv_columns.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "base/index.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

enum class Role { kX, kY, kZ, kRadius, kDiameter, kId, kParent, kBranch, kInlet };

struct ColumnName {
  std::string_view name;
  Role role;
};

constexpr std::array kColumnNames = {ColumnName{"x", Role::kX},
                                     ColumnName{"posx", Role::kX},
                                     ColumnName{"px", Role::kX},
                                     ColumnName{"points:0", Role::kX},
                                     ColumnName{"y", Role::kY},
                                     ColumnName{"posy", Role::kY},
                                     ColumnName{"py", Role::kY},
                                     ColumnName{"points:1", Role::kY},
                                     ColumnName{"z", Role::kZ},
                                     ColumnName{"posz", Role::kZ},
                                     ColumnName{"pz", Role::kZ},
                                     ColumnName{"points:2", Role::kZ},
                                     ColumnName{"r", Role::kRadius},
                                     ColumnName{"radius", Role::kRadius},
                                     ColumnName{"radii", Role::kRadius},
                                     ColumnName{"maximuminscribedsphereradius", Role::kRadius},
                                     ColumnName{"d", Role::kDiameter},
                                     ColumnName{"diameter", Role::kDiameter},
                                     ColumnName{"diam", Role::kDiameter},
                                     ColumnName{"id", Role::kId},
                                     ColumnName{"n", Role::kId},
                                     ColumnName{"node", Role::kId},
                                     ColumnName{"nodeid", Role::kId},
                                     ColumnName{"pointid", Role::kId},
                                     ColumnName{"parent", Role::kParent},
                                     ColumnName{"parentid", Role::kParent},
                                     ColumnName{"pid", Role::kParent},
                                     ColumnName{"branch", Role::kBranch},
                                     ColumnName{"branchid", Role::kBranch},
                                     ColumnName{"line", Role::kBranch},
                                     ColumnName{"lineid", Role::kBranch},
                                     ColumnName{"edge", Role::kBranch},
                                     ColumnName{"edgeid", Role::kBranch},
                                     ColumnName{"segment", Role::kBranch},
                                     ColumnName{"vessel", Role::kBranch},
                                     ColumnName{"inlet", Role::kInlet}};

struct ColumnTitle {
  std::string name;
  std::string unit;
};

// "Pos_X [mm]" -> "posx" and the unit "mm".
ColumnTitle title_of(std::string_view field) {
  const std::string lower = lower_case(field);
  std::string_view name = lower;
  std::string_view unit;
  const std::size_t bracket = name.find_first_of("[(");
  if (bracket != std::string_view::npos) {
    const std::size_t end = name.find_first_of("])", bracket);
    unit = name.substr(bracket + 1, end == std::string_view::npos ? end : end - bracket - 1);
    name = name.substr(0, bracket);
  }
  for (const std::string_view suffix : {"_mm", "_um", "_cm", "_m"}) {
    if (name.size() <= suffix.size() || !name.ends_with(suffix)) continue;
    unit = suffix.substr(1);
    name.remove_suffix(suffix.size());
    break;
  }

  ColumnTitle title{std::string(name), std::string(unit)};
  std::erase_if(title.name, [](char c) { return c == ' ' || c == '_' || c == '-' || c == '.'; });
  return title;
}

int& column_of(CsvColumns& columns, Role role) {
  switch (role) {
    case Role::kX:
    case Role::kY:
    case Role::kZ:
      return columns.xyz[static_cast<std::size_t>(role)];
    case Role::kRadius:
    case Role::kDiameter:
      return columns.radius;
    case Role::kId:
      return columns.id;
    case Role::kParent:
      return columns.parent;
    case Role::kBranch:
      return columns.branch;
    case Role::kInlet:
      break;
  }
  return columns.inlet;
}

tl::unexpected<Error> bad(std::string what, std::string_view file, int line, std::string value,
                          std::string rule) {
  return fail({ErrorKind::kBadInput, std::move(what), at_line(file, line), std::move(value),
               std::move(rule)});
}

}  // namespace

Result<CsvColumns> columns_by_name(const std::vector<std::string_view>& header,
                                   std::string_view file, int line) {
  CsvColumns columns;
  columns.count = header.size();
  for (std::size_t c = 0; c < header.size(); ++c) {
    const ColumnTitle title = title_of(header[c]);
    const auto known = std::find_if(kColumnNames.begin(), kColumnNames.end(),
                                    [&](const ColumnName& k) { return k.name == title.name; });
    if (known == kColumnNames.end()) continue;

    // A radius beats a diameter; any other column named twice cannot be told.
    const Role role = known->role;
    int& column = column_of(columns, role);
    const bool is_taken = column != kNoColumn;
    if (!is_taken || role != Role::kDiameter) {
      const bool replaces_diameter = role == Role::kRadius && columns.diameters;
      if (is_taken && !replaces_diameter) {
        return bad("two columns have the same meaning", file, line,
                   fmt::format("'{}'", quoted_value(header[c])), "each column has its own name");
      }
      column = static_cast<int>(c);
      if (role == Role::kRadius || role == Role::kDiameter)
        columns.diameters = role == Role::kDiameter;
    }

    // Only lengths have a unit that matters here: those of x, y, z and the radius.
    if (role <= Role::kDiameter && !title.unit.empty()) columns.unit = title.unit;
  }

  const bool has_points = std::all_of(columns.xyz.begin(), columns.xyz.end(),
                                      [](int column) { return column != kNoColumn; });
  if (!has_points || columns.radius == kNoColumn) {
    return bad("the header line names no x, y, z and radius", file, line,
               fmt::format("'{}'", quoted_value(header.empty() ? "" : header[0])),
               "columns are called x, y, z, radius (or diameter), id, parent, branch");
  }
  return columns;
}

Result<CsvColumns> columns_by_order(std::size_t count, std::string_view file, int line) {
  if (count != 4 && count != 5) {
    return bad("the columns cannot be told", file, line, fmt::format("{} columns", count),
               "without a header line a row is x, y, z, radius and perhaps a parent or branch");
  }
  CsvColumns columns;
  columns.count = count;
  columns.xyz = {0, 1, 2};
  columns.radius = 3;
  if (count == 5) columns.unnamed = 4;
  return columns;
}

}  // namespace angiospline
