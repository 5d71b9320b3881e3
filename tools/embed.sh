#!/bin/bash
# C source that holds files byte by byte: embed.sh ARRAY HEADER (NAME=PATH)...
# The array's elements are {name, data, size}; it ends with an element of zeros.
set -euo pipefail
array=$1 header=$2
shift 2
echo "#include \"$header\""
i=0
for file in "$@"; do
  echo "static const unsigned char file$i[] = {"
  od -An -v -tu1 "${file#*=}" | sed 's/ *\([0-9][0-9]*\)/\1,/g'
  echo "};"
  i=$((i + 1))
done
echo "const sf_kit_file $array[] = {"
i=0
for file in "$@"; do
  echo "{\"${file%%=*}\", file$i, sizeof file$i},"
  i=$((i + 1))
done
echo "{0}};"
