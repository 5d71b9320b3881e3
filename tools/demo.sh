#!/bin/bash
# make demo: the chain on a scene of its own making, in build/demo.
set -euo pipefail
build=$1
STARTED=${STARTED:-$(date +%s)}
export STARTED
"$build/bin/sf_scene" textured -o "$build/demo/scene" --size 200 --train 60 --test 8
"$(dirname "$0")/chain.sh" "$build" "$build/demo/scene" "$build/demo" --minutes 2.2 --rays 1500 \
  --train "--levels 12 --log2-hash 16 --finest-res 512 --lattice 512 --occ-res 64 --samples 8192"
