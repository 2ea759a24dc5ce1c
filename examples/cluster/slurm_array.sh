#!/bin/sh
#SBATCH --job-name=balls
#SBATCH --array=0-3
#SBATCH --cpus-per-task=2
#SBATCH --time=00:10:00
# 1000 balls as an array of Slurm; each task takes its share:
#
#     job=$(sbatch --parsable slurm_array.sh balls)
#     sbatch --dependency=afterok:$job --wrap "ricochet ensemble --merge balls"
#
# Tasks that ran out of time are submitted again as they were: the array has to be the same.
set -eu
ricochet ensemble bouncing-ball --count 1000 \
    --vary height=1:10 restitution=0.7:0.9 --t-end 5 --out "${1:-balls}"
