#!/usr/bin/env bash
# Builds the Debian package from a program that is built already, on the Debian that it was built on:
#
#   cargo build --profile dist --locked --bin precut
#   packaging/deb.sh target/dist/precut FOLDER [OPTION OF dpkg-deb ...]     prints the package's path
set -euo pipefail

precut=$1
folder=$2
shift 2
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
chmod 755 "$root"

version=$("$precut" --version | cut -d ' ' -f 2)
architecture=$(dpkg --print-architecture)
# The newest C library that it asks for something.
glibc=$(readelf --version-info --wide "$precut" | grep --only-matching 'GLIBC_[0-9.]*' | sort --version-sort | tail -n 1)

install -D -m 755 "$precut" "$root/usr/bin/precut"
install -D -m 644 "$here/precut.service" "$root/usr/lib/systemd/system/precut.service"
install -D -m 644 "$here/precut.toml" "$root/etc/precut/precut.toml"
install -D -m 644 "$here/../LICENSE" "$root/usr/share/doc/precut/copyright"
install -D -m 644 "$here/../CHANGELOG.md" "$root/usr/share/doc/precut/CHANGELOG.md"
install -D -m 644 "$here/../config.default.toml" "$root/usr/share/doc/precut/config.default.toml"
install -d "$root/DEBIAN"
for script in postinst prerm postrm; do install -m 755 "$here/debian/$script" "$root/DEBIAN/$script"; done
echo /etc/precut/precut.toml >"$root/DEBIAN/conffiles"
cat >"$root/DEBIAN/control" <<END
Package: precut
Version: $version
Architecture: $architecture
Maintainer: precut <precut@localhost>
Depends: libc6 (>= ${glibc#GLIBC_}), libgcc-s1
Recommends: ca-certificates
Section: science
Priority: optional
Installed-Size: $(du --summarize --block-size=1024 "$root/usr" | cut -f 1)
Description: what to know before the cut: machining accuracy as a service
 An HTTP service with a workbench for the browser: deflection of shafts and rings, lobing, feed schedules,
 fixtures, diagnosis of machines. It listens on this machine only until /etc/precut/precut.toml says otherwise.
END

mkdir -p "$folder"
package=$folder/precut_${version}_$architecture.deb
dpkg-deb --root-owner-group "$@" --build "$root" "$package" >&2
echo "$package"
