#!/bin/bash
# sim_render --dut: a block of another name and size, from positions to pixels, renders what the core does, byte for byte; one
# wrong number of its 30th pixel is found and named; what does not build says where.   usage: other_ray_dut.sh BUILD
. "$(dirname "$0")/../small_scene.bash" "$@"
quick_dut
built=()
trap 'rm -rf "$work" "${built[@]}"' EXIT
cd "$work" || exit 1
render=$build/bin/sim_render

# The RTL of this build (which may be a variant), in the order of the kit.
"$build/bin/sf_export" scene.snn --vectors kit --data data --samples 1 >/dev/null || exit 1
sed "s/^module sf_ray_top/module my_rays/; s/ MACS = LANES.*MACS,/ MACS = 32,/; s/ NEURONS = sf_arch_pkg::NEURONS/ NEURONS = 4/; s/ PLANES = 1 / PLANES = 0 /
  s/^  assign m_axis_tdata_o = {53'd0, samples,/  reg [31:0] pixels_q;\n  always_ff @(posedge clk_i) if (!rst_ni) pixels_q <= 32'd0; else if (m_axis_tvalid_o \&\& m_axis_tready_i) pixels_q <= pixels_q + 32'd1;\n  assign m_axis_tdata_o = {53'd0, 11'(samples + 11'(pixels_q == 32'd29)),/" \
  kit/rtl/sf_ray_top.sv >my_rays.sv
[ "$(grep -c 'module my_rays\|MACS = 32\|NEURONS = 4\|PLANES = 0\|32.d29' my_rays.sv)" -eq 5 ] || fail "no other block: $(grep 'my_rays' my_rays.sv)"
sed "/sf_ray_top.sv$/d; s|\brtl\b|kit/rtl|" kit/rtl.f >mine.f
echo "my_rays.sv" >>mine.f
mine=(--backend rtl --dut "-F mine.f" --dut-top my_rays)

# run STATUS TEXT ARGS...
run() {
  "$render" scene.snn data "${@:3}" >out 2>err
  [ $? -eq "$1" ] || fail "${*:3}: exit status is not $1"
  grep -qF -- "$2" out err || fail "${*:3}: '$2' is not there"
  while read -r folder; do built+=("$folder"); done < <(sed -n 's/^ *VERI *//p' err)
}
run 0 "" --crop 13,13,5,5 -o fixed.exr -q
run 0 "" --crop 13,13,5,5 -o mine.exr -q "${mine[@]}"
[ ${#built[@]} -eq 1 ] || fail "no block was built: $(cat err)"
cmp fixed.exr mine.exr || fail "25 pixels of the other block are not the core's"
run 0 "" --all --crop 13,13,6,6 -o set -q
run 1 "number of samples is" --verify set/manifest.json --view 0 -q "${mine[@]}"
read -r core block < <(sed -n 's/.*pixel ([0-9]*, [0-9]*) of view .* is \([0-9]*\) in the core, \([0-9]*\) in the accelerator.*/\1 \2/p' err)
[ "${block:-0}" -eq $((${core:-0} + 1)) ] || fail "the 30th pixel: no difference of one"
[ ${#built[@]} -eq 1 ] || fail "built again without a change"
run 0 "OK: 1 of 2 views" --verify set/manifest.json --view 0 -q --backend rtl

sed '90s/^/this is no Verilog;/' my_rays.sv >broken.sv
sed 's/my_rays/broken/' mine.f >broken.f
run 1 "broken.sv:90:" -o x.exr -q --backend rtl --dut "-F broken.f"
grep -q 'module sf_ray_top does not build' err || fail "what does not build is not named"
run 2 "needs --backend rtl" -o x.exr --dut my_rays.sv
run 2 "belongs to --dut" -o x.exr --backend rtl --dut-top my_rays
finish "another block renders, its mistake is found"
