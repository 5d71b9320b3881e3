#!/bin/bash
# Damaged data sets, models and scenes: exit status 1, one line that names the file, no output.   usage: cli_data.sh BUILD
. "$(dirname "$0")/../cli_run.bash" "$@"

whole_readers() { # PATTERN DIR: every program that reads all views
  data "$1" sf_train "$2" -o out --stage1 2 --stage2 2 --levels 2 --log2-hash 8 --threads 1
  data "$1" energy_audit s.snn "$2" --views 2 --rtl-rays 1
  data "$1" sf_export model.safetensors -o out --fit --fit-rays 256 -q --data "$2"
  data "$1" sf_cosim s.snn "$2" --rays 1
  absent out "bad data $2"
}
readers() { # PATTERN DIR: and those that read one after the other
  whole_readers "$1" "$2"
  data "$1" sim_render s.snn "$2" -o out
  data "$1" sim_render s.snn "$2" --all -o out
  data "$1" sf_cycles s.snn "$2"
  absent out "bad data $2"
}
spoil() { rm -rf bad; cp -r d bad; } # then change bad/
both() { # SED PROGRAM: on both JSON files
  sed -i "$1" bad/transforms_train.json bad/transforms_test.json
}
first_pictures() { for f in bad/train/r_0.png bad/test/r_0.png; do "$@" $f; done; }
cut_picture() { truncate -s $(($(size_of "$1") * 6 / 10)) "$1"; }
flip_picture() { poke "$1" $(($(size_of "$1") / 2)) 123; }
empty_picture() { : >"$1"; }

readers nodir nodir
spoil; rm bad/*.json; readers bad bad
spoil; rm bad/*/*.png; readers r_ bad
spoil; rm bad/train/r_[01].png bad/test/r_0.png; readers r_0 bad
spoil; first_pictures cut_picture; readers r_0 bad
spoil; first_pictures empty_picture; readers r_0 bad
spoil; first_pictures flip_picture; readers r_0 bad
spoil; for s in train test; do cp s.snn bad/$s/r_0.png; done; readers r_0 bad
sf_small() { run sf_scene simple -o small --size 8 --train 1 --test 1; }
sf_small
spoil; for s in train test; do cp small/$s/r_0.png bad/$s/r_1.png; done; whole_readers r_1 bad
spoil; for s in train test; do sed -i '3s/frames/fra\x01mes" "/' bad/transforms_$s.json; done; readers json:3: bad
spoil; for s in train test; do truncate -s 200 bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do : >bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do echo trailing >>bad/transforms_$s.json; done; readers .json: bad
spoil; for s in train test; do echo '[]' >bad/transforms_$s.json; done; readers .json bad
spoil; for s in train test; do echo '{"camera_angle_x":0.7,"frames":[]}' >bad/transforms_$s.json; done; readers .json bad
spoil; both 's/"frames"/"fromes"/'; readers .json bad
spoil; both '5,6s/\[\[-*[0-9.e-]*,/[[NaN,/'; readers .json: bad
spoil; both 's/\[\[-*[0-9.e-]*,/[[1e999,/'; readers .json bad
spoil; both 's/\[\[-*[0-9.e-]*,/[["1",/'; readers .json bad
spoil; both 's/, *\[0, 0, 0, 1\]//;s/\[\[[^]]*\],/[/'; readers .json bad
spoil; both 's/"transform_matrix"/"transform"/'; readers .json bad
spoil; both 's/"file_path"/"path"/'; readers .json bad
spoil; both 's/"camera_angle_x":.*,/"camera_angle_x": 0,/'; readers .json bad
spoil; both 's/"camera_angle_x":.*,/"camera_angle_x": -1e999,/'; readers .json bad
spoil; both '/camera_angle_x/d'; readers .json bad

