# For scripts of tests/chain:   . chain.bash BUILD
# Gives build, root (of the source), work (a folder that goes at the end), fail, finish, quick, quick_dut, interrupt, and learn, which makes a
# scene.
set -u
build=$(cd "${1:?usage: $0 BUILD}" && pwd) || exit 2
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd) || exit 2
work=$(mktemp -d "${TMPDIR:-/tmp}/sf_chain.XXXXXX") || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
failures=0
# What Verilator makes is built without optimising, which is sooner. --dut starts make without MAKEFLAGS; these get there.
quick='OPT_FAST=-O0 OPT_SLOW=-O0 OPT_GLOBAL=-O0'
quick_dut() { export GNUMAKEFLAGS="VERILATED_OPT=${quick// /\\ }"; }

fail() {
  echo "FAILED: $*"
  grep -lI . "$work"/{out,err,log} 2>/dev/null | xargs -r tail -n 4 # what is text: out may be a model
  failures=$((failures + 1))
}
finish() { # TEXT: the last line of a script where nothing failed
  [ $failures -eq 0 ] && echo "$1"
  exit $((failures > 0))
}

# interrupt WHEN OUT ERR PROGRAM ARGS...: runs it, and interrupts it once it catches signals and `WHEN` succeeds: on no machine
# too early or too late. Leaves $status.
interrupt() {
  local i pid
  "${@:4}" >"$2" 2>"$3" </dev/null &
  pid=$!
  for ((i = 0; i < 30000; i++)); do
    kill -0 $pid 2>/dev/null || break
    [ "$(cat /proc/$pid/comm 2>/dev/null)" = "$(basename "$4")" ] && (($(sed -n 's/^SigCgt:[[:space:]]*/0x/p' /proc/$pid/status) & 2)) &&
      eval "$1" && kill -INT $pid && break
    sleep 0.01
  done
  wait $pid
  status=$?
}

# learn NAME HIDDEN EXPORT-OPTIONS...: a small model in NAME.safetensors and its export in NAME.snn, of pictures in data/
learn() {
  [ -e "$work/data" ] || "$build/bin/sf_scene" textured -o "$work/data" --size 24 --train 8 --test 2 >/dev/null || exit 1
  "$build/bin/sf_train" "$work/data" -o "$work/$1.safetensors" --stage1 20 --stage2 40 --samples 512 --levels 4 \
    --log2-hash 10 --finest-res 32 --lattice 64 --occ-res 16 --hidden "$2" --steps 3 --quiet >/dev/null &&
    "$build/bin/sf_export" "$work/$1.safetensors" -o "$work/$1.snn" "${@:3}" >/dev/null || exit 1
}
