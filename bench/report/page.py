"""Writes the report: figures, a page of HTML that needs nothing but its figures, Markdown."""
import html
import json
import math
import re
import shutil
import statistics
import subprocess

import guard_map
from compare import NOISY, minimum, spread, verdict
from score import scored_as_wrong

BOUNDS = (1e-4, 1e-6, 1e-8, 1e-10)
PALETTE = ["ricochet: dopri5", "ricochet: fehlberg78", "ricochet: Taylor", "odeint: step map",
           "odeint: vector, dense output", "GSL: rk8pd, bisection", "CVODE: Adams, root finding",
           "ARKODE: DP5, root finding", "SciPy: RK45", "SciPy: DOP853"]


def median(row):
    return statistics.median(row["samples"]) if row["samples"] else math.nan


def p90(row):
    ordered = sorted(row["samples"])
    return ordered[round(0.9 * (len(ordered) - 1))] if ordered else math.nan


def is_right(row):
    return "failed" not in row and not scored_as_wrong(row)


def series(rows):
    """Rows by peer and way, in the order of the palette."""
    out = {}
    for row in rows:
        out.setdefault(f"{row['peer']}: {row['how']}", []).append(row)
    known = [name for name in PALETTE if name in out]
    return {name: out[name] for name in known + [name for name in out if name not in PALETTE]}


def number(x, unit=1.0):
    if x is None or x != x:
        return "-"
    return f"{x / unit:.3g}"


def three(x):
    """Three digits, without an exponent where the number is large."""
    return f"{x:.3g}" if abs(x) < 999.5 else f"{x:.0f}"


def duration(seconds):
    if seconds != seconds:
        return "-"
    for unit, size in (("s", 1), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)):
        if seconds >= 0.9995 * size:
            return f"{three(seconds / size)} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


# --- figures ---

def curve(name, points):
    points = [(x, y) for x, y in points if x == x and y == y and x > 0 and y > 0]
    return {"name": name, "x": [x for x, _ in points], "y": [y for _, y in points],
            "dashed": not name.startswith("ricochet"),
            "colour": PALETTE.index(name) if name in PALETTE else None}


def panel(title, x, y, curves, **axes):
    """Curves that have no place in the palette take those after it, one each."""
    curves = [c for c in curves if c["x"]]
    others = [c for c in curves if c["colour"] is None]
    for k, other in enumerate(others):
        other["colour"] = len(PALETTE) + k
    return {"title": title, "x": x, "y": y, "curves": curves} | axes


def work_precision(title, rows, unit):
    """Time against error, of right answers."""
    curves = []
    for name, cells in series(rows).items():
        right = sorted((row for row in cells if is_right(row)), key=lambda row: -row["value"])
        curves.append(curve(name, [(max(row["error"], 1e-17), minimum(row)) for row in right]))
    return panel(title, unit, "shortest time of a run [s]", curves)


def near_tangent(rows):
    """Found crossings and time, over the depth, at one tolerance."""
    found, times = [], []
    for name, cells in series([row for row in rows if row["value"] == 1e-10]).items():
        cells = sorted(((float(row["problem"].removeprefix("near-tangent-")), row)
                        for row in cells if "failed" not in row), key=lambda pair: pair[0])
        found.append(curve(name, [(depth, max(100 * row["share"], 1e-3)) for depth, row in cells]))
        times.append(curve(name, [(depth, minimum(row)) for depth, row in cells
                                  if not scored_as_wrong(row)]))
    return [panel("Crossings found, tolerance 1e-10", "depth below the crest", "found [%]", found,
                  log_y=False),
            panel("Time of those that find all", "depth below the crest",
                  "shortest time of 32 runs [s]", times)]


def over_size(rows, prefix, title, bound, per_event):
    """Shortest time over N of the cells whose error is within a bound."""
    best = {}
    for row in rows:
        if not row["problem"].startswith(prefix) or not is_right(row) or row["error"] > bound:
            continue
        n = int(row["problem"].removeprefix(prefix))
        seconds = minimum(row) / (per_event(row["problem"]) or 1)
        per_peer = best.setdefault(f"{row['peer']}: {row['how']}", {})
        per_peer[n] = min(per_peer.get(n, math.inf), seconds)
    return panel(title, "N", "shortest time [s]",
                 [curve(name, sorted(points.items())) for name, points in
                  ((name, best[name]) for name in series(rows) if name in best)])


