# Runs a board's vivado.tcl and what it reads with commands of Vivado that only look: files that are not there, ports that the
# top has not, pins given twice, ports without a pin.   usage: tclsh vivado_lint.tcl FOLDER     (rtl/board/NAME)
set folder [file normalize [lindex $argv 0]]
set name [file tail $folder]
set wrong {}
proc wrong {text} {lappend ::wrong $text}

# Ports of the top, bit by bit.
set file [open [file join $folder $name.sv]]
set source [read $file]
close $file
if {![regexp "module $name\\s*\\((.*?)\\);" $source -> list]} {puts stderr "$name.sv: no module $name"; exit 1}
set ports {}
foreach {all width port} [regexp -all -inline {(?:input|output)\s+wire\s*(\[[0-9:]+\])?\s*(\w+)} $list] {
  if {[regexp {\[(\d+):0\]} $width -> high]} {
    for {set i 0} {$i <= $high} {incr i} {lappend ports "$port\[$i\]"}
  } else {
    lappend ports $port
  }
}

set pin_of [dict create]
set standard_of [dict create]
set clocks {}
set read {}
set done {}
proc get_ports {patterns} {
  set found {}
  foreach pattern $patterns {
    set literal [string map {\[ \\\[ \] \\\]} $pattern]
    set some [lsearch -all -inline $::ports $literal]
    if {$some eq {}} {wrong "port $pattern is not one of $::name.sv"}
    lappend found {*}$some
  }
  return $found
}
proc set_property {args} {
  if {[lindex $args 0] eq "-dict"} {lassign $args - values objects} else {
    lassign $args key value objects
    set values [list $key $value]
  }
  if {[llength $values] % 2} {wrong "set_property: '$values' is no list of names and values"; return}
  foreach {key value} $values {
    switch -glob $key {
      PACKAGE_PIN {
        foreach {port pin} $::pin_of {if {$pin eq $value} {wrong "pin $pin is given to $port and $objects"}}
        foreach port $objects {dict set ::pin_of $port $value}
      }
      IOSTANDARD {foreach port $objects {dict set ::standard_of $port $value}}
      CFGBVS - CONFIG_VOLTAGE - BITSTREAM.* {if {$objects ne "design"} {wrong "$key is not of the design"}}
      default {wrong "set_property $key is not known here"}
    }
  }
}
proc create_clock {args} {
  if {[dict get [lrange $args 0 end-1] -period] <= 0} {wrong "a clock without a period"}
  lappend ::clocks {*}[lindex $args end]
}
proc set_false_path {args} {if {[llength $args] % 2 || [lindex $args 1] eq {}} {wrong "set_false_path $args"}}
proc current_design {} {return design}
proc read_verilog {option files} {
  foreach file $files {if {![file exists $file]} {wrong "$file is not there"}}
  lappend ::read {*}$files
}
proc read_xdc {file} {if {[file exists $file]} {uplevel #0 [list source $file]} else {wrong "$file is not there"}}
proc get_property {name object} {return 0}
proc get_timing_paths {args} {return path}
set steps {synth_design opt_design place_design phys_opt_design route_design report_utilization report_timing_summary}
lappend steps write_checkpoint write_bitstream
foreach step $steps {proc $step {args} "lappend ::done $step"}

# What it would print is not of interest.
rename puts say
proc puts {args} {}
if {[catch {source [file join $folder vivado.tcl]} message]} {wrong "vivado.tcl: $message"}
rename puts {}
rename say puts

foreach port $ports {
  if {![dict exists $pin_of $port]} {wrong "port $port has no pin"}
  if {![dict exists $standard_of $port]} {wrong "port $port has no IOSTANDARD"}
}
if {$clocks eq {}} {wrong "no clock"}
if {[lsearch $read "*sf_board.sv"] < 0 || [lsearch $read "*/$name.sv"] < 0} {wrong "vivado.tcl does not read the board's RTL"}
if {[join $done] ne [join $steps]} {wrong "vivado.tcl: steps are [join $done]"}
foreach text $wrong {puts stderr "$name: $text"}
if {$wrong eq {}} {puts "$name: [llength $ports] ports, [llength $read] files of RTL"}
exit [expr {$wrong ne {}}]
