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

# ---- what was written is said ----

"$bin/sf_export" model.safetensors -o s.snn >/dev/null || fail "no scene"
says "wrote a.csv" energy_audit s.snn data --rays 10 --rtl-rays 0 --csv a.csv -q
says "wrote a.html" energy_audit s.snn data --rays 10 --rtl-rays 1 --html a.html -q
"$bin/sf_train" data -o leaky.safetensors --input-mode hybrid "${learn[@]}" >/dev/null || fail "no model with leaks"
says "wrote s.nir" sf_export leaky.safetensors --nir s.nir
says "wrote cameras.png" sf_data data --png cameras.png
says "wrote views/manifest.json and views/contact.png" sim_render s.snn data --all -o views -q
says "2 views rendered by fixed" sim_render s.snn data --all -o again -q
says "all 2 views are there already: nothing was rendered" sim_render s.snn data --all -o views -q
cmp -s views/contact.png again/contact.png || fail "another contact sheet"
rm views/contact.png
says "contact.png" sim_render s.snn data --all -o views -q
cmp -s views/contact.png again/contact.png || fail "no contact sheet of what was there"
# Two pictures of 32 x 32, side by side, as the previews show them; not one colour.
"$bin/sim_render" s.snn data --view 1 -o one.exr --png one.png -q >/dev/null
python3 - <<'END' || fail "the contact sheet does not show the views"
import struct, zlib
def load(path):
    data, at, packed = open(path, "rb").read(), 8, b""
    while at < len(data):
        n, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + n]
        if kind == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", body[:10])
            assert bits == 8 and colour == 6, (bits, colour)
        if kind == b"IDAT":
            packed += body
        at += n + 12
    raw, rows, before = zlib.decompress(packed), [], bytes(4 * width)
    for y in range(height):
        kind, line = raw[y * (4 * width + 1)], bytearray(raw[y * (4 * width + 1) + 1 : (y + 1) * (4 * width + 1)])
        for i in range(len(line)):
            a, b, c = line[i - 4] if i > 3 else 0, before[i], before[i - 4] if i > 3 else 0
            p = a + b - c
            paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
            line[i] = (line[i] + [0, a, b, (a + b) // 2, paeth][kind]) & 255
        rows.append([tuple(line[4 * x : 4 * x + 3]) for x in range(width)])
        before = bytes(line)
    return rows
sheet, one = load("views/contact.png"), load("one.png")
left = 8 + 96 + 8
assert [row[left : left + 32] for row in sheet[8:40]] == one, "view 1 is not where it should be"
assert len({pixel for row in one for pixel in row}) > 2
labels = sheet[8 + 32 : 8 + 32 + 12]
assert any(pixel != (255, 255, 255) for row in labels for pixel in row[left:]), "no name under view 1"
END

# ---- what there is, where a name is not known ----

refuses 1 "--tech 7nm: no such file, and no " energy_audit s.snn data --rays 1 --rtl-rays 0 --tech 7nm -q
grep -q "share/spikefield/tech/7nm.tech; names there: 45nm, osu018, sky130 (or give a file)" err.txt || fail "--tech does not list its names: $(cat err.txt)"
cp -r data nan && sed -i '0,/\[\[*[-0-9.e]*,/s/\(\[\[*\)[-0-9.e]*,/\1NaN,/' nan/transforms_test.json
refuses 1 "NaN is not JSON: a number must stand here" sf_data nan
grep -qE 'nan/transforms_test.json:[0-9]+:[0-9]+: ' err.txt || fail "NaN is not located: $(cat err.txt)"

# ---- shares follow from their columns ----

"$bin/error_budget" --samples 2000 -q >budget.txt || fail "error_budget"
! grep -q '|' budget.txt || fail "error_budget prints Markdown"
python3 - <<'END' || fail "error_budget: the share does not follow from its columns"
import re
rows = 0
for line in open("budget.txt"):
    found = re.match(r".{49}\s*(\S+)\s+(\S+)\s+(\d+) %\s+(\d+) %", line)
    if found:
        error, bound, share, nearest = map(float, found.groups())
        rows += 1
        assert abs(share - (100 * error / bound if error else 0)) <= 0.6, line
        assert nearest >= share, line
assert rows == 38, rows
END
# ---- --help: groups, lines of a terminal, defaults in columns ----

for program in "$bin"/*; do
  "$program" --help >help.txt || fail "$(basename "$program") --help"
  grep -E '^( {2,6}(-., )?--| {28})' help.txt | awk 'length > 80' >long.txt
  [ ! -s long.txt ] || fail "$(basename "$program") --help: lines over 80 columns: $(head -1 long.txt)"
  options=$(grep -c '^ \{2,6\}\(-., \)\?--' help.txt) groups=$(grep -c '^[A-Z].*:\( .*\)\?$' help.txt)
  [ "$options" -le 12 ] || [ "$groups" -ge 4 ] || fail "$(basename "$program") --help: $options options in $groups groups"
done
"$bin/sf_train" --help >help.txt
[ "$(grep -n '^A first run:\|^Tuning:  .* ingp  tensorf$\|^Ablations' help.txt | wc -l)" -eq 3 ] || fail "sf_train --help: groups"
grep -q -- '--samples N  *samples per iteration, about  *16384  *32768$' help.txt || fail "sf_train --help: defaults in columns"
! grep -q 'default .*tensorf ' help.txt || fail "sf_train --help: defaults of a backbone in brackets"

finish "first_hour: nothing to trip over"
