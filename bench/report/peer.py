"""The protocol of ricochet_report, for peers in Python."""
import json
import os
import sys
import time


def answer(**known):
    """An answer as main.cpp writes it; what is not given is not counted."""
    out = {"finished": False, "times": [], "guards": [], "samples": [], "steps": None,
           "flow_calls": None, "guard_calls": None, "energy_change": None, "note": ""}
    return out | known


def seconds(solve, n):
    start = time.process_time()
    for _ in range(n):
        solve()
    return time.process_time() - start


def cell_name(problem, peer, how, value):
    return f"{problem}/{peer}/{how}" + (f"/{value:g}" if value else "")


def main(versions, cells):
    """`cells` are (problem, peer, how, value, solve)."""
    words = sys.argv[1:]
    if words == ["list"]:
        listed = [{"name": cell_name(*cell[:4]), "problem": cell[0], "peer": cell[1],
                   "how": cell[2], "value": cell[3]} for cell in cells]
        print(json.dumps({"versions": versions, "problems": [], "cells": listed}))
        return 0
    if len(words) != 2 or words[0] not in ("serve", "run"):
        print("usage: list | serve <cell> | run <cell>", file=sys.stderr)
        return 2
    chosen = [cell[4] for cell in cells if cell_name(*cell[:4]) == words[1]]
    if not chosen:
        print(f"no cell '{words[1]}'; see `list`", file=sys.stderr)
        return 2
    solve = chosen[0]
    # What libraries print themselves, as LSODA does, is no answer.
    protocol = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    if words[0] == "run":
        print(json.dumps(solve()), file=protocol)
        best = min(seconds(solve, 1) for _ in range(3))
        print(f"shortest run of {words[1]}: {best * 1e6:.4g} us of processor time", file=protocol)
        return 0
    for line in sys.stdin:
        verb = line.split()
        if verb and verb[0] == "time":
            print(json.dumps({"seconds": seconds(solve, int(verb[1]))}), file=protocol, flush=True)
        else:
            print(json.dumps(solve()), file=protocol, flush=True)
    return 0
