# Shared by the tests of the pipelines; sourced with the program $1 and the source folder $2.
set -eu
graspmap=$(realpath "$1")
source=$(realpath "$2")
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

# SHA-256 of all files below the folder $1, in its order, but those whose name fits the pattern $2. Of
# what tells how long a run took, without that: of a manifest the section `run`, its last; of a
# store's plan, when its inputs were written; of a report, which shows all of these, the name alone.
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

# The processes that were started with GRASPMAP_TEST_RUN=$1 in their environment.
processes_of() {
  for found in $(grep -lsxz "GRASPMAP_TEST_RUN=$1" /proc/[0-9]*/environ); do
    process=${found%/environ}
    tr '\0' ' ' 2>/dev/null <"$process/cmdline" && echo
  done
}

# All of them have ended, at once or soon, and nobody holds a lock in the folder $2. One that is about
# to end has lost its environment before it gives its locks back.
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
