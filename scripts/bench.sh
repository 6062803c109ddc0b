#!/usr/bin/env bash
# Builds the benchmarks (build/bench) and runs them; arguments go to bench_kernel, for instance
# --benchmark_filter=reduce. Times are CPU times: compare rows of one run with each other.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p build
cmake -S . -B build/bench -G Ninja -DCMAKE_BUILD_TYPE=Release -DANGIOSPLINE_TESTS=OFF \
  -DANGIOSPLINE_BENCHES=ON >build/bench.log 2>&1 || { cat build/bench.log >&2; exit 1; }
grep -E "SISL not found" build/bench.log >&2 || true
targets=$(cmake --build build/bench --target help | grep -oE '^bench_[a-z_]+' | sort -u)
cmake --build build/bench --parallel "${JOBS:-$(nproc)}" --target $targets
for target in $targets; do
  echo "== $target"
  case $target in
    bench_kernel) "build/bench/benches/$target" --benchmark_counters_tabular=true "$@" ;;
    *) "build/bench/benches/$target" || echo "$target ended with $?" >&2 ;;  # tables of their own
  esac
done
