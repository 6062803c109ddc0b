#!/usr/bin/env bash
# Runs ctest for one preset; its closing summary is the last thing printed. Says first which inputs and outside
# judges the tests will find; tests that miss one skip and are counted as such.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
if [ -n "${ANGIOSPLINE_DATA:-}" ]; then
  echo "Tests on real data use ANGIOSPLINE_DATA=$ANGIOSPLINE_DATA" >&2
else
  echo "Tests on real data are skipped: ANGIOSPLINE_DATA is not set" >&2
fi
modules=$PWD/build/judges/node_modules
if [ -z "${ANGIOSPLINE_NODE_MODULES:-}" ] && [ -d "$modules/gltf-validator" ]; then export ANGIOSPLINE_NODE_MODULES=$modules; fi
if [ -z "${ANGIOSPLINE_CHROMIUM:-}" ] && command -v chromium >/dev/null; then export ANGIOSPLINE_CHROMIUM=chromium; fi
missing=()
for judge in gmsh freecadcmd netgen doxygen; do command -v "$judge" >/dev/null || missing+=("$judge"); done
[ -n "${ANGIOSPLINE_NODE_MODULES:-}" ] || missing+=(gltf-validator)
[ -n "${ANGIOSPLINE_CHROMIUM:-}" ] || missing+=(chromium)
if [ ${#missing[@]} -gt 0 ]; then
  echo "Tests with these outside judges are skipped: ${missing[*]} (make judges installs them)" >&2
else
  echo "All outside judges are here: gmsh, FreeCAD, Netgen, the Khronos validator, a browser, Doxygen" >&2
fi
exec ctest --preset "$1" --parallel "${JOBS:-$(nproc)}"
