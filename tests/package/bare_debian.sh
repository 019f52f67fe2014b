#!/bin/sh
# Installs Debian packages of graspmap in a bare Debian 12 (debootstrap, as root, with this machine's
# mirror), runs the demo there, and the Python module if its package is given. Prints the durations.
# `scripts/package --test` runs it; it is not part of the test suite.
#
# bare_debian.sh PACKAGE.deb...
set -eu
[ $# -gt 0 ] || { sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2; }
packages=$*
folder=$(mktemp -d)
root=$folder/root
trap 'rm -rf --one-file-system "$folder"' EXIT

debian=/etc/apt/sources.list.d/debian.sources
[ -f "$debian" ] || debian=/etc/apt/sources.list
mirror=$(grep -Eo 'https?://[^ ]*' "$debian" | grep -v snapshot | head -n 1)
debootstrap --variant=minbase bookworm "$root" "$mirror" >"$folder/debootstrap.log"
rm -f "$root/etc/apt/sources.list"
mkdir -p "$root/root/packages"
cp "$debian" "$root/etc/apt/$(echo "$debian" | cut -d / -f 4-)"
# Proxy settings and other APT configuration.
for file in /etc/apt/apt.conf.d/*; do
  ! grep -q '^ *Acquire::' "$file" || cp "$file" "$root/etc/apt/apt.conf.d/"
done
cp /etc/resolv.conf "$root/etc/"
# shellcheck disable=SC2086 # the names are words
cp $packages "$root/root/packages/"

cat >"$root/root/run.sh" <<'END'
set -eu
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
mount -t proc proc /proc
cd /root
begin=$(date +%s)
step() { echo "bare_debian: $1 after $(($(date +%s) - begin)) s"; }
apt-get -qq update
apt-get -qq install -y --no-install-recommends ./packages/graspmap_*.deb >install.log 2>&1 || {
  cat install.log
  exit 1
}
step "installed ($(du -sxh / 2>/dev/null | cut -f 1) on disk)"
graspmap --version | head -n 1
make -f /usr/share/graspmap/pipelines/demo.mk OUT=demo -j "$(nproc)" >demo.log 2>&1 || {
  cat demo.log
  exit 1
}
step "demo done"
first=$(find demo -name 'map.pcd' -printf '%T@ %p\n' | sort -n | head -n 1)
echo "bare_debian: first map ${first#* } after $((${first%%.*} - begin)) s"
ls demo/report.html demo/rock_site/scan/map/*.png
set -- ./packages/python3-graspmap_*.deb
if [ -f "$1" ]; then
  apt-get -qq install -y --no-install-recommends "$1" >install.log 2>&1 || {
    cat install.log
    exit 1
  }
  python3 - <<'PYTHON'
import graspmap
terrain = graspmap.read_cloud("demo/rock_site/scan/terrain.pcd")
scored = graspmap.score(terrain, scenario="artificial_rocks_prescan")
print("bare_debian: Python:", len(scored.map), "voxels,", scored.graspable_voxels, "graspable")
PYTHON
  step "Python's map"
fi
END
unshare --mount --pid --fork --propagation private chroot "$root" /bin/sh /root/run.sh
