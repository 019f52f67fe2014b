# Functions of the pipeline tests; sourced with the program $1 and the source folder $2.
set -eu
graspmap=$(realpath "$1")
source=$(realpath "$2")
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

fail() {
  echo "FAILED: $*" >&2
  exit 1
}

# Fails unless every file exists and is not empty.
require_files() {
  for file in "$@"; do [ -s "$file" ] || fail "$file is missing or empty"; done
}

# Prints names, sizes and times of all files below a folder.
listing() {
  find "$1" -type f -printf '%P %s %T@\n' | sort
}

# Prints the SHA-256 of all files below the folder $1, sorted, except files whose name matches the pattern
# $2. Data that differ between runs are excluded: the section `run` of a manifest (the last section), the
# times of the inputs in the plan of a tile store, and the content of a report.
digest() {
  (cd "$1" && find . -mindepth 1 ! -type d ! -name "${2:-}" | LC_ALL=C sort | while read -r file; do
    case $file in
      */report.html | */report.html.json) echo "$file" ;;
      */progress/plan.json) sed '/"modified_ns"/d' "$file" | sha256sum | sed "s|-|$file|" ;;
      *.json) sed '/^  "run": {/,$d' "$file" | sha256sum | sed "s|-|$file|" ;;
      *) sha256sum "$file" ;;
    esac
  done)
}

# Prints the processes that were started with GRASPMAP_TEST_RUN=$1 in their environment.
processes_of() {
  for found in $(grep -lsxz "GRASPMAP_TEST_RUN=$1" /proc/[0-9]*/environ); do
    process=${found%/environ}
    tr '\0' ' ' 2>/dev/null <"$process/cmdline" && echo
  done
}

# Fails unless these processes end soon and no process holds a lock in the folder $2. An ending process
# loses its environment before it releases its locks.
require_no_processes() {
  for _ in $(seq 300); do
    if [ -z "$(processes_of "$1")" ] &&
      ! find "$2" -name .lock 2>/dev/null -exec sh -c 'flock --nonblock "$0" true || echo held' {} \; |
        grep -q held; then
      return
    fi
    sleep 0.1
  done
  fail "processes were left behind: $(processes_of "$1")"
}
