#!/usr/bin/env bash
# Programs against a board: the Verilated one behind a pseudo-terminal. Pictures and counters equal the core's; a line that loses,
# doubles and changes bytes is repaired or named; a board that is not as it should be is one line and status 1, and no file.
# usage: board.sh BUILD
NEURONS=32 # programmed sooner
. "$(dirname "$0")/../small_scene.bash"
cd "$work" || exit 1
board=0

begin() { # OPTIONS OF sf_board
  rm -f tty
  "$build/board/sf_board" tty "$@" 2>board.log &
  board=$!
  for _ in $(seq 100); do [ -L tty ] && return; sleep 0.1; done
  fail "no board: $(cat board.log)"
}
end() { kill "$board" && wait "$board"; }
trap 'kill "$board" 2>/dev/null; rm -rf "$work"' EXIT
render() { "$build/bin/sim_render" "${scene:-scene.snn}" data --backend board --port tty --timeout "${patience:-20}" --crop 10,10,3,2 --quiet -o "$1" >said.log 2>&1; }
cosim() { "$build/bin/sf_cosim" scene.snn data --backend board --port tty --timeout "${patience:-20}" --rays 5 --quiet "$@" >said.log 2>&1; }
says() { grep -q -e "$1" said.log || fail "$2 does not say '$1' but: $(cat said.log)"; }
refuses() { # TEXT WHAT: status 1, one line, nothing written
  local status=0
  rm -f refused.exr
  render refused.exr || status=$?
  [ $status -eq 1 ] || fail "$2: status $status"
  [ "$(wc -l <said.log)" -eq 1 ] || fail "$2: not one line: $(cat said.log)"
  [ -z "$(ls refused.exr* 2>/dev/null)" ] || fail "$2: a file was written"
  says "$1" "$2"
}

"$build/bin/sim_render" scene.snn data --crop 10,10,3,2 --quiet -o fixed.exr >/dev/null || fail "no golden picture"

# ---- a sound board
begin
render board.exr || fail "no picture: $(cat said.log)"
cmp -s board.exr fixed.exr || fail "the board's picture is not the core's"
! grep -q "sent again" said.log || fail "a quiet line needed repair: $(cat said.log)"
cosim || fail "lockstep: $(cat said.log)"
says "5 rays (.*: 0 differences" lockstep
says "compared: pixels, every counter, energy" lockstep
cosim --limit-samples 1 --json || fail "lockstep: $(cat said.log)"
says '"differences":[[:space:]]*0' "lockstep in JSON"
end

# ---- a line that damages
begin --noise 10 --seed 3
patience=6 render noisy.exr || fail "no picture over a noisy line: $(cat said.log)"
cmp -s noisy.exr fixed.exr || fail "a picture over a noisy line is another"
says "sent again: .*\(CRC\|length\|broken\|without an answer\)" "a noisy line"
end
begin --noise 20000 --seed 4
patience=0.3 refuses "tty: \(frames .* are damaged, 6 times in a row\|the board does not answer\)" "a line that damages every frame"
end

# ---- boards that are not as they should be
begin --defect 1
status=0
rm -f wrong.exr
render wrong.exr || status=$?
[ $status -eq 1 ] && [ ! -e wrong.exr ] || fail "a bad memory: status $status: $(cat said.log)"
says "scene.snn: pixel (1[0-2], 1[01]) of view test/r_0, sample [0-9]*: " "a bad memory"
status=0
cosim || status=$?
[ $status -eq 1 ] || fail "lockstep with a bad memory: status $status"
says "ray [0-9]* (view test/r_[01], pixel [0-9]*,[0-9]*) sample [0-9]*: " "lockstep with a bad memory"
end
begin --version 0x40002
refuses "tty: the board's accelerator has version 4.2, this program drives 6.x: build both of one source" "another version"
end
begin --mute 7
patience=0.3 refuses "tty: the board does not answer (6 tries, 0.3 s each)" "a board that stops answering"
end
refuses "tty: no board there: No such file" "no board"
touch tty
refuses "tty: no serial port" "a file for a port"

# ---- a scene that does not fit, and what its message says to do
"$build/bin/sf_train" data -o model.safetensors --stage1 40 --stage2 60 --samples 1024 --lattice 64 --steps 2 --hidden 32 --occ-res 16 \
  --eval-views 1 --quiet >/dev/null 2>&1 || fail "no model"
"$build/bin/sf_export" model.safetensors -o large.snn >/dev/null || fail "no scene"
begin
scene=large.snn refuses "large.snn: its grid takes [0-9]* bytes, the board has 131072: room for the first [0-9]* of 16 levels; a scene that fits: sf_export MODEL -o SMALL.snn --fit --data DATA --fit-bytes 131072$" "a large scene"
end
picture() { "$root/tools/board_picture.sh" "$build" model.safetensors data --board "$1" --downscale 1 --crop 10,10,3,2 --fit-rays 256 --out picture >said.log 2>&1; }
picture "$build/board/sf_board" || fail "the picture of a fitted scene: $(cat said.log)"
grep -q "grid: [0-9]* -> [0-9]* bytes, at most 131072 were asked for" picture/fit.log || fail "--fit-bytes: $(cat picture/fit.log)"
cmp -s picture/board.exr picture/fixed.exr || fail "the picture of a fitted scene is not the core's"
says "^3 x 2 pixels, [0-9]* samples: .*byte for byte$" "a fitted scene"
says "^over the line at 12.50 Mbaud: [0-9]* bytes to the board, [0-9]* back" "a fitted scene"
printf '#!/bin/sh\nexec %s "$@" --version 0x40002\n' "$build/board/sf_board" >another && chmod +x another
! picture ./another && [ ! -e picture/board.exr ] || fail "a board of another version gives a picture"
says "picture/tty: the board's accelerator has version 4.2" "a picture from a board of another version"
finish "board: pictures and counters equal over a pseudo-terminal; noise, defects, wrong boards and scenes are named"
