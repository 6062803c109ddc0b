#!/usr/bin/env bash
# Builds the benchmarks (build/bench) and runs them one after the other, each for at most BENCH_SECONDS
# (default 300): all, or those named.
#   scripts/bench.sh [NAME ...] [-- arguments of bench_kernel, bench_numerics]
#   scripts/bench.sh kernel -- --benchmark_filter=reduce
# Times are CPU times: compare rows of one run with each other. The exit code is 1 if a benchmark failed
# or was cut off.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
names=()
while [ $# -gt 0 ] && [ "$1" != "--" ]; do names+=("bench_${1#bench_}"); shift; done
[ $# -gt 0 ] && shift
mkdir -p build
cmake -S . -B build/bench -G Ninja -DCMAKE_BUILD_TYPE=Release -DANGIOSPLINE_TESTS=OFF \
  -DANGIOSPLINE_BENCHES=ON -DANGIOSPLINE_WARNINGS_AS_ERRORS=ON >build/bench.log 2>&1 || { cat build/bench.log >&2; exit 1; }
grep -E "SISL not found" build/bench.log >&2 || true
if [ ${#names[@]} -eq 0 ]; then
  mapfile -t names < <(cmake --build build/bench --target help | grep -oE '^bench_[a-z_]+' | sort -u)
fi
cmake --build build/bench --parallel "${JOBS:-$(nproc)}" --target "${names[@]}"

limit=${BENCH_SECONDS:-300}
failed=0
for name in "${names[@]}"; do
  echo "== $name"
  arguments=()
  if [ "$name" = bench_kernel ] || [ "$name" = bench_numerics ]; then
    arguments=(--benchmark_counters_tabular=true --benchmark_min_time=0.2 "$@")
  fi
  start=$SECONDS
  status=0
  timeout "$limit" "build/bench/benches/$name" "${arguments[@]}" || status=$?
  if [ $status -eq 124 ]; then
    echo "$name was cut off after $limit s (BENCH_SECONDS)" >&2
  elif [ $status -ne 0 ]; then
    echo "$name ended with $status" >&2
  fi
  [ $status -eq 0 ] || failed=1
  echo "== $name: $((SECONDS - start)) s"
done
exit $failed
