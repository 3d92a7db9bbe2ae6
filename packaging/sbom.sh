#!/usr/bin/env bash
# Lists every package that the program is built from, with versions, checksums and licences (CycloneDX 1.5, JSON):
#
#   packaging/sbom.sh FILE
#
# It builds cargo-cyclonedx once, in about two minutes, under the target folder.
set -euo pipefail
VERSION=0.5.9

file=$(realpath "$1")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
tools=$(cargo metadata --format-version 1 --no-deps --locked | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/tools
root=$tools/cyclonedx-$VERSION
if [ ! -x "$root/bin/cargo-cyclonedx" ]; then
  CARGO_PROFILE_DEV_DEBUG=none cargo install --quiet --locked --debug --root "$root" --target-dir "$root/build" \
    "cargo-cyclonedx@$VERSION"
  rm -rf "$root/build"
fi
"$root/bin/cargo-cyclonedx" cyclonedx --format json --spec-version 1.5 --describe binaries --no-build-deps --quiet
mv precut_bin.cdx.json "$file"
