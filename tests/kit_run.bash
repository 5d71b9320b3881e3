# For scripts of tests/chain that run a vector kit:   . kit_run.bash BUILD
# Beside small_scene.bash: kit, the folder of the small scene's kit, and run.
. "$(dirname "${BASH_SOURCE[0]}")/small_scene.bash" "$@"
unset MAKEFLAGS MAKELEVEL
kit=$work/elsewhere
"$build/bin/sf_export" "$work/scene.snn" --vectors "$work/made" --data "$work/data" --samples "${KIT_SAMPLES:-24}" --seed 3 >/dev/null && mv "$work/made" "$kit" || exit 1

# run SIMULATOR STATUS TEXT... [-- VARIABLE...]: make's status (0, or 1 for any failure) and texts in what it prints
run() {
  local simulator=$1 want=$2 texts=() got
  shift 2
  while [ $# -gt 0 ] && [ "$1" != -- ]; do texts+=("$1"); shift; done
  shift
  make -s -C "$kit" "$simulator" "$@" >"$work/log" 2>&1
  got=$(($? > 0))
  [ $got -eq "$want" ] || fail "$simulator $*: status $got, expected $want: $(tail -n 3 "$work/log")"
  for text in "${texts[@]}"; do
    grep -qF -- "$text" "$work/log" || fail "$simulator $*: '$text' is not in $(grep -E 'DIFF|PASS|rror' "$work/log")"
  done
  grep -E '^(PASS|DIFFERENCE)' "$work/log"
}

# flip FILE LINE: one wrong bit
flip() {
  cp "$kit/$1" "$work/kept"
  awk -v at="$2" 'NR == at { digit = substr($0, length($0)); $0 = substr($0, 1, length($0) - 1) \
    substr("1032547698badcfe", index("0123456789abcdef", digit), 1) } { print }' "$work/kept" >"$kit/$1"
}
