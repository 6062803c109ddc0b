#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/atomic_file.h"
#include "io/report/report_html.h"
#include "io/report/report_page.h"
#include "modeling/network/tessellation.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

struct Sample {
  Model model = samples::model_of(samples::tube_with_t_vertex());
  TriangleMesh mesh = tessellate(model.network)->mesh;
};

// The text between two marks of a page.
std::string between(const std::string& page, const std::string& from, const std::string& to) {
  const std::size_t start = page.find(from) + from.size();
  return page.substr(start, page.find(to, start) - start);
}

std::string decoded(const std::string& base64) {
  static const std::string digits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  unsigned bits = 0;
  int count = 0;
  for (const char c : base64) {
    if (c == '=') break;
    bits = bits << 6U | static_cast<unsigned>(digits.find(c));
    count += 6;
    if (count >= 8) {
      count -= 8;
      bytes += static_cast<char>(bits >> static_cast<unsigned>(count) & 255U);
    }
  }
  return bytes;
}

TEST(Report, FactsSayWhatTheModelIs) {
  const Sample s;
  ReportExtras extras;
  extras.certificate = certify(s.model.network).value();
  extras.seconds = {{"seed", 1.5}};
  extras.files = {"a.step"};
  const auto facts = nlohmann::json::parse(report_json(s.model, s.mesh, extras));
  EXPECT_EQ(facts["summary"]["branches"], 1);
  EXPECT_EQ(facts["summary"]["inlets"], 1);
  EXPECT_EQ(facts["summary"]["outlets"], 1);
  EXPECT_EQ(facts["summary"]["loops"], 0);
  EXPECT_EQ(facts["failed"][0]["name"], "junction_7");
  EXPECT_EQ(facts["faces"].size(), 4u);
  EXPECT_EQ(facts["faces"][2]["name"], "inlet");
  EXPECT_NEAR(facts["branches"][0]["length_mm"].get<double>(), std::hypot(0.1, 1.0 / 3, 5), 1e-12);
  EXPECT_NEAR(facts["branches"][0]["area_mm2"].get<double>(), 4 * 3.14159, 0.1);
  EXPECT_EQ(facts["branches"][0]["radius_mm"].size(), 3u);
  EXPECT_EQ(facts["certificate"]["closed"], true);
  EXPECT_EQ(facts["seconds"]["seed"], 1.5);
  EXPECT_FALSE(facts.contains("geometry"));
}

TEST(Report, PageHoldsTheGeometryAndNeedsNothingElse) {
  const Sample s;
  const MeshField field{"height_mm", s.mesh.points_mm.row(2).transpose()};
  const std::string page = report_html(s.model, s.mesh, {.certificate = {}, .fields = {field}});
  std::string without_namespace = page;
  const std::string svg = "http://www.w3.org/2000/svg";
  without_namespace.erase(without_namespace.find(svg), svg.size());
  EXPECT_EQ(without_namespace.find("http"), std::string::npos);
  EXPECT_EQ(page.find("%FACTS%"), std::string::npos);
  EXPECT_EQ(page.find("%MESH%"), std::string::npos);
  const auto facts = nlohmann::json::parse(between(page, "id=\"facts\">", "</script>"));
  const std::string bytes = decoded(between(page, "id=\"mesh\">", "</script>"));
  const auto& geometry = facts["geometry"];
  std::size_t triangles = 0;
  double largest = 0;
  for (const auto& part : geometry["parts"]) {
    triangles += part["triangles"].get<std::size_t>();
    std::vector<std::uint16_t> q(4 * part["points"].get<std::size_t>());
    std::memcpy(q.data(), bytes.data() + part["positions"].get<std::size_t>(), 2 * q.size());
    for (std::size_t k = 2; k < q.size(); k += 4) {
      largest = std::max(largest, geometry["low_mm"][2].get<double>() +
                                      q[k] / 65535.0 * geometry["extent_mm"][2].get<double>());
    }
    std::vector<std::uint16_t> value(2 * part["points"].get<std::size_t>());
    std::memcpy(value.data(), bytes.data() + part["fields"][0].get<std::size_t>(),
                2 * value.size());
    for (std::size_t k = 0; k < value.size() / 2; ++k) {  // the field is the height
      EXPECT_NEAR(value[2 * k] / 65534.0, q[4 * k + 2] / 65535.0, 3e-5);
    }
  }
  EXPECT_EQ(triangles, static_cast<std::size_t>(s.mesh.triangles.cols()));
  EXPECT_NEAR(largest, 5, 1e-9);
}

TEST(Report, PageBundlesItsStyleAndScriptsWithTwoMarksLeft) {
  const std::string page(report_page());
  const auto count = [&](const std::string& part) {
    int n = 0;
    for (std::size_t at = page.find(part); at != std::string::npos; at = page.find(part, at + 1))
      ++n;
    return n;
  };
  EXPECT_EQ(count("%FACTS%"), 1);
  EXPECT_EQ(count("%MESH%"), 1);
  EXPECT_EQ(count("%STYLE%") + count("%SCRIPTS%"), 0);
  EXPECT_EQ(count("<style>"), 1);
  EXPECT_EQ(count("</html>"), 1);
  // The helpers come first, for all scripts use them; the view comes before what is drawn beside
  // it.
  EXPECT_LT(page.find("const facts ="), page.find("(function plots()"));
  EXPECT_LT(page.find("(function plots()"), page.find("function threeD()"));
  EXPECT_LT(page.find("function threeD()"), page.find("for (const image of facts.images)"));
  EXPECT_NE(page.find("for (const image of facts.images)"), std::string::npos);
}

