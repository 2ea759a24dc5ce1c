#!/usr/bin/env bash
# The blocks of a page in C, one after the other, are a program: compiles and runs it, and compares
# what it prints with the page's block of text.
# usage: docs.sh PAGE COMPILER INCLUDE_DIRECTORY LIBRARY
set -euo pipefail
page=$1 compiler=$2 include=$3 library=$4

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
blocks() { awk -v language="$1" '/^```/ { inside = $0 == "```" language; next } inside' "$page"; }
blocks c >"$work/page.c"
blocks text >"$work/expected"
"$compiler" -std=c99 -Wall -Wextra -Wpedantic -Werror -I"$include" "$work/page.c" "$library" \
    -Wl,-rpath,"$(dirname "$library")" -lm -o "$work/page"
"$work/page" >"$work/printed"
diff "$work/expected" "$work/printed"
echo "$(basename "$page"): its program prints what it says"