def figures(report):
    """Name of the file, caption and panels of every figure that has a curve."""
    rows, problems = report["rows"], report["problems"]
    by = {name: [row for row in rows if row["problem"] == name] for name in problems}
    for row in rows:
        events = problems[row["problem"]]["events"]
        row["share"] = 1 - row.get("missed", events) / events if events else 1
    out = []
    for name, problem in problems.items():
        if re.match(r"near-tangent|balls-|guards-|plain-", name) or not by[name]:
            continue
        unit = "relative error of the state" if not problem["events"] else "largest error [s]"
        out.append((name, problem["title"] + ": time against error",
                    [work_precision(problem["title"], by[name], unit)]))
    tangent = [row for row in rows if row["problem"].startswith("near-tangent")]
    if tangent:
        out.append(("near-tangent", "Near-tangent pairs: found, and at what cost",
                    near_tangent(tangent)))
    balls = [row for row in rows if row["problem"].startswith("balls-")]
    if balls:
        out.append(("balls", "N balls, in one state and as a scene: time of an impact, errors within 1e-8 s",
                    [over_size(balls, "balls-", "N balls, per impact", 1e-8,
                               lambda name: problems[name]["events"])]))
    idle = [row for row in rows if row["problem"].startswith("guards-") and row["value"] == 1e-8]
    if idle:
        without = {f"{row['peer']}: {row['how']}": minimum(row) for row in idle
                   if row["problem"] == "guards-0"}
        curves = []
        for name, cells in series(idle).items():
            points = sorted((int(row["problem"].removeprefix("guards-")),
                             minimum(row) / without.get(name, math.nan)) for row in cells
                            if is_right(row))
            curves.append(curve(name, points))
        out.append(("guards", "Guards that never fire: time over that without guards",
                    [panel("Idle guards, tolerance 1e-8", "guards", "time over none", curves)]))
    if report.get("map"):
        out.append(("map", "Guards: the fastest way with the same events, and how many times as fast "
                    "as a check at every step", guard_map.panels(report["map"])))
    return [figure for figure in out if any(p["curves"] for p in figure[2])]


def draw(report, directory, root):
    """Draws the figures; returns their names and captions, and why they are not there."""
    program = root / "build/release/bin/ricochet_report_draw"
    drawn = []
    for name, caption, panels in figures(report):
        file = directory / f"{name}.svg"
        try:
            run = subprocess.run([program, file], input=json.dumps({"title": "", "panels": panels}),
                                 text=True, capture_output=True)
        except OSError as error:
            return drawn, str(error)
        if run.returncode != 0:
            return drawn, run.stderr.strip()
        drawn.append((name, caption))
    return drawn, ""


# --- tables ---

def fastest(rows, bound):
    right = [row for row in rows if is_right(row) and row["error"] <= bound and row["samples"]]
    return min(right, key=minimum, default=None)


def at_equal_error(report):
    """Per problem and bound: our fastest cell, and how many times as long each peer takes."""
    out = []
    for name, problem in report["problems"].items():
        if name.startswith(("near-tangent", "guards-", "plain-")):
            continue
        rows = [row for row in report["rows"] if row["problem"] == name]
        for bound in BOUNDS:
            ours = fastest([row for row in rows if row["peer"] == "ricochet"], bound)
            if not ours:
                continue
            ratios = {}
            for peer in sorted({row["peer"] for row in report["rows"]} - {"ricochet"}):
                theirs = fastest([row for row in rows if row["peer"] == peer], bound)
                ratios[peer] = minimum(theirs) / minimum(ours) if theirs else None
            out.append((problem["title"], bound, ours, ratios))
    return out


LEAD = ("How many times as long as the fastest setting of ricochet the fastest setting of each peer takes, "
        "both within the same error. A dash: no setting of the peer is that right.")


