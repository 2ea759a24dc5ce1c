#!/bin/sh
# 1000 balls in four shares by GNU parallel; with --sshlogin on other machines that see one directory.
set -eu
out=${1:-balls}
parallel --will-cite ricochet ensemble bouncing-ball --count 1000 \
    --vary height=1:10 restitution=0.7:0.9 --t-end 5 --threads 1 --out "$out" --share '{}/4' \
    ::: 1 2 3 4
ricochet ensemble --merge "$out"
