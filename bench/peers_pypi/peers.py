#!/usr/bin/env python3
"""Solves, scores and times ricochet from Python beside the peers of PyPI; see docs/notes/peers.md.

    scripts/bench --peers pypi                     all of it, or the rest of what was interrupted
    scripts/bench --peers pypi --only ball         the problems whose name contains this
    scripts/bench --peers pypi --peer heyoka       this peer beside ricochet
    scripts/bench --peers pypi --fresh             from the beginning
    scripts/bench --peers pypi --keep              renews docs/notes/peers.md

Every cell (problem, peer, setting) has a process of its own, pinned to one core. An answer is scored
before it is timed. The cells of a problem are timed in turns of random order, and the least processor
time of a run counts; a second pass over all problems takes the other half of the samples. Each cell leaves a JSON file in build/peers-pypi/cells, so that
the same command goes on where it ended.
"""
import argparse
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
FOLDER = ROOT / "build/peers-pypi"
sys.path[:0] = [str(HERE), str(HERE.parent / "report")]

import environment  # noqa: E402
import peers_page  # noqa: E402
import problems as asked  # noqa: E402
import run as report  # noqa: E402
from scoring import is_wrong, scored  # noqa: E402

PATIENCE = 90  # [s] of processor time for the first answer, which may be compiled first
LONGEST = 3600  # [s] of a wait
# Programs of cells; those with True need ricochet, and run in the interpreter that it was built for.
PROGRAMS = {"peer_ricochet.py": True, "scenes_ricochet.py": True, "peer_heyoka.py": False,
            "peer_diffrax.py": False, "peer_solvers.py": False, "bodies_engines.py": False,
            "fmu_fmpy.py": False, "peer_torchdiffeq.py": False}
YARDSTICK = """
import sys, time
for line in sys.stdin:
    start, total = time.process_time(), 0
    for k in range(20 * 100000):
        total += k
    print('{"seconds": %r}' % (time.process_time() - start), flush=True)
"""


def listing(absent, options):
    """Cells with their commands, and the versions of what they use."""
    cells, versions = [], {}
    for program, needs_ricochet in PROGRAMS.items():
        if set(peers_page.PEERS_OF[program]) <= set(absent):
            continue
        python = options.python if needs_ricochet else environment.python_of(FOLDER)
        command = [str(python), str((HERE / program).relative_to(ROOT))]
        found = subprocess.run(command + ["list"], cwd=ROOT, capture_output=True, text=True)
        try:
            listed = json.loads(found.stdout)
        except ValueError:
            peers = peers_page.PEERS_OF[program]
            why = environment.last_line(found.stderr)
            absent.update({peer: absent.get(peer, f"cannot be imported: {why}") for peer in peers})
            if needs_ricochet:
                sys.exit(f"peers.py: {' '.join(command)} list: {why}\npeers.py: build ricochet_python first, or say "
                         "with --module and --python where the package is")
            continue
        versions |= listed["versions"]
        cells += [cell | {"command": command + ["serve", cell["name"]]} for cell in listed["cells"]
                  if cell["peer"] not in absent]
    return cells, versions


class Worker(report.Worker):
    """A process that solves one cell; what it may take is counted in processor time, not on a busy clock.

    It is read from outside, since a limit of the process would make its own clock coarse.
    """

    def ask(self, line, patience=LONGEST):
        answered = threading.Event()

        def watch():
            while not answered.wait(1):
                if processor_time(self.process.pid) > PATIENCE and line == "solve":
                    self.spent = True
                    self.process.kill()
                    return
        threading.Thread(target=watch, daemon=True).start()
        try:
            return super().ask(line, patience)
        except report.PeerFailed as failure:
            if getattr(self, "spent", False):
                raise report.PeerFailed(f"no answer within {PATIENCE} s of processor time") from failure
            raise
        finally:
            answered.set()


def processor_time(pid):
    """Of a process [s], 0 where it has ended."""
    try:
        words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def solve(cell, problem, core):
    """The row of a cell, and its worker if it may be timed."""
    row = report.row_of(cell, core)
    worker = Worker(cell["command"], core)
    try:
        answer = worker.ask("solve")
    except report.PeerFailed as failure:
        row["failed"] = str(failure)
        worker.close()
        return row, None
    row |= scored(answer, problem) | {"first": answer["first"]}
    if is_wrong(row, problem["kind"]):
        worker.close()
        return row, None
    return row, worker


def run_problem(name, problem, cells, done, clock, options):
    """Rows of a problem after `done` + 1 passes; what is stored is not run again."""
    rows, todo = [], []
    for cell in cells:
        file = report.file_of(FOLDER / "cells", cell["name"])
        row = json.loads(file.read_text()) if file.exists() else None
        if row and (row["passes"] > done or "rounds" not in row or report.share(row) == 0):
            rows.append(row)
        else:
            todo.append((cell, row))
    if not todo:
        return rows
    began = time.monotonic()
    print(f"{name}, pass {done + 1}: {len(todo)} cells ", end="", flush=True)
    # A few at a time, so that an interrupt loses little and processes stay few.
    for first in range(0, len(todo), options.together):
        rows += run_some(todo[first:first + options.together], problem, done, clock, options)
    print(f" {time.monotonic() - began:.0f} s", flush=True)
    return rows


