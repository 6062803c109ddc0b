#include <cstring>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include "base/atomic_file.h"
#include "base/random.h"
#include "io/model/model_file.h"
#include "tests/shapes/sample_networks.h"

namespace angiospline {
namespace {

namespace fs = std::filesystem;

bool same_bits(const Points3& a, const Points3& b) {
  return a.cols() == b.cols() &&
         std::memcmp(a.data(), b.data(), sizeof(double) * static_cast<std::size_t>(a.size())) == 0;
}

bool same_side(const Side& a, const Side& b) {
  return a.patch == b.patch && a.side == b.side && a.from == b.from && a.to == b.to;
}

void expect_same(const SurfaceNetwork& a, const SurfaceNetwork& b) {
  EXPECT_TRUE(same_bits(a.control_points_mm, b.control_points_mm));
  ASSERT_EQ(a.patches.size(), b.patches.size());
  for (std::size_t k = 0; k < a.patches.size(); ++k) {
    EXPECT_EQ(a.patches[k].u, b.patches[k].u);
    EXPECT_EQ(a.patches[k].v, b.patches[k].v);
    EXPECT_EQ(a.patches[k].control, b.patches[k].control);
    EXPECT_EQ(a.patches[k].region, b.patches[k].region);
  }
  ASSERT_EQ(a.regions.size(), b.regions.size());
  for (std::size_t k = 0; k < a.regions.size(); ++k) {
    EXPECT_EQ(a.regions[k].name, b.regions[k].name);
    EXPECT_EQ(a.regions[k].kind, b.regions[k].kind);
    EXPECT_EQ(a.regions[k].radius_mm, b.regions[k].radius_mm);
  }
  ASSERT_EQ(a.joins.size(), b.joins.size());
  for (std::size_t k = 0; k < a.joins.size(); ++k) {
    EXPECT_TRUE(same_side(a.joins[k].a, b.joins[k].a) && same_side(a.joins[k].b, b.joins[k].b));
    EXPECT_EQ(a.joins[k].reversed, b.joins[k].reversed);
  }
  ASSERT_EQ(a.rims.size(), b.rims.size());
  for (std::size_t k = 0; k < a.rims.size(); ++k) {
    EXPECT_EQ(a.rims[k].name, b.rims[k].name);
    EXPECT_EQ(a.rims[k].kind, b.rims[k].kind);
    EXPECT_EQ(a.rims[k].center_mm, b.rims[k].center_mm);
    EXPECT_EQ(a.rims[k].normal, b.rims[k].normal);
    EXPECT_EQ(a.rims[k].radius_mm, b.rims[k].radius_mm);
    ASSERT_EQ(a.rims[k].sides.size(), b.rims[k].sides.size());
    for (std::size_t s = 0; s < a.rims[k].sides.size(); ++s) {
      EXPECT_TRUE(same_side(a.rims[k].sides[s], b.rims[k].sides[s]));
    }
  }
  ASSERT_EQ(a.dependencies.size(), b.dependencies.size());
  for (std::size_t k = 0; k < a.dependencies.size(); ++k) {
    EXPECT_EQ(a.dependencies[k].point, b.dependencies[k].point);
    EXPECT_EQ(a.dependencies[k].masters, b.dependencies[k].masters);
  }
}

void expect_same(const CenterlineTree& a, const CenterlineTree& b) {
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.assumptions, b.assumptions);
  EXPECT_EQ(a.inlets, b.inlets);
  ASSERT_EQ(a.nodes.size(), b.nodes.size());
  for (std::size_t k = 0; k < a.nodes.size(); ++k) {
    EXPECT_EQ(a.nodes[k].name, b.nodes[k].name);
    EXPECT_EQ(a.nodes[k].position_mm, b.nodes[k].position_mm);
  }
  ASSERT_EQ(a.branches.size(), b.branches.size());
  for (std::size_t k = 0; k < a.branches.size(); ++k) {
    EXPECT_EQ(a.branches[k].name, b.branches[k].name);
    EXPECT_EQ(a.branches[k].from, b.branches[k].from);
    EXPECT_EQ(a.branches[k].to, b.branches[k].to);
    EXPECT_TRUE(same_bits(a.branches[k].points_mm, b.branches[k].points_mm));
    EXPECT_EQ(a.branches[k].radii_mm, b.branches[k].radii_mm);
  }
}

TEST(ModelFile, ReadsBackWhatItWroteBitForBit) {
  for (const SurfaceNetwork& network :
       {samples::tube(), samples::tube_with_t_vertex(), samples::torus(), samples::bent_tube()}) {
    const Model model = samples::model_of(network);
    const std::string text = model_to_json(model);
    const Result<Model> back = model_from_json(text, "m.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_EQ(back->name, model.name);
    EXPECT_EQ(back->assumptions, model.assumptions);
    EXPECT_EQ(back->warnings, model.warnings);
    ASSERT_EQ(back->failed.size(), 1u);
    EXPECT_EQ(back->failed[0].name, model.failed[0].name);
    EXPECT_EQ(back->failed[0].why, model.failed[0].why);
    expect_same(model.tree, back->tree);
    expect_same(model.network, back->network);
    EXPECT_EQ(model_to_json(*back), text);
  }
}

TEST(ModelFile, KeepsDoublesOfEveryMagnitude) {
  Model model = samples::model_of(samples::torus());
  Random random(7);
  int kept = 0;
  for (int round = 0; round < 20; ++round) {
    for (double& x : model.network.control_points_mm.reshaped()) {
      do {
        const std::uint64_t bits = random.bits();
        std::memcpy(&x, &bits, sizeof x);
      } while (!std::isfinite(x));
      ++kept;
    }
    model.network.control_points_mm(0, 0) = -0.0;
    model.network.control_points_mm(1, 0) = std::numeric_limits<double>::denorm_min();
    model.network.control_points_mm(2, 0) = std::numeric_limits<double>::max();
    const Result<Model> back = model_from_json(model_to_json(model), "m.json");
    ASSERT_TRUE(back) << back.error().message();
    EXPECT_TRUE(same_bits(model.network.control_points_mm, back->network.control_points_mm));
  }
  EXPECT_EQ(kept, 6000);
}

TEST(ModelFile, AModelOfNothingIsAModel) {
  const Result<Model> back = model_from_json(model_to_json(Model{}), "m.json");
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(back->network.control_points_mm.cols(), 0);
}

// The text of a sample with the value at `pointer` replaced.
std::string changed(const std::string& pointer, const nlohmann::ordered_json& value) {
  static const std::string text = model_to_json(samples::model_of(samples::tube_with_t_vertex()));
  auto json = nlohmann::ordered_json::parse(text);
  json.at(nlohmann::ordered_json::json_pointer(pointer)) = value;
  return json.dump();
}

TEST(ModelFile, NamesFilePlaceValueAndRuleOfWhatIsWrong) {
  struct Bad {
    const char* pointer;
    nlohmann::ordered_json value;
    const char* message;
  };
  const std::vector<Bad> cases{
      {"/schema", "other", "m.json:/schema: unknown schema: \"other\" (angiospline-model)"},
      {"/schema_version", 99,
       "m.json:/schema_version: unknown schema version: 99 (this program reads version 1)"},
      {"/units/length", "cm", "m.json:/units/length: unknown unit: \"cm\" (mm)"},
      {"/network/control_points_mm/3",
       {1, 2},
       "m.json:/network/control_points_mm/3: unexpected value: array (three coordinates)"},
      {"/network/control_points_mm/3/1", nullptr,
       "m.json:/network/control_points_mm/3/1: unexpected value: null (a number is needed)"},
      {"/network/patches/1/control/0", 100000,
       "m.json: patch 1: control point outside the pool: 100000 (0 to 143)"},
      {"/network/patches/1/control/0", 1.5,
       "m.json:/network/patches/1/control/0: unexpected value: 1.5 (an integer is needed)"},
      {"/network/patches/1/control/0", 1e300,
       "m.json:/network/patches/1/control/0: unexpected value: 1e+300 (an integer is needed)"},
      {"/network/patches/1/control/0", 4294967296,
       "m.json:/network/patches/1/control/0: unexpected value: 4294967296 (a 32-bit integer is "
       "needed)"},
      {"/network/patches/0/u/knots/2", 0.5,
       "m.json:/network/patches/0/u: knot 3: knot decreases: object (knots must not decrease)"},
      {"/network/joins/0/a/side", "u2",
       "m.json:/network/joins/0/a/side: unexpected value: \"u2\" (one of u0 u1 v0 v1)"},
      {"/network/rims/0/normal/2", 2.0,
       "m.json: inlet: rim's normal is not a unit vector: 2.000000 (normals have length 1)"},
      {"/network/dependencies/0/masters/0/0", 65,
       "m.json: dependency 0: master is not a free point with a finite weight: 65 (masters are "
       "never "
       "dependent themselves)"},
      {"/tree/branches/0/radii_mm/1", -1,
       "m.json: branch a, point 1: radius is not positive: -1.000000 (radii are positive and "
       "finite)"},
      {"/tree/branches/0/to", 2,
       "m.json: branch a: branch names a node that is not there: 2 (0 to 1)"},
  };
  for (const Bad& bad : cases) {
    const Result<Model> result = model_from_json(changed(bad.pointer, bad.value), "m.json");
    ASSERT_FALSE(result) << bad.pointer;
    EXPECT_EQ(result.error().message(), bad.message);
  }
}

TEST(ModelFile, EveryKeyIsNeeded) {
  const auto whole = nlohmann::ordered_json::parse(
      model_to_json(samples::model_of(samples::tube_with_t_vertex())));
  int removed = 0;
  const std::function<void(const nlohmann::ordered_json&, const std::string&)> visit =
      [&](const nlohmann::ordered_json& json, const std::string& pointer) {
        if (json.is_array() && !json.empty()) return visit(json[0], pointer + "/0");
        if (!json.is_object()) return;
        for (const auto& [key, value] : json.items()) {
          if (pointer.empty() && key == "provenance") continue;  // for people
          if (pointer.empty() && key == "warning_codes")
            continue;  // not in earlier releases' files
          auto copy = whole;
          copy.at(nlohmann::ordered_json::json_pointer(pointer)).erase(key);
          const auto result = model_from_json(copy.dump(), "m.json");
          ASSERT_FALSE(result) << pointer << "/" << key;
          EXPECT_EQ(result.error().where, "m.json:" + pointer);
          EXPECT_EQ(result.error().value, key);
          ++removed;
          visit(value, pointer + "/" + key);
        }
      };
  visit(whole, "");
  EXPECT_GT(removed, 45);
}

TEST(ModelFile, WarningsOfAFileWithoutCodesAreUnspecified) {
  const Model model = samples::model_of(samples::tube());
  auto json = nlohmann::ordered_json::parse(model_to_json(model));
  ASSERT_EQ(json["warning_codes"].size(), 2u);
  json.erase("warning_codes");
  const Result<Model> back = model_from_json(json.dump(), "m.json");
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_EQ(texts_of(back->warnings), texts_of(model.warnings));
  for (const Warning& warning : back->warnings) EXPECT_EQ(warning.code, WarningCode::kUnspecified);
}

TEST(ModelFile, ACodeOfALaterReleaseIsUnspecifiedAndOthersKeepTheirs) {
  const Model model = samples::model_of(samples::tube());
  auto json = nlohmann::ordered_json::parse(model_to_json(model));
  json["warnings"].push_back("the vessel hums");
  json["warning_codes"].push_back("vessel-hums");
  const Result<Model> back = model_from_json(json.dump(), "m.json");
  ASSERT_TRUE(back) << back.error().message();
  ASSERT_EQ(back->warnings.size(), 3u);
  EXPECT_EQ(back->warnings[0], model.warnings[0]);
  EXPECT_EQ(back->warnings[2], (Warning{WarningCode::kUnspecified, "the vessel hums"}));
}

TEST(ModelFile, CodesThatAreNotOneForEachWarningAreRefused) {
  auto json = nlohmann::ordered_json::parse(model_to_json(samples::model_of(samples::tube())));
  json["warning_codes"].push_back("wall-folds");
  const Result<Model> back = model_from_json(json.dump(), "m.json");
  ASSERT_FALSE(back);
  EXPECT_EQ(back.error().message(),
            "m.json:/warning_codes: unexpected value: array (a code for each warning)");
}

TEST(ModelFile, AnyWrongValueIsRefusedOrHarmless) {
  const auto whole =
      nlohmann::ordered_json::parse(model_to_json(samples::model_of(samples::tube())));
  const std::vector<nlohmann::ordered_json> wrong{nullptr,
                                                  "x",
                                                  -1,
                                                  3,
                                                  1e308,
                                                  true,
                                                  nlohmann::ordered_json::array(),
                                                  nlohmann::ordered_json::object()};
  int refused = 0;
  int accepted = 0;
  const nlohmann::ordered_json flat = whole.flatten();
  for (const auto& [pointer, value] : flat.items()) {
    for (const auto& w : wrong) {
      auto copy = whole;
      copy.at(nlohmann::ordered_json::json_pointer(pointer)) = w;
      const auto result = model_from_json(copy.dump(), "m.json");
      if (result) {
        EXPECT_FALSE(find_defect(*result));
        ++accepted;
      } else {
        EXPECT_EQ(result.error().message().rfind("m.json", 0), 0u) << result.error().message();
        ++refused;
      }
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_GT(accepted, 0);
}

TEST(ModelFile, TruncatedDeepAndForeignTextIsRefused) {
  const std::string text = model_to_json(samples::model_of(samples::tube()));
  for (std::size_t n = 0; n + 2 < text.size(); n += 97) {
    EXPECT_FALSE(model_from_json(std::string_view(text).substr(0, n), "m.json")) << n;
  }
  const std::string deep(1000000, '[');
  EXPECT_FALSE(model_from_json(deep, "m.json"));
  const std::string closed = "{\"schema\":" + deep + std::string(deep.size(), ']') + "}";
  const auto result = model_from_json(closed, "m.json");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().where, "m.json:/schema");
  for (const char* bad :
       {"", "null", "[]", "{}", "NaN", "{\"schema\":NaN}", "\xff\xfe", "ISO-10303-21;",
        "{\"schema\":\"angiospline-model\",\"schema_version\":1e999}"}) {
    EXPECT_FALSE(model_from_json(bad, "m.json")) << bad;
  }
}

TEST(ModelFile, GoesThroughAFileAndRefusesAnUnsoundModel) {
  const fs::path folder = fs::temp_directory_path() / ("model_file_" + std::to_string(::getpid()));
  fs::create_directories(folder);
  Model model = samples::model_of(samples::tube());
  ASSERT_TRUE(write_model(folder / "a.json", model));
  EXPECT_TRUE(read_model(folder / "a.json"));
  model.network.control_points_mm(0, 0) = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(write_model(folder / "b.json", model));
  EXPECT_FALSE(fs::exists(folder / "b.json"));
  EXPECT_FALSE(read_model(folder / "none.json"));
  fs::remove_all(folder);
}

}  // namespace
}  // namespace angiospline
