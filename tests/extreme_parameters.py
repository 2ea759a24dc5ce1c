#!/usr/bin/env python3
"""Every system of the command line with every parameter at the ends of the range of numbers.

    extreme_parameters.py <ricochet> [system ...]

Each run must answer within 5 s of processor time, with status 0, 1 or 2. Prints the runs that do
not, and exits with 1 then.
"""
import json
import os
import resource
import subprocess
import sys

LIMIT = 5  # [s]
NUMBERS = ("1e308", "-1e308", "1e-308", "-1e-308")


def runs_of(systems):
    for system in systems:
        for number in NUMBERS:
            for parameter in system["parameters"]:
                yield [system["name"], "--set", f"{parameter['name']}={number}"]


def limit_time():
    resource.setrlimit(resource.RLIMIT_CPU, (LIMIT, LIMIT))


def main():
    program = os.path.abspath(sys.argv[1])
    systems = json.loads(subprocess.run([program, "systems", "--json"], capture_output=True,
                                        check=True).stdout)
    if sys.argv[2:]:
        systems = [system for system in systems if system["name"] in sys.argv[2:]]
    bad = count = 0
    for words in runs_of(systems):
        done = subprocess.run([program, "simulate", *words], stdin=subprocess.DEVNULL,
                              capture_output=True, preexec_fn=limit_time)
        count += 1
        if done.returncode not in (0, 1, 2):
            bad += 1
            print("simulate", *words, f"status {done.returncode}", flush=True)
    print(f"{count} runs, {bad} without an answer in {LIMIT} s")
    return bad > 0 or count == 0


if __name__ == "__main__":
    sys.exit(main())
