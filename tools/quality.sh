#!/bin/bash
# make quality: short equal runs of several scenes, spiking and ReLU twin, with two seeds, and one table. Whoever changes a
# default of training runs it before and after.
set -euo pipefail
export LC_ALL=C
usage="usage: quality.sh BUILD [options]
  --scenes FOLDER  where mic, lego, fern and fox are, those that are there (none)
  --only 'NAME...' these scenes alone (simple, textured, fog, wires, mic, lego, fern, fox)
  --seeds 'S...'   (1 2)
  --stage1 N, --stage2 N, --samples N    of every run (300, 900, 4096)
  --train 'OPTIONS'                      further options of sf_train, spiking runs alone
  --jobs N         runs at a time, one thread each (as many as processors)
  --out FOLDER     (BUILD/quality)
  --keep           the table of now is what later ones are compared with
Results: FOLDER/quality.json and SCENE/{snn,ann}-SEED/. Finished runs are kept. Those of another sf_train or with other options start again."

die() { echo "quality: $1" >&2; exit "${2:-2}"; }
[ $# -ge 1 ] || die "missing argument BUILD (see quality.sh --help)"
if [ "$1" = --help ] || [ "$1" = -h ]; then echo "$usage"; exit 0; fi
build=$1 scenes="" only="simple textured fog wires mic lego fern fox" seeds="1 2" jobs=$(nproc) keep="" out=$1/quality
stage1=300 stage2=900 samples=4096 train=""
shift
while [ $# -gt 0 ]; do
  case $1 in
    --keep) keep=1; shift; continue ;;
    --help | -h) echo "$usage"; exit 0 ;;
  esac
  [ $# -ge 2 ] || die "$1 needs a value (see quality.sh --help)"
  case $1 in
    --scenes) scenes=$2 ;;
    --only) only=$2 ;;
    --out) out=$2 ;;
    --train) train=$2 ;;
    --seeds) [[ $2 =~ ^[0-9]+(\ +[0-9]+)*$ ]] || die "--seeds '$2': expected whole numbers"; seeds=$2 ;;
    --jobs | --stage1 | --stage2 | --samples)
      [[ $2 =~ ^[1-9][0-9]{0,7}$ ]] || die "$1 '$2' is not a whole number above 0"
      declare "${1#--}=$2" ;;
    *) die "unknown option $1 (see quality.sh --help)" ;;
  esac
  shift 2
done
for program in sf_scene sf_train sf_quality; do
  [ -x "$build/bin/$program" ] || die "$build/bin/$program is missing: run make first" 1
done

# "SCENE|DATA|OPTIONS" of every scene that is there. Pictures of about 200 pixels, fields to match.
list_scenes() {
  local name
  for name in $only; do
    case $name in
      simple | textured | fog | wires) echo "$name|$build/quality-data/$name|--log2-hash 16 --occ-res 64" ;;
      mic | lego | fern | fox)
        if [ -z "$scenes" ] || [ ! -d "$scenes/$name" ]; then echo "quality: no $name (SCENES=folder)" >&2; continue; fi
        case $name in
          lego) echo "$name|$scenes/$name|--log2-hash 17 --downscale 2" ;;
          fern) echo "$name|$scenes/$name|--backbone tensorf --voxels 160 --downscale 16" ;;
          *) echo "$name|$scenes/$name|--log2-hash 17" ;;
        esac ;;
      *) die "scene '$name' is unknown: expected simple, textured, fog, wires, mic, lego, fern, fox" ;;
    esac
  done
}
make_scene() { # NAME
  local to=$build/quality-data/$1
  [ -e "$to/complete" ] && return
  rm -rf "$to"
  "$build/bin/sf_scene" "$1" -o "$to" --size 200 --train 60 --test 8 --quiet && touch "$to/complete"
}
one() { # "NET SEED SCENE|DATA|OPTIONS"
  local net seed scene data options dir command failed=""
  read -r net seed options <<<"$1"
  IFS='|' read -r scene data options <<<"$options"
  dir=$out/$scene/$net-$seed
  command="$data $options $common --net $net --seed $seed"
  [ "$net" = ann ] || command="$command${train:+ $train}"
  if [ "$(cat "$dir/command" 2>/dev/null)" != "$trainer $command" ]; then rm -rf "$dir"; fi
  mkdir -p "$dir"
  echo "$trainer $command" >"$dir/command"
  if [ ! -s "$dir/train.json" ]; then
    # shellcheck disable=SC2086
    "$build/bin/sf_train" $command --threads 1 --quiet -o "$dir/model.safetensors" --log "$dir/train.jsonl" \
      --summary "$dir/train.json" >"$dir/log" 2>&1 || failed=": FAILED: $(tail -n 1 "$dir/log")"
  fi
  printf '[%3d s] %-9s %s seed %s%s\n' $(($(date +%s) - started)) "$scene" "$net" "$seed" \
    "${failed:-: $(sed -nE 's/.*"psnr":[[:space:]]*([0-9.]{1,5}).*/\1/p' "$dir/train.json" | head -n 1) dB}"
  [ -z "$failed" ] || return 1
}
export -f one
trainer=$(sha256sum <"$build/bin/sf_train" | cut -c1-16)
export build out common train trainer started
started=$(date +%s)
common="--stage1 $stage1 --stage2 $stage2 --samples $samples --eval-views 4"
list=$(list_scenes)
[ -n "$list" ] || die "no scene is left" 1
mkdir -p "$out"
for name in $only; do [[ ! " simple textured fog wires " == *" $name "* ]] || make_scene "$name"; done
failures=0
for seed in $seeds; do
  while read -r scene; do printf 'snn %s %s\0ann %s %s\0' "$seed" "$scene" "$seed" "$scene"; done <<<"$list"
done | xargs -0 -n 1 -P "$jobs" bash -c 'one "$0"' || failures=1
against=()
[ ! -s "$out/kept.json" ] || against=(--against "$out/kept.json")
"$build/bin/sf_quality" "$out" "${against[@]}" || failures=1
[ -z "$keep" ] || [ $failures -ne 0 ] || cp "$out/quality.json" "$out/kept.json"
exit $failures
