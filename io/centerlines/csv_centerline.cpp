#include "io/centerlines/csv_centerline.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include <fmt/format.h>

#include "base/index.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

constexpr int kNone = -1;

// Which column holds what; kNone where there is none.
struct Columns {
  std::array<int, 3> xyz = {kNone, kNone, kNone};
  int radius = kNone;
  int id = kNone;
  int parent = kNone;
  int branch = kNone;
  int inlet = kNone;
  bool diameters = false;
};

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

// "Pos_X [mm]" -> "posx" and the unit "mm".
std::string plain_column_name(std::string_view field, std::string& unit) {
  std::string name = lower_case(field);
  const std::size_t bracket = name.find_first_of("[(");
  if (bracket != std::string::npos) {
    const std::size_t end = name.find_first_of("])", bracket);
    unit = name.substr(bracket + 1, end == std::string::npos ? end : end - bracket - 1);
    name.resize(bracket);
  }
  for (const std::string_view suffix : {"_mm", "_um", "_cm", "_m"}) {
    if (name.size() <= suffix.size() || !name.ends_with(suffix)) continue;
    unit = std::string(suffix.substr(1));
    name.resize(name.size() - suffix.size());
    break;
  }
  std::erase_if(name, [](char c) { return c == ' ' || c == '_' || c == '-' || c == '.'; });
  return name;
}

tl::unexpected<Error> bad(std::string what, std::string where, std::string value,
                          std::string rule) {
  return fail(
      {ErrorKind::kBadInput, std::move(what), std::move(where), std::move(value), std::move(rule)});
}

bool is_yes(std::string_view field) {
  const std::string text = lower_case(field);
  return text == "1" || text == "true" || text == "yes" || text == "inlet";
}

char separator_of(std::string_view line) {
  for (const char c : {';', '\t', ','}) {
    if (line.find(c) != std::string_view::npos) return c;
  }
  return ' ';
}

struct Row {
  int line;
  std::string key;  // the parent or the branch, as written
};

class CsvReader {
 public:
  CsvReader(std::string_view text, std::string_view name) : lines_(text), name_(name) {}

  Result<CenterlineTree> read(const CenterlineFileOptions& options) {
    if (auto read = read_rows(); !read) return fail(read.error());
    if (columns_.parent == kNone && columns_.branch == kNone && fifth_ != kNone) {
      if (auto told = tell_fifth_column(); !told) return fail(told.error());
    }
    if (columns_.parent != kNone) {
      if (auto linked = link_parents(); !linked) return fail(linked.error());
    } else {
      link_lines();
    }
    if (comma_decimals_) facts_.notes.push_back("numbers: written with decimal commas");
    return finish_tree(std::move(graph_), facts_, name_, options);
  }

 private:
  std::string here() const { return at_line(name_, lines_.line()); }

  Result<void> read_rows() {
    bool first = true;
    while (const auto line = lines_.next()) {
      const std::string_view content = trimmed(line->substr(0, line->find('#')));
      if (content.empty()) continue;
      if (first) {
        separator_ = separator_of(content);
        split_fields(content, separator_, fields_);
        first = false;
        bool is_header = false;
        if (auto found = find_columns(is_header); !found) return found;
        if (is_header) continue;
      }
      split_fields(content, separator_, fields_);
      if (auto added = add_row(); !added) return added;
    }
    if (rows_.empty()) {
      return bad("holds no point", std::string(name_), {}, "a row is: x, y, z, radius");
    }
    return {};
  }

