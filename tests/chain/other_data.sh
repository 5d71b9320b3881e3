#!/bin/bash
# A scene with another scene's data is refused by every program that takes both, in one line that names what differs.
# A scene that does not say what it learned from is taken, with a warning.   usage: other_data.sh BUILD
export LC_ALL=C OMP_NUM_THREADS=2
. "$(dirname "$0")/../small_scene.bash" "$@"
bin=$build/bin
cd "$work" || exit 1

# The same pictures as instant-ngp would list them: another scale, a larger box.
cp -r data cube && sed -i 's/^{/{"aabb_scale": 4, /' cube/transforms_t*.json
train() { # DATA NAME
  "$bin/sf_train" "$1" -o "$2.safetensors" --stage1 2 --stage2 2 --hidden 16 --steps 3 --levels 2 --log2-hash 8 -q >/dev/null &&
    "$bin/sf_export" "$2.safetensors" -o "$2.snn" >/dev/null || fail "no scene $2"
}
train data ours
train cube theirs

refused() { # WHAT PROGRAM ARGUMENTS...: one line that holds WHAT
  timeout 120 "$bin/$2" "${@:3}" >out.txt 2>err.txt
  local status=$?
  [ $status -eq 1 ] || fail "$*: exit status $status, expected 1"
  [ "$(wc -l <err.txt)" -eq 1 ] || fail "$*: $(wc -l <err.txt) lines on stderr"
  grep -qF "$1" err.txt || fail "$*: $(head -1 err.txt)"
}
other="ours.snn: learned from data of scale 0.8 and bound 1, cube/transforms_test.json: scale 0.33 and bound 2"
refused "$other" sim_render ours.snn cube -o out.exr -q
refused "$other" sim_render ours.snn cube -o views --all -q
refused "$other" sf_cosim ours.snn cube --rays 1 -q
refused "$other" energy_audit ours.snn cube --rays 10 --rtl-rays 0 -q
refused "$other" sf_cycles ours.snn cube -q
refused "$other" error_budget ours.safetensors ours.snn cube --samples 10 --rays 1
refused "$other" sf_soc ours.snn cube --crop 7,7,2,2
refused "learned from data of scale 0.8" sf_export ours.safetensors -o out.snn --fit --data cube --fit-rays 256
refused "learned from data of scale 0.8" sf_point ours.safetensors cube
refused "ours.safetensors: learned from data of scale 0.8" sf_train cube -o out.safetensors -q --fine-tune ours.safetensors
refused "theirs.snn: learned from data of scale 0.33 and bound 2" sim_render theirs.snn data -o out.exr -q
[ ! -e out.exr ] && [ ! -e out.snn ] || fail "something was written"

# Another scene of the same scale and box, and the same scene with a camera moved: told by the poses.
"$bin/sf_scene" simple -o twin --size 16 --train 2 --test 1 --seed 7 >/dev/null || fail "no twin"
cp -r data moved
python3 - moved/transforms_train.json <<'END'
import json, sys
text = json.load(open(sys.argv[1]))
text["frames"][0]["transform_matrix"][0][3] += 0.01
json.dump(text, open(sys.argv[1], "w"))
END
views=$(grep -o '"transform_matrix"' data/transforms_train.json | wc -l)
for folder in twin moved; do
  listed=$(grep -o '"transform_matrix"' $folder/transforms_train.json | wc -l)
  other="ours.snn: learned from a list of $views views, $folder lists $listed and their poses differ"
  refused "$other" sim_render ours.snn $folder -o out.exr -q
  refused "$other" sf_cosim ours.snn $folder --rays 1 -q
  refused "$other" energy_audit ours.snn $folder --rays 10 --rtl-rays 0 -q
  refused "$other" sf_soc ours.snn $folder --crop 7,7,2,2
  refused "ours.safetensors: learned from a list of $views views" sf_train $folder -o out.safetensors -q --fine-tune ours.safetensors
  refused "learned from a list of $views views" sf_export ours.safetensors -o out.snn --fit --data $folder --fit-rays 256
