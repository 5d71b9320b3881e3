#!/bin/bash
# What a newcomer meets in the first hour: full disks, progress lines, what programs say that they wrote, what is missing.
# usage: first_hour.sh BUILD
export LC_ALL=C OMP_NUM_THREADS=2
. "$(dirname "$0")/../small_scene.bash" "$@"
bin=$build/bin
cd "$work" || exit 1

# says TEXT COMMAND...: on either stream, with exit status 0
says() {
  timeout 120 "$bin/$2" "${@:3}" >out.txt 2>err.txt </dev/null || fail "${*:2}: exit status $?: $(head -1 err.txt)"
  grep -qF -e "$1" out.txt err.txt || fail "${*:2}: does not say '$1': $(cat out.txt err.txt | head -3)"
}
# refuses STATUS TEXT COMMAND...: one line on stderr
refuses() {
  timeout 120 "$bin/$3" "${@:4}" >out.txt 2>err.txt </dev/null
  local status=$?
  [ $status -eq "$1" ] || fail "${*:3}: exit status $status, expected $1"
  grep -qF -e "$2" err.txt && [ "$(wc -l <err.txt)" -eq 1 ] || fail "${*:3}: does not say '$2' in one line: $(head -3 err.txt)"
}

# ---- a full disk: the model fits, a checkpoint does not ----

learn=(--stage1 2 --stage2 2 --levels 2 --log2-hash 8 --eval-views 1 -q)
"$bin/sf_train" data -o model.safetensors "${learn[@]}" >/dev/null || fail "no model"
limit=$(($(wc -c <model.safetensors) / 1024 + 8))
(ulimit -f $limit && "$bin/sf_train" data -o full.safetensors "${learn[@]}" --checkpoint-minutes 0 >out.txt 2>err.txt) ||
  fail "a model that fits is lost: $(cat err.txt)"
cmp -s model.safetensors full.safetensors || fail "another model on a full disk"
[ "$(grep -c 'warning: .*full.safetensors.*no checkpoint, the run goes on' err.txt)" -eq 1 ] && [ "$(wc -l <err.txt)" -eq 1 ] ||
  fail "a checkpoint that failed is not told once: $(cat err.txt)"
(ulimit -f $((limit / 2)) && "$bin/sf_train" data -o none.safetensors "${learn[@]}" >out.txt 2>err.txt) &&
  fail "a model that does not fit was saved"
[ ! -e none.safetensors ] || fail "half a model"

# ---- progress fits 80 columns ----

script -qec "stty cols 80 && '$bin/sf_train' data -o wide.safetensors --minutes 0.02 --levels 2 --log2-hash 8" typescript \
  </dev/null >/dev/null 2>&1
tr '\r' '\n' <typescript >lines.txt
grep -q 'stage I .*ETA [0-9]*:[0-9][0-9].*PSNR .*iteration [0-9]* *$' lines.txt || fail "no whole progress line in 80 columns"
grep -q 'evaluation: view 1 of 2' lines.txt || fail "no progress of the evaluation"
finish "first_hour: nothing to trip over"
