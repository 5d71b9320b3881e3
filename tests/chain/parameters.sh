#!/bin/bash
# Impossible parameters of the RTL: Verilator, Yosys and Icarus end with an error that names the parameter.
# usage: parameters.sh BUILD
. "$(dirname "$0")/../chain.bash" "$@"
export LC_ALL=C
cd "$root" || exit 1
cases=0
packages=$(ls rtl/gen/*_pkg.sv rtl/*_pkg.sv | tr '\n' ' ')
sources=$packages$(ls rtl/gen/*.sv rtl/*.sv | grep -v _pkg | tr '\n' ' ')
# refused TOOL MODULE PARAMETER VALUE TEXT: the last command failed and said why
refused() {
  local status=$? what="$1: $2 with $3 = $4"
  cases=$((cases + 1))
  [ $status -ne 0 ] || fail "$what was taken"
  grep -qF "$5" "$work/log" || fail "$what: not said that $5"
}
while read -r module parameter value text; do
  verilator --lint-only --top-module "$module" "-G$parameter=$value" -Irtl rtl/lint.vlt $sources >"$work/log" 2>&1
  refused verilator "$module" "$parameter" "$value" "$text"
  if command -v yosys >/dev/null; then
    yosys -q -p "read_verilog -sv -defer -Irtl $sources; hierarchy -check -top $module -chparam $parameter $value" >"$work/log" 2>&1
    refused yosys "$module" "$parameter" "$value" "$text"
  fi
  if command -v iverilog >/dev/null; then
    { iverilog -g2012 -Wno-timescale -Irtl -s "$module" -P "$module.$parameter=$value" -o "$work/vvp" $sources && vvp -n "$work/vvp"; } >"$work/log" 2>&1
    refused icarus "$module" "$parameter" "$value" "$text"
  fi
done <<'END'
sf_encoder CACHE_BYTES 512 CACHE_BYTES is not a power of two from 1024 to 65536
sf_encoder CACHE_BYTES 3072 CACHE_BYTES is not a power of two from 1024 to 65536
sf_encoder CACHE_BYTES 131072 CACHE_BYTES is not a power of two from 1024 to 65536
sf_encoder CACHE_WAYS 3 CACHE_WAYS is not 1, 2, 4 or 8
sf_encoder CACHE_WAYS 16 CACHE_WAYS is not 1, 2, 4 or 8
sf_top LANES 48 LANES is not 32, 64, 128 or 256
sf_top MACS 48 MACS is not LANES, a half or a quarter of it
sf_top NEURONS 12 NEURONS is not a power of two from 4 to 64
sf_top STEPS_AT_ONCE 3 STEPS_AT_ONCE is not 1, 2, 4 or 8
END
echo "$cases refusals of impossible parameters"
exit $((failures > 0))
