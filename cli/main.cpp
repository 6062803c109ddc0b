// The program: reads the command line, runs one subcommand, returns its exit code.
#include <exception>
#include <new>

#include "base/version.h"
#include "cli/commands.h"
#include "cli/console.h"

namespace {

int run(int argc, char** argv) {
  angiospline::cli::CommandLine line(
      "angiospline", "Angiospline: vessels to CAD, from an image or from centerlines with radii",
      angiospline::version());
  for (const auto add : angiospline::cli::kCommands) add(line);
  return line.run(argc, argv);
}

int report_failure(const char* what, const char* where) {
  return angiospline::cli::report_error({angiospline::ErrorKind::kFailed, what, where, {}, {}});
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::bad_alloc&) {
    return report_failure("out of memory", "");
  } catch (const std::exception& error) {
    return report_failure(error.what(), "internal error");
  }
}
