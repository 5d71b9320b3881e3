#!/bin/bash
# Every tool on TensoRF: around an object, in a larger box and in NDC. usage: every_tool_planes.sh BUILD
. "$(dirname "$0")/../every_tool.bash" "$@"
planes=(--backbone tensorf --voxels 24 --samples 512 --rays 256)
every_tool tensorf object "${planes[@]}"
every_tool tensorf-box place "${planes[@]}"
every_tool tensorf-ndc faces "${planes[@]}"
[ $failures -eq 0 ]
