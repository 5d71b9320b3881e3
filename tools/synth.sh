#!/bin/bash
# Synthesis with Yosys for the 7 series: what each module costs, per number of lanes.
set -euo pipefail
usage() {
  cat <<'TEXT'
Usage: synth.sh BUILD [--modules "NAME..."] [--lanes "N..."] [--rtl DIR] [--top] [--report] [--json] [--quiet]

Synthesise modules of the accelerator (yosys, synth_xilinx -family xc7) and print a table of what they cost. Writes
BUILD/synth/synth.md and BUILD/synth/synth.json. Every finished run is kept in BUILD/synth/runs until the RTL, the
tool or the recipe changes, so an interrupted set goes on where it stopped.

  --modules "NAME..."  these only (default: all but sf_engine, sf_top and sf_ray_top,
                       small ones first)
  --lanes "N..."       numbers of lanes (default: the one of sf_arch_pkg); a module without a parameter LANES exists
                       for that one alone
  --rtl DIR            folder that holds rtl/ (default: that of this script)
  --top                sf_top and sf_ray_top, too, without tap ports: minutes to an hour and gigabytes
  --report             only what is there, for every number of lanes there is; run nothing
  --json               print the JSON instead of the table
  --quiet              no progress

Examples:
  tools/synth.sh build
  tools/synth.sh build --modules "sf_plif sf_readout" --lanes "32 64 128"
  tools/synth.sh build --top --report --json
TEXT
}
die() { echo "synth: $2" >&2; exit "$1"; }

build='' modules='' lanes='' root=$(cd "$(dirname "$0")/.." && pwd) top='' report='' json='' quiet=''
while [ $# -gt 0 ]; do
  case $1 in
    --help | -h) usage; exit 0 ;;
    --modules | --lanes | --rtl)
      [ $# -ge 2 ] || die 2 "$1 needs a value (see --help)"
      case $1 in --modules) modules=$2 ;; --lanes) lanes=$2 ;; *) root=$2 ;; esac
      shift ;;
    --top) top=1 ;;
    --report) report=1 ;;
    --json) json=1 ;;
    --quiet) quiet=1 ;;
    -*) die 2 "unknown option '$1' (see --help)" ;;
    *) [ -z "$build" ] || die 2 "unexpected argument '$1' (see --help)"; build=$1 ;;
  esac
  shift
done
[ -n "$build" ] || { usage >&2; exit 2; }
[ -f "$root/rtl/sf_top.sv" ] || die 1 "$root/rtl/sf_top.sv is not there"
[ -n "$report" ] || command -v yosys >/dev/null || die 77 "yosys is not installed"
say() { [ -n "$quiet" ] || echo "synth: $1" >&2; }

