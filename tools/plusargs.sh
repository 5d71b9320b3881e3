#!/bin/bash
# The plusargs that a Verilated model reads, as its source names them ("fault=%d "). usage: plusargs.sh FOLDER
cat "$1"/V*.cpp | tr -d '\n' | grep -oE 'VL_(TEST|VALUE)PLUSARGS[A-Z_]*\([^"]{0,80}"[^"]*"' | sed 's/.*"\(.*\)"/\1/' |
  sort -u | tr '\n' ' '
