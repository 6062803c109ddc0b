// What the program writes as JSON follows docs/schemas, and the schemas describe every key of it.
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "base/warning.h"
#include "tests/cli/run_program.h"
#include "tests/shapes/paths.h"

namespace angiospline::test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

const std::string kPython = "/usr/bin/python3";

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

fs::path schema(const std::string& name) {
  return testing_paths::source_folder() / "docs/schemas" / (name + ".schema.json");
}

// Validates with Debian's python3-jsonschema; skips, and says so, where that is not installed.
class Schemas : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system((kPython + " -c 'import jsonschema' 2>/dev/null").c_str()) != 0) {
      GTEST_SKIP() << kPython << " has no jsonschema (apt-get install python3-jsonschema)";
    }
  }

  // One line for each thing that is wrong with the file; empty if it follows the schema.
  std::string wrong_with(const std::string& file, const std::string& name) const {
    const fs::path script = testing_paths::source_folder() / "tests/cli/validate_json.py";
    const std::string command = kPython + " -W ignore '" + script.string() + "' '" +
                                schema(name).string() + "' '" + file + "' >'" +
                                (folder_ / "wrong") + "' 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << text_of(folder_ / "wrong");
    return text_of(folder_ / "wrong");
  }

  // Runs the program, keeps its JSON in a file of this name and returns the file's path.
  std::string printed(const std::string& name, const std::vector<std::string>& arguments) const {
    const ProgramRun run = run_angiospline(arguments);
    EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 1) << run.err;
    return folder_.write(name, run.out);
  }

  // Two vessels that cross without a junction: both outputs have a warning.
  std::string crossing() const {
    return folder_.write("cross.swc",
                         "# unit mm\n1 3 0 0 0 2 -1\n2 3 0 0 10 2 1\n3 3 0 0 20 2 2\n"
                         "4 3 3 -10 10 2 -1\n5 3 3 0 10 2 4\n6 3 3 10 10 2 5\n");
  }

  TemporaryFolder folder_;
};

TEST_F(Schemas, SeedCheckAndTheModelFileFollowTheirs) {
  const std::string seed = printed("seed.out", {"seed", crossing(), "-o", folder_ / "model.json",
                                                folder_ / "model.step", "--json"});
  EXPECT_EQ(wrong_with(seed, "seed"), "");
  EXPECT_EQ(wrong_with(folder_ / "model.json", "model"), "");
  for (const char* model : {"model.json", "model.step"}) {
    const std::string check = printed("check.out", {"check", folder_ / model, "--json"});
    EXPECT_EQ(wrong_with(check, "check"), "") << model;
  }
}

TEST_F(Schemas, AModelWithJunctionsFollowsIts) {
  const fs::path sample = testing_paths::source_folder() / "samples/circle_of_willis.csv";
  const std::string seed =
      printed("seed.out", {"seed", sample.string(), "-o", folder_ / "model.json", "--json"});
  EXPECT_EQ(wrong_with(seed, "seed"), "");
  EXPECT_EQ(wrong_with(folder_ / "model.json", "model"), "");
}

TEST_F(Schemas, RecoverFollowsIts) {
  ASSERT_EQ(run_angiospline({"phantom", "cylinder", "-o", folder_ / "image.nrrd"}).exit_code, 0);
  const std::string recover =
      printed("recover.out", {"recover", folder_ / "image.nrrd", "-o", folder_ / "out", "--json"});
  EXPECT_EQ(wrong_with(recover, "recover"), "");
  EXPECT_EQ(wrong_with(folder_ / "out/model.json", "model"), "");
}

TEST_F(Schemas, RefuseAMissingKeyAnUnknownOneAndAWrongValue) {
  const std::string seed =
      printed("seed.out", {"seed", crossing(), "-o", folder_ / "model.json", "--json"});
  EXPECT_NE(wrong_with(seed, "check"), "");
  const Json whole = Json::parse(text_of(folder_ / "model.json"));
  const auto changed = [&](const char* pointer, const Json& value) {
    Json json = whole;
    json[Json::json_pointer(pointer)] = value;
    return wrong_with(folder_.write("changed.json", json.dump()), "model");
  };
  EXPECT_EQ(changed("/name", "other"), "");
  EXPECT_NE(changed("/nickname", "other"), "");
  EXPECT_NE(changed("/units/length", "cm"), "");
  EXPECT_NE(changed("/warning_codes/0", "vessel-hums"), "");
  EXPECT_NE(changed("/tree/branches/0/radii_mm/0", -1), "");
  EXPECT_NE(changed("/network/joins/0/a/side", "u2"), "");
  EXPECT_NE(changed("/network/control_points_mm/0", Json::array({1, 2})), "");
  Json less = whole;
  less["network"].erase("rims");
  EXPECT_NE(wrong_with(folder_.write("less.json", less.dump()), "model"), "");
}

TEST(WarningsAsJson, HaveOneCodeForEachTextWhereverTheyStand) {
  const TemporaryFolder folder;
  const std::string tree =
      folder.write("cross.swc",
                   "# unit mm\n1 3 0 0 0 2 -1\n2 3 0 0 10 2 1\n3 3 0 0 20 2 2\n"
                   "4 3 3 -10 10 2 -1\n5 3 3 0 10 2 4\n6 3 3 10 10 2 5\n");
  const ProgramRun run = run_angiospline({"seed", tree, "-o", folder / "model.json", "--json"});
  const Json seed = Json::parse(run.out);
  const Json model = Json::parse(text_of(folder / "model.json"));
  for (const Json& json : {seed, model}) {
    ASSERT_EQ(json["warnings"].size(), 1U) << json["warnings"];
    EXPECT_EQ(json["warning_codes"], Json::array({"vessels-overlap"}));
    EXPECT_NE(run.err.find(
                  "\nwarning [vessels-overlap]: " + json["warnings"][0].get<std::string>() + "\n"),
              std::string::npos)
        << run.err;
  }
}

TEST(WarningsAsJson, TheSchemaListsTheCodesThereAre) {
  Json codes = Json::array();
  for (const WarningKind& kind : warning_kinds()) codes.push_back(std::string(kind.name));
  const Json common = Json::parse(text_of(schema("common")));
  EXPECT_EQ(common["definitions"]["warning_code"]["enum"], codes);
}

}  // namespace
}  // namespace angiospline::test
