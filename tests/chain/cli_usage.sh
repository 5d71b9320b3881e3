#!/bin/bash
# Command lines that no program takes: exit status 2, one line that names the option.   usage: cli_usage.sh BUILD
. "$(dirname "$0")/../cli_run.bash" "$@"

good sf_train d -o vm.safetensors --backbone tensorf --stage1 2 --stage2 2 --voxels 16 --rays 64 --samples 256 --threads 1
helped() { [ "$status" -eq 0 ] && [ -s stdout.txt ] && [ ! -s err ]; }
for p in sf_scene sf_train sf_export sf_cosim sim_render energy_audit error_budget; do
  usage --no-such-option $p ${right[$p]} --no-such-option
  usage --no-such-option $p ${right[$p]} --no-such-option=3
  usage -Z $p ${right[$p]} -Z
  usage --json $p ${right[$p]} --json=
  usage --seed $p ${right[$p]} --seed
  usage --seed $p ${right[$p]} --seed nan
  usage --seed $p ${right[$p]} --seed -1
  usage --seed $p ${right[$p]} --seed 99999999999999999999999
  usage --seed $p ${right[$p]} --seed 12abc
  usage --seed $p ${right[$p]} --seed=
  usage surplus $p ${right[$p]} surplus
  [ $p = error_budget ] || usage missing $p
  run $p --help
  check "$p --help" "status $status" helped
done
number sf_scene --size 0 -1 nan 1e400 99999999999 '' 3.5
number sf_scene --train 0 nan
number sf_scene --test -1 inf
number sf_train --beta -1 2 nan NaN inf -inf 1e999 x ''
number sf_train --steps 0 9 nan
number sf_train --stage1 -1 nan 3000000000
number sf_train --minutes -1 nan
for minutes in --minutes\ 0 -m0; do usage "--minutes 0 leaves no time to learn" sf_train d -o out $minutes; done
number sf_train --threads -1 nan
number sf_train --hidden 0 129
usage hidden sf_train d -o out --hidden 17
number sf_train --input-mode sometimes nan ''
number sf_train --net cnn
number sf_train --backbone nerf
number sf_train --voxels 8 2000 nan
number sf_train --rays 1 nan
usage --fine-tune sf_train d -o out --backbone tensorf --fine-tune model.safetensors
for option in --backbone\ tensorf --voxels\ 32 --hidden\ 32 --undecoded\ 0.02; do
  usage "has no effect beside --fine-tune" sf_train d -o out --fine-tune vm.safetensors $option
done
usage "--levels has no effect on --backbone tensorf" sf_train d -o out --fine-tune vm.safetensors --levels 4
for option in --net\ ann --levels\ 4 --steps=4 -T4 --bound\ 2 --stage1\ 3 --no-stage1 --no-distill --beta\ 1 --price\ energy --target-loss\ 1 --objective\ paper; do
  usage "has no effect beside --fine-tune" sf_train d -o out --fine-tune model.safetensors $option
done
for option in --stage1 --stage2; do usage "$option has no effect beside --minutes" sf_train d -o out -m 1 $option 4; done
usage "also --summary" sf_train d -o out --summary out.jsonl
for option in --rays\ 64 --voxels\ 64 --undecoded\ 0.01; do
  usage "${option% *} has no effect on --backbone ingp" sf_train d -o out $option
done
for option in --levels --finest-res --bound; do
  usage "$option has no effect on --backbone tensorf" sf_train d -o out --backbone tensorf $option 4
done
data "cannot open the log for writing: No such file" sf_train d -o out --log absent/x.jsonl
for options in "" "--backbone tensorf" "--scale 0.3"; do
  data "cannot resume: this is no checkpoint but a finished model" sf_train d -o model.safetensors --resume $options
