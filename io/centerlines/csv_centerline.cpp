#include "io/centerlines/csv_centerline.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

#include <fmt/format.h>

#include "base/index.h"
#include "io/centerlines/csv_columns.h"
#include "io/reading/graph_builder.h"
#include "io/text/text_file.h"

namespace angiospline {
namespace {

constexpr int kNoParent = -1;

bool is_yes(std::string_view field) {
  const std::string text = lower_case(field);
  return text == "1" || text == "true" || text == "yes" || text == "inlet";
}

struct Row {
  int line;
  std::string key;  // the parent or the branch, as written
};

class CsvReader {
 public:
  CsvReader(std::string_view text, std::string_view name)
      : lines_(text), name_(name), builder_(name) {}

  Result<CenterlineTree> read(const CenterlineFileOptions& options) {
    if (auto read = read_rows(); !read) return fail(read.error());
    if (columns_.unnamed != kNoColumn) {
      if (auto told = tell_unnamed_column(); !told) return fail(told.error());
    }
    if (columns_.parent != kNoColumn) {
      if (auto linked = link_parents(); !linked) return fail(linked.error());
    } else {
      link_lines();
    }
    if (comma_decimals_) note("numbers: written with decimal commas");
    return builder_.finish(options);
  }

 private:
  void note(std::string text) { builder_.facts.notes.push_back(std::move(text)); }

  Result<void> read_rows() {
    bool first = true;
    while (const auto line = lines_.next()) {
      const std::string_view content = trimmed(line->substr(0, line->find('#')));
      if (content.empty()) continue;

      if (first) separator_ = separator_of(content);
      split_fields(content, separator_, fields_);
      if (std::exchange(first, false)) {
        const Result<bool> is_header = find_columns();
        if (!is_header) return fail(is_header.error());
        if (*is_header) continue;
      }
      if (auto added = add_row(); !added) return added;
    }
    if (rows_.empty()) return builder_.bad_file("holds no point", "a row is: x, y, z, radius");
    return {};
  }

  // From the first line; whether that is a header: one without a number.
  Result<bool> find_columns() {
    const bool is_header = std::none_of(fields_.begin(), fields_.end(), [&](std::string_view f) {
      return parse_number(number_text(f)).has_value();
    });
    Result<CsvColumns> columns = is_header ? columns_by_name(fields_, name_, lines_.line())
                                           : columns_by_order(fields_.size(), name_, lines_.line());
    if (!columns) return fail(columns.error());
    columns_ = *std::move(columns);

    if (!is_header) note("columns: x, y, z, radius, as there is no header line");
    if (const Result<double> mm = parse_unit_mm(columns_.unit); mm && !columns_.unit.empty()) {
      builder_.facts.state_unit(*mm, columns_.unit);
    }
    builder_.facts.has_diameters = columns_.diameters;
    return is_header;
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
    if (fields_.size() < columns_.count) {
      return builder_.bad("the row is cut short", line, fmt::format("{} values", fields_.size()),
                          fmt::format("every row has {}", columns_.count));
    }

    const auto field = [&](int column) { return fields_[index(column)]; };
    const Result<Vec3> position = parse_position(
        [&](int k) { return number_text(field(columns_.xyz[index(k)])); }, name_, line);
    if (!position) return fail(position.error());
    const Result<double> r = parse_radius(number_text(field(columns_.radius)), name_, line);
    if (!r) return fail(r.error());
    std::string id = columns_.id == kNoColumn ? std::to_string(rows_.size() + 1)
                                              : std::string(field(columns_.id));
    const int point = builder_.add_point({std::move(id), *position, *r}, line);

    if (columns_.inlet != kNoColumn && is_yes(field(columns_.inlet))) {
      builder_.graph.roots.push_back(point);
    }
    const int key = columns_.parent != kNoColumn   ? columns_.parent
                    : columns_.branch != kNoColumn ? columns_.branch
                                                   : columns_.unnamed;
    rows_.push_back({line, key == kNoColumn ? std::string() : std::string(field(key))});
    return {};
  }

