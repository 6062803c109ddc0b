#include "io/meshes/stl_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <iterator>
#include <numeric>

#include <Eigen/Geometry>
#include <fmt/format.h>

#include "base/atomic_file.h"
#include "base/contract.h"
#include "io/text/text_encoding.h"

namespace angiospline {
namespace {

constexpr std::string_view kHeader = "angiospline binary STL, millimetres, attribute = part";
constexpr std::size_t kHeaderSize = 80;
constexpr std::size_t kFacetSize = 50;

struct Solid {
  std::string name;
  std::vector<int> triangles;
};

std::vector<Solid> solids_of(const TriangleMesh& mesh, StlGrouping grouping) {
  std::vector<Solid> solids;
  std::vector<std::size_t> solid_of;
  if (grouping == StlGrouping::kFlow) solids.push_back({"wall", {}});
  for (const MeshPart& part : mesh.parts) {
    if (grouping == StlGrouping::kFlow && is_wall(part.kind)) {
      solid_of.push_back(0);
      continue;
    }
    solid_of.push_back(solids.size());
    solids.push_back({word(part.name), {}});
  }

  for (int t = 0; t < mesh.triangles.cols(); ++t) {
    const auto part = static_cast<std::size_t>(mesh.part_of[static_cast<std::size_t>(t)]);
    solids[solid_of[part]].triangles.push_back(t);
  }
  return solids;
}

Vec3 unit_normal(const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 n = (b - a).cross(c - a);
  return n.squaredNorm() > 0 ? Vec3(n.normalized()) : Vec3::Zero();
}

std::string ascii(const TriangleMesh& mesh, const std::vector<Solid>& solids) {
  std::string text;
  text.reserve(static_cast<std::size_t>(mesh.triangles.cols()) * 280);
  auto out = std::back_inserter(text);
  for (const Solid& solid : solids) {
    fmt::format_to(out, "solid {}\n", solid.name);
    for (const int t : solid.triangles) {
      const std::array<Vec3, 3> p{mesh.points_mm.col(mesh.triangles(0, t)),
                                  mesh.points_mm.col(mesh.triangles(1, t)),
                                  mesh.points_mm.col(mesh.triangles(2, t))};
      const Vec3 n = unit_normal(p[0], p[1], p[2]);
      fmt::format_to(out, "facet normal {:.6g} {:.6g} {:.6g}\nouter loop\n", n.x(), n.y(), n.z());
      for (const Vec3& q : p)
        fmt::format_to(out, "vertex {:.9g} {:.9g} {:.9g}\n", q.x(), q.y(), q.z());
      fmt::format_to(out, "endloop\nendfacet\n");
    }
    fmt::format_to(out, "endsolid {}\n", solid.name);
  }
  return text;
}

template <typename T>
void append_bytes(std::string& bytes, T value) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), &value, sizeof(T));
  bytes.append(raw.data(), raw.size());
}

std::string binary(const TriangleMesh& mesh, const std::vector<Solid>& solids) {
  std::string bytes(kHeader);
  bytes.resize(kHeaderSize, ' ');
  append_bytes(bytes, static_cast<std::uint32_t>(mesh.triangles.cols()));
  for (std::size_t s = 0; s < solids.size(); ++s) {
    for (const int t : solids[s].triangles) {
      const std::array<Vec3, 3> p{mesh.points_mm.col(mesh.triangles(0, t)),
                                  mesh.points_mm.col(mesh.triangles(1, t)),
                                  mesh.points_mm.col(mesh.triangles(2, t))};
      for (const Vec3& v : {unit_normal(p[0], p[1], p[2]), p[0], p[1], p[2]}) {
        for (const double x : v) append_bytes(bytes, static_cast<float>(x));
      }
      append_bytes(bytes, static_cast<std::uint16_t>(s));
    }
  }
  return bytes;
}

// Facets as they stand in a file: three corners each, unconnected.
struct Soup {
  std::vector<Vec3> corners;
  std::vector<int> part_of;
  std::vector<MeshPart> parts;
};

