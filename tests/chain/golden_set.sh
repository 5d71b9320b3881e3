#!/bin/bash
# Whole sets of golden images: sim_render --all and --verify. Same manifest and pictures for any number of threads, core
# or accelerator, interrupted or not; every kind of difference is found and named.   usage: golden_set.sh BUILD
. "$(dirname "$0")/../chain.bash" "$@"
export LC_ALL=C OMP_NUM_THREADS=2
BIN=$build/bin
cd "$work" || exit 2
passed=0 failed=0

check() { # LABEL COMMAND...
  if "${@:2}"; then passed=$((passed + 1)); return; fi
  failed=$((failed + 1))
  echo "FAILED: $1"
  sed 's/^/    /' err out 2>/dev/null | head -8
}
# expect STATUS PATTERN SIM_RENDER_ARGS...: exit status, and the pattern in what it prints; one line on stderr on failure.
expect() {
  timeout -k 5 120 "$BIN/sim_render" "${@:3}" --quiet >out 2>err </dev/null
  local status=$?
  check "sim_render ${*:3}: exit status $status, expected $1" [ $status -eq "$1" ]
  check "sim_render ${*:3}: does not say '$2'" grep -qF -e "$2" out err
  check "sim_render ${*:3}: lines on stderr" [ "$(wc -l <err)" -eq $(($1 > 0)) ]
}

"$BIN/sf_scene" simple -o d --size 12 --train 3 --test 4 >/dev/null &&
  for seed in 1 2; do
    "$BIN/sf_train" d -o m$seed.safetensors --seed $seed --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --hidden 32 -q >/dev/null &&
      "$BIN/sf_export" m$seed.safetensors -o s$seed.snn >/dev/null
  done || { echo "no scene to test with"; exit 1; }
cp m1.safetensors model.safetensors

# ---- the same everywhere ----

OMP_NUM_THREADS=1 expect 0 "4 views rendered by fixed" s1.snn d --all -o one
OMP_NUM_THREADS=2 expect 0 "4 views rendered by fixed" s1.snn d --all -o two
check "threads change the set" diff -r one two
check "manifest lists all views" grep -q '"complete":.*true' one/manifest.json
check "six files" [ "$(ls one | wc -l)" -eq 6 ]
check "the contact sheet is written" grep -q "wrote two/manifest.json and two/contact.png" out
"$BIN/sim_render" s1.snn d --view 2 -o alone.exr >/dev/null
check "a view alone is the view of the set" cmp -s alone.exr one/view_0002.exr
expect 0 "OK: 4 of 4 views" s1.snn d --verify one/manifest.json
check "each view is named" [ "$(grep -c '^view . test/r_.: OK$' out)" -eq 4 ]
OMP_NUM_THREADS=1 expect 0 "OK: 1 of 4 views" s1.snn d --verify one/manifest.json --view 3
expect 0 '"ok":	true' s1.snn d --verify one/manifest.json --view 0 --json
mkdir bare && cp one/manifest.json bare
expect 0 "OK: 1 of 4 views" s1.snn d --verify bare/manifest.json --view 1
(cd one && "$BIN/sim_render" ../s1.snn ../d --verify manifest.json --view 0 >../out 2>../err)
check "the manifest of this folder" grep -q "OK: 1 of 4 views are as manifest.json says" out

expect 0 "4 views rendered by fixed" s1.snn d --all --crop 5,6,2,1 -o core
expect 0 "4 views rendered by rtl" s1.snn d --all --crop 5,6,2,1 -o rtl --backend rtl
check "core and accelerator give one set" diff -r core rtl
expect 0 "OK: 4 of 4 views" s1.snn d --verify core/manifest.json --backend rtl
expect 0 "OK: 4 of 4 views" s1.snn d --verify rtl/manifest.json
expect 0 "4 views rendered by float" s1.snn d --all --backend float -o float
expect 1 "float pictures may differ" s1.snn d --verify float/manifest.json

# ---- again, and interrupted ----

