#!/bin/sh
# Installs the build folder $1 of the source folder $2 into a scratch prefix, builds the example of
# README.md against it, and compares its map with the map of the installed program.
set -eu
build=$1
source=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cmake --install "$build" --prefix "$scratch/prefix" >"$scratch/install.log"
sed -n '/^```cpp$/,/^```$/p' "$source/README.md" | sed '1d; $d' >"$scratch/main.cc"
cmake -S "$source/tests/consumer" -B "$scratch/build" -G Ninja -DMAIN="$scratch/main.cc" \
  -DCMAKE_PREFIX_PATH="$scratch/prefix" ${3:+-DCMAKE_CXX_FLAGS="$3"} >"$scratch/configure.log"
cmake --build "$scratch/build"
program=$scratch/prefix/bin/graspmap
"$program" simulate scene --spacing 0.02 -o "$scratch/terrain.pcd" --quiet
"$scratch/build/consumer" "$scratch/terrain.pcd" "$scratch/library.pcd" | grep -q ' voxels are graspable$'
"$program" score "$scratch/terrain.pcd" --config primitive_shapes_prescan -o "$scratch/command.pcd" --quiet
cmp "$scratch/library.pcd" "$scratch/command.pcd"
# A moved installation finds its libraries and its data.
mv "$scratch/prefix" "$scratch/moved"
"$scratch/moved/bin/graspmap" simulate scene --spacing 0.03 -o "$scratch/scene.pcd" --quiet
"$scratch/moved/bin/graspmap" score "$scratch/scene.pcd" --voxel-size 0.03 -o "$scratch/map.pcd" \
  --quiet
"$scratch/moved/bin/graspmap" info "$scratch/map.pcd" | grep 'kind: graspability map'
# The Python module, if it is built, finds them too.
module=$scratch/moved/lib/python3/dist-packages
if [ -d "$module" ]; then
  PYTHONPATH=$module /usr/bin/python3 -B -c "if True:
    import sys, graspmap
    terrain = graspmap.read_cloud(sys.argv[1])
    graspmap.write_cloud(sys.argv[2], graspmap.score(terrain, voxel_size_m=0.03).map)
    assert graspmap.__file__.startswith(sys.argv[3])" \
    "$scratch/scene.pcd" "$scratch/python.pcd" "$scratch/moved"
  cmp "$scratch/map.pcd" "$scratch/python.pcd"
fi
