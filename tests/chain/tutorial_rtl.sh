#!/bin/bash
# Runs the commands of docs/tutorial-rtl.md as a reader types them, and holds the page to what it shows. usage: tutorial_rtl.sh BUILD
command -v python3 >/dev/null || { echo "skipped: python3 is not installed"; exit 77; }
exec python3 "$(dirname "$0")/../tutorials.py" "$1" docs/tutorial-rtl.md