# What is evaluated on is looked at before anything is learned.
spoil; rm bad/test/*.png
data test/r_0 sf_train bad -o out --stage1 100000000 --levels 2 --log2-hash 8 --threads 1
absent out.jsonl "bad test views"

# ---- models and scenes ----

models() { # PATTERN FILE
  data "$1" sf_export "$2" -o out
  data "$1" sim_render s.snn d --backend float --model "$2" -o out
  absent out "bad model $2"
}
scenes() { # PATTERN FILE
  data "$1" sim_render "$2" d -o out
  data "$1" energy_audit "$2" d --rays 1 --rtl-rays 1
  data "$1" sf_cosim "$2" d --rays 1
  data "$1" sf_cycles "$2" d
  absent out "bad scene $2"
}
each_file() { # FUNCTION GOOD
  $1 none.file none.file
  $1 d d
  for n in 0 1 7 8 9 100 $(($(size_of "$2") / 2)) $(($(size_of "$2") - 1)); do
    head -c "$n" "$2" >cut.file; $1 cut.file cut.file
  done
  { cat "$2"; echo; } >long.file; $1 long.file long.file
  cp "$2" edited.file; poke edited.file 0 377; $1 edited.file edited.file    # header length
  cp "$2" edited.file; poke edited.file 7 177; $1 edited.file edited.file    # header length beyond any file
  cp "$2" edited.file; poke edited.file 8 170; $1 edited.file edited.file    # not JSON
  cp "$2" edited.file; poke edited.file 40 0; $1 edited.file edited.file     # a NUL in the header
  sed 's/"version":"[12]"/"version":"9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"t_r":"[0-9]"/"t_r":"9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"t_r":"[0-9]"/"t_r":"0"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"format":"spikefield/"format":"spokefield/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"dtype":"U8"/"dtype":"I8"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"colour.w4"/"colour.w9"/' "$2" >edited.file; $1 edited.file edited.file
  sed 's/"shape":\[512,2\]/"shape":[256,4]/' "$2" >edited.file; $1 edited.file edited.file
  printf 'PK\003\004 something else entirely' >other.file; $1 other.file other.file
}
data model.safetensors sf_export model.safetensors --vectors out --data d
data nodir sf_export s.snn --vectors out --data nodir
absent out "vectors of nothing"
each_file models model.safetensors
each_file scenes s.snn

# Floats that are not numbers: -NaN in the first weight of the file.
header=$(od -An -tu8 -N8 model.safetensors | tr -d ' ')
cp model.safetensors nan.file
for i in 0 1 2 3; do poke nan.file $((8 + header + i)) 377; done
models nan.file nan.file
# One weight of C3 becomes 1000: too large for narrower widths, which --fit then leaves out.
cp model.safetensors large.safetensors
at=$(head -c $((8 + header)) model.safetensors | sed -n 's/.*"colour.w5":{[^}]*"data_offsets":\[\([0-9]*\).*/\1/p')
for i in 2 3; do poke large.safetensors $((8 + header + at + i)) $((i == 2 ? 172 : 104)); done
for i in 0 1; do poke large.safetensors $((8 + header + at + i)) 0; done
good sf_export large.safetensors -o large.snn
good sf_export large.safetensors -o large.snn --fit --data d --fit-rays 256 --json
if grep -q "clipped_weights" stdout.txt; then fail "--fit" "figures of the layers before they were cut down"; fi
# A scene's checksum covers every byte behind its header; the weights of a model may be anything finite.
header=$(od -An -tu8 -N8 s.snn | tr -d ' ')
for part in 1 3 5 7 9; do
  cp s.snn edited.file
  at=$((8 + header + ($(size_of s.snn) - 8 - header) * part / 10))
  poke edited.file $at "$(if [ "$(od -An -tu1 -j$at -N1 edited.file | tr -d ' ')" = 1 ]; then echo 2; else echo 1; fi)"
  scenes edited.file edited.file
done
sed 's/"D1.theta":"[0-9]/"D1.theta":"-/' s.snn >edited.file; scenes edited.file edited.file
sed 's/"max_samples":"1024"/"max_samples":"1023"/' s.snn >edited.file; scenes edited.file edited.file
scenes model.safetensors model.safetensors
models s.snn s.snn
usage --steps sim_render s.snn d --steps 9 -o out

# One wrong byte anywhere in a scene's header is refused; in a model's it may be another good number, but never a crash.
header=$(od -An -tu8 -N8 s.snn | tr -d ' ')
for at in $(seq 8 $((header / 30)) $((header + 7))); do
  cp s.snn edited.file
  poke edited.file $at "$(if [ "$(od -An -tc -j$at -N1 edited.file | tr -d ' ')" = 9 ]; then echo 70; else echo 71; fi)"
  data edited.file sim_render edited.file d -o out
done
header=$(od -An -tu8 -N8 model.safetensors | tr -d ' ')
for at in $(seq 9 $((header / 30)) $((header + 7))); do
  cp model.safetensors edited.file
  poke edited.file $at 71
  run sf_export edited.file -o out
  if [ "$status" -eq 0 ]; then passed=$((passed + 1)); rm -f out
  else judge "model with byte $at edited" sf_export 1 edited.file; absent out "model with byte $at edited"; fi
done

# A float model of the other kind of field.
good sf_train d -o planes.safetensors --backbone tensorf --voxels 16 --hidden 16 --rays 128 --samples 512 --stage1 2 --stage2 2 --threads 1
data "planes.safetensors: the model's field is TensoRF's" sim_render s.snn d -o out --backend float --model planes.safetensors
absent out "a model of another field"

finish
