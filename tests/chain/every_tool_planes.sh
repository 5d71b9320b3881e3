#!/bin/bash
# Every tool on TensoRF: around an object, in a larger box and in NDC. usage: every_tool_planes.sh BUILD
. "$(dirname "$0")/../every_tool.bash" "$@"
planes=(--backbone tensorf --voxels 16 --hidden 16 --samples 512 --rays 128)
every_tool tensorf object "${planes[@]}"
every_tool tensorf-box place "${planes[@]}"
every_tool tensorf-ndc faces "${planes[@]}"
[ $failures -eq 0 ]
