#!/usr/bin/env python3
"""Counts the instructions of the library's hot paths and compares them with the stored counts.

    bench/instructions.py build/release/bin/ricochet_paths             fails where a path differs
    bench/instructions.py build/release/bin/ricochet_paths --update    stores the counts of today

Counts do not depend on what else the machine does, but on the compiler and the C library, whose
versions are stored with them: under others nothing is compared (exit status 77, "skipped"). A change
that is meant to move a count comes with the file renewed. Needs valgrind.
"""
import argparse
import json
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

STORED = Path(__file__).resolve().parent / "instructions.json"
TOLERANCE = 0.03
SKIPPED = 77


def made_by():
    compiler = subprocess.run(["c++", "-dumpfullversion"], capture_output=True, text=True)
    return {"compiler": compiler.stdout.strip(), "libc": " ".join(platform.libc_ver()),
            "machine": platform.machine()}


def count(program, path):
    run = subprocess.run(["valgrind", "--tool=callgrind", "--callgrind-out-file=/dev/null",
                          "--toggle-collect=ricochet_measured_path", program, path],
                         capture_output=True, text=True)
    found = re.search(r"Collected : (\d+)", run.stderr)
    if run.returncode != 0 or not found:
        sys.exit(f"instructions.py: '{path}' failed: {run.stderr[-300:]}")
    return int(found.group(1))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--update", action="store_true")
    options = parser.parse_args()
    if not shutil.which("valgrind"):
        print("instructions.py: found no valgrind; on Debian: apt-get install valgrind")
        return SKIPPED
    names = subprocess.run([options.program], check=True, capture_output=True,
                           text=True).stdout.splitlines()
    if options.update:
        counts = {name: count(options.program, name) for name in names}
        STORED.write_text(json.dumps({"made_by": made_by(), "counts": counts}, indent=2) + "\n")
        return 0
    stored = json.loads(STORED.read_text())
    if stored["made_by"] != made_by():
        print(f"instructions.py: the stored counts are of {stored['made_by']}, this is "
              f"{made_by()}; nothing is compared")
        return SKIPPED
    failed = 0
    for name in names:
        now, then = count(options.program, name), stored["counts"].get(name)
        change = now / then - 1 if then else float("nan")
        good = abs(change) <= TOLERANCE
        failed += not good
        print(f"{'pass' if good else 'FAIL':<5}{name:<42}{now:>12}  "
              + (f"{100 * change:+.1f} %" if then else "not stored"))
    gone = stored["counts"].keys() - set(names)
    if failed or gone:
        print(f"{failed} of {len(names)} paths differ by more than {100 * TOLERANCE:g} %"
              + (f", and there is none of {sorted(gone)}" if gone else "")
              + "; where that is meant, store the counts by --update and commit them")
    return 1 if failed or gone else 0


if __name__ == "__main__":
    sys.exit(main())
