#!/usr/bin/env python3
"""Solves, scores and times the cells of the report, and writes it; see scripts/bench.

Every cell (problem, peer, setting) runs in processes of its own, pinned to one core, which solve
and repeat on request. An answer is scored before it is timed; the cells of a problem are timed in
turns, in blocks of random order, so that what the machine does meanwhile falls on all alike. A
second pass over all problems takes the other half of the samples, minutes later and in other
processes. Each cell leaves a JSON file, and a report that was interrupted goes on where it ended.
The files are kept apart by a hash of the programs, so that another build starts anew.
"""
import argparse
import hashlib
import json
import os
import random
import re
import select
import subprocess
import sys
import time
from pathlib import Path

import page
from compare import verdict
from keep import keep
from score import score, scored_as_wrong

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
PYTHON = "/usr/bin/python3"  # Debian's, which has Debian's SciPy and Siconos
PROGRAM = "build/release/bin/ricochet_report"
MAP = "build/release/bin/ricochet_map"
PROGRAMS = [[PROGRAM], [PYTHON, "bench/report/scipy_peer.py"],
            [PYTHON, "bench/report/siconos_peer.py"]]
PACKAGES = {"CVODE": "libsundials-dev", "ARKODE": "libsundials-dev", "GSL": "libgsl-dev",
            "ODE": "libode-dev", "Bullet": "libbullet-dev", "SciPy": "python3-scipy",
            "Siconos": "python3-siconos"}
PATIENCE = 20  # [s] for one answer
PASSES = 2  # what slows some cells for minutes, or the memory of one process, does not meet both


class PeerFailed(Exception):
    """What a peer did instead of answering, as a clause."""


class Worker:
    """A process that solves one cell."""

    def __init__(self, command, core):
        pin = ["taskset", "-c", str(core)] if core is not None else []
        self.process = subprocess.Popen(pin + command, cwd=ROOT, stdin=subprocess.PIPE,
                                        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                        env=os.environ | {"OMP_NUM_THREADS": "1",
                                                          "OPENBLAS_NUM_THREADS": "1"})
        self.buffer = b""

    def ask(self, line, patience=PATIENCE):
        try:
            self.process.stdin.write(line.encode() + b"\n")
            self.process.stdin.flush()
        except BrokenPipeError:
            raise PeerFailed(self.last_words()) from None
        end = time.monotonic() + patience
        while b"\n" not in self.buffer:
            ready, _, _ = select.select([self.process.stdout], [], [],
                                        max(0.0, end - time.monotonic()))
            if not ready:
                self.close()
                raise PeerFailed(f"no answer within {patience:.0f} s")
            more = os.read(self.process.stdout.fileno(), 1 << 20)
            if not more:
                raise PeerFailed(self.last_words())
            self.buffer += more
        answer, self.buffer = self.buffer.split(b"\n", 1)
        try:
            return json.loads(answer)
        except ValueError:
            raise PeerFailed(f"answered nonsense: {answer[:60]!r}") from None

    def last_words(self):
        status = self.process.wait()
        said = self.process.stderr.read().decode(errors="replace").strip().splitlines()
        how = f"signal {-status}" if status < 0 else f"status {status}"
        return f"ended with {how}" + (f": {said[-1][:160]}" if said else "")

    def close(self):
        self.process.kill()
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout, self.process.stderr):
            pipe.close()


def listing():
    """Problems by name, cells, versions, and why a peer is not there."""
    problems, cells, versions, absent = {}, [], {}, {}
    for program in PROGRAMS:
        run = subprocess.run(program + ["list"], cwd=ROOT, capture_output=True, text=True)
        peer = {"scipy_peer.py": "SciPy", "siconos_peer.py": "Siconos"}.get(
            Path(program[-1]).name)
        try:
            listed = json.loads(run.stdout)
        except ValueError:
            words = (run.stderr.strip().splitlines() or [f"status {run.returncode}"])[-1]
            if peer is None:
                sys.exit(f"run.py: {PROGRAM} list failed: {words}")
            absent[peer] = words
            continue
        problems |= {problem["problem"]: problem for problem in listed["problems"]}
        versions |= listed["versions"]
        for cell in listed["cells"]:
            cells.append(cell | {"command": program + ["serve", cell["name"]]})
    for peer, package in PACKAGES.items():
        if peer not in versions:
            absent.setdefault(peer, f"absent when this was built; on Debian: {package}")
    return problems, cells, versions, absent