def equal_error_table(report):
    peers = sorted({row["peer"] for row in report["rows"]} - {"ricochet"})
    header = ["problem", "error within", "ricochet", "by"] + peers
    rows = []
    for title, bound, ours, ratios in at_equal_error(report):
        rows.append([title, f"{bound:g}", duration(minimum(ours)), ours["how"]] +
                    [three(ratios[peer]) if ratios.get(peer) else "-" for peer in peers])
    return header, rows


def why(row):
    """What is wrong with a row, and what is known of its energy; or nothing."""
    if "failed" in row:
        return row["failed"]
    if not row["finished"]:
        return "did not reach the end" + (f": {row['note']}" if row["note"] else "")
    said = ["wrong"] if scored_as_wrong(row) else []
    if row.get("energy_change") is not None:
        said.append(f"energy changes by {row['energy_change']:.1g}")
    return "; ".join(said)


def cell_table(rows):
    header = ["peer", "set as", "tolerance or step", "error", "missed", "invented", "steps",
              "flow calls", "guard calls", "time min", "median", "p90", "remark", "again by"]
    out = []
    for row in rows:
        known = "failed" not in row or "error" in row
        out.append([row["peer"], row["how"], f"{row['value']:g}",
                    number(row["error"]) if known else "-",
                    str(row["missed"]) if known else "-", str(row["invented"]) if known else "-",
                    *(str(row.get(c)) if row.get(c) is not None else "-"
                      for c in ("steps", "flow_calls", "guard_calls")),
                    duration(minimum(row)), duration(median(row)), duration(p90(row)), why(row),
                    f"`{row['command']}`"])
    return header, out


THINGS = {"flow": "the flow alone", "floor": "a guard and a reset: the ball",
          "modes": "the ball with two modes", "recording": "the ball, every step kept, 200 samples",
          "planning": "the ball with a bound, Planned", "network": "the ball, Verified<BareNetwork>",
          "taylor": "the ball, Taylor", "sensitivities": "the ball and its derivatives",
          "friction": "a friction oscillator, set-valued"}


def pays_table(report):
    header = ["a program of", "time of a run", "events", "allocations in a run", "code",
              "functions of ricochet"]
    rows = []
    for row in report["pays"]:
        if "failed" in row:
            rows.append([THINGS[row["thing"]], row["failed"], "-", "-", "-", "-"])
            continue
        rows.append([THINGS[row["thing"]], duration(row["seconds"]), str(row["events"]),
                     str(row["allocations"]), f"{row['text'] / 1024:.0f} KiB",
                     str(row["symbols"])])
    return header, rows


def remarks(report, older):
    """Sentences about how far the report can be relied upon."""
    out = []
    noise = spread(report["yardstick"])
    out.append(f"The yardstick, one rk4 step of the ball through odeint, took "
               f"{duration(min(report['yardstick'], default=math.nan))} at best; a tenth of its "
               f"samples were {100 * noise:.0f} % above that or more.")
    if noise > NOISY:
        out.append(f"That is more than {100 * NOISY:.0f} %: **the machine was too noisy**, and "
                   "ratios of this report are not to be quoted.")
    if older:
        out += verdict(report, older)[1]
    for peer, reason in sorted(report["absent"].items()):
        out.append(f"{peer} is not in this report: {reason}.")
    return out


# --- pages ---

def heading(report):
    machine = report["machine"]
    peers = ", ".join(f"{peer} {version}" for peer, version in sorted(report["versions"].items()))
    return (f"Commit {machine['commit']}, {machine['date']}; {machine['processor']}, "
            f"{machine['cores']} cores; {machine['compiler']}. {peers}.")


EXPLANATION = (
    "A time is the processor time of one run, the shortest of up to 15 samples; the cells of a "
    "problem are sampled in turns, each in a process of its own, all on one core. An answer is "
    "scored first: events that are missed or invented, then the largest error of their times "
    "against the reference. What misses or invents events is not timed, but for the near-tangent "
    "pairs, where that is the question. Every peer solves the same problem, written once for all "
    "that are driven from C++, and is used as its manual says.")


PAYS = (
    "One program for each thing that a scene may use, linked to the static libraries. The engine of "
    "events is compiled once and comes whole; further libraries come where they are used.")


