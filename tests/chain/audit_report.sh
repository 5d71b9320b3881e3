#!/bin/bash
# Reports of energy_audit on a small scene: schemas, sums, comparison, technology files. usage: audit_report.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
audit() { "$build/bin/energy_audit" "$work/scene.snn" "$work/data" --rays 200 --rtl-rays 2 --recount-rays 20 --quiet "$@"; }

# A technology of one's own: a copy gives the same report, one with another price another, a broken one none.
audit --json >"$work/a.json" || fail "audit"
cp share/tech/45nm.tech "$work/own.tech"
audit --json --tech "$work/own.tech" >"$work/b.json" || fail "audit with a copy of the prices"
"$build/bin/energy_audit" --compare "$work/a.json" "$work/b.json" >"$work/same.txt" || fail "comparison"
[ "$(grep -c ': none$' "$work/same.txt")" -eq 3 ] || fail "a copy of the prices gives another report"
sed -i 's/^sram.8192 .*/sram.8192 5 pJ half of it/' "$work/own.tech"
audit --json --tech "$work/own.tech" >"$work/c.json" || fail "audit with other prices"
"$build/bin/energy_audit" --compare "$work/a.json" "$work/c.json" >"$work/other.txt" || fail "comparison"
grep -q 'price of sram.8192 *10 pJ -> 5 pJ' "$work/other.txt" || fail "the comparison does not name the price"
grep -q 'events per view, by relative change: none' "$work/other.txt" || fail "a price changes events"
grep -Eq '^paper .*\+0.00%' "$work/other.txt" || fail "a memory price changes the paper's metric"
grep -Eq '^  weight rows .* -[0-9.]+%$' "$work/other.txt" || fail "a memory price does not change the weights' energy"
"$build/bin/energy_audit" --compare "$work/a.json" "$work/c.json" --plot "$work/change.gp" >/dev/null 2>"$work/err" || fail "--plot: $(cat "$work/err")"
grep -q "change.gp" "$work/err" || fail "--plot says nothing"
[ "$(sed -n 's/^"weight rows" //p' "$work/change.gp" | awk '{ print ($2 < $1) }')" = 1 ] || fail "the plot: $(cat "$work/change.gp")"
if command -v gnuplot >/dev/null; then
  (cd "$work" && gnuplot change.gp) >"$work/err" 2>&1 && grep -q 'weight rows' "$work/change.svg" || fail "gnuplot: $(cat "$work/err")"
fi
"$build/bin/energy_audit" --compare "$work/a.json" "$work/c.json" --plot "$work/change.svg" >/dev/null 2>"$work/err"
[ $? -eq 2 ] && grep -q 'expected NAME.gp' "$work/err" || fail "--plot change.svg: $(cat "$work/err")"
sed -i 's/^dram .*/dram 2 pj typing error/' "$work/own.tech"
audit --tech "$work/own.tech" >"$work/out" 2>"$work/err" && fail "a broken technology file is accepted"
line=$(grep -n '^dram' "$work/own.tech" | cut -d: -f1)
grep -qF "own.tech:$line: key 'dram': unit 'pj'" "$work/err" || fail "not named: $(cat "$work/err")"
[ ! -s "$work/out" ] || fail "output in spite of an error"

# Another cache: other misses, the same look-ups; what no build has is refused.
audit --json --cache-bytes 1024 --cache-ways 1 >"$work/d.json" || fail "audit with another cache"
"$build/bin/energy_audit" --compare "$work/a.json" "$work/d.json" >"$work/cache.txt" || fail "comparison"
grep -q 'cache bytes *32768 -> 1024' "$work/cache.txt" && grep -q 'cache ways *4 -> 1' "$work/cache.txt" ||
  fail "the comparison does not name the cache"
grep -q '^  field lines missed .*+' "$work/cache.txt" || fail "a smaller cache misses no more: $(cat "$work/cache.txt")"
grep -q '^  field look-ups .*change' "$work/cache.txt" && fail "another cache has other look-ups"
for wrong in '--cache-bytes 3000' '--cache-ways 3'; do
  audit $wrong >"$work/out" 2>"$work/err" && fail "$wrong is accepted"
  grep -q 'cache of 3.* expected' "$work/err" || fail "$wrong: $(cat "$work/err")"