TEST(Report, TextCannotBreakOutOfThePage) {
  Sample s;
  s.model.name = "</script><script>alert(1)</script> \xff %MESH%";
  const std::string page = report_html(s.model, s.mesh);
  EXPECT_EQ(page.find("<script>alert"), std::string::npos);
  const auto facts = nlohmann::json::parse(between(page, "id=\"facts\">", "</script>"));
  EXPECT_EQ(facts["name"], "</script><script>alert(1)</script> \uFFFD %MESH%");
}

TEST(Report, AModelWithoutTreeOrSurfaceIsStillReported) {
  const Model empty;
  const std::string page = report_html(empty, TriangleMesh{});
  EXPECT_NE(page.find("</html>"), std::string::npos);
  EXPECT_EQ(nlohmann::json::parse(report_json(empty, TriangleMesh{}))["summary"]["branches"], 0);
}

TEST(Report, IsWrittenWithItsFactsBesideIt) {
  const Sample s;
  const fs::path folder = fs::temp_directory_path() / ("report_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  ASSERT_TRUE(write_report(folder / "r.html", s.model, s.mesh));
  EXPECT_TRUE(nlohmann::json::accept(*read_file(folder / "r_facts.json")));
  EXPECT_EQ(std::distance(fs::directory_iterator(folder), fs::directory_iterator()), 2);
  EXPECT_FALSE(write_report(folder / "none" / "r.html", s.model, s.mesh));
  fs::remove_all(folder);
}

TEST(Report, DrawsItselfInABrowser) {
  const char* browser = std::getenv("ANGIOSPLINE_CHROMIUM");
  if (browser == nullptr)
    GTEST_SKIP() << "ANGIOSPLINE_CHROMIUM is not set: the command of a browser";
  const Sample s;
  const fs::path folder = fs::temp_directory_path() / ("report_page_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  ASSERT_TRUE(write_report(folder / "r.html", s.model, s.mesh));
  const std::string command = std::string(browser) +
                              " --headless=new --no-sandbox --use-angle=swiftshader "
                              "--enable-unsafe-swiftshader --virtual-time-budget=4000 --dump-dom "
                              "file://" +
                              (folder / "r.html").string() + " 2>/dev/null";
  std::FILE* const pipe = ::popen(command.c_str(), "r");
  ASSERT_NE(pipe, nullptr);
  std::string dom;
  for (int c = 0; (c = std::fgetc(pipe)) != EOF;) dom += static_cast<char>(c);
  ::pclose(pipe);
  fs::remove_all(folder);
  EXPECT_NE(dom.find("Branches (2)"), std::string::npos);   // the legend comes after the drawing
  EXPECT_NE(dom.find("from the head"), std::string::npos);  // the projections
  EXPECT_NE(dom.find("Could not be modelled"), std::string::npos);
}

TEST(Projections, HangTheHeadUpAndThePatientsRightOnTheLeft) {
  // Voxel axes: x to the right, y to the front (RAS), z to the head; one bright voxel near the
  // patient's left, back and head.
  ImageGrid grid;
  grid.size = {20, 24, 16};
  grid.spacing_mm = {1, 1, 2};
  grid.direction.diagonal() << -1, -1, 1;
  Image<float> image(grid, 10.0F);
  const Voxel bright{2, 3, 13};
  image[bright] = 100.0F;
  CenterlineTree tree;
  tree.nodes = {{"1", grid.world_mm(bright)}, {"2", grid.world_mm(Voxel{2, 3, 0})}};
  CenterlineBranch branch{"1_2", 0, 1, Points3(3, 2), Eigen::Vector2d(1, 1)};
  branch.points_mm << tree.nodes[0].position_mm, tree.nodes[1].position_mm;
  tree.branches.push_back(branch);
  const auto pictures = projections(image, tree);
  ASSERT_EQ(pictures.size(), 3u);
  for (const ReportImage& p : pictures) {  // the bright pixel lies where the line starts
    const auto at =
        static_cast<std::size_t>(std::max_element(p.grey.begin(), p.grey.end()) - p.grey.begin());
    const auto width = static_cast<std::size_t>(p.width);
    EXPECT_NEAR(p.lines[0][0].x(), static_cast<double>(at % width), 1e-9) << p.title;
    EXPECT_NEAR(p.lines[0][0].y(), static_cast<double>(at / width), 1e-9) << p.title;
  }
  EXPECT_EQ(pictures[0].title, "maximum intensity along y, with centerlines");
  EXPECT_EQ(pictures[0].width, 20);  // left on the right side, head up
  EXPECT_NEAR(pictures[0].lines[0][0].x(), 17, 1e-9);
  EXPECT_NEAR(pictures[0].lines[0][0].y(), 2, 1e-9);
  EXPECT_EQ(pictures[0].pixel_mm, Vec2(1, 2));
  EXPECT_EQ(pictures[1].width, 24);  // from the left side: back on the right, head up
  EXPECT_NEAR(pictures[1].lines[0][0].x(), 20, 1e-9);
  EXPECT_NEAR(pictures[2].lines[0][0].y(), 20, 1e-9);  // along z: the back down
  EXPECT_TRUE(projections(Image<float>{}, tree).empty());
}

}  // namespace
}  // namespace angiospline
