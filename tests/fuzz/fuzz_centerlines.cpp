// libFuzzer's entry for the reader named by ANGIOSPLINE_FUZZ_READER: whatever the bytes, a tree
// that keeps its invariants or an error of one line, within libFuzzer's limits of time and memory.
#include "tests/fuzz/reader_checks.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace angiospline;        // the readers
  using namespace angiospline::fuzz;  // and those made of two
  read_and_check(ANGIOSPLINE_FUZZ_READER, {reinterpret_cast<const char*>(data), size});
  return 0;
}
