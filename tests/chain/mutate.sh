#!/bin/bash
# A sample of mutants of each unit: the checkers kill what they are to kill (make mutate: all of them).
# usage: mutate.sh BUILD
set -u
command -v python3 >/dev/null || { echo "mutate: skipped: python3 is not installed"; exit 77; }
exec "$(dirname "$0")/../mutate/units.py" "$1" --sample
