#!/bin/sh
# 1000 balls in four processes of mpirun, on this machine or, by a host file of yours, on several that
# see one directory. Each process takes the share that its rank has.
set -eu
out=${1:-balls}
mpirun ${MPIRUN_OPTIONS:-} -n 4 ricochet ensemble bouncing-ball --count 1000 \
    --vary height=1:10 restitution=0.7:0.9 --t-end 5 --threads 1 --out "$out"
ricochet ensemble --merge "$out"
