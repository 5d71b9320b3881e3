#!/bin/sh
# Finds which packages are missing and installs them with apt (Debian 12 and Ubuntu names). Needs root only then.
# DEPS: other packages instead, as `make deps-fuzz` names them.
set -eu
packages="${DEPS:-git gcc g++ make pkg-config patch libopenexr-dev libpng-dev libjpeg-dev libcjson-dev libmicrohttpd-dev libhdf5-dev zlib1g-dev check libsubunit-dev
verilator clang iverilog yosys z3 bc gcc-riscv64-unknown-elf libunicorn-dev libopenmpi-dev openmpi-bin clang-format cppcheck gnuplot-nox help2man python3-jsonschema procps util-linux}"
missing=
for package in $packages; do
  state=$(dpkg-query -W -f '${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$state" = installed ] || missing="$missing $package"
done
if [ -z "$missing" ]; then
  echo "deps: everything is installed"
  exit 0
fi
echo "deps: installing$missing"
command -v apt-get >/dev/null || { echo "deps: apt-get not found; install these packages by hand:$missing" >&2; exit 1; }
as_root=
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || { echo "deps: run as root (or install sudo) to install:$missing" >&2; exit 1; }
  as_root=sudo
fi
$as_root env DEBIAN_FRONTEND=noninteractive apt-get update -qq
# shellcheck disable=SC2086
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing >/dev/null
echo "deps: done"
