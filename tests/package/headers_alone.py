#!/usr/bin/env python3
"""Compiles each installed header by itself, with nothing installed but its component and what that stands on.

usage: headers_alone.py BUILD_TREE COMPILER [OPTION ...]

A header that includes one of a peer that is not there (hosts) is skipped.
"""
import os
import re
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

STANDS_ON = {
    "c": [],
    "core": [],
    **{room: ["core"] for room in ("taylor", "nonsmooth", "sensitivity", "scene", "hosts", "learn", "fmi")},
    "faults": ["nonsmooth", "core"],
    "learn_steps": ["learn", "faults", "nonsmooth", "core"],
}


def main(build, compiler, *options):
    with tempfile.TemporaryDirectory() as work:
        jobs = []
        for component in STANDS_ON:
            prefix = Path(work) / component
            subprocess.run(["cmake", "--install", build, "--prefix", prefix, "--component", component],
                           check=True, stdout=subprocess.DEVNULL)
            if component == "fmi" and not prefix.exists():
                continue  # built where its packages are
            headers = [h for h in sorted((prefix / "include").rglob("*.h*")) if h.suffix in (".h", ".hpp")]
            if not headers:
                sys.exit(f"{component}: no header is installed")
            paths = [f"-I{Path(work) / part}/include" for part in (component, *STANDS_ON[component])]
            jobs += [(component, str(h.relative_to(prefix / "include")), paths) for h in headers]

        def compiles(job):
            component, header, paths = job
            run = subprocess.run([compiler, "-std=c++20", "-fsyntax-only", *options, *paths, "-x", "c++", "-"],
                                 input=f"#include <{header}>\n", capture_output=True, text=True)
            if run.returncode == 0:
                return "compiles"
            missing = re.search(r"fatal error: '?([^\s:']+)'?(?:: No such file| file not found)", run.stderr)
            if missing and not missing[1].startswith("ricochet/"):
                return "skipped"
            print(f"{component}: {header}\n{run.stderr[:1000]}", flush=True)
            return "fails"

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            results = list(zip(jobs, pool.map(compiles, jobs)))
        for component in STANDS_ON:
            mine = [result for (of, _, _), result in results if of == component]
            print(f"{component}: " + ", ".join(f"{mine.count(r)} {r}" for r in sorted(set(mine))))
        return 1 if any(result == "fails" for _, result in results) else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
