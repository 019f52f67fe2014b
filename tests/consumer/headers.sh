#!/bin/sh
# Every header that is installed compiles alone, and includes nothing but the standard library, Eigen
# and this project. headers.sh BUILD_FOLDER COMPILER EIGEN_INCLUDE_FOLDER
set -eu
build=$1
export compiler=$2
export eigen=$3
scratch=$(mktemp -d)
export scratch
trap 'rm -rf "$scratch"' EXIT
cmake --install "$build" --prefix "$scratch" >"$scratch/install.log"
cd "$scratch/include/graspmap"

foreign=$(grep -rnE '^ *# *include *(<[^>]*[/.]|"[^"]*")' . |
  grep -vE '# *include *(<Eigen/|"lib(map|gtd)/)') || true
if [ -n "$foreign" ]; then
  echo "headers that show other libraries:" >&2
  echo "$foreign" >&2
  exit 1
fi

# shellcheck disable=SC2016 # the inner shell expands
find . -name '*.h' | sort | xargs -P 2 -I {} sh -c \
  'echo "#include \"{}\"" | "$compiler" -std=c++20 -Wall -Wextra -Werror -fsyntax-only -x c++ \
     -I . -isystem "$eigen" - || { echo "{} does not compile alone" >&2; exit 255; }'
