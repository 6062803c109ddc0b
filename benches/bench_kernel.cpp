// The kernel against SISL and OpenCASCADE: run scripts/bench.sh, which also prints the ratios.
#include <cstdio>

#include <benchmark/benchmark.h>

int main(int argc, char** argv) {
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