cp one/manifest.json before.json
expect 0 "all 4 views are there already: nothing was rendered" s1.snn d --all -o one
check "files that stay as they are: kept" grep -qx "kept one/manifest.json and one/contact.png" out
expect 0 "all 4 views are there already: nothing was rendered" s1.snn d --all -o one --downscale 1
cp d/test/r_1.png truth.png && cp d/test/r_2.png d/test/r_1.png
quality() { sed -nE 's/^[[:space:]]*"psnr":[[:space:]]*([0-9.]+).*/\1/p' one/manifest.json | tr '\n' ' '; }
first=$(quality)
expect 0 "all 4 views are there already: nothing was rendered" s1.snn d --all -o one
check "a truth that changed: still $first" [ "$(quality)" != "$first" ]
mv truth.png d/test/r_1.png
expect 0 "all 4 views are there already: nothing was rendered" s1.snn d --all -o one
check "a truth that is as it was: $(quality), not $first" [ "$(quality)" = "$first" ]
check "measured again: as it was" cmp -s before.json one/manifest.json
rm one/contact.png
expect 0 "kept one/manifest.json and wrote one/contact.png" s1.snn d --all -o one
cp one/view_0001.exr one/view_0003.exr
expect 0 "1 view rendered" s1.snn d --all -o one
rm one/view_0000.exr
expect 0 "1 view rendered" s1.snn d --all -o one
check "what was mended is what it was" diff -r one two
expect 1 "one/manifest.json belongs to another set: scene_sha256 is" s2.snn d --all -o one
expect 1 "one/manifest.json belongs to another set: t_r is" s1.snn d --all -o one --steps 1
expect 1 "one/manifest.json belongs to another set: crop is" s1.snn d --all -o one --crop 0,0,4,4
expect 1 "one/manifest.json belongs to another set: downscale is" s1.snn d --all -o one --downscale 2
cp -r d turned && sed -i '0,/\[\[\([^,]*,[^,]*,[^,]*,\)[^]]*/s//[[\1 0.25/' turned/transforms_test.json
expect 1 "one/manifest.json belongs to another set: view[0]: camera_sha256 is" s1.snn turned --all -o one
cp -r d named && sed -i 's,test/r_2,test/s_2,' named/transforms_test.json && mv named/test/r_2.png named/test/s_2.png
expect 1 "one/manifest.json belongs to another set: view[2]: name is test/r_2, here it is test/s_2" s1.snn named --all -o one
check "a refusal changes nothing" diff -r one two

# Views enough for the signal to come in the middle, whatever the speed.
views=400
"$BIN/sf_scene" simple -o many --size 8 --train 1 --test $views >/dev/null && cp -r d/transforms_train.json d/train many
expect 0 "$views views rendered" s1.snn many --all -o whole
"$BIN/sim_render" s1.snn many --all -o cut -q >out 2>err &
pid=$!
for _ in $(seq 6000); do grep -qs '"name":.*test/r_1"' cut/manifest.json && break; sleep 0.01; done
kill -INT $pid
wait $pid
check "interrupted: exit status 130" [ $? -eq 130 ]
done_views=$(sed -nE "s/.*cut holds ([0-9]+) of $views views, the same command goes on.*/\1/p" err)
done_views=${done_views:-0}
check "interrupted: says how to go on" [ "$done_views" -ge 2 ]
check "interrupted: in the middle" [ "$done_views" -lt $views ]
check "interrupted: what is finished is listed" [ "$(grep -c '"name":' cut/manifest.json)" -eq "$done_views" ]
check "interrupted: not complete" grep -q '"complete":.*false' cut/manifest.json
check "interrupted: nothing left aside" [ -z "$(find cut -name '*.sf-*')" ]
expect 0 "OK: $done_views of $views views" s1.snn many --verify cut/manifest.json
expect 2 "--view $done_views is out of range" s1.snn many --verify cut/manifest.json --view "$done_views"
expect 1 "belongs to another set" s2.snn many --all -o cut
expect 0 "$((views - done_views)) views rendered" s1.snn many --all -o cut
check "resumed = never interrupted" diff -r cut whole

# ---- differences ----

cp s1.snn flipped.snn # one weight: the scene's own checksum sees it
at=$(($(wc -c <s1.snn) - 700))
printf "\\$([ "$(od -An -tu1 -j$at -N1 s1.snn | tr -d ' ')" = 1 ] && echo 2 || echo 1)" |
  dd of=flipped.snn bs=1 seek=$at conv=notrunc status=none
