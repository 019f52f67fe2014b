#!/bin/sh
# Checks that the outputs of the demo's pipelines, except images and the section `run` of manifests, have
# identical bytes for any number of threads, locale, folder and umask. Uses smaller inputs than
# pipelines/demo.mk. FULL=1 uses those of pipelines/demo.mk (DEMO_WITH: variables of make), runs each
# number of threads twice, and reports if the images agree too.
. "$(dirname "$0")/check.sh"
if [ -n "${FULL:-}" ]; then
  demo_with=${DEMO_WITH:-}
  runs='1:C 1:de_DE.UTF-8 2:tr_TR.UTF-8 2:C 8:de_DE.UTF-8 8:tr_TR.UTF-8'
else
  demo_with='FRAMES=8 EDGE=0.03 SPACING=0.02 MESH=--cell-size=0.02'
  runs='1:C 2:de_DE.UTF-8 8:tr_TR.UTF-8'
fi

# Generates locales that this machine does not have.
for locale in de_DE tr_TR; do
  if locale -a | grep -qix "$locale.utf-\?8"; then continue; fi
  mkdir -p "$scratch/locales"
  localedef -i "$locale" -f UTF-8 "$scratch/locales/$locale.UTF-8" ||
    fail "there is no locale $locale.UTF-8: install Debian's locales or locales-all"
  export LOCPATH="$scratch/locales"
done

# Wrapper that sets the number of threads of graspmap if the pipeline does not.
cat >"$scratch/graspmap" <<END
#!/bin/sh
for word in "\$@"; do
  if [ "\$word" = --threads ]; then exec "$graspmap" "\$@"; fi
done
exec "$graspmap" "\$@" --threads "\$GRASPMAP_TEST_THREADS"
END
chmod +x "$scratch/graspmap"

# A report contains the durations of commands. Two reports of one folder are identical.
same_reports() (
  cd "$1"
  LC_ALL=C "$graspmap" report out -o one.html --threads 1 --quiet
  LC_ALL=tr_TR.UTF-8 "$graspmap" report out -o other.html --threads 8 --quiet
  cmp one.html other.html || fail "the report differs"
)

pictures_agree=yes
run() {
  threads=${1%%:*}
  locale=${1#*:}
  number=$2
  # Manifests contain the paths of inputs, so OUT is the same path in different folders.
  folder=$scratch/"place $number"
  mkdir "$folder" "$scratch/tmp_$number"
  # shellcheck disable=SC2086 # words
  (
    cd "$folder"
    umask "$((number % 2 * 55))"
    LC_ALL=$locale LANG=$locale TMPDIR=$scratch/tmp_$number GRASPMAP_TEST_THREADS=$threads \
      make --no-print-directory -f "$source/pipelines/demo.mk" OUT=out $demo_with \
      GRASPMAP="$scratch/graspmap" -j2
  ) >"$scratch/log" 2>&1 || { cat "$scratch/log" >&2; fail "run $1 failed"; }
  digest "$folder/out" '*.png' >"$scratch/digests"
  digest "$folder/out" '*.[!p]*' >"$scratch/pictures"
  same_reports "$folder"
  rm -r "$folder"
  if [ "$number" -eq 1 ]; then
    mv "$scratch/digests" "$scratch/first"
    mv "$scratch/pictures" "$scratch/first_pictures"
    [ "$(wc -l <"$scratch/first")" -ge 40 ] || fail "too few outputs to compare"
  else
    diff "$scratch/first" "$scratch/digests" || fail "run $1 differs"
    cmp -s "$scratch/first_pictures" "$scratch/pictures" || pictures_agree=no
  fi
}

count=0
for one in $runs; do
  count=$((count + 1))
  run "$one" "$count"
done
echo "passed: $(wc -l <"$scratch/first") outputs of $count runs; pictures alike: $pictures_agree"
