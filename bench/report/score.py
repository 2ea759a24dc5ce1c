"""Answers against their reference: the set of events first, then their times, or the states."""
import math


def streams(times, guards):
    """Times by guard; a time that is no number stays where it is and is matched with nothing."""
    out = {}
    for t, guard in zip(times, guards):
        out.setdefault(guard, []).append(t)
    return out


def match(found, expected):
    """Missed, invented and largest error of one guard's times. Each expected time takes the next
    found one that is nearer than half the distance to its neighbours in the reference."""
    missed = invented = 0
    error = 0.0
    k = 0
    for i, t in enumerate(expected):
        gaps = [abs(t - other) for other in expected[max(0, i - 1):i] + expected[i + 1:i + 2]]
        window = min(gaps, default=math.inf) / 2
        while k < len(found) and not found[k] > t - window:
            invented += 1
            k += 1
        if k < len(found) and found[k] < t + window:
            error = max(error, abs(found[k] - t))
            k += 1
        else:
            missed += 1
    return missed, invented + len(found) - k, error


def score_events(answer, problem):
    """Events after `scored_until` are not compared, where the problem has one."""
    until = problem.get("scored_until")
    known = [(t, guard) for t, guard in zip(answer["times"], answer["guards"])
             if until is None or not t > until]
    found = streams([t for t, _ in known], [guard for _, guard in known])
    expected = streams(problem["times"], problem["guards"])
    missed = invented = 0
    error = 0.0
    for guard in found.keys() | expected.keys():
        m, i, e = match(found.get(guard, []), expected.get(guard, []))
        missed, invented, error = missed + m, invented + i, max(error, e)
    return {"missed": missed, "invented": invented, "error": error}


def score_samples(answer, problem):
    """Relative L2 norm of the error over the sample times, by the trapezoidal rule."""
    exact, ours = problem["samples"], answer["samples"]
    if len(exact) != len(ours) or any(len(a) != len(b) for a, b in zip(exact, ours)):
        return {"missed": len(exact), "invented": 0, "error": math.inf}
    above = below = 0.0
    for i, (a, b) in enumerate(zip(exact, ours)):
        weight = 0.5 if i in (0, len(exact) - 1) else 1.0
        above += weight * sum((p - q) ** 2 for p, q in zip(a, b))
        below += weight * sum(p * p for p in a)
    error = math.sqrt(above / below)
    return {"missed": 0, "invented": 0, "error": error if error == error else math.inf}


def score(answer, problem):
    """What a row says of an answer: whether it reached the end, missed, invented, error."""
    row = score_samples(answer, problem) if problem["samples"] else score_events(answer, problem)
    return row | {"finished": bool(answer["finished"]), "note": answer.get("note", "")}


def scored_as_wrong(row):
    return (not row["finished"] or row["missed"] > 0 or row["invented"] > 0
            or not math.isfinite(row["error"]))
