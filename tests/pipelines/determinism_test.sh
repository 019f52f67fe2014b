#!/bin/sh
# Every output of the demo's pipelines but pictures has the same bytes for any number of threads and
# in any locale; manifests but for their section `run`. On smaller inputs; with FULL=1 on those of
# scripts/demo, each number of threads twice.
. "$(dirname "$0")/check.sh"
if [ -n "${FULL:-}" ]; then
  small_site= small_scene= runs='1 1 2 2 8 8'
else
  small_site='FRAMES=8 EDGE=0.03' small_scene='SPACING=0.02' runs='1 2 8'
fi

# A program that runs graspmap with so many threads where the pipeline does not say how many.
cat >"$scratch/graspmap" <<END
#!/bin/sh
for word in "\$@"; do
  if [ "\$word" = --threads ]; then exec "$graspmap" "\$@"; fi
done
exec "$graspmap" "\$@" --threads "\$GRASPMAP_TEST_THREADS"
END
chmod +x "$scratch/graspmap"

# SHA-256 of all outputs of the run $1, in the folder's order.
digest() {
  (cd "$scratch/$1" && find . -type f ! -name '*.png' | LC_ALL=C sort | while read -r file; do
    case $file in
      # As every output is a part of the folder's run, its manifest ends in the section "run".
      *.json) sed '/^  "run": {/,$d' "$file" | sha256sum | sed "s|-|$file|" ;;
      *) sha256sum "$file" ;;
    esac
  done)
}

run() {
  name=$1
  GRASPMAP_TEST_THREADS=$2
  export GRASPMAP_TEST_THREADS
  # One folder name for every run: manifests hold the inputs' paths.
  rm -rf "$scratch/out"
  mkdir "$scratch/out"
  (
    cd "$scratch"
    # shellcheck disable=SC2086 # words
    make --no-print-directory -f "$source/pipelines/rock_site.mk" OUT=out/rock_site $small_site \
      GRASPMAP="$scratch/graspmap" -j2
    # shellcheck disable=SC2086 # words
    make --no-print-directory -f "$source/pipelines/primitive_shapes.mk" OUT=out/primitive_shapes \
      $small_scene GRASPMAP="$scratch/graspmap" -j2
  ) >"$scratch/log" 2>&1 || { cat "$scratch/log" >&2; fail "$name did not end well"; }
  digest out >"$scratch/digests"
  if [ ! -f "$scratch/first" ]; then
    mv "$scratch/digests" "$scratch/first"
    [ "$(wc -l <"$scratch/first")" -ge 40 ] || fail "too few outputs to compare"
  else
    diff "$scratch/first" "$scratch/digests" || fail "$name differs"
  fi
}

for threads in $runs; do run "$threads threads" "$threads"; done
for locale in C de_DE.UTF-8 tr_TR.UTF-8; do
  LC_ALL=$locale LANG=$locale run "locale $locale" 2
done
echo "passed: $(wc -l <"$scratch/first") outputs"
