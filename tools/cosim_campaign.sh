#!/bin/bash
# Co-simulates SAMPLES samples, shared by the SEEDS, with stalls; JSON and JUnit XML in BUILD/cosim.
# usage: cosim_campaign.sh BUILD SCENE DATA SAMPLES "SEEDS" [STALLS]
# LAUNCH: in place of JOBS processes here, ranks: "mpirun -n 8", "srun --mpi=pmix -n 64".
# Interrupted, the same command goes on. A seed that is finished is not run again while program, scene and options are the same.
set -u
if [ $# -lt 5 ]; then
  echo 'usage: cosim_campaign.sh BUILD SCENE DATA SAMPLES "SEEDS" [STALLS]' >&2
  exit 2
fi
build=$1 scene=$2 data=$3 samples=$4 seeds=$5 stalls=${6:-20}
out=$build/cosim
program=$build/bin/sf_cosim
read -ra launch <<<"${LAUNCH:-}"
[ ${#launch[@]} -gt 0 ] && processes=() || processes=(--jobs "${JOBS:-$(nproc)}")
case $samples in *[!0-9]*) echo "cosim_campaign: SAMPLES '$samples' is not a whole number" >&2; exit 2 ;; esac
read -ra seed <<<"$seeds"
[ ${#seed[@]} -gt 0 ] && [ "${samples:-0}" -gt 0 ] || { echo "cosim_campaign: SAMPLES or SEEDS is empty" >&2; exit 2; }
twice=$(printf '%s\n' "${seed[@]}" | sed -E 's/^0+([0-9])/\1/' | sort | uniq -d | head -n 1)
[ -z "$twice" ] || { echo "cosim_campaign: SEEDS holds $twice twice" >&2; exit 2; }
each=$(((10#$samples + ${#seed[@]} - 1) / ${#seed[@]}))
mkdir -p "$out" || exit 1
field() { sed -nE "s/^\t\"$2\":\t([^,]*).*/\1/p" "$1"; }

failed=0
for s in "${seed[@]}"; do
  key=$(sha256sum "$program" "$scene" | cut -c1-64 | tr '\n' ' ')"$data $s $each $stalls"
  if [ "$(cat "$out/seed-$s.key" 2>/dev/null)" != "$key" ]; then
    rm -f "$out/seed-$s".*
    printf '%s' "$key" >"$out/seed-$s.key"
  fi
  [ -e "$out/seed-$s.done" ] && { echo "seed $s: done before"; continue; }
  "${launch[@]}" "$program" "$scene" "$data" --rays 1000000000 --limit-samples "$each" --seed "$s" --stalls "$stalls" "${processes[@]}" \
    --checkpoint "$out/seed-$s.part" --evidence "$out/seed-$s-difference" --junit "$out/seed-$s.xml" --json >"$out/seed-$s.json"
  status=$?
  # A launcher may have a status of its own for it.
  [ $status -ne 0 ] && [ "$(field "$out/seed-$s.json" complete) $(field "$out/seed-$s.json" differences)" = "false 0" ] && status=130
  [ $status -eq 130 ] && { echo "stopped; the same command goes on"; exit 130; }
  if [ $status -ne 0 ]; then
    failed=$((failed + 1))
    [ -s "$out/seed-$s.json" ] || exit $status
    continue
  fi
  touch "$out/seed-$s.done"
done

# write FILE COMMAND: FILE is whole, or the campaign fails.
write() {
  if "$2" >"$1.part" && mv -T "$1.part" "$1"; then return; fi
  rm -f "$1.part"
  echo "cosim_campaign: $1 cannot be written" >&2
  exit 1
}
junit() {
  printf '<?xml version="1.0" encoding="UTF-8"?>\n<testsuites>\n' || return
  for s in "${seed[@]}"; do sed 1d "$out/seed-$s.xml" || return; done
  echo '</testsuites>'
}
json() {
  printf '{"samples": %d, "differences": %d, "stall_percent": %d, "seeds": [\n' $total $differences "$stalls" || return
  comma=
  for s in "${seed[@]}"; do
    printf '%s' "$comma" || return
    cat "$out/seed-$s.json" || return
    comma=,
  done
  echo ']}'
}
total=0 differences=0
for s in "${seed[@]}"; do
  n=$(field "$out/seed-$s.json" samples) d=$(field "$out/seed-$s.json" differences)
  [ -n "$n" ] && [ -n "$d" ] || { echo "cosim_campaign: $out/seed-$s.json is not whole" >&2; exit 1; }
  echo "seed $s: $n samples, $d differences, $(field "$out/seed-$s.json" cycles) cycles"
  total=$((total + n)) differences=$((differences + d))
done
write "$out/campaign.xml" junit
write "$out/campaign.json" json
echo "$total samples over ${#seed[@]} seeds, stalls $stalls %, $differences differences: $out/campaign.json, $out/campaign.xml"
[ $failed -eq 0 ]