def run_some(todo, problem, done, clock, options):
    yardstick = Worker([sys.executable, "-c", YARDSTICK], options.core)
    pairs = []
    try:
        for cell, row in todo:
            if row is None:
                pairs.append(solve(cell, problem, options.core))
            else:
                worker = Worker(cell["command"], options.core)
                pairs.append((row, worker))
                try:
                    worker.ask("time 1")
                except report.PeerFailed as failure:
                    row["failed"] = str(failure)
            print(".", end="", flush=True)
        clock.run([(row, worker) for row, worker in pairs if worker and "failed" not in row], yardstick)
    finally:
        yardstick.close()
        for _, worker in pairs:
            if worker:
                worker.close()
    for row, _ in pairs:
        row["passes"] = done + 1
        file = report.file_of(FOLDER / "cells", row["name"])
        part = file.with_suffix(".part")
        part.write_text(json.dumps(row))
        part.rename(file)
    return [row for row, _ in pairs]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="problems whose name contains this")
    parser.add_argument("--peer", help="this peer alone, beside ricochet")
    parser.add_argument("--with", dest="wished", action="append", default=[], metavar="PEER",
                        choices=sorted(environment.BY_WISH), help="installs a peer that is large")
    parser.add_argument("--renew", action="store_true", help="tries again to install what was not there")
    parser.add_argument("--fresh", action="store_true", help="does not go on with older rows")
    parser.add_argument("--keep", action="store_true", help="renews docs/notes/peers.md")
    parser.add_argument("--module", type=Path, default=ROOT / "build/release/python",
                        help="folder that has the package ricochet")
    parser.add_argument("--python", default=report.PYTHON, help="the interpreter that it was built for")
    parser.add_argument("--program", type=Path, default=ROOT / "build/release/bin/ricochet",
                        help="the command line, which exports the FMUs")
    parser.add_argument("--passes", type=int, default=report.PASSES, choices=(1, 2), help="over all problems")
    parser.add_argument("--rounds", type=int, default=12, help="most samples of a cell")
    parser.add_argument("--sample", type=float, default=0.02, help="[s] shortest sample")
    parser.add_argument("--seconds", type=float, default=0.5, help="[s] for the samples of a cell")
    parser.add_argument("--together", type=int, default=12, help="cells that take turns")
    parser.add_argument("--core", type=int, default=None, help="core to pin to; default: the last")
    options = parser.parse_args()
    allowed = sorted(os.sched_getaffinity(0))
    options.core = allowed[-1] if options.core is None else options.core
    if options.core not in allowed:
        parser.error(f"--core is {options.core}; expected one of {allowed}")
    return options


def export_fmus(program):
    """ball2.fmu and ball3.fmu in the folder; the reason where they cannot be made."""
    for version in ("2", "3"):
        command = [program, "fmu", "export", "bouncing-ball", "--fmi", version, "-o", FOLDER / f"ball{version}.fmu"]
        try:
            said = subprocess.run(command, capture_output=True, text=True)
        except OSError as error:
            return str(error)
        if said.returncode != 0:
            return environment.last_line(said.stderr)
    return ""


def main():
    options = arguments()
    report.PASSES = options.passes
    os.environ |= {"PYTHONPATH": str(options.module.resolve()), "PYTHONDONTWRITEBYTECODE": "1",
                   "RICOCHET_FMUS": str(FOLDER)}
    absent = environment.make(FOLDER, options.wished, options.renew)
    no_fmus = export_fmus(options.program)
    cells, versions = listing(absent, options)
    chosen = [cell for cell in cells if options.only in cell["problem"]
              and (options.peer is None or cell["peer"] in (options.peer, "ricochet"))]
    known = {name: problem for name, problem in asked.problems().items() if options.only in name}
    if no_fmus:
        print(f"no FMUs: {no_fmus}")
        known.pop("fmu-ball", None)
    (FOLDER / "cells").mkdir(exist_ok=True)
    if options.fresh:
        for cell in chosen:
            report.file_of(FOLDER / "cells", cell["name"]).unlink(missing_ok=True)
    clock, load = report.Clock(options), [os.getloadavg()[0]]
    for done in range(options.passes):
        rows = []
        for name, problem in known.items():
            rows += run_problem(name, problem, [cell for cell in chosen if cell["problem"] == name], done, clock,
                                options)
            load.append(os.getloadavg()[0])
    found = {"machine": report.machine(), "versions": versions, "absent": absent, "rows": rows, "load": load,
             "passes": options.passes, "rounds": options.rounds, "yardstick": clock.yardstick}
    (FOLDER / "peers.json").write_text(json.dumps(found))
    text = peers_page.page(found, asked.problems() if not options.only else known)
    (FOLDER / "peers.md").write_text(text)
    print(f"{FOLDER / 'peers.md'}: {len(rows)} cells")
    if options.keep:
        peers_page.keep(text, ROOT)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("\npeers.py: interrupted; the same command goes on from here")
