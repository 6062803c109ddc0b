#!/usr/bin/env bash
# Installs the outside judges: Debian's (scripts/packages-judges.txt) and, from npm, the Khronos glTF validator,
# which goes to build/judges.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
# A machine may have a newer node than Debian's, from elsewhere; then Debian's is not asked for.
list=$(mktemp)
trap 'rm -f "$list"' EXIT
cp scripts/packages-judges.txt "$list"
if command -v node >/dev/null && command -v npm >/dev/null; then sed -i -e '/^nodejs$/d' -e '/^npm$/d' "$list"; fi
scripts/install_packages.sh "$list"

validator=2.0.0-dev.3.10
if [ ! -d build/judges/node_modules/gltf-validator ]; then
  mkdir -p build/judges
  npm install --silent --no-fund --no-audit --prefix build/judges "gltf-validator@$validator" >&2
fi