done
number sf_train --fixed-steps -1 9 nan
number sf_train --target-loss -1 21 nan x
number sf_train --target-saving -1 101 nan x
number sf_train --search-rate 0 -1 101 nan x
number sf_train --opaque -1 11 nan x
number sf_train --undecoded -1 0.11 nan x
number sf_train --near-camera -1 101 nan x
number sf_train --distortion -1 101 nan x
number sf_train --stop 0 1e-7 0.051 nan x
usage "--opaque has no effect beside --objective paper" sf_train d -o out --objective paper --opaque 0.1
usage "--undecoded has no effect beside --objective paper" sf_train d -o out --backbone tensorf --objective paper --undecoded 0.1
usage "--near-camera has no effect beside --objective paper" sf_train d -o out --objective paper --near-camera 1
usage "--distortion has no effect beside --objective paper" sf_train d -o out --objective paper --distortion 1
usage --price sf_train d -o out --price euros
usage --objective sf_train d -o out --objective none
usage "beside a target" sf_train d -o out --target-loss 0.1 --beta 1e-6
usage "number of steps is fixed" sf_train d -o out --price energy --fixed-steps 2
usage "number of steps is fixed" sf_train d -o out --target-saving 50 --net ann
usage "--charge has no effect on --net ann" sf_train d -o out --net ann --charge 0.2
usage "--steps-along-ray has no effect on --net ann" sf_train d -o out --net ann --steps-along-ray
usage "--fixed-steps has no effect beside --steps-along-ray" sf_train d -o out --steps-along-ray --fixed-steps 2
usage "--charge has no effect beside --steps-along-ray" sf_train d -o out --steps-along-ray --charge 0.2
usage "--input-mode radix needs steps" sf_train d -o out --steps-along-ray --input-mode radix
usage "number of steps is fixed" sf_train d -o out --steps-along-ray --target-loss 0.1
SPIKEFIELD_CPU=avx data "SPIKEFIELD_CPU=avx: expected portable, avx2" sf_train d -o out
usage "exclude each other" sf_train d -o out --target-loss 0.1 --target-saving 50
number sf_train --psnr-prefixes -1 nan
number sf_train --weight-bits 1 9 nan
number sf_train --leak-bits 3 13 nan
number sf_train --grid-bits 1 9 nan
for width in weight leak grid; do usage "--$width-bits needs --fine-tune" sf_train d -o out --$width-bits 4; done
usage feature-bits sf_train d -o out --fine-tune model.safetensors --feature-bits 9
data scale sf_train d -o out --fine-tune model.safetensors --scale 0.3
usage --fixed-steps sf_train d -o out --net ann --fixed-steps 2
number sf_export --steps 0 9 -1 nan
number sf_export --fit-loss -1 nan inf 101 ''
number sf_export --fit-rays 0 255 -1 nan
number sf_export --fit-bytes 0 -1 nan x
usage --data sf_export model.safetensors -o out --fit
usage --data sf_export s.snn --vectors out
usage --data sf_export model.safetensors -o out --vectors kit
usage --fit sf_export s.snn --vectors out --data d --fit
number sf_export --samples 0 4097 nan
while read -r option value; do
  usage "$option needs" sf_export model.safetensors -o out $option $value
done <<'END'
--fit-loss 0.1
--fit-rays 256
--fit-bytes 4096
--data d
--samples 4
--rays 4
--view 0
END
while read -r option value; do
  usage "$option needs" sf_export s.snn --nir out $option $value
done <<'END'
--steps 1
--background white
--weight-bits 4
--feature-bits 9
--leak-bits 6
--grid-bits 4
--seed 2
--data d
END
usage "--view needs --traces" sf_export s.snn --vectors out --data d --view 0
usage "--samples needs --vectors" sf_export s.snn --traces out --data d --samples 4
absent out "options that nothing reads"
data nodir sf_export model.safetensors -o out --traces traces --data nodir
absent out "traces of nothing"
usage "--view 9 is out of range" sf_export model.safetensors -o out --traces traces --data d --view 9
absent out "traces of no view"
usage "--model needs --backend float" sim_render s.snn d -o out --model model.safetensors
usage "--model needs --backend float" sim_render s.snn d --verify none.json --model model.safetensors
usage "--camera goes with one view" sim_render s.snn d -o out --view 1 --camera 1
usage "a camera is" sim_render s.snn d -o out --camera 9,8,9.5
usage "a camera is" sim_render s.snn d -o out --camera 9,8,9.5,9.5,4.5,4,1,0,0,0,0,0,-1,nan,0,1,0,0
usage "DATA is missing" sim_render s.snn -o out
for of_data in "--split train" "--downscale 2" "--scale 0.5"; do
  usage "${of_data% *} is about a data set" sim_render s.snn -o out --camera 9,8,9.5,9.5,4.5,4,1,0,0,0,0,0,-1,0,0,1,0,0 $of_data
  usage "${of_data% *} is about a data set" sf_view s.snn $of_data
