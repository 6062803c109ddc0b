#!/bin/sh
# Fuzzes every reader of centerlines: run_fuzz.sh [SECONDS for each, default 20] [READER ...].
# Needs clang with its runtime (clang-14 libclang-rt-14-dev). Finds go to build/fuzz/finds.
set -eu
root=$(cd "$(dirname "$0")/.." && pwd)
seconds=${1:-20}
[ $# -gt 0 ] && shift
[ $# -gt 0 ] || set -- swc csv tree gxl graphml vtp vtk tables simvascular
build=$root/build/fuzz
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DANGIOSPLINE_FUZZ=ON \
  -DCMAKE_C_COMPILER=clang-14 -DCMAKE_CXX_COMPILER=clang++-14 >/dev/null
targets=$(printf 'fuzz_%s ' "$@")
# shellcheck disable=SC2086 # one word for each target
cmake --build "$build" --target $targets -j2
mkdir -p "$build/finds"
for reader in "$@"; do
  grown=$build/corpus/$reader
  mkdir -p "$grown"
  echo "fuzzing $reader for $seconds s"
  "$build/tests/fuzz/fuzz_$reader" "$grown" "$root/tests/fuzz/corpus/$reader" \
    -max_total_time="$seconds" -max_len=4096 -timeout=10 -rss_limit_mb=1024 -malloc_limit_mb=256 \
    -print_final_stats=1 -verbosity=0 -artifact_prefix="$build/finds/$reader-"
done