def markdown_table(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    lines += ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join(lines)


def html_table(header, rows):
    def cell(text):
        if text.startswith("`") and text.endswith("`"):
            return f"<td><code>{html.escape(text[1:-1])}</code></td>"
        return f"<td>{html.escape(text)}</td>"
    head = "".join(f"<th>{html.escape(name)}</th>" for name in header)
    body = "".join("<tr>" + "".join(cell(text) for text in row) + "</tr>" for row in rows)
    return (f'<div class="wide"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'
            "</div>")


STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 0 auto; padding: 0 1rem;
       color: #222; background: #fff; overflow-wrap: break-word; }
figure { margin: 1rem 0; }
img { max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.8rem; white-space: nowrap; }
th, td { padding: 0.15rem 0.6rem; border-bottom: 1px solid #ddd; text-align: left; }
th { background: #f2f4f7; }
summary { cursor: pointer; font-weight: 600; padding: 0.4rem 0; }
"""


def sections(report):
    """Heading and rows of each problem's table."""
    for name, problem in report["problems"].items():
        rows = [row for row in report["rows"] if row["problem"] == name]
        if rows:
            yield problem["title"], cell_table(rows)


def write(report, older, directory, root):
    directory.mkdir(parents=True, exist_ok=True)
    for old in directory.glob("*.svg"):
        old.unlink()
    drawn, undrawn = draw(report, directory, root)
    said = remarks(report, older) + ([f"No figures: {undrawn}."] if undrawn else [])
    table = equal_error_table(report)
    text = ["# Run time against error, beside the peers", heading(report), EXPLANATION, *said,
            "## At equal error", LEAD, markdown_table(*table)]
    if report.get("map"):
        text += ["## Ways to check a guard", guard_map.LEAD, guard_map.remark(report["map"]),
                 markdown_table(*guard_map.table(report["map"]))]
    if report["pays"]:
        text += ["## What a scene pays for", PAYS, markdown_table(*pays_table(report))]
    text += ["## Figures"]
    text += [f"![{caption}]({name}.svg)" for name, caption in drawn]
    text += ["## Every cell"]
    for title, cells in sections(report):
        text += [f"### {title}", markdown_table(*cells)]
    if report.get("map"):
        text += ["### Ways to check a guard",
                 markdown_table(*guard_map.ways_table(report["map"]))]
    (directory / "report.md").write_text("\n\n".join(text) + "\n")

    def paragraph(sentence):
        bold = re.sub(r"\*\*(.+?)\*\*", r"<b>\1</b>", html.escape(sentence))
        return f"<p>{bold}</p>"
    page = ['<!doctype html><html lang="en"><head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            "<title>ricochet: run time against error</title>", f"<style>{STYLE}</style></head>",
            "<body><h1>Run time against error, beside the peers</h1>",
            *map(paragraph, [heading(report), EXPLANATION, *said]),
            "<h2>At equal error</h2>", paragraph(LEAD), html_table(*table)]
    if report.get("map"):
        page += ["<h2>Ways to check a guard</h2>", paragraph(guard_map.LEAD),
                 paragraph(guard_map.remark(report["map"])),
                 html_table(*guard_map.table(report["map"]))]
    if report["pays"]:
        page += ["<h2>What a scene pays for</h2>", paragraph(PAYS),
                 html_table(*pays_table(report))]
    page.append("<h2>Figures</h2>")
    for name, caption in drawn:
        escaped = html.escape(caption)
        page.append(f'<figure><a href="{name}.svg"><img src="{name}.svg" alt="{escaped}"></a>'
                    f"<figcaption>{escaped}</figcaption></figure>")
    page.append("<h2>Every cell</h2>")
    for title, cells in sections(report):
        page.append(f"<details><summary>{html.escape(title)}</summary>{html_table(*cells)}"
                    "</details>")
    if report.get("map"):
        page.append(f"<details><summary>Ways to check a guard</summary>"
                    f"{html_table(*guard_map.ways_table(report['map']))}</details>")
    page.append("</body></html>")
    (directory / "index.html").write_text("\n".join(page) + "\n")
    if (directory / "report.json").exists():
        shutil.copy(directory / "report.json", directory / "report.before.json")
    (directory / "report.json").write_text(json.dumps(report))
