"""Answers of the peers from PyPI against their reference; see problems.py for the kinds."""
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "report"))

from score import score_events, score_samples, scored_as_wrong  # noqa: E402


def score_rows(answer, problem):
    """Of an ensemble: events missed and invented over all runs, the largest error of a last time."""
    missed = invented = 0
    error = 0.0
    if len(answer["counts"]) != len(problem["counts"]):
        return {"missed": sum(problem["counts"]), "invented": 0, "error": math.inf}
    for found, known, t, exact in zip(answer["counts"], problem["counts"], answer["last"], problem["last"]):
        missed += max(0, known - found)
        invented += max(0, found - known)
        if found == known:
            error = max(error, abs(t - exact)) if t == t else math.inf
    return {"missed": missed, "invented": invented, "error": error}


def score_bodies(answer, problem):
    """Contacts lost (or invented) and what an engine does to bodies and their energy."""
    found, known = answer["contacts"], problem["contacts"]
    return {"missed": max(0, known - found), "invented": max(0, found - known), "error": 0.0,
            "penetration": answer["penetration"], "energy_change": answer["energy_change"]}


def scored(answer, problem):
    row = {"events": lambda: score_events(answer, problem), "values": lambda: score_samples(answer, problem),
           "rows": lambda: score_rows(answer, problem),
           "bodies": lambda: score_bodies(answer, problem)}[problem["kind"]]()
    return row | {"finished": bool(answer["finished"]), "note": answer["note"]}


def is_wrong(row, kind):
    """Whether an answer is too wrong to be timed; of engines the loss itself is the answer."""
    return not row["finished"] if kind == "bodies" else scored_as_wrong(row)
