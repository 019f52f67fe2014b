#!/bin/sh
# Checks that the target `docs` builds without warnings and that every function of the public headers has
# a comment: run.sh BUILD_FOLDER PYTHON DOXYGEN. Exits with 77 if Doxygen is not installed.
set -eu
if [ ! -x "$3" ]; then
  echo "skipped: Debian's doxygen is not installed"
  exit 77
fi
"$3" "$1/Doxyfile"
PYTHONDONTWRITEBYTECODE=1 "$2" "$(dirname "$0")/check_documented.py" "$1/docs/xml"
