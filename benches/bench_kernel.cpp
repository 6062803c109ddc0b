// The kernel against SISL and OpenCASCADE: run scripts/bench.sh, which also prints the ratios.
#include <cstdio>

#include <benchmark/benchmark.h>
#include <malloc.h>

int main(int argc, char** argv) {
  // Memory once had is kept, for all rows alike: a page that the system has to find anew costs a
  // virtual machine some 10 us, and rows would measure that.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  mallopt(M_TOP_PAD, 64 << 20);
#ifndef ANGIOSPLINE_HAS_SISL
  std::fputs("bench_kernel: SISL is missing, its rows do not run (apt install libsisl-dev)\n",
             stderr);
#endif
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  benchmark::Shutdown();
  return 0;
}