def key_of(files):
    digest = hashlib.sha256()
    for file in files:
        digest.update(file.read_bytes())
    return digest.hexdigest()[:12]


def repeat_command(cell, core):
    words = cell["command"][:-2] + ["run", cell["name"]]
    quoted = [f"'{word}'" if re.search(r"[ ,]", word) else word for word in words]
    return (f"taskset -c {core} " if core is not None else "") + " ".join(quoted)


def row_of(cell, core):
    row = {name: cell[name] for name in ("name", "problem", "peer", "how", "value")}
    return row | {"command": repeat_command(cell, core), "samples": [], "passes": 0}


def unasked(cell, core):
    return row_of(cell, core) | {"failed": "not asked: no answer at another setting"}


def solve(cell, problem, core):
    """The row of a cell, and its worker if it may be timed."""
    row = row_of(cell, core)
    worker = Worker(cell["command"], core)
    try:
        answer = worker.ask("solve")
    except PeerFailed as failure:
        row["failed"] = str(failure)
        worker.close()
        return row, None
    row |= {count: answer[count]
            for count in ("steps", "flow_calls", "guard_calls", "energy_change")}
    row |= score(answer, problem)
    if scored_as_wrong(row) and not cell["problem"].startswith("near-tangent"):
        worker.close()
        return row, None
    return row, worker


class Clock:
    """Samples of a set of workers, taken in turns."""

    def __init__(self, options):
        self.options = options
        self.random = random.Random(1)
        self.yardstick = []

    def repetitions(self, row, worker):
        """How often it runs in a sample, and how many more samples are affordable in all passes."""
        single = worker.ask("time 1")["seconds"]
        if single >= 5:
            row["samples"].append(single)
            return 1, 0
        if single < 1:  # anew, since the first run may have been slow
            single = max(worker.ask("time 1")["seconds"], 1e-7)
        n = max(1, round(self.options.sample / single))
        if n > 1:  # anew, over more than one run
            single = max(worker.ask(f"time {n}")["seconds"] / n, 1e-7)
            n = max(1, round(self.options.sample / single))
        # Of the slower cells more samples than the time says: three may all fall on a disturbance.
        affordable = max(int(self.options.seconds / (n * single)), min(8, int(3 / single)))
        return n, max(3, min(self.options.rounds, affordable))

    def run(self, timed, yardstick):
        """`timed` are pairs of row and worker; the samples are appended to the rows."""
        plans = []
        for row, worker in timed:
            try:
                if "rounds" in row:
                    worker.ask("time 1")
                else:
                    row["runs"], row["rounds"] = self.repetitions(row, worker)
                plans.append((row, worker, share(row)))
            except PeerFailed as failure:
                row["failed"] = str(failure)
        turns = max((plan[2] for plan in plans), default=0)
        for turn in range(turns):
            self.random.shuffle(plans)
            self.yardstick.append(yardstick.ask("time 20")["seconds"] / 20 / 100000)
            for row, worker, rounds in plans:
                # Few samples are spread over all turns, so that one disturbance does not meet all.
                if turn * rounds % turns >= rounds or "failed" in row:
                    continue
                try:
                    runs = row["runs"]
                    row["samples"].append(worker.ask(f"time {runs}")["seconds"] / runs)
                except PeerFailed as failure:
                    row["failed"] = str(failure)
            print(".", end="", flush=True)