  Result<void> find_columns(bool& is_header) {
    is_header = std::none_of(fields_.begin(), fields_.end(), [&](std::string_view f) {
      return parse_number(number_text(f)).has_value();
    });
    column_count_ = fields_.size();
    if (!is_header) {
      if (fields_.size() != 4 && fields_.size() != 5) {
        return bad("the columns cannot be told", here(), fmt::format("{} columns", fields_.size()),
                   "without a header line a row is x, y, z, radius and perhaps a parent or branch");
      }
      columns_.xyz = {0, 1, 2};
      columns_.radius = 3;
      fifth_ = fields_.size() == 5 ? 4 : kNone;
      facts_.notes.push_back("columns: x, y, z, radius, as there is no header line");
      return {};
    }
    std::string unit;
    for (std::size_t c = 0; c < fields_.size(); ++c) {
      std::string column_unit;
      const std::string name = plain_column_name(fields_[c], column_unit);
      const auto known = std::find_if(kColumnNames.begin(), kColumnNames.end(),
                                      [&](const ColumnName& k) { return k.name == name; });
      if (known == kColumnNames.end()) continue;
      if (auto set = set_column(known->role, static_cast<int>(c)); !set) return set;
      if (known->role <= Role::kDiameter && !column_unit.empty()) unit = column_unit;
    }
    if (columns_.xyz[0] < 0 || columns_.xyz[1] < 0 || columns_.xyz[2] < 0 || columns_.radius < 0) {
      return bad("the header line names no x, y, z and radius", here(),
                 fmt::format("'{}'", quoted_value(fields_.empty() ? "" : fields_[0])),
                 "columns are called x, y, z, radius (or diameter), id, parent, branch");
    }
    if (const Result<double> mm = parse_unit_mm(unit); mm && !unit.empty()) {
      facts_.unit_mm = *mm;
      facts_.unit_name = unit;
      facts_.unit_stated = true;
    }
    facts_.has_diameters = columns_.diameters;
    return {};
  }

  Result<void> set_column(Role role, int c) {
    int* column = nullptr;
    if (role <= Role::kZ) column = &columns_.xyz[static_cast<std::size_t>(role)];
    if (role == Role::kRadius || role == Role::kDiameter) column = &columns_.radius;
    if (role == Role::kId) column = &columns_.id;
    if (role == Role::kParent) column = &columns_.parent;
    if (role == Role::kBranch) column = &columns_.branch;
    if (role == Role::kInlet) column = &columns_.inlet;
    // A radius beats a diameter; any other column named twice cannot be told.
    if (role == Role::kDiameter && *column != kNone) return {};
    const bool replaces_diameter = role == Role::kRadius && columns_.diameters;
    if (*column != kNone && !replaces_diameter) {
      return bad("two columns have the same meaning", here(),
                 fmt::format("'{}'", quoted_value(fields_[index(c)])),
                 "each column has its own name");
    }
    *column = c;
    if (role == Role::kRadius || role == Role::kDiameter)
      columns_.diameters = role == Role::kDiameter;
    return {};
  }

  // A field as a number's text: the decimal comma of many countries where the separator allows it.
  std::string_view number_text(std::string_view field) {
    if (separator_ == ',' || field.find(',') == std::string_view::npos) return field;
    if (field.find('.') != std::string_view::npos) return field;
    comma_decimals_ = true;
    buffer_.assign(field);
    std::replace(buffer_.begin(), buffer_.end(), ',', '.');
    return buffer_;
  }

  Result<void> add_row() {
    const int line = lines_.line();
    if (fields_.size() < column_count_) {
      return bad("the row is cut short", here(), fmt::format("{} values", fields_.size()),
                 fmt::format("every row has {}", column_count_));
    }
    GraphPoint point;
    for (int k = 0; k < 3; ++k) {
      const std::string_view field = fields_[index(columns_.xyz[index(k)])];
      const Result<double> x = parse_coordinate(number_text(field), name_, line);
      if (!x) return fail(x.error());
      point.position_mm(k) = *x;
    }
    const Result<double> r =
        parse_radius(number_text(fields_[index(columns_.radius)]), name_, line);
    if (!r) return fail(r.error());
    point.radius_mm = *r;
    point.name = columns_.id == kNone ? std::to_string(rows_.size() + 1)
                                      : std::string(fields_[index(columns_.id)]);
    const int key = columns_.parent != kNone   ? columns_.parent
                    : columns_.branch != kNone ? columns_.branch
                                               : fifth_;
    if (columns_.inlet != kNone && is_yes(fields_[index(columns_.inlet)])) {
      graph_.roots.push_back(static_cast<int>(rows_.size()));
    }
    rows_.push_back({line, key == kNone ? std::string() : std::string(fields_[index(key)])});
    graph_.points.push_back(std::move(point));
    return {};
  }