expect 1 "flipped.snn" flipped.snn d --verify two/manifest.json
expect 1 "made from the scene with SHA-256" s2.snn d --verify two/manifest.json
cp -r two forged # the manifest claims the other scene: the pictures tell, to the pixel
sed -i "s/$(sha256sum <s1.snn | cut -c1-64)/$(sha256sum <s2.snn | cut -c1-64)/" forged/manifest.json
expect 1 "4 of 4 views differ" s2.snn d --verify forged/manifest.json
check "the view is named" grep -q "^view 0 test/r_0: DIFFERS: forged/view_0000.exr: plane " out
check "the pixel is named" grep -qE 'pixel \([0-9]+, [0-9]+\) is [0-9]+, here it is [0-9]+' out
check "a difference is told once" [ "$(cat out err | grep -c 'forged/view_0000.exr: plane ')" -eq 1 ]
expect 1 "4 of 4 views differ; view test/r_0: forged/view_0000.exr: plane " s2.snn d --verify forged/manifest.json --json
rm forged/*.exr
expect 1 "1 of 1 views differ" s2.snn d --verify forged/manifest.json --view 1
check "without pictures, the hash is named" grep -qE '^view 1 test/r_1: DIFFERS: plane [a-zA-Z.]+: SHA-256 is [0-9a-f]{64}, here it is' out

cp -r two spoilt # a picture with other pixels, a picture cut short, a picture packed otherwise
"$BIN/sim_render" s1.snn d --view 1 --steps 1 -o spoilt/view_0001.exr >/dev/null
truncate -s 900 spoilt/view_0002.exr
mkdir e && cp -r d/test e && cp d/transforms_test.json e/transforms_other.json
cp d/transforms_t*.json e && "$BIN/sim_render" s1.snn e --split other --view 3 -o spoilt/view_0003.exr >/dev/null
expect 1 "2 of 4 views differ" s1.snn d --verify spoilt/manifest.json
check "the renderings are right" [ "$(grep -c '^view . test/r_.: OK$' out)" -eq 4 ]
check "the pixel of the file is named" grep -q 'its file DIFFERS: spoilt/view_0001.exr: plane .*pixel (' out
check "the cut file is named" grep -q 'its file DIFFERS: spoilt/view_0002.exr' out
check "other bytes, same planes" grep -q 'note: view_0003.exr is not the file of the manifest' out
expect 0 "OK: 1 of 4 views" s1.snn d --verify spoilt/manifest.json --view 3

expect 1 "1 of 4 views differ" s1.snn turned --verify bare/manifest.json
check "the camera is named" grep -q "^view 0 test/r_0: DIFFERS: camera_sha256 is" out
cp -r d grey && cp d/test/r_0.png grey/test/r_1.png
expect 0 "note: PSNR" s1.snn grey --verify bare/manifest.json --view 1
"$BIN/sf_scene" simple -o fewer --size 12 --train 3 --test 3 >/dev/null
expect 1 "views is 4, fewer has 3 test views" s1.snn fewer --verify bare/manifest.json
sed 's/"mac":\t\([0-9]*\)/"mac":\t1\1/' two/manifest.json >bare/edited.json
expect 1 "energy_fj contradicts the counts" s1.snn d --verify bare/edited.json

# ---- usage ----

expect 2 "-o DIR is missing" s1.snn d --all
expect 2 "--view does not go with --all" s1.snn d --all -o x --view 1
expect 2 "--png does not go with --all" s1.snn d --all -o x --png x.png
expect 2 "needs --crop" s1.snn d --all -o x --backend rtl
for option in "--all" "-o x" "--png x" "--crop 0,0,1,1" "--steps 1" "--split test" "--downscale 1" "--downscale 0" "--scale 1"; do
  expect 2 "does not go with --verify" s1.snn d --verify two/manifest.json $option
done
expect 2 "cannot verify" s1.snn d --verify two/manifest.json --backend float
expect 2 "--view 4 is out of range" s1.snn d --verify two/manifest.json --view 4
expect 1 "is not inside" s1.snn d --all -o x --crop 8,8,8,8
check "a window that is refused makes no folder" [ ! -e x ]
mkdir x && sed -e '/"view":/,$d' -e '/"totals"/,/}/s/:\t[0-9][0-9]*/:\t0/' -e 's/"complete":.*/"complete":\tfalse,/' \
  -e 's/"\(psnr\|ssim\)":.*/"\1":\tnull,/' -e 's/"crop":.*/"crop":\t[0, 0, 3, 3],/' two/manifest.json >x/manifest.json
echo '"view": []}' >>x/manifest.json # interrupted in its first view
expect 0 "4 views rendered" s1.snn d --all -o x --crop 0,0,4,4
expect 1 "none.json" s1.snn d --verify none.json
: >plain
expect 1 "plain" s1.snn d --all -o plain
rm -rf x

echo "$passed passed, $failed failed"
[ $failed -eq 0 ] && [ $passed -gt 0 ]
