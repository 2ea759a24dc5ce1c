#!/usr/bin/env python3
"""What a user's file costs to compile, and a fresh clone to build. `scripts/house` counts headers, lines and functions.

usage: bench/house.py           compile times, one line for each target
       bench/house.py --clone   times a fresh clone: demo, the whole build, the quick tests

Exit status 1 where a target is missed. The yardstick is the processor time of g++ for a file that
includes <Eigen/Dense> and inverts a matrix of 3 x 3, at -O2: 1 s on the reference machine. Processor
times of the compiler are the least of three, and given in yardsticks; the raw ones stand beside them.
Times of a clone are what the clock shows.
"""
import os
import re
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

OWN_SYSTEM = """
#include <array>
#include <cstdio>
#include <ricochet/integrate.hpp>
struct Ball {
    void flow(double, const std::array<double, 2>& x, std::array<double, 2>& dxdt) const
    {
        dxdt = {x[1], -9.81};
    }
    double guard(double, const std::array<double, 2>& x) const { return x[0]; }
    void reset(double, std::array<double, 2>& x) const { x[1] *= -0.9; }
};
int main()
{
    const auto run = ricochet::integrate(Ball{}, std::array{10.0, 0.0}, {.t_end = 20.5});
    for (const auto& impact : run.events) std::printf("%.15f s\\n", impact.t);
}
"""


YARDSTICK = """
#include <Eigen/Dense>
Eigen::Matrix3d inverse(const Eigen::Matrix3d& m) { return m.inverse(); }
"""

missed = []


def line(passed, sentence, target, measured):
    verdict = "pass" if passed else "FAIL"
    print(f"{verdict:<11} {sentence} | target: {target} | measured: {measured}", flush=True)
    if not passed:
        missed.append(sentence)


def seconds_to_compile(text, options):
    """[s] Processor time of the compiler."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder) / "main.cpp"
        source.write_text(text)
        took = []
        for _ in range(3):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run(["g++", "-std=c++20", *options, f"-I{ROOT}/include",
                            "-isystem", "/usr/include/eigen3", "-c", source,
                            "-o", f"{folder}/main.o"], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            took.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
    return min(took)


def yardstick():
    return seconds_to_compile(YARDSTICK, ["-O2"])


def preprocessed():
    text = subprocess.run(["g++", "-std=c++20", "-E", f"-I{ROOT}/include",
                           ROOT / "include/ricochet/ricochet.hpp"], check=True, capture_output=True)
    count = text.stdout.count(b"\n")
    line(count <= 100000, "preprocessed lines of ricochet.hpp", "<= 100000", str(count))


def compile_times():
    readme = re.search(r"```cpp\n(// readme\.cpp.*?)```", (ROOT / "README.md").read_text(), re.S)[1]
    integrate = "#include <ricochet/integrate.hpp>\n"
    cases = [("ten lines with an own system, -O2", OWN_SYSTEM, ["-O2"], 0.9),
             ("ten lines with the umbrella and a ready system, -O2", readme, ["-O2"], 1.0),
             ("ten lines with an own system, -O0", OWN_SYSTEM, ["-O0"], 0.7),
             ("ten lines with the umbrella and a ready system, -O0", readme, ["-O0"], 0.8),
             ("the header that everyone includes, integrate.hpp, -O2", integrate, ["-O2"], 0.5)]
    for sentence, text, options, limit in cases:
        before = yardstick()
        raw = seconds_to_compile(text, options)
        yard = min(before, yardstick())  # a disturbed yardstick would flatter
        line(raw <= limit * yard, f"{sentence}, processor time of g++", f"<= {limit} yardsticks",
             f"{raw / yard:.2f} ({raw:.2f} s here, yardstick {yard:.2f} s)")


def timed(command, folder):
    """[s] By the clock; the output goes to a log beside the clone."""
    began = time.monotonic()
    with open(f"{folder}.log", "a") as log:
        done = subprocess.run(command, cwd=folder, stdout=log, stderr=log,
                              env={**os.environ, "CCACHE_DISABLE": "1"})
    return done.returncode == 0, time.monotonic() - began


def clone():
    with tempfile.TemporaryDirectory() as parent:
        folder = f"{parent}/ricochet"
        subprocess.run(["git", "clone", "-q", ROOT, folder], check=True)
        yard = yardstick()
        good, demo = timed(["scripts/demo"], folder)
        line(good and demo <= 120, "fresh clone, no cache: scripts/demo", "<= 180 s, then 120 s",
             f"{demo:.0f} s, yardstick {yard:.2f} s")
        good, rest = timed(["scripts/setup"], folder)
        line(good and demo + rest <= 360, "fresh clone, no cache: everything with its tests",
             "<= 480 s, then 360 s", f"{demo + rest:.0f} s")
        good, tests = timed(["scripts/test"], folder)
        log = Path(f"{folder}.log").read_text()
        summary = re.findall(r"\d+% tests passed.*", log)
        line(good and tests <= 180, "fresh clone: scripts/test", "<= 240 s, then 180 s",
             f"{tests:.0f} s; {summary[-1] if summary else 'no summary of ctest'}; "
             f"{log.count('warning:')} warnings of the compiler")
        if not good:
            (ROOT / "build/release/measure-clone.log").write_text(log)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--clone"]:
        clone()
    else:
        preprocessed()
        compile_times()
    sys.exit(1 if missed else 0)
