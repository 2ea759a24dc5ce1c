"""The page docs/notes/peers.md, of what peers.py has found. Needs no peer."""
import math
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "report"))

from compare import minimum, spread  # noqa: E402
from page import duration, markdown_table, three  # noqa: E402
from scoring import is_wrong  # noqa: E402

BOUNDS = (1e-6, 1e-9, 1e-12)
PEERS_OF = {"peer_ricochet.py": ["ricochet"], "scenes_ricochet.py": ["ricochet"], "peer_heyoka.py": ["heyoka"],
            "peer_diffrax.py": ["diffrax"], "peer_torchdiffeq.py": ["torchdiffeq"], "fmu_fmpy.py": ["FMPy"],
            "peer_solvers.py": ["SciPy", "scikit-sundae", "numbalsoda", "casadi", "Drake"],
            "bodies_engines.py": ["pymunk", "Box2D", "MuJoCo"]}
PEERS = ["ricochet", "heyoka", "diffrax", "numbalsoda", "casadi", "scikit-sundae", "SciPy", "Drake", "torchdiffeq",
         "pymunk", "Box2D", "MuJoCo", "FMPy"]
ENGINE = "an engine of bodies: no differential equations of one's own"
NO_RECORD = "events end its runs; driven for resets, not here for crossings that are only recorded"
NO_MODES = "has no modes; driven here where one flow suffices"
BY_HAND = "has no events of ensembles; a loop over single runs, whose time stands above"
NO_GRADIENT = "no derivatives through events"
FMU = "does not read FMUs"
# Why a peer has no row of a problem; a peer that is not there has its own reason.
CANNOT = {
    "ball": {"pymunk": ENGINE, "Box2D": ENGINE, "FMPy": "reads FMUs alone: see the ball as an FMU",
             "MuJoCo": "has no coefficient of restitution: a contact is a spring whose damping is set by trial"},
    "henon-heiles": {"numbalsoda": NO_RECORD, "casadi": NO_RECORD, "Drake": NO_RECORD, "torchdiffeq": NO_RECORD},
    "lorenz": {"numbalsoda": NO_RECORD, "casadi": NO_RECORD, "Drake": NO_RECORD, "torchdiffeq": NO_RECORD},
    "stick-slip": {"numbalsoda": NO_MODES, "casadi": NO_MODES, "Drake": "driven here by the ball alone",
                   "diffrax": NO_MODES, "torchdiffeq": NO_MODES},
    "balls": {peer: BY_HAND for peer in ("numbalsoda", "casadi", "scikit-sundae", "SciPy", "Drake", "torchdiffeq")},
    "orbits": {peer: BY_HAND for peer in ("numbalsoda", "casadi", "scikit-sundae", "SciPy", "Drake", "torchdiffeq")}
    | {"diffrax": "an event ends a run, and under `vmap` all wait for the last; the single orbit stands above"},
    "gradient": {"heyoka": "derivatives of smooth motion; " + NO_GRADIENT, "numbalsoda": NO_GRADIENT,
                 "scikit-sundae": NO_GRADIENT, "SciPy": NO_GRADIENT,
                 "Drake": "scalars with derivatives exist; a witness function in Python has none of them"},
    "discs": {},
    "spinning-disc": {"MuJoCo": "has no coefficient of restitution"},
    "fmu-ball": {"casadi": "imports FMUs (`DaeBuilder`), and warns that events are experimental; not driven here",
                 "SciPy": FMU, "heyoka": FMU, "diffrax": FMU},
}
# Where these alone have a place; elsewhere all of them.
PLACES = {"discs": ("pymunk", "Box2D", "MuJoCo"), "spinning-disc": ("pymunk", "Box2D", "MuJoCo"),
          "fmu-ball": ("FMPy", "casadi")}


def cannot(problem, peer, absent):
    """Why `peer` has no row, or nothing where there is nothing to say."""
    if peer in absent and peer in PLACES.get(problem, PEERS):
        return absent[peer]
    return CANNOT.get(problem, {}).get(peer, "")


def first_cost(row):
    """What the first answer took beyond a run: building, compiling, processor time [s]; NaN if not known."""
    cost = row["first"] - minimum(row) if row.get("samples") and "first" in row else math.nan
    return cost if cost > 0 else math.nan


def number(x):
    return "-" if x is None or x != x else f"{x:.2g}"


def cell_of(row, kind):
    """A row of the table of its problem."""
    value = f"{row['value']:.3g}" if row["value"] else "-"
    head = [row["peer"], row["how"], value]
    if "failed" in row:
        return head + ["-"] * (5 if kind == "bodies" else 4) + [row["failed"]]
    wrong = is_wrong(row, kind)
    times = [duration(minimum(row)) if row["samples"] else "-", duration(first_cost(row))]
    remark = row["note"] or ("too wrong to be timed" if wrong else "")
    if kind == "bodies":
        return head + [f"{row['missed']}, {row['invented']}", number(row["penetration"]), number(row["energy_change"]),
                       *times, remark]
    lost = "-" if kind == "values" else f"{row['missed']}, {row['invented']}"
    return head + [number(row["error"]), lost, *times, remark]


HEADERS = {
    "events": ["by", "method", "tolerance or step", "largest error of a time [s]", "lost, invented", "a run",
               "before the first answer", ""],
    "values": ["by", "method", "tolerance or step", "relative error", "lost, invented", "a run",
               "before the first answer", ""],
    "bodies": ["by", "method", "step [s]", "contacts lost, invented", "deepest overlap [radii]",
               "relative change of energy", "a run", "before the first answer", ""],
}
HEADERS["rows"] = HEADERS["events"]


