#!/bin/bash
# sf_cosim --dut: a top level of another name around another neuron co-simulates with 0 differences; when an included
# file changes, it is built again and its mistake located; what does not build says where. usage: other_dut.sh BUILD
NEURONS=32 # programmed sooner
. "$(dirname "$0")/../small_scene.bash" "$@"
built=()
trap 'rm -rf "$work" "${built[@]}"' EXIT
quick_dut

# The RTL of this build (which may be a variant), in the order of the kit.
"$build/bin/sf_export" "$work/scene.snn" --vectors "$work/kit" --data "$work/data" --samples 1 >/dev/null || exit 1
rtl=$work/kit/rtl
mkdir "$work/overlay"
cp "$root/tests/dut/serial/sf_plif.sv" "$work/overlay"
sed 's/^module sf_top/module my_block/' "$rtl/sf_top.sv" >"$work/my_block.sv"
sources=$(sed -n "s|^rtl/|$rtl/|p" "$work/kit/rtl.f" | sed "s|.*/sf_plif.sv$|$work/overlay/sf_plif.sv|; /\/sf_top.sv$/d" | tr '\n' ' ')

# run NAME STATUS OPTION...: the report in NAME.json, standard error in NAME.err
run() {
  local name=$1 want=$2 got
  shift 2
  "$build/bin/sf_cosim" "$work/scene.snn" "$work/data" --rays 100 --limit-samples 300 --seed 7 --quiet --json --evidence "$work/evidence" "$@" \
    >"$work/$name.json" 2>"$work/$name.err"
  got=$?
  while read -r folder; do built+=("$folder"); done < <(sed -n 's/^ *VERI *//p' "$work/$name.err")
  [ $got -eq "$want" ] || fail "$name: exit status $got, expected $want: $(tail -n 3 "$work/$name.err")"
}
field() { sed -nE "s/^.*\"$2\":[[:space:]]*\"?([^\",]*)\"?,?$/\1/p" "$work/$1.json" | head -n 1; }
has() { grep -qF -- "$2" "$work/$1" || fail "'$2' is not in $1: $(head -n 5 "$work/$1")"; }

my_block=(--dut "+incdir+$work/overlay +incdir+$rtl $sources $work/my_block.sv" --dut-top my_block)
run serial 0 "${my_block[@]}"
[ "$(field serial samples)" -ge 300 ] && [ "$(field serial differences)" = 0 ] || fail "the other neuron: $(cat "$work/serial.json")"
run again 0 "${my_block[@]}"
[ ! -s "$work/again.err" ] || fail "built again without a change: $(head -n 1 "$work/again.err")"
# Its activity has the nets of what it shares with ours: arrays over lanes, too.
saif() { "$build/bin/sf_cosim" "$work/scene.snn" "$work/data" --rays 2 --quiet --saif "$work/$1.saif" "${@:2}" >/dev/null; }
saif own && saif other "${my_block[@]}" || fail "a SAIF file"
own=$(grep -c '(current_q' "$work/own.saif") other=$(grep -c '(current_q' "$work/other.saif")
[ "$own" -ge 1000 ] && [ "$own" -eq "$other" ] || fail "$own bits of current_q, of the other block $other"

wrong() { sed -f "$root/tests/dut/wrong.sed" "$root/tests/dut/serial/sf_plif.sv"; }
wrong >"$work/overlay/sf_plif.sv"
run wrong 1 "${my_block[@]}"
[ "$(field wrong wire)" = membrane ] || fail "the wrong neuron: $(cat "$work/wrong.err")"
[ "$(field wrong actual)" = $(($(field wrong expected) - 1)) ] || fail "the wrong neuron is not one too low"
tail -n 1 "$work/wrong.err"

