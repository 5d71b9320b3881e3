#!/bin/bash
# The vector kit's rays, of a hash grid and of TensoRF: PASS in Verilator and in Icarus with the same line; a wrong word in any
# file, and a fault in the block's field, are caught. usage: kit_rays.sh BUILD
NEURONS=32 # programmed sooner
. "$(dirname "$0")/../kit_run.bash" "$@"
export OPT=-O0
grid=$kit

# changed FILE SED TEXT
changed() {
  cp "$kit/$1" "$work/kept"
  sed -E "$2" "$work/kept" >"$kit/$1"
  run verilator 1 "DIFFERENCE $3" -- RAYS=1 STALLS=0
  cp "$work/kept" "$kit/$1"
}
every_file() {
  run verilator 0 PASS -- RAYS=1 >"$work/verilator"
  cat "$work/verilator"
  changed expected_pixels.hex '1y/0123456789abcdef/1032547698badcfe/' 'ray 0 red'
  changed expected_pixels.hex '2s/^.{16}/0123456789abcdef/' 'ray 1 samples'
  changed rays.hex '1s/.{6}$/123456/' 'ray 0'
  changed memory.hex '2,40s/^[0-9a-f]{16}/7f7f7f7f7f7f7f7f/' 'ray 0'
  changed expected_ray_counters.hex '58s/.$/f/' rays
}
every_file

"$build/bin/sf_train" "$work/data" -o "$work/planes.safetensors" --backbone tensorf --stage1 50 --stage2 50 --samples 512 \
  --rays 64 --hidden 32 --voxels 16 --steps 3 --quiet >/dev/null && "$build/bin/sf_export" "$work/planes.safetensors" -o "$work/planes.snn" >/dev/null &&
  "$build/bin/sf_export" "$work/planes.snn" --vectors "$work/planes" --data "$work/data" --samples 24 --seed 3 >/dev/null || exit 1
kit=$work/planes
every_file
# Weights of a neighbour that are one too large.
mkdir "$work/wrong"
sed "s/beside1_q <= both ? {1'b0, g}/beside1_q <= both ? {1'b0, g} + 9'd1/" rtl/sf_planes_reads.sv >"$work/wrong/sf_planes_reads.sv"
cmp -s rtl/sf_planes_reads.sv "$work/wrong/sf_planes_reads.sv" && fail "no fault was planted"
run verilator 1 'DIFFERENCE ray 0' -- RAYS=1 OVERLAY="$work/wrong" BUILD=faulty

# Requests of the memory against the rules of AXI4.
against() {
  rm -rf "$work/wrong" && mkdir "$work/wrong"
  sed "$2" "rtl/$1" >"$work/wrong/$1"
  cmp -s "rtl/$1" "$work/wrong/$1" && fail "no fault was planted"
  run verilator 1 "DIFFERENCE $3" -- RAYS=1 STALLS=60 OVERLAY="$work/wrong" BUILD=against
}
kit=$grid
against sf_fetch.sv 's/m_axi_arvalid_o = ask_q;/m_axi_arvalid_o = ask_q \&\& !m_axi_rvalid_i;/' 'a request of the memory changed'
against sf_fetch.sv 's/m_axi_araddr_o = {address_q,/m_axi_araddr_o = {address_q + 28'"'"'(m_axi_rvalid_i),/' 'a request of the memory changed'
against sf_ray_top.sv 's/\(m_axi_arprot_o *=\) 3.d0/\1 3'"'"'d1/' protection

command -v iverilog >/dev/null || { echo "iverilog: not installed"; finish "Icarus skipped"; }
run icarus 0 PASS -- RAYS=1
finish "the kit's rays pass in both simulators; wrong words and a fault of the field are caught"
