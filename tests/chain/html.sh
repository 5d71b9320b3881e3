#!/bin/bash
# The HTML report of a small scene: what --json says is what the page says; in a real browser, without a script error,
# every figure is seen, in light, dark and print, on a wide and on a narrow screen. Screenshots in BUILD/tests/html.
# usage: html.sh BUILD [PAGE.html]   with a page: only the browser's part, on that page
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
build=$1
bin=$build/bin
shots=$build/tests/html
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
fail() { echo "html: $1" >&2; exit 1; }

make_page() {
  local scene=$work/scene
  "$bin/sf_scene" textured -o "$scene" --size 48 --train 10 --test 2 >/dev/null
  "$bin/sf_train" "$scene" -o "$scene/model.safetensors" --stage1 40 --stage2 80 --samples 2048 --levels 6 --log2-hash 12 \
    --finest-res 64 --lattice 128 --occ-res 32 --quiet --json >/dev/null
  "$bin/sf_export" "$scene/model.safetensors" -o "$scene/scene.snn" >/dev/null
  "$bin/energy_audit" "$scene/scene.snn" "$scene" --view 1 --rtl-rays 4 --html "$work/page.html" --json --quiet >"$work/audit.json" ||
    fail "energy_audit"
  [ "$(stat -c %s "$work/page.html")" -lt 3000000 ] || fail "the page is larger than 3 MB"
}

# The PSNR of the float model stands on the page of its own scene alone.
compare_models() {
  local scene=$work/scene other=$work/other.safetensors
  audit() { "$bin/energy_audit" "$scene/scene.snn" "$scene" --view 1 --html "$work/other.html" --quiet "$@" >/dev/null 2>"$work/err"; }
  grep -q 'model SHA-256' "$work/page.html" || fail "the page does not name the model beside the scene"
  "$bin/sf_train" "$scene" -o "$other" --seed 2 --stage1 20 --stage2 20 --samples 2048 --levels 6 --log2-hash 12 \
    --finest-res 64 --lattice 128 --occ-res 32 --quiet --json >/dev/null
  audit --model "$other" && fail "a model of another training was taken"
  grep -qF "$other: not the model of this scene (other weights in layer D1)" "$work/err" || fail "not said: $(cat "$work/err")"
  mv "$other" "$scene/model.safetensors"
  audit || fail "a model of another training lies beside the scene: $(cat "$work/err")"
  ! grep -q 'model SHA-256' "$work/other.html" || fail "the page has a model of another training"
}

# White space and escapes aside, the JSON inside the page is the JSON of the program.
compare_json() {
  sed -n 's|.*<script type="application/json" id="audit-json">\(.*\)</script>.*|\1|p' "$work/page.html" |
    sed 's/\\u003c/</g; s/\\u003e/>/g; s/\\u0026/\&/g' | tr -d ' \t\n' >"$work/inside"
  tr -d ' \t\n' <"$work/audit.json" >"$work/outside"
  [ -s "$work/inside" ] || fail "no JSON inside the page"
  cmp "$work/inside" "$work/outside" || fail "the JSON inside the page is not that of --json"
}

browser() { # name, width, height, print, options
  local name=$1 width=$2 height=$3 print=$4
  shift 4
  {
    echo '<!DOCTYPE html><html><body style="margin:0;overflow:hidden">'
    printf '<iframe src="checked-%s.html" style="border:0;width:%dpx;height:%dpx"></iframe><pre id="verdict" hidden></pre>\n' "$print" "$width" "$height"
    echo '<script>addEventListener("message",function(e){document.getElementById("verdict").textContent="BEGIN\n"+e.data+"\nEND"})</script>'
    echo '</body></html>'
  } >"$work/$name.html"
  timeout 120 "$chromium" --headless --no-sandbox --disable-gpu --hide-scrollbars --allow-file-access-from-files \
    --user-data-dir="$work/profile" --window-size="$((width < 500 ? 500 : width)),$height" --virtual-time-budget=8000 "$@" \
    --screenshot="$shots/$name.png" --dump-dom "file://$work/$name.html" >"$work/$name.dom" 2>"$work/$name.err" ||
    fail "$name: the browser failed: $(tail -n 1 "$work/$name.err")"
  sed -n '/BEGIN$/,/^END/p' "$work/$name.dom" | sed '1d;$d' >"$work/$name.verdict"
  [ "$(head -n 1 "$work/$name.verdict")" = ok ] || {
    cat "$work/$name.verdict" >&2
    fail "$name: $([ -s "$work/$name.verdict" ] && echo "see above" || echo "no verdict, the check did not end")"
  }
  [ -s "$shots/$name.png" ] || fail "$name: no screenshot"
  echo "$name: $(tail -n 1 "$work/$name.verdict")"
}

if [ $# -ge 2 ]; then
  cp "$2" "$work/page.html"
else
  make_page
  compare_json
  compare_models
  if command -v xmllint >/dev/null; then
    xmllint --noout --huge "$work/page.html" || fail "not well-formed"
  else
    echo "the page was not read as XML; tests/test_html.c checks the same"; echo "xmllint: not installed"
  fi
fi

chromium=$(command -v chromium || command -v chromium-browser || command -v google-chrome || true)
if [ -z "$chromium" ]; then
  echo "chromium is not installed: the page was not looked at"
  exit 77
fi
mkdir -p "$shots"
for print in 0 1; do # the check comes first, to see every error
  awk -v paper="$print" -v check="$here/../html/check.js" '
    !done && /<head>/ { print $0; print "<script>var PRINT=" paper ";"; while ((getline line < check) > 0) print line; print "</script>"; done = 1; next }
    { print }' "$work/page.html" >"$work/checked-$print.html"
done
browser light-1280 1280 9000 0
browser dark-1280 1280 9000 0 --blink-settings=preferredColorScheme=0
browser print-1280 1280 9000 1
browser print-700 700 11000 1 # A4 between its margins
browser light-390 390 14000 0
browser dark-390 390 14000 0 --blink-settings=preferredColorScheme=0
browser print-390 390 14000 1
