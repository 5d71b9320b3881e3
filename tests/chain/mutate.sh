#!/bin/bash
# A sample of mutants of each unit: the checkers kill what they are to kill (make mutate: all of them). Every equivalent
# that is listed for the source is one of its mutants (make mutate-engine and the like judge them).
# usage: mutate.sh BUILD
set -u
command -v python3 >/dev/null || { echo "mutate: skipped: python3 is not installed"; exit 77; }
here=$(cd "$(dirname "$0")/../.." && pwd)
MAKEFLAGS='' make -s -C "$here" B="$(cd "$1" && pwd)" listed-engine listed-lanes listed-ray || exit 1
exec "$here/tests/mutate/units.py" "$1" --sample
