# For scripts of tests/chain that try programs on a small scene:   . small_scene.bash BUILD
# Gives what chain.bash gives, and scene.snn and data/ in its folder. NEURONS=32: in each layer, not the block's lanes.
. "$(dirname "${BASH_SOURCE[0]}")/chain.bash" "$@"
"$build/faults/make_scene" "$work/scene.snn" ${NEURONS:-} || exit 1
"$build/bin/sf_scene" "${SF_FAULT_SCENE:-simple}" -o "$work/data" --size 32 --train 1 --test 2 >/dev/null || exit 1
