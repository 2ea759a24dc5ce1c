"""A program of cells: what each peer's file calls, and the words that run.py says to it.

A cell is a problem, a peer, how it is set, a tolerance or step, and `make`, a function that builds
whatever is built once (compiled code, a solver, a space) and returns `solve` and `read`. `solve()`
is what is timed; `read(solve())` is the answer. The time of the first answer has the building in it.
"""
import json
import os
import sys
import time
from importlib import metadata


def cell_name(problem, peer, how, value):
    return f"{problem}/{peer}/{how}" + (f"/{value:g}" if value else "")


def events(times, guards=None):
    times = [float(t) for t in times]
    return {"times": times, "guards": list(guards) if guards is not None else [0] * len(times)}


def rows(counts, last):
    return {"counts": [int(n) for n in counts], "last": [float(t) for t in last]}


def values(numbers):
    return {"samples": [[float(x) for x in numbers]]}


def version(package):
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "unknown"


def seconds(solve, n):
    start = time.process_time()
    for _ in range(n):
        solve()
    return time.process_time() - start


def first(make):
    """`solve`, `read`, the first result, and the processor time until it was there."""
    start = time.process_time()
    solve, read = make()
    raw = solve()
    return solve, read, raw, time.process_time() - start


def answered(read, raw, took):
    return {"finished": True, "note": ""} | read(raw) | {"first": took}


def serve(make, protocol):
    solve, read, raw, took = first(make)
    for line in sys.stdin:
        verb = line.split()
        if verb and verb[0] == "time":
            said = {"seconds": seconds(solve, int(verb[1]))}
        else:
            said = answered(read, raw, took)
        print(json.dumps(said), file=protocol, flush=True)


def main(versions, cells):
    words = sys.argv[1:]
    if words == ["list"]:
        listed = [{"name": cell_name(*cell[:4]), "problem": cell[0], "peer": cell[1], "how": cell[2],
                   "value": cell[3]} for cell in cells]
        print(json.dumps({"versions": versions, "cells": listed}))
        return 0
    chosen = [cell[4] for cell in cells if len(words) == 2 and cell_name(*cell[:4]) == words[1]]
    if not chosen or words[0] not in ("serve", "run"):
        print("usage: list | serve <cell> | run <cell>", file=sys.stderr)
        return 2
    protocol = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what libraries print is no answer
    if words[0] == "serve":
        serve(chosen[0], protocol)
        return 0
    solve, read, raw, took = first(chosen[0])
    print(json.dumps(answered(read, raw, took)), file=protocol)
    best = min(seconds(solve, 1) for _ in range(3))
    print(f"shortest run of {words[1]}: {best * 1e6:.4g} us of processor time", file=protocol)
    return 0
