#!/bin/bash
# sf_soc from the command line: the firmware's tile and audit are those of the host, an image can be kept and loaded, and
# everything that can go wrong is one line and an exit status.   usage: firmware.sh BUILD
. "$(dirname "$0")/../chain.bash" "$@"
export LC_ALL=C OMP_NUM_THREADS=1
for needed in "$build/bin/sf_soc" "$build/firmware/sf_firmware.elf"; do
  [ -e "$needed" ] && continue
  echo "no ${needed#"$build"/}: libunicorn-dev and gcc-riscv64-unknown-elf are needed"
  exit 77
done
cd "$work" || exit 2
passed=0

# run STATUS PATTERN ARGS...: exit status; with a status but 0, one line on stderr that has the pattern.
run() {
  local want=$1 pattern=$2 got
  shift 2
  timeout -k 5 60 "$build/bin/sf_soc" "$@" --quiet >out 2>err </dev/null
  got=$?
  if [ $got -ne "$want" ]; then fail "sf_soc $*: exit status $got, expected $want"
  elif [ "$want" -eq 0 ] && [ -s err ]; then fail "sf_soc $*: a good run wrote on stderr"
  elif [ "$want" -ne 0 ] && [ "$(grep -c '' err)" -ne 1 ]; then fail "sf_soc $*: not one line on stderr"
  elif [ "$want" -ne 0 ] && ! grep -qF -e "$pattern" err; then fail "sf_soc $*: no '$pattern'"
  else passed=$((passed + 1)); fi
}
check() { if "${@:2}"; then passed=$((passed + 1)); else fail "$1"; fi; }

"$build/faults/make_scene" scene.snn || exit 1
"$build/bin/sf_scene" simple -o data --size 32 --train 1 --test 2 >/dev/null || exit 1

# The firmware's numbers beside those of the program that renders the same window on the host.
run 0 '' scene.snn data --view 1 --crop 14,15,4,3 --stall 25 --png tile.png --save-image tile.img --json
mv out soc.json
"$build/bin/sim_render" scene.snn data --view 1 --crop 14,15,4,3 -o host.exr --png host.png --json --quiet >host.json || exit 1
field() { sed -nE "s/.*\"$2\":[^0-9]*([0-9]+).*/\1/p" "$1" | head -1; }
printed() { sed -nE "s/.*\"audit .*$1 ([0-9]+).*/\1/p" soc.json | tail -1; }
check "samples printed by the firmware are the host's" [ "$(printed samples)" = "$(field host.json samples)" ]
check "energy printed by the firmware is the host's" [ "$(printed energy_fj)" = "$(field host.json energy_fj)" ]
check "there is something to compare" [ "$(printed samples)" -gt 20 ]
check "the firmware's picture is the host's" cmp -s tile.png host.png

# The image that was kept is a memory image: it runs again, and one wrong byte in it is found.
run 0 '' scene.snn data --view 1 --crop 14,15,4,3 --image tile.img
check "text names the equality" grep -q '^equal to the fixed-point core: 12 pixels' out
check "the audit is printed" grep -q '^  audit energy_fj [0-9]' out
size=$(wc -c <tile.img)
for at in 16 300 $((size / 2)) $((size - 1)); do
  cp tile.img bad.img
  byte=$(od -An -tu1 -j$at -N1 bad.img)
  printf "\\$(printf %o $((byte ^ 16)))" | dd of=bad.img bs=1 seek=$at conv=notrunc status=none
  run 1 'exit status 1: error: image: damaged: wrong checksum' scene.snn data --view 1 --crop 14,15,4,3 --image bad.img
done
head -c 100 tile.img >bad.img
run 1 'error: image: ' scene.snn data --image bad.img
: >bad.img
run 1 'error: image: none in memory' scene.snn data --image bad.img
head -c $((size / 2)) tile.img >bad.img
run 1 'error: image: damaged' scene.snn data --image bad.img
run 1 'core' scene.snn data --view 1 --crop 0,0,32,32 --image tile.img # of a smaller tile
run 1 'core' scene.snn data --view 0 --crop 14,15,4,3 --image tile.img # the image of another view

# TensoRF: the accelerator makes the pixels.
"$build/bin/sf_train" data -o planes.safetensors --backbone tensorf --voxels 24 --samples 512 --rays 256 --stage1 20 --stage2 30 --steps 2 \
  --occ-res 16 --eval-views 1 --quiet >/dev/null && "$build/bin/sf_export" planes.safetensors -o planes.snn >/dev/null || exit 1
run 0 '' planes.snn data --view 1 --crop 14,15,4,3 --stall 25 --png planes.png --save-image planes.img --json
check "look-ups of the planes are printed" grep -q '"audit lookups [1-9][0-9]* misses [1-9]' out
"$build/bin/sim_render" planes.snn data --view 1 --crop 14,15,4,3 -o host.exr --png host.png --quiet >/dev/null || exit 1
check "the firmware's picture of planes is the host's" cmp -s planes.png host.png
run 0 '' planes.snn data --view 1 --crop 14,15,4,3 --image planes.img
run 1 'core' planes.snn data --view 0 --crop 14,15,4,3 --image planes.img
size=$(wc -c <planes.img)
cp planes.img bad.img
printf '\377' | dd of=bad.img bs=1 seek=$((size / 2)) conv=notrunc status=none
run 1 'exit status 1: error: image: damaged: wrong checksum' planes.snn data --view 1 --crop 14,15,4,3 --image bad.img
run 1 'where there is nothing' planes.snn data --view 1 --crop 14,15,4,3 --image tile.img # of a hash grid
run 1 'error: load planes: ' scene.snn data --view 1 --crop 14,15,4,3 --image planes.img

# Programs that are none, or do not end in time.
run 1 'no end after' scene.snn data --instructions 5000
run 1 'tile.img: not an ELF file' scene.snn data --firmware tile.img
run 1 'nowhere.elf' scene.snn data --firmware nowhere.elf
run 1 'not a 32-bit RISC-V program' scene.snn data --firmware "$build/bin/sf_soc"
run 1 'nowhere.img' scene.snn data --image nowhere.img

# Usage.
for value in '' 1 0,0,0,1 0,0,33,1 -1,0,1,1; do run 2 --crop scene.snn data --crop "$value"; done
run 2 --view scene.snn data --view 2
run 2 --stall scene.snn data --stall 91
run 2 --split scene.snn data --split all
run 2 --no-such-option scene.snn data --no-such-option
run 2 missing scene.snn
run 1 nowhere.snn nowhere.snn data
run 1 nodir scene.snn data --save-image nodir/a.img
run 1 nodir scene.snn data --png nodir/a.png
check "--help" "$build/bin/sf_soc" --help >help
check "--help has examples" grep -q 'sf_soc scene.snn data --view 3' help
"$build/bin/sf_soc" scene.snn data --quiet >/dev/full 2>err
check "standard output on a full disk" [ $? -eq 1 ]

# An interrupt ends it at once, in the middle of the tile. --foreground: timeout would send the signal
# to its whole group as well, and a second one kills at once.
"$build/bin/sf_scene" simple -o large --size 400 --train 1 --test 1 >/dev/null
: >out # what stands there is of an earlier run
timeout --foreground -k 5 60 "$build/bin/sf_soc" scene.snn large --crop 0,0,400,400 --stall 90 --quiet >out 2>err &
for _ in $(seq 300); do grep -q tile out && break; sleep 0.1; done
kill -TERM $!
wait $!
check "interrupted" [ $? -eq 130 ]
check "and says so" grep -q 'stopped after' err
echo "$passed passed, $failures failed"
[ $failures -eq 0 ]
