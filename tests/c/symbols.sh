#!/usr/bin/env bash
# Whether a shared library shows functions of the header alone, and all of them.
# usage: symbols.sh LIBRARY HEADER
set -euo pipefail
library=$1 header=$2

shown=$(nm --dynamic --defined-only "$library" | awk '$2 != "A" { sub(/@.*/, "", $3); print $3 }' | sort)
declared=$(grep '^RC_API' -A1 "$header" | grep -o '\brc_[a-z_]*(' | tr -d '(' | sort -u)
if [ "$shown" != "$declared" ]; then
    echo "shown by the library (<) and declared by the header (>):"
    diff <(echo "$shown") <(echo "$declared") || true
    exit 1
fi
soname=$(readelf --dynamic "$library" | sed -n 's/.*soname: \[\(.*\)\]/\1/p')
[[ $soname == libricochet_c.so.[0-9]* ]] || { echo "found the soname '$soname'"; exit 1; }
echo "$soname: $(echo "$shown" | wc -l) functions, nothing else"
