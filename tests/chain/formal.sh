#!/bin/bash
# The quick properties of the RTL (make formal: all of them).
# usage: formal.sh BUILD
set -u
exec "$(dirname "$0")/../formal/run.sh" "$1" --quick