done
[ ! -e out.exr ] && [ ! -e out.snn ] || fail "something was written"

# With the data that it learned from: not a word, also at a scale and a box of the user's own.
quiet() { # PROGRAM ARGUMENTS...
  timeout 120 "$bin/$1" "${@:2}" >out.txt 2>err.txt || fail "$*: $(head -1 err.txt)"
  [ ! -s err.txt ] || fail "$*: $(head -1 err.txt)"
}
quiet sim_render theirs.snn cube -o out.exr -q
"$bin/sf_train" cube -o own.safetensors --scale 0.2 --bound 1 --stage1 2 --stage2 2 --hidden 16 --steps 3 --levels 2 --log2-hash 8 -q >/dev/null
"$bin/sf_export" own.safetensors -o own.snn >/dev/null
quiet sim_render own.snn cube -o out.exr -q
refused "own.snn: learned from data of scale 0.33" sim_render own.snn data -o out2.exr -q

# The same cameras before other pictures: taken, with one warning.
"$bin/sf_scene" textured -o painted --size 32 --train 1 --test 2 >/dev/null || fail "no painted scene"
warned() { # PROGRAM ARGUMENTS...
  timeout 120 "$bin/$1" "${@:2}" >out.txt 2>err.txt || fail "$*: $(head -1 err.txt)"
  [ "$(grep -c "warning: ours.s.*: learned from other pictures: painted has the same cameras" err.txt)" -eq 1 ] ||
    fail "$*: other pictures: $(wc -l <err.txt) lines, $(head -1 err.txt)"
}
warned sim_render ours.snn painted -o out.exr -q
warned sim_render ours.snn painted -o views --all -q
warned sf_cosim ours.snn painted --rays 1 -q
warned energy_audit ours.snn painted --rays 10 --rtl-rays 0 -q
warned sf_cycles ours.snn painted -q
warned error_budget ours.safetensors ours.snn painted --samples 10 --rays 1
warned sf_soc ours.snn painted --crop 15,15,2,2
warned sf_export ours.safetensors -o out.snn --fit --data painted --fit-rays 256
warned sf_point ours.safetensors painted
warned sf_train painted -o out.safetensors -q --fine-tune ours.safetensors --stage2 1
"$bin/sim_render" ours.snn painted -o out.exr -q --backend float --model ours.safetensors >out.txt 2>err.txt
grep -q "ours.snn: learned from other" err.txt && grep -q "ours.safetensors: learned from other" err.txt ||
  fail "the float model: $(cat err.txt)"
rm out.exr

# The same with LLFF's and COLMAP's lists, at any size that is read. Without `images`, nothing is known.
"$bin/sf_scene" simple -o data_2 --size 16 --train 1 --test 2 >/dev/null || fail "no small scene"
"$bin/sf_scene" textured -o painted_2 --size 16 --train 1 --test 2 >/dev/null || fail "no small painted scene"
python3 - <<'END'
import os, shutil, struct
for name, scene in ("ours", "data"), ("other", "painted"):
    for layout in "llff", "colmap":
        os.makedirs(f"{layout}_{name}/sparse/0" if layout == "colmap" else f"{layout}_{name}")
        for folder, pictures in ("images", scene), ("images_2", scene + "_2"):
            os.mkdir(f"{layout}_{name}/{folder}")
            for i in range(9):
                shutil.copy(f"{pictures}/test/r_{i % 2}.png", f"{layout}_{name}/{folder}/{i}.png")
    row = []
    for i in range(9):
        pose = [[0, 1, 0, 0.1 * i, 32], [-1, 0, 0, 0.05 * (i % 3), 32], [0, 0, 1, 0, 40]]
        row.append([x for line in pose for x in line] + [2, 10])
    header = "{'descr': '<f8', 'fortran_order': False, 'shape': (9, 17), }"
    header += " " * (63 - (10 + len(header)) % 64) + "\n"
    with open(f"llff_{name}/poses_bounds.npy", "wb") as f:
        f.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header.encode())
        f.write(b"".join(struct.pack("<17d", *r) for r in row))
    with open(f"colmap_{name}/sparse/0/cameras.txt", "w") as f:
        f.write("1 PINHOLE 32 32 40 40 16 16\n")
    with open(f"colmap_{name}/sparse/0/images.txt", "w") as f:
        for i in range(9):
            f.write(f"{i + 1} 1 0 0 0 {-0.1 * i} {0.05 * (i % 3)} 4 1 {i}.png\n\n")
