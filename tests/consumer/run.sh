#!/bin/sh
# Installs the build folder $1 of the source folder $2 into a scratch prefix, builds the little
# project beside this script against it, and runs it and the installed program from there.
set -eu
build=$1
source=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cmake --install "$build" --prefix "$scratch/prefix" >"$scratch/install.log"
cmake -S "$source/tests/consumer" -B "$scratch/build" -G Ninja \
  -DCMAKE_PREFIX_PATH="$scratch/prefix" ${3:+-DCMAKE_CXX_FLAGS="$3"} >"$scratch/configure.log"
cmake --build "$scratch/build"
"$scratch/build/consumer" "$scratch/prefix/share/graspmap/grippers/hubrobo.yaml"
# Moved as a whole, it still finds its libraries and its data.
mv "$scratch/prefix" "$scratch/moved"
"$scratch/moved/bin/graspmap" simulate scene --spacing 0.03 -o "$scratch/scene.pcd" --quiet
"$scratch/moved/bin/graspmap" score "$scratch/scene.pcd" --voxel-size 0.03 -o "$scratch/map.pcd" \
  --quiet
"$scratch/moved/bin/graspmap" info "$scratch/map.pcd" | grep 'kind: graspability map'
