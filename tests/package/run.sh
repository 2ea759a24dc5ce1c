#!/usr/bin/env bash
# Installs the build tree, the core alone and as a whole. With every compiler given, builds a
# consumer of the core by find_package; with the last of them one by add_subdirectory, which
# compiles the core, and one of each further component.
# usage: run.sh BUILD_TREE SOURCE_TREE COMPILER...
set -euo pipefail
build=$(realpath "$1") source=$(realpath "$2")
shift 2

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cmake --install "$build" --prefix "$work/core" --component core >/dev/null
cmake --install "$build" --prefix "$work/whole" >/dev/null
export CMAKE_BUILD_PARALLEL_LEVEL=2

# Optimised, g++ warns of more.
build_type=Release

# consume <compiler> <what it is> <options of the configuration> -- <programs>
consume() {
    local compiler=$1 what=$2 options=()
    shift 2
    while [ "$1" != -- ]; do
        options+=("$1")
        shift
    done
    shift
    local tree
    tree=$(mktemp -d "$work/tree.XXXX")
    cmake -G Ninja -S "$source/tests/package" -B "$tree" -DCMAKE_CXX_COMPILER="$compiler" \
        -DCMAKE_BUILD_TYPE="$build_type" "${options[@]}" >/dev/null
    cmake --build "$tree" --target "$@" >"$work/log" 2>&1 || { cat "$work/log"; exit 1; }
    for program in "$@"; do "$tree/$program" >/dev/null; done
    echo "$(basename "$compiler"), $what: builds without warnings and runs"
}

for compiler in "$@"; do
    consume "$compiler" "the core" -DCMAKE_PREFIX_PATH="$work/core" -- consumer
done
last=${!#}
build_type=None
components=(taylor nonsmooth sensitivity scene faults learn learn_steps)
if [ -e "$work/whole/include/ricochet/fmi" ]; then components+=(fmi); fi
list=$(IFS=';'; echo "${components[*]}")
consume "$last" "all components" -DCMAKE_PREFIX_PATH="$work/whole" \
    -DRICOCHET_COMPONENTS="$list;hosts" -- "${components[@]}"
consume "$last" "add_subdirectory" -DRICOCHET_SOURCE="$source" -- consumer

if cmake -G Ninja -S "$source/tests/package" -B "$work/missing" -DCMAKE_PREFIX_PATH="$work/core" \
    -DRICOCHET_COMPONENTS=learn >"$work/log" 2>&1; then
    echo "a component that is not installed was found"
    exit 1
fi
grep -q learn "$work/log"

# configures <options>: what configuring a consumer of the core prints.
configures() {
    cmake -G Ninja -S "$source/tests/package" -B "$(mktemp -d "$work/tree.XXXX")" \
        -DCMAKE_CXX_COMPILER="$last" -DCMAKE_PREFIX_PATH="$work/core" "$@" 2>&1
}
configures >"$work/log"  # not into a pipe, which grep -q would break
grep -q 'ricochet: CMAKE_BUILD_TYPE is empty.*-DCMAKE_BUILD_TYPE=Release' "$work/log"
for chosen in -DCMAKE_BUILD_TYPE=Release -DCMAKE_BUILD_TYPE=Debug -DCMAKE_CXX_FLAGS=-O2; do
    configures "$chosen" >"$work/log"
    ! grep 'CMAKE_BUILD_TYPE is empty' "$work/log" || exit 1
done
echo "an empty build type is named"
cmp "$source/LICENSE" "$work/core/share/doc/libricochet-dev/copyright"
for package in libricochet-dev libricochet-c ricochet; do
    cmp "$source/LICENSE" "$work/whole/share/doc/$package/copyright"
    cmp "$source/LICENSE-THIRD-PARTY" "$work/whole/share/doc/$package/LICENSE-THIRD-PARTY"
done
echo "licences are installed"

for room in learn learn_steps faults hosts nonsmooth scene sensitivity taylor systems/sliding_mode.hpp; do
    [ -e "$work/whole/include/ricochet/$room" ]
    [ ! -e "$work/core/include/ricochet/$room" ]
done
[ -e "$work/whole/include/ricochet/hosts/detail/run.hpp" ]
echo "the core alone: no other component is installed or found"
"$work/whole/bin/ricochet" simulate bouncing-ball --step 0.01 --detector network --json >/dev/null
"$work/whole/bin/ricochet" simulate fault --json >/dev/null
"$work/whole/bin/ricochet" simulate sliding-mode --json >/dev/null
"$work/whole/bin/ricochet" train --help >/dev/null
echo "installed command line: finds its models and its further programs"
