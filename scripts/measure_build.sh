#!/usr/bin/env bash
# What a build from nothing costs: CPU minutes of the program, then of everything with its tests, nothing cached, and
# the slowest files. Usage: measure_build.sh [FOLDER]   (default build/measure; it is made anew)
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${1:-build/measure}
rm -rf "$folder"
mkdir -p "$folder"
export CCACHE_DISABLE=1
TIMEFORMAT='%U s of user time, %S s of system time, %R s in all'
cmake --preset release -B "$folder" >"$folder/configure.log" 2>&1
echo "the program:"
time ninja -C "$folder" angiospline >"$folder/program.log"
echo "the rest, with all tests:"
time ninja -C "$folder" >"$folder/rest.log"
echo "the slowest files, in seconds of wall time beside their neighbours:"
# Lines of ninja's log: start and end in milliseconds, a time stamp, the file.
grep -v '^#' "$folder/.ninja_log" | awk '{ printf "%6.1f  %s\n", ($2 - $1) / 1000, $4 }' | sort -rn | head -20