# The line that the difference ends with replays it on that block; told when the block has changed, is another, is gone.
line=$(sed -n 's/^replay: *//p' "$work/wrong.err")
# replay STATUS TEXT [COMMAND]
replay() {
  (cd "$work" && bash -c "${3:-$line}") >"$work/replay.out" 2>&1
  [ $? -eq "$1" ] || fail "${3:-$line}: exit status is not $1: $(cat "$work/replay.out")"
  has replay.out "$2"
}
replay 1 "membrane: expected $(field wrong expected), actual $(field wrong actual)"
grep -q 'changed\|another' "$work/replay.out" && fail "the same block: $(cat "$work/replay.out")"
sed 's/"sources":.*/"sources": "of before"/' "$work/evidence.json" >"$work/before.json"
replay 1 "the block's sources have changed since the file was written" "$build/bin/sf_cosim --replay before.json"
mv "$work/my_block.sv" "$work/kept_block.sv"
replay 1 "evidence.json: the block that differed: --dut: $work/my_block.sv: No such file"
mv "$work/kept_block.sv" "$work/my_block.sv"

# The kit's list of files, by the line of docs/kit.md.
mkdir "$work/wrong"
wrong >"$work/wrong/sf_plif.sv"
listed=$(sed -n 's/^\(sed .* >kit\/wrong.f\)$/\1/p' "$root/docs/kit.md")
documented=$(sed -n 's/^sf_cosim [^ ]* [^ ]* \(.*--dut "-F kit\/wrong.f"\)$/sf_cosim scene.snn data \1/p' "$root/docs/kit.md")
[ -n "$documented" ] && (cd "$work" && bash -c "$listed") && [ -s "$work/kit/wrong.f" ] || fail "docs/kit.md has no line with a list of one's own"
replay 1 'neuron' "PATH=$build/bin:\$PATH; $documented --quiet"
grep -q '^replay: *sf_cosim --replay sf_cosim-difference.json$' "$work/replay.out" || fail "$documented: $(tail -n 4 "$work/replay.out")"
while read -r folder; do built+=("$folder"); done < <(sed -n 's/^ *VERI *//p' "$work/replay.out")
replay 1 'the file is of another block' "$build/bin/sf_cosim --replay evidence.json ${documented#*data }"
replay 1 'No such file or directory (names in -f kit/rtl.f' "$build/bin/sf_cosim scene.snn data --dut '-f kit/rtl.f'"
replay 2 '-F names no list' "$build/bin/sf_cosim scene.snn data --dut '-F'"
printf '// none\n-F list.f # again\n' >"$work/list.f"
replay 1 'lists within lists' "$build/bin/sf_cosim scene.snn data --dut '-F list.f'"

sed '30s/^/this is no Verilog;/' "$work/my_block.sv" >"$work/broken.sv"
run broken 1 --dut "+incdir+$rtl $sources $work/broken.sv" --dut-top my_block
has broken.err "broken.sv:30:"
has broken.err "module my_block does not build"
run absent 1 --dut "$work/absent.sv"
has absent.err "absent.sv"
run name 2 --dut "$work/my_block.sv" --dut-top 'a b'
has name.err "--dut-top"
run nothing 2 --dut " "
has nothing.err "--dut"

# A program builds in the folder that it stands in, not in the one that it was built in.
below=${build#"$root"/}
if [ "$below" != "$build" ]; then
  mkdir -p "$work/moved/$below/bin" "$work/moved/sim"
  cp "$build/bin/sf_cosim" "$work/moved/$below/bin/"
  build=$work/moved/$below
  run lost 1 "${my_block[@]}"
  has lost.err "$build is not the build folder of a source tree"
  touch "$work/moved/sim/dut.mk"
  printf 'dut:\n\t@echo "built in $B, $(DUT_OUT)" >&2; exit 1\n' >"$work/moved/Makefile"
  run moved 1 "${my_block[@]}"
  has moved.err "built in $build, $build/dut/"
  # A new file in an include folder may stand before the one that was included: another build.
  touch "$work/overlay/notes.txt"
  run same 1 "${my_block[@]}"
  cmp -s "$work/moved.err" "$work/same.err" || fail "another build for a file that is no Verilog"
  touch "$work/overlay/other.svh"
  run shadow 1 "${my_block[@]}"
  has shadow.err "built in $build, $build/dut/"
  cmp -s "$work/moved.err" "$work/shadow.err" && fail "no other build for a new file in an include folder"
fi
finish "another block co-simulates, its mistake is located, what does not build says where"