def share(row):
    """Samples of a cell in its next pass; those of all passes are `rounds`."""
    def until(passes):
        return -(-row["rounds"] * passes // PASSES)
    return until(row["passes"] + 1) - until(row["passes"])


def file_of(directory, name):
    return directory / (re.sub(r"[^A-Za-z0-9.+-]", "_", name) + ".json")


def solved(cells, problem, options):
    """Rows of cells and their workers, where they may be timed."""
    out = []
    mute = set()  # ways that have given no answer; the other settings would cost as much
    for cell in cells:
        way = (cell["peer"], cell["how"])
        if way in mute:
            row, worker = unasked(cell, options.core), None
        else:
            row, worker = solve(cell, problem, options.core)
        if "no answer" in row.get("failed", ""):
            mute.add(way)
        out.append((row, worker))
    return out


def run_problem(problem, cells, done, options, clock, directory):
    """Rows of one problem after `done` + 1 passes; what is stored is not run again."""
    rows, todo = [], []
    for cell in cells:
        file = file_of(directory, cell["name"])
        row = json.loads(file.read_text()) if file.exists() else row_of(cell, options.core)
        if row["passes"] > done or "failed" in row:
            rows.append(row)
        elif done > 0 and ("rounds" not in row or share(row) == 0):
            rows.append(row)
        else:
            todo.append((cell, row))
    if not todo:
        return rows
    began = time.monotonic()
    print(f"{problem['problem']}: {len(todo)} cells ", end="", flush=True)
    yardstick = Worker([PROGRAM, "serve", "yardstick/odeint/rk4"], options.core)
    pairs = []
    try:
        if done == 0:
            pairs = solved([cell for cell, _ in todo], problem, options)
        else:
            pairs = [(row, Worker(cell["command"], options.core)) for cell, row in todo]
        clock.run([(row, worker) for row, worker in pairs if worker], yardstick)
    finally:
        yardstick.close()
        for _, worker in pairs:
            if worker:
                worker.close()
    for row, _ in pairs:
        row["passes"] = done + 1
        file = file_of(directory, row["name"])
        part = file.with_suffix(".part")
        part.write_text(json.dumps(row))
        part.rename(file)
    print(f" {time.monotonic() - began:.0f} s", flush=True)
    return rows + [row for row, _ in pairs]


def pays():
    """What the programs of pays.cpp say, and their sizes; those that are not there are left out."""
    out = []
    for thing in ("flow", "floor", "modes", "recording", "planning", "network", "taylor",
                  "sensitivities", "friction"):
        program = ROOT / f"build/release/bin/ricochet_pays_{thing}"
        if not program.exists():
            continue
        try:
            said = subprocess.run([program], capture_output=True, text=True, timeout=PATIENCE)
            size = subprocess.run(["size", program], capture_output=True, text=True)
            symbols = subprocess.run(["nm", "-C", "--defined-only", program], capture_output=True,
                                     text=True)
            ours = sum(" ricochet::" in line for line in symbols.stdout.splitlines())
            out.append(json.loads(said.stdout) | {
                "thing": thing, "text": int(size.stdout.splitlines()[1].split()[0]),
                "symbols": ours})
        except (ValueError, IndexError, OSError, subprocess.TimeoutExpired) as error:
            out.append({"thing": thing, "failed": str(error)})
    return out


def guard_map(options):
    """What ricochet_map says, which is kept; nothing where it is not asked for, or not there."""
    program = ROOT / MAP
    if options.only not in "map" or not program.exists():
        return None
    file = ROOT / "build/bench/cells" / f"map-{key_of([program])}.json"
    if file.exists() and not options.fresh:
        return json.loads(file.read_text())
    command = ["taskset", "-c", str(options.core), MAP]
    print("map ", end="", flush=True)
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    try:
        found = json.loads(run.stdout) | {"command": " ".join(command)}
    except ValueError:
        said = (run.stderr.strip().splitlines() or ["no answer"])[-1]
        print(f"left out: {said}", flush=True)
        return None
    part = file.with_suffix(".part")
    part.write_text(json.dumps(found))
    part.rename(file)
    print(f"{found['seconds']:.0f} s", flush=True)
    return found


def machine():
    model = ""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    except OSError:
        pass
    compiler = subprocess.run(["c++", "--version"], capture_output=True, text=True).stdout
    commit = subprocess.run(["git", "rev-parse", "--short=12", "HEAD"], cwd=ROOT,
                            capture_output=True, text=True).stdout.strip()
    changed = subprocess.run(["git", "status", "--porcelain", "--untracked-files=no"], cwd=ROOT,
                             capture_output=True, text=True).stdout.strip()
    return {"processor": model, "cores": os.cpu_count(),
            "compiler": (compiler.splitlines() or ["unknown"])[0],
            "commit": commit + (" with changes" if changed else ""),
            "date": time.strftime("%Y-%m-%d")}


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", default="", help="problems whose name contains this")
    parser.add_argument("--rounds", type=int, default=15, help="most samples of a cell")
    parser.add_argument("--sample", type=float, default=0.01, help="[s] shortest sample")
    parser.add_argument("--seconds", type=float, default=0.2, help="[s] for the samples of a cell")
    parser.add_argument("--core", type=int, default=None, help="core to pin to; default: the last")
    parser.add_argument("--fresh", action="store_true", help="do not go on with an older report")
    parser.add_argument("--compare", type=Path, help="a report.json of the same commit")
    parser.add_argument("--keep", action="store_true", help="renew docs/benchmarks.md with it")
    parser.add_argument("--out", type=Path, default=ROOT / "build/bench/report")
    options = parser.parse_args()
    allowed = sorted(os.sched_getaffinity(0))
    if options.core is None:
        options.core = allowed[-1]
    if options.core not in allowed:
        sys.exit(f"run.py: --core is {options.core}; expected one of {allowed}")
    if len(allowed) > 1:  # this process stays out of the way
        os.sched_setaffinity(0, set(allowed) - {options.core})
    return options


def main():
    options = arguments()
    problems, cells, versions, absent = listing()
    programs = [ROOT / PROGRAM, Path(__file__), *sorted(HERE.glob("*_peer.py"))]
    directory = ROOT / "build/bench/cells" / key_of(programs)
    directory.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    clock = Clock(options)
    spread_file = directory / "yardstick.txt"
    chosen = {name: [cell for cell in cells if cell["problem"] == name]
              for name in problems if options.only in name}
    if options.fresh:
        spread_file.unlink(missing_ok=True)
        for cell in (cell for of in chosen.values() for cell in of):
            file_of(directory, cell["name"]).unlink(missing_ok=True)
    for done in range(PASSES):
        rows = []
        for name, of in chosen.items():
            rows += run_problem(problems[name], of, done, options, clock, directory)
            with spread_file.open("a") as file:
                file.writelines(f"{seconds}\n" for seconds in clock.yardstick)
            clock.yardstick = []
    yardstick = ([float(line) for line in spread_file.read_text().split()]
                 if spread_file.exists() else [])
    report = {"machine": machine(), "versions": versions, "absent": absent, "rows": rows,
              "yardstick": yardstick, "pays": pays(),
              "map": guard_map(options), "seconds": time.monotonic() - began,
              "problems": {name: {"title": problem["title"], "events": len(problem["times"]),
                                  "t_end": problem["t_end"]}
                           for name, problem in problems.items()}}
    older = json.loads(options.compare.read_text()) if options.compare else None
    page.write(report, older, options.out, ROOT)
    if older:
        print("\n".join(verdict(report, older)[1]).replace("**", ""))
    if options.keep:
        keep(report, options.out, ROOT)
    print(f"{options.out / 'index.html'}, {options.out / 'report.md'}: {len(rows)} cells, "
          f"{report['seconds']:.0f} s")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit("\nrun.py: interrupted; the same command goes on from here")