done
usage "SCENE.snn is missing" sf_view
number sf_view --port -1 65536 nan
usage "no address" sf_view s.snn d --address here
usage "--replay takes neither" sf_view s.snn --replay s.snn
data "cannot listen" sf_view s.snn d --address 192.0.2.1
data "no such folder" sf_view s.snn absent
data "model.none" sf_view s.snn d --model model.none
data "none.json" sf_view --replay none.json
number sf_train --view -1 65536 nan
usage "--seed needs --backend rtl" sim_render s.snn d -o out --seed 1
usage "--port needs --backend board" sim_render s.snn d -o out --port tty
usage "--timeout needs --backend board" sim_render s.snn d -o out --timeout 2
usage "--backend board needs --port" sim_render s.snn d -o out --backend board
usage "--backend board needs --port" sf_cosim s.snn d --backend board
usage "belong to --backend board" sf_cosim s.snn d --port tty
for option in --stalls\ 3 --jobs\ 2 --block\ 5 --checkpoint\ out --evidence\ out --plusarg=+fault=1 --saif\ out; do
  usage "has no effect beside --backend board" sf_cosim s.snn d --backend board --port tty $option
done
number sim_render --timeout 0 -1 nan
data "no board there" sim_render s.snn d -o out --backend board --port notty
absent out "a picture without a board"
data "no board there" sf_cosim s.snn d --backend board --port notty
number sf_cosim --rays -1 nan inf x
number sf_cosim --jobs -1 0 257 x
number sf_cosim --block 0 x
number sf_cycles --view -1 nan 2 99999999999
number sf_cycles --downscale -1 65 nan
number sf_cycles --clock 0 nan inf
number sim_render --view -1 nan 2 99999999999
number sim_render --backend gpu nan ''
number sim_render --downscale -1 65 nan
number sim_render --steps 0 9 nan
number sim_render --threads 0 nan
number sim_render --crop '' 1 1,2,3 1,2,3,4,5 0,0,0,1 0,0,1,0 0,0,17,1 16,0,1,1 -1,0,1,1 nan,0,1,1 0,0,1,1x 99999999999,0,1,1
number energy_audit --rays 0 -1 nan
number energy_audit --views 0 3 nan
number energy_audit --view -1 2 nan
number energy_audit --rtl-rays -1 nan
number energy_audit --stall -1 91 nan
number energy_audit --recount-rays -1 nan
number energy_audit --steps 0 9 nan
number energy_audit --steps-b 0 9 nan
number error_budget --rays 0 -1 nan
usage DATA error_budget model.safetensors s.snn
usage nosuch sf_scene nosuch -o out
usage -o sim_render s.snn d
usage "--png is for previews" sim_render s.snn d -o x.png
usage --truth sim_render s.snn d --all -o set --truth t.png
usage --output sf_export model.safetensors
usage "no ReLU twin" sf_convert model.safetensors d
usage --percentile sf_convert model.safetensors d --percentile 0
usage --views energy_audit s.snn d --view 0 --views 1
usage --compare energy_audit --compare s.snn
usage DATA energy_audit --compare s.snn s.snn
usage DATA energy_audit --compare a.json s.snn
usage --csv energy_audit --compare s.snn s.snn d --csv out
usage --tech-b energy_audit s.snn d --tech-b 45nm
usage --steps-b energy_audit s.snn d --steps-b 1
usage extra energy_audit s.snn d extra
usage "missing argument" energy_audit --steps 2
usage "--compare needs two arguments" energy_audit --compare s.snn --steps-b 1
usage "d has no effect: reports" energy_audit --compare a.json b.json d
usage "--tech has no effect: A is a report" energy_audit --compare a.json s.snn d --tech 45nm --tech-b 45nm
usage "--stall has no effect beside --rtl-rays 0" energy_audit s.snn d --rtl-rays 0 --stall 5
usage --model energy_audit s.snn d --model model.safetensors
for option in --tech-b\ nosuch --steps-b\ 1; do
  usage "${option% *} has no effect: B is a report" energy_audit --compare s.snn b.json d $option