// Corners sorted by coordinates, so that equal ones are neighbours; numbered in order of
// appearance.
TriangleMesh connect(const Soup& soup) {
  std::vector<int> order(soup.corners.size());
  std::iota(order.begin(), order.end(), 0);
  const auto key = [&](int i) {
    const Vec3& p = soup.corners[static_cast<std::size_t>(i)];
    return std::array{p.x(), p.y(), p.z()};
  };
  std::sort(order.begin(), order.end(), [&](int a, int b) {
    const auto ka = key(a);
    const auto kb = key(b);
    return ka != kb ? ka < kb : a < b;
  });

  std::vector<int> first(order.size());  // the first corner at the same place
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool same = k > 0 && key(order[k - 1]) == key(order[k]);
    first[static_cast<std::size_t>(order[k])] =
        same ? first[static_cast<std::size_t>(order[k - 1])] : order[k];
  }

  // Triangles that fall together to a line or a point are left out: they have no area.
  std::vector<int> number(order.size(), -1);
  TriangleMesh mesh;
  mesh.parts = soup.parts;
  mesh.points_mm.resize(3, static_cast<Eigen::Index>(order.size()));
  mesh.triangles.resize(3, static_cast<Eigen::Index>(soup.part_of.size()));
  int points = 0;
  Eigen::Index triangles = 0;
  for (std::size_t t = 0; t < soup.part_of.size(); ++t) {
    std::array<int, 3> corner{};
    for (std::size_t k = 0; k < 3; ++k) {
      const auto at = static_cast<std::size_t>(first[3 * t + k]);
      if (number[at] < 0) {
        mesh.points_mm.col(points) = soup.corners[at];
        number[at] = points++;
      }
      corner[k] = number[at];
    }
    if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
    mesh.triangles.col(triangles++) << corner[0], corner[1], corner[2];
    mesh.part_of.push_back(soup.part_of[t]);
  }
  mesh.points_mm.conservativeResize(3, points);
  mesh.triangles.conservativeResize(3, triangles);
  return mesh;
}

template <typename T>
T value_at(std::string_view bytes, std::size_t offset) {
  T value;
  std::memcpy(&value, bytes.data() + offset, sizeof(T));
  return value;
}

Result<TriangleMesh> from_binary(std::string_view bytes, const std::string& file) {
  const auto count = value_at<std::uint32_t>(bytes, kHeaderSize);
  const bool ours = bytes.substr(0, kHeader.size()) == kHeader;
  Soup soup;
  int most = 0;
  for (std::uint32_t f = 0; f < count; ++f) {
    const std::size_t start = kHeaderSize + 4 + kFacetSize * f;
    for (std::size_t k = 1; k <= 3; ++k) {
      Vec3 p;
      for (std::size_t d = 0; d < 3; ++d) {
        p[static_cast<Eigen::Index>(d)] =
            static_cast<double>(value_at<float>(bytes, start + 4 * (3 * k + d))) + 0.0;
      }
      if (!p.allFinite()) {
        return fail({ErrorKind::kBadInput,
                     "coordinate is not finite",
                     file + ": facet " + std::to_string(f + 1),
                     {},
                     "coordinates are finite"});
      }
      soup.corners.push_back(p);
    }

    // Our own files keep the part in the attribute, which others leave 0 or use for colours.
    const int part = ours ? value_at<std::uint16_t>(bytes, start + 48) : 0;
    most = std::max(most, part);
    soup.part_of.push_back(part);
  }

  for (int p = 0; p <= most; ++p) {
    soup.parts.push_back({ours ? "part_" + std::to_string(p) : "surface", PartKind::kBody, 0.0});
  }
  return connect(soup);
}

class AsciiReader {
 public:
  AsciiReader(std::string_view text, const std::string& file) : text_(text), file_(file) {}

