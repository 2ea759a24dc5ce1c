#!/usr/bin/env python3
"""Compares two reports of one commit: do their ratios agree?

    compare.py report.json other.json

Exit status: 0 if every ratio agrees within 15 %, 1 if some do not, 3 if some do not and their own
samples or one of the machines were too noisy to tell.
"""
import json
import math
import statistics
import sys
from pathlib import Path

NOISY = 0.30      # a tenth of the yardstick's samples are this much above the shortest, or more
AGREEMENT = 0.15  # by which ratios of two reports may differ


def minimum(row):
    return min(row["samples"]) if row["samples"] else math.nan


def spread(samples):
    """Excess of the 90th percentile over the shortest sample, as a fraction of the latter."""
    ordered = sorted(samples)
    return (ordered[round(0.9 * (len(ordered) - 1))] / ordered[0] - 1) if ordered else math.inf


def agreement(report, older):
    """Departures of the ratios of two reports and their rows, the largest first: each time is
    taken over the geometric mean of those of its problem that both have."""
    def times(of):
        return {row["name"]: minimum(row) for row in of["rows"] if row["samples"]}
    new, old = times(report), times(older)
    problem_of = {row["name"]: row["problem"] for row in report["rows"]}
    departures = []
    for problem in report["problems"]:
        names = [name for name in new if name in old and problem_of[name] == problem]
        if len(names) < 2:
            continue
        shift = statistics.fmean(math.log(new[name] / old[name]) for name in names)
        departures += [(math.expm1(abs(math.log(new[name] / old[name]) - shift)), name)
                       for name in names]
    return sorted(departures, reverse=True)


def verdict(report, older):
    """Exit status, and sentences that say whether the ratios agree."""
    said = []
    commit, other = report["machine"]["commit"], older["machine"]["commit"]
    if commit != other:
        said.append(f"The other report is of commit {other}, not of {commit}.")
    departures = agreement(report, older)
    if not departures:
        return 1, said + ["The two reports have no times of the same rows to compare."]
    apart = sum(departure > AGREEMENT for departure, _ in departures)
    percent, name = 100 * departures[0][0], departures[0][1]
    if apart == 0:
        return 0, said + [f"All {len(departures)} ratios of the two reports agree within "
                          f"{100 * AGREEMENT:.0f} %; the largest departure is {percent:.0f} % "
                          f"({name})."]
    said.append(f"{len(departures) - apart} of {len(departures)} ratios of the two reports agree "
                f"within {100 * AGREEMENT:.0f} %; the largest departure is {percent:.0f} % "
                f"({name}).")
    wide = {row["name"] for of in (report, older) for row in of["rows"]
            if row["samples"] and spread(row["samples"]) > NOISY}
    unclear = sum(departure > AGREEMENT and name in wide for departure, name in departures)
    if unclear:
        said.append(f"{unclear} of the other {apart} are too noisy to tell: a tenth of their own "
                    f"samples were {100 * NOISY:.0f} % above the shortest or more.")
    if unclear == apart:
        return 3, said
    noise = max(spread(report["yardstick"]), spread(older["yardstick"]))
    if noise > NOISY:
        said.append(f"**The machine was too noisy to tell**: a tenth of the yardstick's samples "
                    f"were {100 * noise:.0f} % above the shortest or more in one of them.")
        return 3, said
    said.append(f"**They disagree**, although the machine was quiet (yardstick within "
                f"{100 * noise:.0f} %).")
    return 1, said


def main():
    if len(sys.argv) != 3:
        print("usage: compare.py report.json other.json", file=sys.stderr)
        return 2
    try:
        report, older = (json.loads(Path(file).read_text()) for file in sys.argv[1:])
        status, said = verdict(report, older)
    except (OSError, ValueError, KeyError) as error:
        print(f"compare.py: no report: {error}", file=sys.stderr)
        return 2
    print("\n".join(sentence.replace("**", "") for sentence in said))
    return status


if __name__ == "__main__":
    sys.exit(main())