mkdir -p "$build/synth/runs"
out=$(cd "$build/synth" && pwd)
cd "$root"
packages=$(ls rtl/gen/*_pkg.sv rtl/*_pkg.sv)
sources=$(ls -rS rtl/*.sv rtl/gen/*.sv | grep -v '_pkg\.sv$')
built_for=$(sed -nE 's/.*\bLANES = ([0-9]+);.*/\1/p' rtl/gen/sf_arch_pkg.sv)
macs=$(sed -nE 's/.*\bMACS = ([0-9]+);.*/\1/p' rtl/gen/sf_arch_pkg.sv)
[ -n "$built_for" ] || die 1 "rtl/gen/sf_arch_pkg.sv: no LANES"
for n in $lanes; do [[ $n =~ ^[1-9][0-9]{0,3}$ ]] || die 2 "--lanes: '$n' is no number of lanes"; done
[ -n "$lanes" ] || [ -z "$report" ] || lanes=$(for run in "$out"/runs/*-*[0-9]; do echo "${run##*-}"; done | grep -x '[0-9]*' | sort -nu)
lanes=${lanes:-$built_for}
if [ -z "$modules" ]; then
  for file in $(ls -rS rtl/*.sv | grep -v '_pkg\.sv$'); do
    [[ $file = rtl/sf_engine.sv || $file = rtl/sf_top.sv || $file = rtl/sf_ray_top.sv ]] || modules+=" $(basename "$file" .sv)"
  done
fi
[ -z "$top" ] || modules+=" sf_top sf_ray_top"
# What yosys printed, as "name value" lines. First statistics: memories are still memories. Last: mapped.
extract() {
  awk '
    /Printing statistics/ { part++; lut = ff = latch = carry = dsp = ramb18 = ramb36 = lutram = 0 }
    part == 1 && /Number of memory bits:/ { bits = $NF }
    part == 1 && /Number of cells:/ { word = $NF }
    part > 1 && $1 ~ /^LUT[1-6]$/ { lut += $2 }
    part > 1 && $1 ~ /^FD[A-Z]+(_1)?$/ { ff += $2 }
    part > 1 && $1 ~ /^LD[A-Z]+$/ { latch += $2 }
    part > 1 && $1 == "CARRY4" { carry += $2 }
    part > 1 && $1 == "DSP48E1" { dsp += $2 }
    part > 1 && $1 ~ /^RAMB18/ { ramb18 += $2 }
    part > 1 && $1 ~ /^RAMB36/ { ramb36 += $2 }
    part > 1 && ($1 ~ /^RAM(32|64|128|256)/) { lutram += $2 }
    /Replacing memory .* with list of registers/ { gsub(/\\/, "", $0); match($0, /memory [^ ]+/)
      name = substr($0, RSTART + 7, RLENGTH - 7)
      if (!(name in seen)) { seen[name] = 1; spread = spread (spread ? "," : "") name } }
    /Longest topological path in/ { match($0, /length=[0-9]+/); path = substr($0, RSTART + 7, RLENGTH - 7) }
    END {
      if (part < 2 || path == "") exit 1
      printf "word_cells %d\nmemory_bits %d\nlut %d\nff %d\nlatch %d\ncarry4 %d\n", word, bits, lut, ff, latch, carry
      printf "dsp48e1 %d\nramb18e1 %d\nramb36e1 %d\nlutram %d\npath %d\n", dsp, ramb18, ramb36, lutram, path
      printf "spread %s\n", spread == "" ? "-" : spread
    }' "$1"
}

exists_for() { # MODULE LANES
  [ "$2" = "$built_for" ] || grep -qE '^ *parameter +(integer +|int +)?LANES\b' "rtl/$1.sv"
}

# Weights are meant for block RAM; without the attribute yosys weighs a memory of few rows as LUT RAM.
synthesise() { # MODULE LANES RESULT
  local log=$3.log parameters='' defines='' started=$SECONDS
  if grep -qE '^ *parameter +(integer +|int +)?LANES\b' "rtl/$1.sv"; then parameters="-chparam LANES $2"; fi
  if grep -qE '^ *parameter +(integer +|int +)?MACS\b' "rtl/$1.sv"; then parameters+=" -chparam MACS $(($2 < macs ? $2 : macs))"; fi
  if [[ $1 = sf_top || $1 = sf_ray_top ]]; then defines="-D SF_NO_TAP"; fi
  local map="synth_xilinx -family xc7 -flatten -noiopad -top $1"
  # shellcheck disable=SC2086
  if ! nice -n 10 yosys -q -l "$log" -p "read_verilog -sv -defer $defines -Irtl $(echo $packages $sources)
      hierarchy -check -top $1 $parameters; rename -top $1; setattr -set ram_style \"block\" *sf_rows*/m:*
      $map -run begin:coarse; stat; $map -run coarse:
      delete t:FD* t:LD* t:RAMB*; ltp -noff" >/dev/null 2>"$log.err"; then
    die 1 "$1, $2 lanes: $(grep -h ERROR "$log" | head -n 1 | cut -c1-200), see $log"
  fi
  extract "$log" >"$3.aside" || die 1 "$1, $2 lanes: the output of yosys was not understood, see $log"
  echo "seconds $((SECONDS - started))" >>"$3.aside"
  { echo "key $key"; cat "$3.aside"; } >"$3.whole"
  mv "$3.whole" "$3"
  rm -f "$3.aside" "$log" "$log.err"
}

key=$({ yosys -V; declare -f extract synthesise; cat rtl/*.sv rtl/*.svh rtl/gen/*.sv; } 2>/dev/null | sha256sum)
key=${key:0:16}
kept() { [ -f "$1" ] && [ "$(head -n 1 "$1")" = "key $key" ]; }

done_count=0 total=$(($(wc -w <<<"$modules") * $(wc -w <<<"$lanes")))
rows=() missing=()
for module in $modules; do
  [ -f "rtl/$module.sv" ] || die 1 "rtl/$module.sv is not there"
  for n in $lanes; do
    done_count=$((done_count + 1))
    result=$out/runs/$module-$n
    if ! exists_for "$module" "$n"; then
      missing+=("$module, $n lanes: the module has no parameter LANES; the package says $built_for")
      continue
    fi
    if kept "$result"; then
      say "$done_count of $total: $module, $n lanes: kept"
    elif [ -n "$report" ]; then
      missing+=("$module, $n lanes: not run")
      continue
    else
      say "$done_count of $total: $module, $n lanes ..."
      synthesise "$module" "$n" "$result"
    fi
    rows+=("$result")
  done
done
[ ${#rows[@]} -gt 0 ] || die 1 "nothing to report: ${missing[0]:-no module}"

table() {
  echo "| module | lanes | LUT | FF | CARRY4 | DSP48E1 | RAMB18 | RAMB36 | LUT RAM | memory bits | longest path | s |"
  echo "|---|---|---|---|---|---|---|---|---|---|---|---|"
  local row name
  for row in "${rows[@]}"; do
    name=${row##*/}
    awk -v module="${name%-*}" -v lanes="${name##*-}" '{ v[$1] = $2 }
      END { printf "| `%s` | %s | %d | %d | %d | %d |", module, lanes, v["lut"], v["ff"], v["carry4"], v["dsp48e1"]
        printf " %d | %d | %d | %d |", v["ramb18e1"], v["ramb36e1"], v["lutram"], v["memory_bits"]
        printf " %d | %d |\n", v["path"], v["seconds"] }' "$row"
  done
  for row in "${rows[@]}"; do
    name=${row##*/}
    awk -v module="${name%-*}" '$1 == "spread" && $2 != "-" { notes = $2 } $1 == "latch" && $2 > 0 { latches = $2 }
      END { if (notes) printf "\n`%s`: arrays that became registers, not memory bits: %s.\n", module, notes
            if (latches) printf "\n`%s`: %d latches.\n", module, latches }' "$row"
  done
  for row in ${missing[@]+"${missing[@]}"}; do printf '\n%s.\n' "$row"; done
}
list() {
  echo '{"tool": "'"$(yosys -V 2>/dev/null | cut -d' ' -f1,2)"'", "family": "xc7", "runs": ['
  local row name separator=''
  for row in "${rows[@]}"; do
    name=${row##*/}
    awk -v separator="$separator" -v module="${name%-*}" -v lanes="${name##*-}" '
      BEGIN { printf "%s  {\"module\": \"%s\", \"lanes\": %d", separator, module, lanes }
      $1 == "spread" { n = $2 == "-" ? 0 : split($2, names, ","); printf ", \"spread\": ["
        for (i = 1; i <= n; i++) printf "%s\"%s\"", (i > 1 ? ", " : ""), names[i]; printf "]"; next }
      $1 != "key" { printf ", \"%s\": %d", $1, $2 }
      END { printf "}" }' "$row"
    separator=$',\n'
  done
  printf '\n], "missing": ['
  separator=''
  for row in ${missing[@]+"${missing[@]}"}; do printf '%s"%s"' "$separator" "$row"; separator=', '; done
  echo ']}'
}
table >"$out/synth.md.aside"
mv "$out/synth.md.aside" "$out/synth.md"
list >"$out/synth.json.aside"
mv "$out/synth.json.aside" "$out/synth.json"
if [ -n "$json" ]; then cat "$out/synth.json"; else cat "$out/synth.md"; fi
