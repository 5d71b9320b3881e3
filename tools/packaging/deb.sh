#!/bin/bash
# Debian packages of the source tree, in BUILD/deb; lintian must accept them. The maintainer is DEBFULLNAME <DEBEMAIL>.
# DEB_BUILD_OPTIONS=noopt builds sooner, for a look at the packages.   usage: deb.sh BUILD VERSION
set -euo pipefail
cd "$(dirname "$0")/../.."
build=$1 version=$2
fail() { echo "deb: $1" >&2; exit 1; }
missing=
for tool in dpkg-buildpackage dh lintian; do command -v $tool >/dev/null || missing="$missing $tool"; done
[ -z "$missing" ] || fail "not installed:$missing (make deps-deb installs what a package needs)"

rm -rf "$build/deb"
mkdir -p "$build/deb"
out=$(cd "$build/deb" && pwd)
tree=$out/spikefield-$version
mkdir "$tree"
if [ -e .git ]; then git ls-files -z; else find . -path ./build -prune -o -type f -print0; fi |
  tar -c --null -T - --ignore-failed-read | tar -x -C "$tree"
cp -r tools/packaging/debian "$tree/debian"
cd "$tree"
so=${version%%.*}
maintainer="${DEBFULLNAME:-spikefield} <${DEBEMAIL:-spikefield@localhost}>"
control=$(sed "s/@SOVERSION@/$so/" debian/control)
echo "${control/@MAINTAINER@/"$maintainer"}" >debian/control
mv debian/libspikefield.install "debian/libspikefield$so.install"
if [ -z "${DEBEMAIL:-}" ]; then
  for package in spikefield "libspikefield$so" libspikefield-dev; do
    printf '# %s\n%s\n%s\n' "Built for this machine: nobody's address. DEBEMAIL names one." \
      "$package: bogus-mail-host *" "$package: bogus-mail-host-in-debian-changelog *" >>"debian/$package.lintian-overrides"
  done
fi

# The changelog is the section of CHANGELOG.md, which has to be of this version.
section=$(awk '/^## / { on++ } on == 1' CHANGELOG.md)
grep -qE "^## ${version//./\\.}( |$)" <<<"$section" || fail "the first section of CHANGELOG.md is '$(head -n 1 <<<"$section")', the version is $version"
{
  echo "spikefield ($version) unstable; urgency=medium"
  echo
  sed -n -E 's/^- /\n- /; s/[*`]//g; 2,$p' <<<"$section" | fmt -w 74 | sed -E '/^$/d; s/^- /  * /; t; s/^ */    /'
  echo
  echo " -- $maintainer  $(date -R -u -d "@${SOURCE_DATE_EPOCH:-$(date +%s)}")"
} >debian/changelog

echo "  DEB   $build/deb (minutes: everything is built for any CPU; $build/deb/log)"
export DEB_BUILD_OPTIONS="noautodbgsym parallel=$(nproc)${DEB_BUILD_OPTIONS:+ $DEB_BUILD_OPTIONS}"
unset MAKEFLAGS MAKELEVEL MFLAGS CI
dpkg-buildpackage -b -us -uc >"$out/log" 2>&1 || { tail -n 20 "$out/log" >&2; fail "the package does not build"; }
cd "$out"
lintian --allow-root --fail-on error,warning ./*.deb || fail "lintian refuses the packages"
# Unpacked, the programs run and are of this version.
for package in *.deb; do
  dpkg-deb -x "$package" unpacked
  [ "$(dpkg-deb -f "$package" Version)" = "$version" ] || fail "$package is not of version $version"
done
for program in unpacked/usr/bin/*; do
  [ "$($program --version)" = "$(basename "$program") (spikefield) $version" ] || fail "$program --version: $($program --version 2>&1)"
done
rm -rf "$tree" unpacked
for package in *.deb; do echo "  DEB   $build/deb/$package"; done
echo "  install them: apt-get install$(printf " ./$build/deb/%s" *.deb)"
