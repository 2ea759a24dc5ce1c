#!/usr/bin/env bash
# Installs the build tree and builds a consumer by find_package with every compiler given,
# and one by add_subdirectory, which compiles the whole library, with the last of them.
# usage: run.sh BUILD_TREE SOURCE_TREE COMPILER...
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2")
shift 2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/prefix" >/dev/null
export CMAKE_BUILD_PARALLEL_LEVEL=2

for compiler in "$@"; do
    ways=(find_package)
    [ "$compiler" = "${!#}" ] && ways+=(add_subdirectory)
    for way in "${ways[@]}"; do
        tree="$work/$way-$(basename "$compiler")"
        options=(-DCMAKE_PREFIX_PATH="$work/prefix")
        [ "$way" = add_subdirectory ] && options=(-DRICOCHET_SOURCE="$source")
        cmake -G Ninja -S "$source/tests/package" -B "$tree" -DCMAKE_CXX_COMPILER="$compiler" \
            -DCMAKE_BUILD_TYPE=Debug "${options[@]}" >/dev/null
        cmake --build "$tree" --target consumer >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
        "$tree/consumer" >/dev/null
        echo "$(basename "$compiler"), $way: builds without warnings and runs"
    done
done
"$work/prefix/bin/ricochet" simulate bouncing-ball --step 0.01 --detector network --json >/dev/null
echo "installed command line: finds its models"
