// The native model file: JSON that keeps every number of a model bit for bit.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include "base/result.h"
#include "modeling/network/model.h"

namespace angiospline {

// "schema": "angiospline-model", "schema_version": this. It counts up when files that were written
// before can no longer be read, or files written from then on not by programs from before.
inline constexpr int kModelSchemaVersion = 1;

// The text of a model; docs/files.md describes the keys. Numbers have the fewest digits that read
// back to the same double. Text that is not UTF-8 gets U+FFFD for its wrong bytes. Requires a sound
// model (find_defect): JSON has no NaN.
std::string model_to_json(const Model& model);

// The model in a text that model_to_json wrote, and nothing less: every key is wanted, of the right
// type and count, and the model must be sound. Unknown keys are passed over. Errors name `file`,
// the place as a JSON pointer, the value and the rule. "warning_codes" alone may be missing, as it
// is in files of earlier releases: warnings then have the code "unspecified", as have those whose
// code is not known here.
Result<Model> model_from_json(std::string_view text, const std::string& file);

// The same on files, written atomically. Errors: a model that is not sound; those of writing.
Result<void> write_model(const std::filesystem::path& path, const Model& model);
Result<Model> read_model(const std::filesystem::path& path);

}  // namespace angiospline
