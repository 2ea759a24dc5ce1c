#!/bin/sh
# run.sh <bin> <examples/cluster> <mpirun|slurm_array|parallel>: the script gives the bytes of one
# process. Exit status 77: what it needs is not installed.
set -eu
bin=$1 scripts=$2 name=$3
PATH=$bin:$PATH
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$work"
# As root, and with more processes than cores.
export OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
ricochet ensemble bouncing-ball --count 1000 --vary height=1:10 restitution=0.7:0.9 --t-end 5 --out one
case $name in
    mpirun | parallel)
        command -v "$name" > /dev/null || exit 77
        "$scripts/$name.sh" balls ;;
    slurm_array)
        # What Slurm sets for its tasks, numbered from 0.
        for id in 0 1 2 3; do
            SLURM_JOB_ID=1 SLURM_PROCID=0 SLURM_ARRAY_TASK_ID=$id SLURM_ARRAY_TASK_COUNT=4 \
                SLURM_ARRAY_TASK_MIN=0 SLURM_ARRAY_TASK_MAX=3 SLURM_ARRAY_TASK_STEP=1 \
                "$scripts/slurm_array.sh" balls
        done
        ricochet ensemble --merge balls ;;
    counter)
        command -v mpirun > /dev/null || exit 77
        for n in 1 2 3 4; do
            mpirun -n $n ricochet-mpi ensemble bouncing-ball --count 1000 \
                --vary height=1:10 restitution=0.7:0.9 --t-end 5 --out balls
            cmp one/results.npy balls/results.npy
            # What one process has left undone the others do.
            rm "balls/share-1-of-$n.rows" balls/results.npy
            mpirun -n $n ricochet-mpi ensemble bouncing-ball --count 1000 \
                --vary height=1:10 restitution=0.7:0.9 --t-end 5 --out balls
            cmp one/results.npy balls/results.npy
            [ "$n" = 4 ] || rm -r balls
        done ;;
esac
cmp one/results.npy balls/results.npy
cmp one/results.csv balls/results.csv
