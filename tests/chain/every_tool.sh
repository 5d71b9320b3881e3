#!/bin/bash
# Every tool on hash grids: in a box of bound 1, in one of bound 16 and in NDC. usage: every_tool.sh BUILD
. "$(dirname "$0")/../every_tool.bash" "$@"
grid=(--levels 4 --log2-hash 9 --finest-res 32 --lattice 64 --samples 512)
every_tool grid object "${grid[@]}"
every_tool grid-box place "${grid[@]}" --bound 16
every_tool grid-ndc faces "${grid[@]}"
[ $failures -eq 0 ]
