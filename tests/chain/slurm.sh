#!/bin/bash
# The batch scripts of share/slurm under Debian's Slurm on this host: the runs of make reproduce as an array, sf_cosim,
# sim_render and sf_train as tasks of srun; what comes out is what one process gives.   usage: slurm.sh BUILD
PATH=$PATH:/usr/sbin
for program in slurmctld slurmd munged srun; do
  command -v $program >/dev/null || { echo "skipped: $program is not installed (make deps-ci)"; exit 77; }
done
[ "$(id -u)" -eq 0 ] || { echo "skipped: slurmd needs root"; exit 77; }
. "$(dirname "$0")/../small_scene.bash" "$@"
here=$(cd "$(dirname "$0")/../.." && pwd) programs=$(cd "$build/bin" && pwd)
. "$here/tests/slurm_here.bash" "$work/slurm"
cd "$work" || exit 1
export LC_ALL=C OMP_NUM_THREADS=1 OMP_WAIT_POLICY=passive PATH=$programs:$PATH
trap 'slurm_end; rm -rf "$work"' EXIT
# Some containers keep its daemons from starting: that is no fault of the scripts.
slurm_begin || { echo "slurm: not run, because Slurm does not start here"; exit 0; }
batch() { # SCRIPT OPTIONS OF SBATCH -- ARGS
  local script=$here/share/slurm/$1.sbatch options=()
  shift
  while [ "$1" != -- ]; do options+=("$1"); shift; done
  shift
  timeout -k 5 120 sbatch --wait --parsable --output="$work/job.out" --open-mode=append "${options[@]}" "$script" "$@" >/dev/null
}
plain() { grep -v '"seconds"\|"samples_per_second"\|"pixels_per_second"\|"jobs"' "$1"; }

sf_cosim scene.snn data --rays 20 --block 5 --quiet --json >one.json || fail "sf_cosim"
batch cosim --ntasks=3 -- scene.snn data --rays 20 --block 5 || fail "cosim.sbatch: $(cat job.out)"
diff <(plain one.json) <(plain job.out) || fail "cosim.sbatch: another result"
rm job.out

sim_render scene.snn data --all -o one --quiet >/dev/null || fail "sim_render"
batch render --ntasks=2 --cpus-per-task=2 -- scene.snn data -o two || fail "render.sbatch: $(cat job.out)"
diff -r one two || fail "render.sbatch: another set"

train=(data --samples 768 --occ-res 16 --hidden 16 --levels 6 --log2-hash 9 --stage1 6 --stage2 10 --eval-views 1)
sf_train "${train[@]}" -o one.model --quiet >/dev/null || fail "sf_train"
batch train --ntasks=2 --cpus-per-task=2 -- "${train[@]}" -o two.model || fail "train.sbatch: $(cat job.out)"
cmp one.model two.model || fail "train.sbatch: another model"
rm job.out

# Two tasks of an array, in a checkout; a shorter smoke of the paper's 14 runs.
smoke=(--profile smoke --stage1 4 --stage2 12 --prefix-views 0 --convert-rays 0 --steps 2 --runs paper)
mkdir -p a b
ln -s "$programs" a/bin && ln -s "$programs" b/bin
"$here/tools/reproduce.sh" "$work/a" "${smoke[@]}" >a.out 2>&1 || fail "reproduce.sh: $(tail -n 3 a.out)"
BUILD=$work/b batch reproduce --array=0-1 --cpus-per-task=1 --chdir="$here" -- "${smoke[@]}" || fail "reproduce.sbatch: $(tail -n 5 job.out)"
[ "$(grep -c '^\[.* dB, ' job.out)" -eq "$(grep -c '^\[.* dB, ' a.out)" ] || fail "reproduce.sbatch: not each run once: $(grep '^\[' job.out)"
diff a/reproduce/smoke/table.md b/reproduce/smoke/table.md >/dev/null || fail "reproduce.sbatch: another table"

# Points of a sweep, of a model of its own.
"$here/tools/pareto.sh" "$work/a" --profile smoke --variants none >a.out 2>&1 || fail "pareto.sh: $(tail -n 3 a.out)"
BUILD=$work/b batch pareto --array=0-1 --cpus-per-task=1 --chdir="$here" -- --profile smoke --variants none || fail "pareto.sbatch: $(tail -n 5 job.out)"
points() { (cd "$1/pareto/smoke/points" && grep -v '"samples_per_second"' ./*.json); }
[ "$(points a | wc -l)" -gt 50 ] || fail "pareto.sh: no points"
diff <(points a) <(points b) || fail "pareto.sbatch: other points"
finish "sbatch: what one process gives"