  Result<TriangleMesh> read() {
    Soup soup;
    std::array<Vec3, 3> corner;
    int in_solid = -1;
    std::size_t corners = 0;
    bool in_facet = false;
    for (std::string_view line; next(line);) {
      const std::string keyword = lower_case(take_word(line));
      if (keyword.empty() || keyword == "outer" || keyword == "endloop") continue;
      if (keyword == "solid") {
        in_solid = static_cast<int>(soup.parts.size());
        const std::string name(trimmed(line));
        soup.parts.push_back({name.empty() ? "surface" : name, part_kind_of_name(name), 0.0});
      } else if (keyword == "endsolid") {
        if (in_facet) return bad("solid ends inside a facet", "endsolid", "facets are closed");
        in_solid = -1;
      } else if (keyword == "facet") {
        if (in_facet || in_solid < 0)
          return bad("facet in the wrong place", "facet", "facets stand in solids");
        in_facet = true;
        corners = 0;
      } else if (keyword == "vertex") {
        if (!in_facet || corners == 3)
          return bad("vertex in the wrong place", "vertex", "a facet has three");
        for (double& x : corner[corners]) {
          const std::string_view number = take_word(line);
          if (!parse(number, x)) return bad("not a finite number", number, "a vertex has three");
        }
        ++corners;
      } else if (keyword == "endfacet") {
        if (!in_facet || corners != 3)
          return bad("facet is not complete", std::to_string(corners),
                     "a facet has three vertices");
        in_facet = false;
        soup.corners.insert(soup.corners.end(), corner.begin(), corner.end());
        soup.part_of.push_back(in_solid);
      } else {
        return bad("unknown keyword", keyword,
                   "solid, facet, outer loop, vertex, endloop, endfacet, endsolid");
      }
    }

    if (in_facet || in_solid >= 0)
      return bad("file ends inside a solid", {}, "the last line is endsolid");
    if (soup.part_of.empty()) return bad("no facet", {}, "a mesh has facets");
    return connect(soup);
  }

 private:
  static bool blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }
  static std::string_view trimmed(std::string_view s) {
    while (!s.empty() && blank(s.front())) s.remove_prefix(1);
    while (!s.empty() && blank(s.back())) s.remove_suffix(1);
    return s;
  }
  static std::string lower_case(std::string_view s) {
    std::string lower(s);
    for (char& c : lower) {
      if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    }
    return lower;
  }
  static std::string_view take_word(std::string_view& line) {
    line = trimmed(line);
    std::size_t n = 0;
    while (n < line.size() && !blank(line[n])) ++n;
    const std::string_view first = line.substr(0, n);
    line.remove_prefix(n);
    return first;
  }
  static bool parse(std::string_view s, double& x) {
    if (!s.empty() && s.front() == '+') s.remove_prefix(1);
    const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), x);
    x += 0.0;  // one zero only
    return error == std::errc() && end == s.data() + s.size() && std::isfinite(x);
  }

  bool next(std::string_view& line) {
    if (text_.empty()) return false;
    ++line_;
    const std::size_t end = std::min(text_.find('\n'), text_.size());
    line = text_.substr(0, end);
    text_.remove_prefix(std::min(end + 1, text_.size()));
    return true;
  }

  tl::unexpected<Error> bad(std::string what, std::string_view value, std::string rule) const {
    return fail({ErrorKind::kBadInput, std::move(what), file_ + ":" + std::to_string(line_),
                 valid_utf8(value.substr(0, 40)), std::move(rule)});
  }

  std::string_view text_;
  const std::string& file_;
  int line_ = 0;
};

}  // namespace

std::string mesh_to_stl(const TriangleMesh& mesh, const StlOptions& options) {
  EXPECTS(!find_defect(mesh));
  const std::vector<Solid> solids = solids_of(mesh, options.grouping);
  return options.format == StlFormat::kAscii ? ascii(mesh, solids) : binary(mesh, solids);
}

Result<TriangleMesh> mesh_from_stl(std::string_view bytes, const std::string& file) {
  // A binary header may start with "solid" too: the size decides.
  const bool has_count = bytes.size() >= kHeaderSize + 4;
  const std::size_t wanted =
      has_count ? kHeaderSize + 4 + kFacetSize * value_at<std::uint32_t>(bytes, kHeaderSize) : 0;
  if (has_count && bytes.size() == wanted && wanted > kHeaderSize + 4)
    return from_binary(bytes, file);

  const std::size_t start = bytes.find_first_not_of(" \t\r\n");
  const std::string_view first = bytes.substr(std::min(start, bytes.size()), 5);
  if (first == "solid" || first == "SOLID") {
    return AsciiReader(bytes, file).read();
  }
  return fail({ErrorKind::kBadInput, "not an STL file, or cut short", file,
               std::to_string(bytes.size()) + " bytes",
               has_count ? std::to_string(wanted) + " bytes if binary" : "text starts with solid"});
}

Result<void> write_stl(const std::filesystem::path& path, const TriangleMesh& mesh,
                       const StlOptions& options) {
  return write_file(path, mesh_to_stl(mesh, options));
}

Result<TriangleMesh> read_stl(const std::filesystem::path& path) {
  const Result<std::string> bytes = read_file(path);
  if (!bytes) return fail(bytes.error());
  return mesh_from_stl(*bytes, path.string());
}

}  // namespace angiospline
