# Shared by the tests of the pipelines; sourced with the program $1 and the source folder $2.
set -eu
graspmap=$1
source=$2
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# Every file is there and not empty.
require_files() {
  for file in "$@"; do [ -s "$file" ] || fail "$file is missing or empty"; done
}

# Names, sizes and times of all files below a folder.
listing() {
  find "$1" -type f -printf '%P %s %T@\n' | sort
}