done

# A twin of its own: every synapse an fp32 MAC, once for each of the samples that it takes.
"$build/bin/sf_train" "$work/data" -o "$work/twin.safetensors" --net ann --stage1 2 --stage2 2 --levels 2 --log2-hash 8 \
  --threads 1 -q >/dev/null || fail "twin"
audit --json --twin "$work/twin.safetensors" | tr -d ' \n\t' >"$work/twin.json" || fail "audit with a twin"
twin() { sed -E "s/.*\"twin\":\{[^}]*\"$1\":([0-9]+).*/\1/" "$work/twin.json"; }
[ "$(twin samples)" -gt 0 ] && [ "$(twin macs_per_sample)" -gt 0 ] || fail "the twin counts nothing"
[ "$(twin fj)" -eq $(($(twin samples) * $(twin macs_per_sample) * 4600)) ] || fail "the twin's energy"
# TensoRF's decoder alone counts, on the samples that reach it: 150 * 128 + 128 * 128 + 128 * 3.
"$build/bin/sf_train" "$work/data" -o "$work/decoder.safetensors" --backbone tensorf --net ann --stage1 2 --stage2 2 --voxels 16 \
  --threads 1 -q >/dev/null || fail "TensoRF twin"
audit --json --twin "$work/decoder.safetensors" | tr -d ' \n\t' >"$work/twin.json" || fail "audit with a TensoRF twin"
[ "$(twin macs_per_sample)" -eq 35968 ] && [ "$(twin samples)" -gt 0 ] || fail "the decoder's synapses"
[ "$(twin fj)" -eq $(($(twin samples) * 35968 * 4600)) ] || fail "the TensoRF twin's energy"

# The prices stand beside the program, wherever the two are; the page's template is inside.
mkdir -p "$work/moved/bin" && cp "$build/bin/energy_audit" "$work/moved/bin" && cp -r "$build/share" "$work/moved"
(cd / && "$work/moved/bin/energy_audit" "$work/scene.snn" "$work/data" --rays 20 --rtl-rays 0 -q --html "$work/moved.html" >/dev/null) ||
  fail "moved program"
grep -q 'id="audit-json"' "$work/moved.html" || fail "the page of a moved program"
rm -r "$work/moved/share"
(cd / && "$work/moved/bin/energy_audit" "$work/scene.snn" "$work/data" --rays 20 --rtl-rays 0 -q >/dev/null 2>"$work/err") &&
  fail "no prices, no error"
grep -qF "moved/share/spikefield/tech/45nm.tech" "$work/err" || fail "the missing file is not named: $(cat "$work/err")"

# The text: every ledger, the limits, the agreement.
audit >"$work/text" || fail "text"
for words in 'core = accelerator = recount' 'everything' 'Where 16 samples share each read of weights' 'field look-ups' 'integer ReLU twin' 'not modelled' 'known criticism' \
  'Firing rate at which' 'Horowitz' 'largest first'; do
  grep -qF -e "$words" "$work/text" || fail "the report does not say '$words'"
done

if ! command -v python3 >/dev/null; then
  echo "the schemas were left out"; echo "python3: not installed"
else
  "$build/bin/sf_train" "$work/data" -o "$work/planes.safetensors" --backbone tensorf --stage1 2 --stage2 2 --voxels 16 \
    --threads 1 -q >/dev/null && "$build/bin/sf_export" "$work/planes.safetensors" -o "$work/planes.snn" >/dev/null || fail "TensoRF scene"
  for scene in scene planes; do
    python3 tests/audit_schema.py "$build/bin/energy_audit" "$work/$scene.snn" "$work/data"
    case $? in 0) ;; 77) echo "schemas: left out" ;; *) fail "schemas of the audit of $scene.snn" ;; esac
  done
fi
finish "reports of energy_audit: all as they should be"