def problem_table(name, problem, rows, absent):
    """Header and rows of a problem: cells by peer, then dashes with their reasons."""
    kind = problem["kind"]
    order = {peer: k for k, peer in enumerate(PEERS)}
    mine = sorted((row for row in rows if row["problem"] == name),
                  key=lambda row: (order.get(row["peer"], len(PEERS)), row["how"], -row["value"]))
    out = [cell_of(row, kind) for row in mine]
    header = HEADERS[kind]
    for peer in PEERS:
        why = cannot(name, peer, absent)
        if why and not any(row["peer"] == peer for row in mine):
            out.append([peer] + ["-"] * (len(header) - 2) + [why])
    return header, out


def fastest(rows, kind, bound):
    """The fastest right row within an error; of none if there is none."""
    right = [row for row in rows if "failed" not in row and row["samples"] and not is_wrong(row, kind)
             and row["error"] <= bound]
    return min(right, key=minimum, default=None)


def at_equal_error(found, known):
    """Problem, bound, ricochet's fastest row, the fastest of each other peer."""
    out = []
    for name, problem in known.items():
        if problem["kind"] == "bodies":
            continue
        rows = [row for row in found["rows"] if row["problem"] == name]
        for bound in BOUNDS:
            best = {peer: fastest([row for row in rows if row["peer"] == peer], problem["kind"], bound)
                    for peer in PEERS}
            if any(best.values()):
                out.append((name, problem, bound, best))
    return out


def said(row):
    return f"{row['how']}{f', {row_value(row)}' if row['value'] else ''}"


def row_value(row):
    return f"{row['value']:.3g}"


def summary(found, known):
    """Of each problem and error: ricochet, the fastest other, and how many times as long it takes."""
    out = []
    for _, problem, bound, best in at_equal_error(found, known):
        ours = best["ricochet"]
        others = [row for peer, row in best.items() if row and peer != "ricochet"]
        other = min(others, key=minimum, default=None)
        ratio = minimum(other) / minimum(ours) if ours and other else math.nan
        verdict = "-" if ratio != ratio else three(ratio) if ratio >= 1 else f"**{three(ratio)}**"
        out.append([problem["title"], f"{bound:g}",
                    f"{duration(minimum(ours))}: {said(ours)}" if ours else "-",
                    f"{duration(minimum(other))}: {other['peer']}, {said(other)}" if other else "-", verdict])
    return (["problem", "error within", "ricochet from Python", "the fastest other", "its time over ricochet's"], out)


INTRODUCTION = """# Beside the peers of PyPI

Made by `scripts/bench --peers pypi --keep`, which installs the peers by pip in an environment under `build/`, solves each problem with each of them
as its manual shows, scores the answers, and then times them: wins and losses alike. [bench/peers_pypi/](../../bench/peers_pypi/) has the programs. The
report beside C++ libraries is in [benchmarks](../benchmarks.md).

- **An answer is scored before it is timed**: events lost and invented, then the largest error of a time against a closed form, or against heyoka in
  long double at 1e-19 (`references.json`). What loses or invents events is not timed.
- **A time is the processor time of one run from Python** on one core, the least of its samples. Up to twelve cells of a problem are sampled in
  turns of random order; an interrupted report goes on, so that rows may also be minutes apart. "Before the first answer" is what building and
  compiling take beyond a run, processor time as well: importing is not in it.
- ricochet runs in the interpreter that it was built for, with its NumPy; the peers in the environment, with that of PyPI.
- A dash: the peer cannot do it, is not there, or is not driven there, with the reason at the end of its row.
"""


def heading(found):
    machine, load = found["machine"], found["load"]
    versions = ", ".join(f"{peer} {version}" for peer, version in sorted(found["versions"].items(), key=lambda v: v[0].lower()))
    noise = spread(found["yardstick"]) if found["yardstick"] else math.nan
    passes = "" if found["passes"] == 1 else ", in two passes with new processes"
    told = [f"Commit `{machine['commit']}`, {machine['date']}; {machine['processor']}, {machine['cores']} cores. {versions}.",
            f"Up to {found['rounds']} samples of a cell{passes}. The load of the machine was {min(load):.1f} to {max(load):.1f}"
            + (f"; of a fixed piece of work, timed in every turn, a tenth of the samples took {100 * noise:.0f} % longer "
               "than the shortest, or more" if noise == noise else "") + "."
            + (" **Other work shared the cores**: read ratios, and those near 1 as ties." if max(load) > 2 else "")]
    return "\n\n".join(told)


def page(found, known):
    parts = [INTRODUCTION.rstrip(), heading(found), "## At equal error",
             "The fastest setting of each within an error; below 1, in bold, ricochet loses.",
             markdown_table(*summary(found, known))]
    for name, problem in known.items():
        table = problem_table(name, problem, found["rows"], found["absent"])
        if table[1]:
            parts += [f"## {problem['title']}", *([NOTES[name].format(**problem)] if name in NOTES else []), markdown_table(*table)]
    return "\n\n".join(parts) + "\n"


NOTES = {
    "discs": "{contacts} contacts by brute force over all pairs; overlaps are looked at after every step of an engine, of ricochet's "
             "scene at 240 times. An engine's contact is one that it has newly noticed; a run of an engine sets the discs back first.",
    "balls": "Counts and the time of the last impact of each ball. heyoka and diffrax return those alone; ricochet's result has "
             "all events and states.",
    "orbits": "6422 crossings of x = 0 in all, on one thread.",
    "fmu-ball": "The FMU is ricochet's own export, so that both call the same code; the motion is a parabola, and what differs is "
                "the location of events. The time of FMPy has the loading of the library in it, as has that of ricochet.",
    "spinning-disc": "By the law of the impacts: restitution 0.6, Coulomb's friction 0.2. Engines are right to their step.",
}


def keep(text, root):
    (root / "docs/notes/peers.md").write_text(text)
