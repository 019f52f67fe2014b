#!/bin/sh
# The target `docs` builds without a warning, and every function of the public headers has a comment.
# run.sh BUILD_FOLDER PYTHON DOXYGEN. Ends with 77 where Doxygen is not installed.
set -eu
if [ ! -x "$3" ]; then
  echo "skipped: Debian's doxygen is not installed"
  exit 77
fi
"$3" "$1/Doxyfile"
PYTHONDONTWRITEBYTECODE=1 "$2" "$(dirname "$0")/check_documented.py" "$1/docs/xml"
