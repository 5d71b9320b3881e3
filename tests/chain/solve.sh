#!/bin/bash
# Photographs of a scene with known cameras: the poses that COLMAP finds, steps that are done once, and what no poses come
# of.   usage: solve.sh BUILD
for program in colmap exiftran ffmpeg python3; do
  command -v $program >/dev/null || { echo "skipped: $program is not installed"; exit 77; }
done
export LC_ALL=C OMP_NUM_THREADS=2
. "$(dirname "$0")/../chain.bash" "$@"
cd "$work" || exit 1

# A colmap before the real one: notes its calls, does what the file plan says instead.
mkdir bin
cat >bin/colmap <<END
#!/bin/bash
echo "\$1" >>"$work/calls"
[ ! -e "$work/plan" ] || . "$work/plan"
exec "$(command -v colmap)" "\$@"
END
chmod +x bin/colmap
export PATH=$work/bin:$PATH

# solves STATUS TEXT PHOTOS OPTIONS...: into the folder solved; TEXT stands on either stream
solves() {
  : >calls
  timeout -k 5 600 env PATH="${search:-$PATH}" "$build/bin/sf_data" "$3" --solve -o solved "${@:4}" >out 2>err </dev/null
  local status=$?
  [ $status -eq "$1" ] || fail "$3 ${*:4}: exit status $status, expected $1"
  grep -qF -e "$2" out err || fail "$3 ${*:4}: does not say '$2'"
}
# refuses TEXT PHOTOS OPTIONS...: in one line, and without a data set
refuses() {
  rm -rf solved
  solves 1 "$1" "${@:2}" --quiet
  [ "$(grep -c . err)" -eq 1 ] && grep -q '^sf_data: ' err || fail "${*:2}: not one line of sf_data"
  [ ! -e solved/sparse ] || fail "${*:2}: left a model"
}
calls() { [ "$(tr '\n' ' ' <calls)" = "$1" ] || fail "COLMAP's calls are '$(tr '\n' ' ' <calls)', expected '$1'"; }

"$build/bin/sf_scene" terrazzo -o truth --size 480 --train 20 --test 1 -q
cp -r truth/train photos
few=(--features 1000)

# ---- an interrupted run goes on, and nothing is done twice ----

echo '[ $1 != exhaustive_matcher ] || { kill -INT $PPID; exec sleep 60; }' >plan
solves 130 "interrupted; the same command goes on" photos "${few[@]}"
calls "feature_extractor exhaustive_matcher "
rm plan
solves 0 "20 of 20 pictures found their place" photos "${few[@]}" --png cameras.png
calls "exhaustive_matcher mapper model_analyzer "
grep -q '^solved .* mean reprojection error 0\.[0-4]' out || fail "the reprojection error is not below half a pixel"
grep -q '^o*solved: colmap layout$' out && grep -q '^looks wrong  nothing$' out || fail "not a good data set"
[ -s cameras.png ] || fail "no picture of the cameras"
cp out first
solves 0 "wrote cameras.png" photos "${few[@]}" --png cameras.png
calls ""
cmp -s out first || fail "another report of the same data set"

# ---- the cameras stand where they stood ----

"$build/bin/sf_data" truth --json >truth.json && "$build/bin/sf_data" photos --solve -o solved "${few[@]}" --json >solved.json ||
  fail "no JSON"
python3 "$root/tests/similarity.py" truth.json solved.json 0.5 || fail "the cameras stand elsewhere"

# ---- what makes a step new: its inputs ----

plan() { printf '%s\n' "case \$1 in feature_extractor$1" 'esac' >plan; }
plan ') echo planned; exit 1 ;;'
solves 1 "colmap failed: planned (its log is solved/.solve/features-0.log)" photos --features 900
calls "feature_extractor "
solves 1 "planned" photos "${few[@]}" # as at first: what later steps made is gone all the same
calls "feature_extractor "
cmp -s photos/r_7.png solved/images/r_7.png || fail "other features, and the pictures are gone"
mkdir eight && cp photos/r_[0-7].png eight
solves 1 "planned" eight
[ "$(ls solved/images | wc -l)" -eq 8 ] || fail "pictures of other photographs are left"

# ---- which pictures ----

cp -r eight some && for i in 1 2; do ffmpeg -v error -i eight/r_$i.png -vf gblur=sigma=6 some/blurred_$i.png; done
solves 1 "left out     2 of 10 pictures, blurred or blank: blurred_1.png, blurred_2.png" some
[ "$(ls solved/images)" = "$(ls eight)" ] || fail "not the eight that are sharp"
noise() { mkdir -p "$1" && ffmpeg -v error -f lavfi -i "nullsrc=s=$2,geq=random(1)*255:128:128" -frames:v 8 "$1/$2_%d.jpg"; }
side() { ffprobe -v error -show_entries stream=width,height -of csv=p=0 "$1"; }
noise large 3300x90
solves 1 "planned" large
[ "$(side solved/images/3300x90_1.jpg)" = 3300,90 ] && [ "$(side solved/images_3/3300x90_1.png)" = 1100,30 ] || fail "not the sizes that are read"
noise sizes 200x150 && noise sizes 150x200
plan ') exit 0 ;; *) echo planned; exit 1 ;;'
solves 1 "planned" sizes
calls "feature_extractor feature_extractor exhaustive_matcher " # a camera for each size
solves 1 "planned" sizes --matching sequential
calls "sequential_matcher "
plan ') echo planned; exit 1 ;;'

