# The bitstream for a Nexys Video:   vivado -mode batch -source rtl/board/nexys_video/vivado.tcl
# Writes build/board/nexys_video. Checked by tests/board/vivado_lint.tcl; Vivado was not run.
set part xc7a200tsbg484-1
set top nexys_video
set here [file dirname [file normalize [info script]]]
set root [file normalize [file join $here .. .. ..]]
set out [file join $root build board nexys_video]
file mkdir $out

# Packages first. The macro leaves out the ports of the tap.
set packages [glob -directory [file join $root rtl gen] *_pkg.sv]
lappend packages [file join $root rtl sf_op_pkg.sv]
set modules {}
foreach folder [list [file join $root rtl gen] [file join $root rtl] [file join $root rtl board] $here] {
  foreach file [lsort [glob -nocomplain -directory $folder *.sv]] {
    if {$file ni $packages} {lappend modules $file}
  }
}
read_verilog -sv [concat [lsort $packages] $modules]
read_xdc [file join $here nexys_video.xdc]

synth_design -top $top -part $part -include_dirs [file join $root rtl] -verilog_define SF_NO_TAP
opt_design
place_design
phys_opt_design
route_design
report_utilization -hierarchical -file [file join $out utilization.txt]
report_timing_summary -file [file join $out timing.txt]
write_checkpoint -force [file join $out routed.dcp]

# As `make board`: no bitstream that is too slow for its clock.
set slack [get_property SLACK [get_timing_paths -max_paths 1 -setup]]
if {$slack < 0} {
  puts stderr "nexys_video: the longest path is $slack ns too long for 50 MHz: no bitstream was made"
  exit 1
}
write_bitstream -force [file join $out nexys_video.bit]
puts "put it on the board: openFPGALoader -b nexysVideo build/board/nexys_video/nexys_video.bit"
