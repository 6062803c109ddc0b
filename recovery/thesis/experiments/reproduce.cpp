#include "recovery/thesis/experiments/reproduce.h"

#include <algorithm>
#include <chrono>
#include <functional>

#include <fmt/format.h>

#include "recovery/thesis/experiments/tables.h"

namespace angiospline {
namespace experiments {

std::string listed(const std::vector<double>& values, int digits) {
  std::string text;
  for (const double v : values)
    text += fmt::format("{}{:.{}f}", text.empty() ? "" : ", ", v, digits);
  return text;
}

namespace {

struct Entry {
  const char* id;
  const char* title;
  std::function<Result<ReproducedTable>(const ReproduceOptions&, const Progress&)> make;
};

const std::vector<Entry>& entries() {
  static const std::vector<Entry> all = {
      {"7.1", "region growing: points by neighbourhood N and deviations M", region_growing},
      {"rings", "growing in a volume and four X-ray views (7.1.1)", two_modalities},
      {"7.2", "gravity: iterations and missed points by method and strength",
       methods_and_strengths},
      {"7.3", "gravity and springs", gravity_and_springs},
      {"7.4", "precision by start position and start size", starts},
      {"7.5", "accuracy by the number of sides", fineness},
      {"cylinder", "right cylinder 64^3, noiseless (7.3.1, 7.3.3)", cylinder},
      {"potato", "potato 64^3, coarse and refined mesh (7.3.3)", potato},
      {"7.6", "potato with noise, refined mesh", noise},
      {"vessel", "small bent vessel 32 x 32 x 48 (7.3.3)", small_vessel},
      {"bifurcation", "bifurcation of 12 surfaces, 128^3 (7.3.4)", bifurcation},
      {"smoothing", "tangent-plane continuity of a bifurcation (7.2.4)", smoothing}};
  return all;
}

}  // namespace
}  // namespace experiments

const std::vector<std::string>& reproducible_tables() {
  static const std::vector<std::string> ids = [] {
    std::vector<std::string> out;
    for (const auto& e : experiments::entries()) out.emplace_back(e.id);
    return out;
  }();
  return ids;
}

Result<ReproducedTable> reproduce_table(const std::string& id, const ReproduceOptions& options,
                                        const Progress& progress) {
  for (const auto& e : experiments::entries()) {
    if (id != e.id) continue;
    const auto start = std::chrono::steady_clock::now();
    auto table = e.make(options, progress);
    if (!table) return table;
    table->id = e.id;
    table->title = e.title;
    table->seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return table;
  }
  std::string known;
  for (const std::string& k : reproducible_tables()) known += (known.empty() ? "" : " ") + k;
  return fail({ErrorKind::kBadInput, "no such table", "reproduce", id, "one of: " + known});
}

}  // namespace angiospline
