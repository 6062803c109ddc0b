#!/usr/bin/env bash
# Runs ctest for one preset; its closing summary is the last thing printed.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
if [ -n "${ANGIOSPLINE_DATA:-}" ]; then
  echo "Tests on real data use ANGIOSPLINE_DATA=$ANGIOSPLINE_DATA" >&2
else
  echo "Tests on real data are skipped: ANGIOSPLINE_DATA is not set" >&2
fi
exec ctest --preset "$1" --parallel "${JOBS:-$(nproc)}"