done
for option in --rays\ 5 --steps\ 1 --tech\ nosuch --view\ 0 --split\ train; do
  usage "${option% *} has no effect: no scene is counted" energy_audit --compare a.json b.json $option
done
for option in --csv --html --twin; do
  usage "$option has no effect: no scene is counted" energy_audit --published $option out
done
for option in --json --junit\ out --rays\ 3 --plusarg=+fault=1 --checkpoint\ out; do
  usage "has no effect beside --replay" sf_cosim --replay evidence.json $option
done
for bad in "--junit out" "--checkpoint out" "--limit-samples 1" "--jobs 1" "--block 1" "--evidence out"; do
  # shellcheck disable=SC2086
  usage "${bad% *}" sf_cosim s.snn d --saif out $bad
done
usage --clock sf_cosim s.snn d --clock 100
usage --top sf_cosim s.snn d --top sf_ray_top
usage --top sf_cosim s.snn d --saif out --top sf_ray_top --dut a.sv
usage --dut-top sf_cosim s.snn d --dut-top my_top
for length in 63 1942; do usage "at most 63 characters" sf_cosim s.snn d --plusarg "+$(printf "%${length}s" '' | tr ' ' x)"; done
usage SECONDS sf_summary d x
usage SECONDS sf_summary d nan
mkdir -p tiny
echo '{"psnr": 30, "ssim": null, "T": 8, "t_r": 2}' | tee tiny/{train,float}.json >tiny/fixed.json
echo '{"samples": 1, "differences": 0}' >tiny/cosim.json
echo '{"energy_spiking_fj": 1, "energy_ann_fj": 2, "energy_saving_percent": 50}' >tiny/audit.json
good sf_summary tiny 3
grep -q '^  time steps' stdout.txt && fail "sf_summary" "a search that was not"
sed -i 's/{/{"t_star": 2.5, "search": {"state": "balanced", "worth": 1.5e-5, "worth_error": 2e-6, "price": 1.4e-5}, /' tiny/train.json
good sf_summary tiny 3
grep -q 't\* = 2.50 (balanced): one more is worth 1.5e-05 +- 2e-06 of squared error and costs 1.4e-05$' stdout.txt ||
  fail "sf_summary" "no line about the search"
sed -i 's/"worth_error": 2e-6/"worth_error": null/' tiny/train.json
good sf_summary tiny 3
grep -q 't\* = 2.50 (balanced): one more is worth 1.5e-05 of squared error and costs 1.4e-05$' stdout.txt ||
  fail "sf_summary" "no line about a search without a standard error"
grep -q 'SSIM -$' stdout.txt || fail "sf_summary" "no '-' for an SSIM that there is not"
grep -Eq '"ssim_fixed":[[:space:]]*null' tiny/summary.json || fail "sf_summary" "no null in summary.json"
data "no folder SCENE/RUN" sf_report d
absent d/table.md "sf_report without a run"
absent out "usage errors"

script() { # PATTERN SCRIPT ARGS...
  "$TOOLS/$2.sh" "${@:3}" >stdout.txt 2>err
  status=$?
  if [ "$status" -eq 2 ] && [ "$(wc -l <err)" -eq 1 ] && grep -qF -e "$1" err; then passed=$((passed + 1))
  else fail "script: ${*:2}" "exit status $status, not 2 and '$1'"; fi
}
script usage: cosim_campaign
script usage: cosim_campaign --help
script "'abc' is not a whole number" cosim_campaign out s.snn d abc 1
script "'1e6' is not a whole number" cosim_campaign out s.snn d 1e6 1
script "SEEDS holds 3 twice" cosim_campaign out s.snn d 9 "3 1 03"
script usage: chain
script usage: chain --help
absent out "usage of scripts"

finish
