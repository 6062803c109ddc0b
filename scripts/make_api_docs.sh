#!/usr/bin/env bash
# The API reference of the public headers by Doxygen, one warning being an error. Usage: make_api_docs.sh OUTPUT
set -euo pipefail
output=$(realpath -m "$1")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p "$output"

# The rooms' lists say which headers are public: those of angiospline_room(PUBLIC ...), and all of a library without
# rooms (angiospline_library(... HEADERS ...)).
public_headers() {
  local list folder
  find . -path ./tests -prune -o -path './build*' -prune -o -name CMakeLists.txt -print | cut -c 3- | sort | while read -r list; do
    folder=$(dirname "$list")
    tr -s ' \n' '\n' <"$list" | awk -v folder="$folder" '
      { closes = /\)/; gsub(/[()]/, "") }
      /^angiospline_(room|library)/ { inside = 1; next }
      /^(PUBLIC|HEADERS)$/ { taken = inside; next }
      /^[A-Z_]+$/ { taken = 0 }
      taken && /\.h$/ { print folder "/" $0 }
      closes { inside = taken = 0 }'
  done
}
public_headers >"$output/headers.txt"
[ -s "$output/headers.txt" ] || { echo "make_api_docs: no public header found" >&2; exit 1; }

{
  cat docs/Doxyfile
  echo "INPUT = docs/api.md $(tr '\n' ' ' <"$output/headers.txt")"
  echo "OUTPUT_DIRECTORY = $output"
} | doxygen -
echo "$(wc -l <"$output/headers.txt") public headers -> $output/html/index.html"
