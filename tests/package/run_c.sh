#!/usr/bin/env bash
# Installs the component c alone, and builds the example by find_package and by pkg-config with
# every compiler given; neither needs C++, nor anything that the library is made of.
# usage: run_c.sh BUILD_TREE SOURCE_TREE COMPILER...
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2")
shift 2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/installed" --component c >/dev/null
# It is found where it was moved to.
mv "$work/installed" "$work/c"
example=$source/examples/c/bouncing_ball.c

for compiler in "$@"; do
    name=$(basename "$compiler")
    cmake -G Ninja -S "$source/tests/package/c" -B "$work/$name" -DCMAKE_C_COMPILER="$compiler" \
        -DCMAKE_PREFIX_PATH="$work/c" -DRICOCHET_EXAMPLE="$example" >/dev/null
    cmake --build "$work/$name" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
    "$work/$name/consumer" >/dev/null
    echo "$name, find_package: builds without warnings and runs"
    if command -v pkg-config >/dev/null; then
        PKG_CONFIG_PATH=$(dirname "$(find "$work/c" -name ricochet-c.pc)")
        export PKG_CONFIG_PATH
        read -ra flags <<<"$(pkg-config --cflags --libs ricochet-c)"
        libraries=$(pkg-config --variable=libdir ricochet-c)
        "$compiler" -std=c99 -Wall -Wextra -Wpedantic -Werror "$example" "${flags[@]}" \
            -Wl,-rpath,"$libraries" -o "$work/$name-pkg-config"
        "$work/$name-pkg-config" >/dev/null
        echo "$name, pkg-config: builds without warnings and runs"
    fi
done
files=$(find "$work/c" -type f -name '*.h*' | wc -l)
[ "$files" = 1 ] || { echo "found $files headers; expected ricochet.h alone"; exit 1; }
echo "the component c: one header, one shared library"
