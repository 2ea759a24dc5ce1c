#!/usr/bin/env bash
# Compiles every case of refused*.cpp with every compiler given, and compares the first error
# with the sentence that the case asks for.
# usage: run.sh SOURCE_TREE INCLUDE_FLAGS COMPILER...
set -uo pipefail
source=$(realpath "$1") flags=$2
shift 2
failed=0
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

compile() { "$@" -std=c++20 -Wall -Wextra -I"$source/include" $flags; }
# first_error COMPILER FLAGS...: nothing where it compiles.
first_error() { compile "$@" -fsyntax-only "$file" 2>&1 | grep -m 1 -E 'error:|warning:'; }
# sentences COMPILER FLAGS...: the errors with a sentence of the library.
sentences() { compile "$@" -fsyntax-only "$file" 2>&1 | grep -c -E 'error:.*ricochet: '; }
expect() { # WHAT FOUND EXPECTED
    local fits=no
    if [ -n "$3" ]; then
        [[ $2 == *"$3"* ]] && fits=yes
    elif [ -z "$2" ]; then
        fits=yes
    fi
    if [ $fits = no ]; then
        printf '%s\n  expected %s\n  found    %s\n' "$1" "${3:-no error}" "${2:-no error}"
        failed=1
    fi
}

for compiler in "$@"; do
    for file in "$source"/tests/messages/refused*.cpp; do
        name=$(basename "$file")
        # The headers that all cases of the file share are read once.
        grep '^#include' "$file" >"$work/$name.hpp"
        compile "$compiler" -x c++-header "$work/$name.hpp" -o "$work/$name.hpp.gch"
        headers=(-include "$work/$name.hpp")
        expect "$compiler, $name, case 0" "$(first_error "$compiler" -DCASE=0 "${headers[@]}")" ''
        while IFS= read -r line; do
            number=${line%%[: ]*} text=${line#*: }
            extra=("${headers[@]}")
            [[ $text == *fast-math* ]] && extra=(-ffast-math)
            expect "$compiler, $name, case $number" \
                "$(first_error "$compiler" "-DCASE=$number" "${extra[@]}")" "$text"
            [[ $line == "$number alone:"* ]] && expect "$compiler, $name, case $number, sentences" \
                "$(sentences "$compiler" "-DCASE=$number" "${extra[@]}")" 1
        done < <(sed -nE 's|^// CASE ([0-9]+( alone)?: .*)|\1|p' "$file")
    done
    file="$source/tests/messages/refused.cpp"
    expect "$compiler, -ffinite-math-only" \
        "$(first_error "$compiler" -DCASE=0 -ffinite-math-only)" 'ricochet: compiled with'
    expect "$compiler, allowed" "$(first_error "$compiler" -DCASE=0 -ffast-math \
        -DRICOCHET_ALLOW_FINITE_MATH)" ''
done
[ $failed = 0 ] && echo "every case is refused with its sentence first"
exit $failed
