#!/usr/bin/env bash
# Whether the layout of the public structs is the one that programs have been compiled with.
# usage: layout.sh PROGRAM EXPECTED
set -euo pipefail
# Fields are added at the end of a struct, and constants: their lines, and its size, are added
# to the list. All other lines stay as they are.
diff "$2" <("$1") && echo "the structs lie as they did"
