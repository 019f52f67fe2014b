#!/bin/sh
# Every header that is installed compiles alone, and includes nothing but the standard library, Eigen
# and this project. headers.sh BUILD_FOLDER SOURCE_FOLDER EIGEN_INCLUDE_FOLDER COMPILER...
set -eu
build=$1
source=$2
export eigen=$3
shift 3
export compiler="$*"
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cmake --install "$build" --prefix "$scratch" >"$scratch/install.log"
(cd "$scratch/include/graspmap" && find . -name '*.h' | sort) >"$scratch/headers"
[ "$(wc -l <"$scratch/headers")" -ge 100 ]

# In the same places each time, so that a compiler cache knows them again.
export units="$build/header_units"
mkdir -p "$units"
cd "$source"
# shellcheck disable=SC2046 # names without spaces
foreign=$(grep -nE '^ *# *include *(<[^>]*[/.]|"[^"]*")' $(cat "$scratch/headers") |
  grep -vE '# *include *(<Eigen/|"lib(map|gtd)/)') || true
if [ -n "$foreign" ]; then
  echo "headers that show other libraries:" >&2
  echo "$foreign" >&2
  exit 1
fi

# A Debian 12 compiler takes a second for Eigen alone.
# shellcheck disable=SC2016 # the inner shell expands
xargs -P 2 -I {} sh -c '
  unit=$units/$(echo {} | tr / _).cc
  echo "#include \"{}\"" >"$unit"
  $compiler -std=c++20 -O0 -Wall -Wextra -Werror -I . -isystem "$eigen" -c "$unit" -o "$unit.o" || {
    echo "{} does not compile alone" >&2
    exit 1
  }' <"$scratch/headers"