  // Without a header: a -1 is a parent; equal values in one run each are branches.
  Result<void> tell_fifth_column() {
    const bool has_root = std::any_of(rows_.begin(), rows_.end(),
                                      [](const Row& r) { return parse_whole_number(r.key) == -1; });
    if (has_root) {
      columns_.parent = fifth_;
      facts_.notes.push_back("fifth column: the parent, as it holds a -1");
      return {};
    }
    std::set<std::string_view> seen;
    std::size_t runs = 0;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (i > 0 && rows_[i].key == rows_[i - 1].key) continue;
      ++runs;
      seen.insert(rows_[i].key);
    }
    if (seen.size() == runs && 2 * runs <= rows_.size()) {
      columns_.branch = fifth_;
      facts_.notes.push_back("fifth column: the branch, as equal values follow each other");
      return {};
    }
    return bad("the fifth column cannot be told", at_line(name_, rows_.front().line),
               fmt::format("'{}'", quoted_value(rows_.front().key)),
               "give a header line that calls it parent or branch");
  }

  Result<void> link_parents() {
    std::map<std::string_view, int> row_of;
    const bool has_ids = columns_.id != kNone;
    for (std::size_t i = 0; has_ids && i < rows_.size(); ++i) {
      if (row_of.emplace(graph_.points[i].name, static_cast<int>(i)).second) continue;
      return bad("the id is used twice", at_line(name_, rows_[i].line),
                 quoted_value(graph_.points[i].name), "ids are unique");
    }
    Result<int> base = has_ids ? Result<int>(0) : row_base();
    if (!base) return fail(base.error());
    std::vector<int> parent_of(rows_.size(), kNone);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Row& row = rows_[i];
      const auto number = parse_whole_number(row.key);
      const bool is_root = row.key.empty() || number == -1;
      int parent = kNone;
      if (has_ids) {
        const auto found = row_of.find(row.key);
        if (found != row_of.end()) parent = found->second;
      } else if (number && *number >= *base &&
                 *number - *base < static_cast<long long>(rows_.size())) {
        parent = static_cast<int>(*number - *base);
      }
      if (parent == kNone && (is_root || number == 0)) {
        graph_.roots.push_back(static_cast<int>(i));
        continue;
      }
      if (parent == kNone) {
        return bad(
            "the parent does not exist", at_line(name_, row.line), quoted_value(row.key),
            has_ids ? "a parent is the id of a row, or -1" : "a parent is a row's number, or -1");
      }
      parent_of[i] = parent;
      graph_.edges.emplace_back(parent, static_cast<int>(i));
    }
    return check_cycles(parent_of);
  }

  // Rows counted from 0 or 1: the one under which no row is its own parent and every parent exists.
  Result<int> row_base() {
    bool possible[2] = {true, true};
    bool zero_after_start = false;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const auto number = parse_whole_number(rows_[i].key);
      if (!number || *number < 0) continue;
      for (const int base : {0, 1}) {
        const long long row = *number - base;
        if (row == static_cast<long long>(i) || row >= static_cast<long long>(rows_.size())) {
          possible[base] = false;
        }
      }
      zero_after_start = zero_after_start || *number == 0;
    }
    if (zero_after_start && possible[0]) possible[1] = false;
    if (possible[0] == possible[1]) {
      return bad("the rows' numbering cannot be told", std::string(name_), {},
                 "parents count rows from 0 or from 1; add an id column");
    }
    facts_.notes.push_back(possible[0] ? "parents: rows counted from 0"
                                       : "parents: rows counted from 1");
    return possible[0] ? 0 : 1;
  }

  Result<void> check_cycles(const std::vector<int>& parent_of) const {
    std::vector<int> walk(rows_.size(), kNone);
    for (std::size_t start = 0; start < rows_.size(); ++start) {
      int p = static_cast<int>(start);
      while (p >= 0 && walk[index(p)] < 0) {
        walk[index(p)] = static_cast<int>(start);
        p = parent_of[index(p)];
      }
      if (p < 0 || walk[index(p)] != static_cast<int>(start)) continue;
      return bad("the point is its own ancestor", at_line(name_, rows_[index(p)].line),
                 quoted_value(graph_.points[index(p)].name),
                 "parents lead to a root, without a cycle");
    }
    return {};
  }

  void link_lines() {
    struct Line {
      int number;
      int points;
      int last;
    };
    std::map<std::string_view, Line> open;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const int row = static_cast<int>(i);
      const int next = static_cast<int>(open.size());
      const auto [found, is_new] = open.try_emplace(rows_[i].key, Line{next, 0, row});
      Line& line = found->second;
      if (is_new) graph_.line_names.push_back(rows_[i].key);
      if (!is_new) {
        graph_.edges.emplace_back(line.last, row);
        graph_.line_of_edge.push_back(line.number);
      }
      line.last = row;
      ++line.points;
      if (columns_.branch != kNone && columns_.id == kNone) {
        graph_.points[i].name = fmt::format("{}_{}", rows_[i].key, line.points);
      }
    }
    if (graph_.roots.empty()) graph_.roots.push_back(0);
    if (columns_.branch == kNone) {
      facts_.notes.push_back("rows: one line, as there is neither a parent nor a branch column");
      return;
    }
    facts_.notes.push_back(
        fmt::format("{} lines, joined where they share a position", open.size()));
    if (columns_.id != kNone) return;
    for (const auto& [key, line] : open) {  // ends have names that stay when points are added
      if (line.points > 1) graph_.points[index(line.last)].name = std::string(key) + "_end";
    }
    std::vector<bool> begun(open.size(), false);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Line& line = open.find(rows_[i].key)->second;
      if (!begun[index(line.number)]) graph_.points[i].name = rows_[i].key + "_start";
      begun[index(line.number)] = true;
    }
  }

  LineReader lines_;
  std::string_view name_;
  char separator_ = ',';
  std::size_t column_count_ = 0;
  Columns columns_;
  int fifth_ = kNone;
  bool comma_decimals_ = false;
  std::vector<std::string_view> fields_;
  std::string buffer_;
  std::vector<Row> rows_;
  PointGraph graph_;
  FileFacts facts_;
};

}  // namespace

Result<CenterlineTree> parse_csv_centerline(std::string_view text, std::string_view name,
                                            const CenterlineFileOptions& options) {
  const Result<std::string_view> plain = plain_text(text, name);
  if (!plain) return fail(plain.error());
  return CsvReader(*plain, name).read(options);
}

std::string csv_text(const CenterlineTree& tree) {
  std::string text = "branch,x_mm,y_mm,z_mm,radius_mm,inlet\n";
  std::vector<bool> is_inlet(tree.nodes.size(), false);
  for (const int n : tree.inlets) is_inlet[index(n)] = true;
  for (const CenterlineBranch& branch : tree.branches) {
    const Eigen::Index last = branch.points_mm.cols() - 1;
    for (Eigen::Index i = 0; i <= last; ++i) {
      const Vec3 p = branch.points_mm.col(i);
      const bool inlet =
          (i == 0 && is_inlet[index(branch.from)]) || (i == last && is_inlet[index(branch.to)]);
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{},{}\n", branch.name, p.x(), p.y(),
                     p.z(), branch.radii_mm(i), inlet ? 1 : 0);
    }
  }
  return text;
}

}  // namespace angiospline
