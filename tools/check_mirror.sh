#!/bin/bash
# Every "Mirror: PATH" in rtl/ and src/fx/ names a file that is there.
cd "$(dirname "$0")/.." || exit 1
status=0
while IFS=: read -r file line text; do
  for path in $(grep -oE '(rtl|src|include)/[a-z_0-9/]+\.(sv|svh|c|h)' <<<"${text#*Mirror:}"); do
    [ -f "$path" ] || { echo "$file:$line: mirror $path is missing" >&2; status=1; }
  done
done < <(grep -rn 'Mirror:' rtl src/fx)
# Both ways: a C file with a mirror in rtl/ is named by that file.
for file in $(grep -rl 'Mirror: rtl/' src/fx); do
  for path in $(grep -ohE 'Mirror: rtl/[a-z_0-9]+\.svh?' "$file" | cut -d' ' -f2); do
    grep -q "Mirror: $file" "$path" "${path%.sv}.svh" 2>/dev/null || { echo "$path: does not name its mirror $file" >&2; status=1; }
  done
done
exit $status
