#!/bin/bash
# A picture that comes from the Verilated board over its serial line, against the fixed-point core's.
set -euo pipefail
usage() {
  cat <<'TEXT'
Usage: board_picture.sh BUILD MODEL DATA [--board PROGRAM] [--crop X,Y,W,H] [--downscale N]
       [--bytes N] [--fit-rays N] [--out DIR]

Makes a scene that fits the board (sf_export --fit), renders a crop over the simulated line and with the fixed-point core,
and compares the files byte for byte. Says what went over the line and how long the board and its simulation took.
Writes BUILD/board/picture. A fitted scene is kept until the model is newer.

  --board PROGRAM  the Verilated board (default BUILD/board/line/sf_board: 3 Mbaud)
  --downscale N    views of 1/N of the size (default 3: the demo's have 66 x 66 then)
  --crop X,Y,W,H   of the first test view (default 1,1,64,64)
  --bytes N        of the field's memory (default 131072)
  --fit-rays N     how many rays the fit looks at (default sf_export's)
  --out DIR        folder of scene, pictures and logs (default BUILD/board/picture)

Examples:
  make board-picture
  tools/board_picture.sh build build/demo/model.safetensors build/demo/scene --crop 20,20,8,8
TEXT
}
die() { echo "board-picture: $2" >&2; exit "$1"; }

words=() board='' downscale=3 crop=1,1,64,64 bytes=131072 rays=() out=''
while [ $# -gt 0 ]; do
  case $1 in
    --help | -h) usage; exit 0 ;;
    --board | --downscale | --crop | --bytes | --fit-rays | --out)
      [ $# -ge 2 ] || die 2 "$1 needs a value (see --help)"
      case $1 in
        --board) board=$2 ;;
        --downscale) downscale=$2 ;;
        --crop) crop=$2 ;;
        --bytes) bytes=$2 ;;
        --out) out=$2 ;;
        *) rays=(--fit-rays "$2") ;;
      esac
      shift ;;
    -*) die 2 "unknown option '$1' (see --help)" ;;
    *) words+=("$1") ;;
  esac
  shift
done
[ ${#words[@]} -eq 3 ] || { usage >&2; exit 2; }
build=$(realpath "${words[0]}") model=${words[1]} data=${words[2]}
board=${board:-$build/board/line/sf_board}
[ -f "$model" ] || die 1 "$model is not there: make demo"
out=${out:-$build/board/picture}
mkdir -p "$out"
scene=$out/board.snn
if [ ! "$scene" -nt "$model" ]; then
  "$build/bin/sf_export" "$model" -o "$scene" --fit --data "$data" --fit-bytes "$bytes" ${rays[@]+"${rays[@]}"} --quiet >"$out/fit.log" || exit 1
fi
what=("$scene" "$data" --downscale "$downscale" --crop "$crop" --quiet)
"$build/bin/sim_render" "${what[@]}" -o "$out/fixed.exr" >"$out/fixed.log"

# The board's processor time is bash's own `time`; its last line says what went over the line.
rm -f "$out/board.exr"
started=$SECONDS
TIMEFORMAT=%U
rm -f "$out/tty"
{ time "$board" "$out/tty" 2>"$out/board.log"; } 2>"$out/seconds" &
trap 'kill "$(pgrep -P $!)" 2>/dev/null || true' EXIT
for _ in $(seq 100); do [ -L "$out/tty" ] && break; sleep 0.1; done
[ -L "$out/tty" ] || die 1 "no board: $(cat "$out/board.log")"
"$build/bin/sim_render" "${what[@]}" --backend board --port "$out/tty" --timeout 300 -o "$out/board.exr" >"$out/render.log" || exit 1
kill "$(pgrep -P $!)"
wait $! || true
trap - EXIT
cmp "$out/board.exr" "$out/fixed.exr" || die 1 "the board's picture is not the core's"
read -r cycles to back baud < <(sed -nE 's/^sf_board: ([0-9]+) cycles, ([0-9]+) bytes to the board and ([0-9]+) back at ([0-9]+) baud.*/\1 \2 \3 \4/p' "$out/board.log")
samples=$(grep -oE '[0-9]+ samples' "$out/fixed.log" | head -n 1)
awk -v samples="$samples" -v cycles="$cycles" -v to="$to" -v back="$back" -v baud="$baud" -v cpu="$(cat "$out/seconds")" -v wall=$((SECONDS - started)) -v crop="$crop" 'BEGIN {
  split(crop, c, ","); printf "%d x %d pixels, %s: the board gives the file of the fixed-point core, byte for byte\n", c[3], c[4], samples
  printf "over the line at %.2f Mbaud: %d bytes to the board, %d back; %d cycles, %.1f s at 50 MHz\n", baud / 1e6, to, back, cycles, cycles / 50e6
  printf "simulated in %.0f s of processor time, %d s by the clock\n", cpu, wall }'