# Rows as the sensor has them, and a tag (EXIF's Orientation) that says how to turn them.
python3 - sizes turned 3 6 8 <<'END'
import os, struct, sys
folder, to, *tags = sys.argv[1:]
os.mkdir(to)
for i in range(1, 9):
    data = open(f"{folder}/200x150_{i}.jpg", "rb").read()
    tag = int(tags[i % len(tags)])
    tiff = struct.pack("<2sHIHHHIII", b"II", 42, 8, 1, 0x112, 3, 1, tag, 0)
    exif = b"Exif\0\0" + tiff
    mark = b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif if i > 2 else b""
    open(f"{to}/{i}_{tag if mark else 1}.jpg", "wb").write(data[:2] + mark + data[2:])
END
plan ') exit 0 ;; *) echo planned; exit 1 ;;'
solves 1 "planned" turned
plan ') echo planned; exit 1 ;;'
calls "feature_extractor feature_extractor feature_extractor feature_extractor exhaustive_matcher "
for file in turned/*.jpg; do # blocks of 16 pixels that are not whole are cut off where they cannot be turned
  case $file in
    *_3.jpg) turn=hflip,vflip,crop=192:144:8:6 ;;
    *_6.jpg) turn=transpose=clock,crop=144:200:6:0 ;;
    *_8.jpg) turn=transpose=cclock,crop=150:192:0:8 ;;
    *) turn=null ;;
  esac
  ffmpeg -v error -y -noautorotate -i "$file" -vf "$turn" upright.png && ffmpeg -v error -y -noautorotate -i "solved/images/${file##*/}" now.png
  [ "$(side now.png)" = "$(side upright.png)" ] || fail "$file: $(side now.png) pixels"
  ffmpeg -v info -i now.png -i upright.png -lavfi psnr -f null - 2>&1 | grep -qE 'average:(inf|[4-9][0-9])' || fail "$file does not stand upright"
done

# The sharp frame of each four, wherever it is.
mkdir walk && n=0 sharp=
for i in 0 1 2 3 4 5 6 7; do
  for k in 0 1 2 3; do
    n=$((n + 1)) blur=gblur=sigma=3
    [ $k -ne $((i * 3 % 4)) ] || { blur=null sharp="$sharp$(printf 'frame_%06d.jpg ' $n)"; }
    ffmpeg -v error -i eight/r_$i.png -vf $blur "$(printf 'walk/%02d.png' $n)"
  done
done
ffmpeg -v error -framerate 25 -i walk/%02d.png -c:v mjpeg -q:v 2 walk.avi
rm -rf solved
solves 1 "planned" walk.avi --frames 8
[ "$(ls solved/images | tr '\n' ' ')" = "$sharp" ] || fail "frames $(ls solved/images | tr '\n' ' '), expected $sharp"

# ---- what no poses come of ----

mkdir none phone still && touch phone/a.heic && mkdir -p three && cp eight/r_[0-2].png three
rm plan
refuses "none: no JPEG or PNG picture is there" none
refuses "phone: no JPEG or PNG picture is there, only a.heic" phone
refuses "three: 3 pictures, at least 8 are needed" three
mkdir blurred && for i in 0 1 2 3 4 5 6 7; do
  ffmpeg -v error -i eight/r_$i.png -vf gblur=sigma=6 blurred/$i.png && cp eight/r_3.png still/$i.png
done
refuses "blurred: 8 of 8 pictures are blurred or blank" blurred
refuses "err: neither a folder of pictures nor a video" err
search=$work/none refuses "colmap is not installed: apt-get install colmap" eight
search=$work/bin refuses "exiftran is not installed: apt-get install exiftran" sizes
search=$work/bin refuses "ffprobe is not installed: apt-get install ffmpeg" walk.avi
search=
refuses "none shows the scene from two places. Either the camera stood still" still --features 200
noise noise 200x200
refuses "only 0 of 8 pictures show something that another one shows" noise --features 200
models() { # SIZE...: COLMAP finds models of so many pictures
  echo 'case $1 in mapper) while [ "$1" != --output_path ]; do shift; done; i=0'
  for n in "$@"; do printf 'mkdir $2/$i && printf "\\%03o\\0\\0\\0\\0\\0\\0\\0" >$2/$i/images.bin; i=$((i + 1))\n' "$n"; done
  echo 'exit 0 ;; feature_extractor | *_matcher) exit 0 ;; esac'
} >plan
models 2 3 1
refuses "several models, of 2, 3 and 1 pictures; none has half of all 8" eight
models 3
refuses "only 3 of 8 pictures found their place" eight

mkdir -p made/bin && ln -s "$build/bin/sf_data" made/bin
out=$(make -s -C "$root" -o all B="$work/made" scene PHOTOS="$work/three" 2>&1) && fail "make scene PHOTOS: exit status 0"
grep -qF "three: 3 pictures" <<<"$out" && [ -d made/scenes/three/data ] || fail "make scene PHOTOS: $out"

# ---- nothing of others is lost ----

rm plan
usage() { "$build/bin/sf_data" "$1" --solve -o "$2" 2>err && fail "-o $2" || grep -qF "$3" err || fail "-o $2: does not say '$3'"; }
usage eight eight "the photographs lie in it"
usage eight truth "neither empty nor made by --solve before"
[ "$(ls eight | wc -l)" -eq 8 ] && [ -s truth/transforms_train.json ] || fail "files of others are gone"

finish "solve: the cameras stand where they stood"
