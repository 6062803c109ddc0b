#!/usr/bin/env bash
# The API reference is made of the public headers and without one warning. Usage: check_api.sh ROOT OUTPUT
# Exit code 77: Doxygen is not installed.
set -euo pipefail
root=$1
output=$2
command -v doxygen >/dev/null || { echo "skipped: doxygen is not installed (scripts/packages-dev.txt)"; exit 77; }
rm -rf "$output"
"$root/scripts/make_api_docs.sh" "$output"
pages=$(find "$output/html" -name '*.html' | wc -l)
echo "$pages pages"
[ "$pages" -gt 100 ]