  // Without a header: a -1 is a parent; equal values in one run each are branches.
  Result<void> tell_unnamed_column() {
    const bool has_root = std::any_of(rows_.begin(), rows_.end(),
                                      [](const Row& r) { return parse_whole_number(r.key) == -1; });
    if (has_root) {
      columns_.parent = columns_.unnamed;
      note("fifth column: the parent, as it holds a -1");
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
      columns_.branch = columns_.unnamed;
      note("fifth column: the branch, as equal values follow each other");
      return {};
    }
    return builder_.bad("the fifth column cannot be told", rows_.front().line,
                        fmt::format("'{}'", quoted_value(rows_.front().key)),
                        "give a header line that calls it parent or branch");
  }

  Result<void> link_parents() {
    const bool has_ids = columns_.id != kNoColumn;
    for (int i = 0; has_ids && i < builder_.point_count(); ++i) {
      if (auto unique = builder_.register_id(i, "the id is used twice"); !unique) return unique;
    }
    const Result<int> base = has_ids ? Result<int>(0) : row_base();
    if (!base) return fail(base.error());

    std::vector<int> parent_of(rows_.size(), kNoParent);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const int here = static_cast<int>(i);
      const std::string& key = rows_[i].key;
      const auto number = parse_whole_number(key);
      int parent = kNoParent;
      if (has_ids) {
        parent = builder_.find(key).value_or(kNoParent);
      } else if (number && *number >= *base &&
                 *number - *base < static_cast<long long>(rows_.size())) {
        parent = static_cast<int>(*number - *base);
      }

      // A 0 stands for "no parent" only where no point is called so.
      const bool is_root = key.empty() || number == -1 || number == 0;
      if (parent != kNoParent) {
        parent_of[i] = parent;
        builder_.graph.edges.emplace_back(parent, here);
      } else if (is_root) {
        builder_.graph.roots.push_back(here);
      } else {
        return builder_.missing_parent(
            here, key,
            has_ids ? "a parent is the id of a row, or -1" : "a parent is a row's number, or -1");
      }
    }
    return builder_.check_parents(parent_of);
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

    // Where both are possible a 0 speaks for counting from 0, where it is a row and not a missing
    // parent.
    if (zero_after_start && possible[0]) possible[1] = false;
    if (possible[0] == possible[1]) {
      return builder_.bad_file("the rows' numbering cannot be told",
                               "parents count rows from 0 or from 1; add an id column");
    }
    note(possible[0] ? "parents: rows counted from 0" : "parents: rows counted from 1");
    return possible[0] ? 0 : 1;
  }

  struct Line {
    int number;
    int points;
    int last;
  };
  using Lines = std::map<std::string_view, Line>;

  void link_lines() {
    PointGraph& graph = builder_.graph;
    Lines open;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const int row = static_cast<int>(i);
      const int next = static_cast<int>(open.size());
      const auto [found, is_new] = open.try_emplace(rows_[i].key, Line{next, 0, row});
      Line& line = found->second;
      if (is_new) {
        graph.line_names.push_back(rows_[i].key);
      } else {
        graph.edges.emplace_back(line.last, row);
        graph.line_of_edge.push_back(line.number);
      }
      line.last = row;
      ++line.points;
      if (columns_.branch != kNoColumn && columns_.id == kNoColumn) {
        graph.points[i].name = fmt::format("{}_{}", rows_[i].key, line.points);
      }
    }

    if (graph.roots.empty()) graph.roots.push_back(0);
    if (columns_.branch == kNoColumn) {
      note("rows: one line, as there is neither a parent nor a branch column");
      return;
    }
    note(fmt::format("{} lines, joined where they share a position", open.size()));
    if (columns_.id == kNoColumn) name_ends(open);
  }

  // Ends have names that stay when points are added.
  void name_ends(const Lines& open) {
    std::vector<GraphPoint>& points = builder_.graph.points;
    for (const auto& [key, line] : open) {
      if (line.points > 1) points[index(line.last)].name = std::string(key) + "_end";
    }
    std::vector<bool> begun(open.size(), false);
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const Line& line = open.find(rows_[i].key)->second;
      if (!begun[index(line.number)]) points[i].name = rows_[i].key + "_start";
      begun[index(line.number)] = true;
    }
  }

  LineReader lines_;
  std::string_view name_;
  char separator_ = ',';
  CsvColumns columns_;
  bool comma_decimals_ = false;
  std::vector<std::string_view> fields_;
  std::string buffer_;
  std::vector<Row> rows_;
  GraphBuilder builder_;
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
