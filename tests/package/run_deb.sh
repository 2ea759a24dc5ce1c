#!/usr/bin/env bash
# Makes the Debian packages, unpacks them side by side and uses each: no two have a file in common
# but the one by which CMake finds them.
# usage: run_deb.sh BUILD_TREE SOURCE_TREE PYTHON
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2") python=$3

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
(cd "$build" && cpack -B "$work/debs" >"$work/log" 2>&1) || { cat "$work/log"; exit 1; }
for package in "$work"/debs/*.deb; do
    dpkg-deb --field "$package" Package Depends
    for licence in copyright LICENSE-THIRD-PARTY; do
        [ -n "$(dpkg-deb --fsys-tarfile "$package" |
            tar -xO "./usr/share/doc/$(dpkg-deb --field "$package" Package)/$licence")" ]
    done
    dpkg-deb --fsys-tarfile "$package" | tar -t | grep -v '/$' >>"$work/files"
    dpkg-deb --extract "$package" "$work/root"
done
twice=$(sort "$work/files" | uniq -d | grep -v 'ricochet-config\(-version\)\?\.cmake$' || true)
[ -z "$twice" ] || { echo "in two packages: $twice"; exit 1; }

usr=$work/root/usr
"$usr/bin/ricochet" simulate bouncing-ball --step 0.01 --detector network >/dev/null
echo "ricochet: runs, and finds its models"
library=$(dirname "$(find "$usr" -name libricochet_c.so)")
cc -std=c99 -I"$usr/include" "$source/examples/c/bouncing_ball.c" -L"$library" -lricochet_c -lm \
    -Wl,-rpath,"$library" -o "$work/ball"
"$work/ball" >/dev/null
echo "libricochet-c: a program builds and runs"
if [ -e "$usr/lib/python3" ]; then
    PYTHONPATH=$usr/lib/python3/dist-packages "$python" -c '
import ricochet
run = ricochet.solve_ivp(lambda t, y: [y[1], -9.81], (0, 1), [1.0, 0.0], rtol=1e-9)
assert abs(run.y[1, -1] + 9.81) < 1e-9, run'
    echo "python3-ricochet: imported, and integrates"
fi
