#!/bin/bash
# Runs the commands of docs/first-hour.md as a reader types them, and holds the page to what it shows. usage: tutorial_first_hour.sh BUILD
command -v python3 >/dev/null || { echo "skipped: python3 is not installed"; exit 77; }
exec python3 "$(dirname "$0")/../tutorials.py" "$1" docs/first-hour.md