END
for layout in llff colmap; do
  train ${layout}_ours $layout
  grep -aq '"data_picture":"[1-9]' $layout.safetensors || fail "$layout: no first picture is recorded"
  for size in 1 2; do
    "$bin/sim_render" $layout.snn ${layout}_ours --downscale $size --crop 3,3,2,2 -o out.exr -q >out.txt 2>err.txt ||
      fail "$layout at size $size: $(head -1 err.txt)"
    ! grep -q "other pictures" err.txt || fail "$layout at size $size: its own data is taken for another scene's"
    "$bin/sim_render" $layout.snn ${layout}_other --downscale $size --crop 3,3,2,2 -o out.exr -q >out.txt 2>err.txt
    grep -q "warning: $layout.snn: learned from other pictures: ${layout}_other has the same cameras" err.txt ||
      fail "$layout at size $size: no warning: $(head -1 err.txt)"
  done
  rm -r ${layout}_other/images out.exr
  "$bin/sim_render" $layout.snn ${layout}_other --crop 7,7,2,2 -o out.exr -q >out.txt 2>err.txt
  ! grep -q "other pictures" err.txt || fail "$layout: a warning without images"
  rm -f out.exr
done

# A record that cannot be.
poses=$(grep -ao '"data_poses":"[0-9]*"' ours.safetensors | tr -dc 0-9)
picture=$(grep -ao '"data_picture":"[0-9]*"' ours.safetensors | tr -dc 0-9)
for edit in ndc:0:2 bound:1:0 poses:$poses:${poses//?/0} picture:$picture:${picture//?/0}; do
  IFS=: read -r key from to <<<"$edit"
  sed "s/\"data_$key\":\"$from\"/\"data_$key\":\"$to\"/" ours.safetensors >bad.safetensors
  refused "bad.safetensors: metadata: data_" sf_export bad.safetensors -o bad.snn
  grep -q "data_$key $((10#$to))[,:]" err.txt || fail "data_$key $to: $(cat err.txt)"
done

# A file without the record, as older ones are.
python3 - ours.safetensors old.safetensors <<'END'
import json, struct, sys
text = open(sys.argv[1], "rb").read()
n = struct.unpack("<Q", text[:8])[0]
header = json.loads(text[8 : 8 + n])
keys = [k for k in header["__metadata__"] if k.startswith("data_")]
assert len(keys) == 6, keys
for key in keys:
    del header["__metadata__"][key]
header = json.dumps(header).encode()
header += b" " * (-len(header) % 8)
open(sys.argv[2], "wb").write(struct.pack("<Q", len(header)) + header + text[8 + n :])
END
"$bin/sf_export" old.safetensors -o old.snn >/dev/null || fail "an older model is not exported"
quiet sim_render old.snn data -o out.exr -q
"$bin/sim_render" old.snn cube -o out.exr -q >out.txt 2>err.txt || fail "an older scene: $(head -1 err.txt)"
grep -q "warning: old.snn: trained at scale 0.8 and bound 1, cube/transforms_test.json has scale 0.33 and bound 2" err.txt ||
  fail "an older scene with other data: no warning"
finish "other_data: scenes are refused with data that cannot be theirs"
