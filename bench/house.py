#!/usr/bin/env python3
"""What the library weighs: headers, lines, and what a user's file costs to compile.

usage: bench/house.py           counts and compile times, one line for each target
       bench/house.py --clone   times a fresh clone: demo, the whole build, the quick tests

Exit status 1 where a target is missed. The yardstick is the processor time of g++ for a file that
includes <Eigen/Dense> and inverts a matrix of 3 x 3, at -O2: 1 s on the reference machine. Processor
times of the compiler are the least of three, and given in yardsticks; the raw ones stand beside them.
Times of a clone are what the clock shows. Needs universal-ctags.
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
BEFORE = 21061  # lines of integrate, detect, locate, hybrid, sensitivity and nonsmooth in d7ce008,
                # the last commit before the core was compiled
ENGINE = ("core", "integrate", "detect", "locate", "hybrid", "sensitivity", "nonsmooth")
LOOP = ("core", "integrate", "detect", "locate", "hybrid", "detail")

OWN_SYSTEM = """
#include <array>
#include <cstdio>
#include <ricochet/integrate/integrate.hpp>
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


def headers(room=""):
    return [path for path in sorted((ROOT / "include" / "ricochet" / room).rglob("*.hpp"))
            if "detail" not in path.parts]


def lines_of(paths):
    return sum(path.read_bytes().count(b"\n") for path in paths)


def sources(*rooms):
    return [path for room in rooms for top in ("include/ricochet", "src")
            for path in sorted((ROOT / top / room).rglob("*.?pp"))]


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


def functions(*rooms):
    """(lines, number of parameters, name) of every function that has a body."""
    listed = "\n".join(map(str, sources(*rooms)))
    found = subprocess.run(
        ["ctags", "--languages=C++", "--kinds-C++=f", "--fields=neS", "-f", "-", "-L", "-"],
        input=listed, text=True, capture_output=True, check=True).stdout
    for row in found.splitlines():
        name, _, *fields = row.split("\t")
        known = dict(field.split(":", 1) for field in fields if ":" in field)
        if name.startswith("!") or "end" not in known:
            continue
        inner = re.sub(r"<[^<>()]*>", "", known.get("signature", "()"))[1:]
        length = int(known["end"]) - int(known["line"]) + 1
        yield length, inner.count(",") + 1, name


def counts():
    public = len(headers())
    line(public <= 60, "public headers", "<= 80, then 60", f"{public} of C++, and ricochet.h for C")
    text = subprocess.run(["g++", "-std=c++20", "-E", f"-I{ROOT}/include",
                           ROOT / "include/ricochet/ricochet.hpp"], check=True, capture_output=True)
    count = text.stdout.count(b"\n")
    line(count <= 100000, "preprocessed lines of ricochet.hpp", "<= 100000", str(count))
    whole = lines_of(sources(""))
    rooms = sorted({path.name for path in (ROOT / "src").iterdir() if path.is_dir()} | {"detail"})
    line(whole <= 48000, "lines of library, command line and bindings", "<= 48000",
         f"{whole}: " + ", ".join(f"{room} {lines_of(sources(room))}" for room in rooms))
    engine, detail = lines_of(sources(*ENGINE)), lines_of(sources("detail"))
    line(engine + detail <= 0.6 * BEFORE,
         "lines of the engine's rooms beside those before it was compiled", f"<= 60 % of {BEFORE}",
         f"{engine}, {100 * engine / BEFORE:.0f} %, and {detail} in detail/ for these and others")
    longest = max((lines_of([path]), path.name) for path in sources(*LOOP))
    line(longest[0] <= 600, "longest file of the loop's rooms and of detail", "<= 600 lines",
         f"{longest[0]}, {longest[1]}")
    found = sorted(functions(*LOOP), reverse=True)
    line(found[0][0] <= 60, "longest function of the loop's rooms and of detail", "<= 60 lines",
         ", ".join(f"{name} {length}" for length, _, name in found[:4]))
    many = [(name, count) for _, count, name in found if count > 5]
    line(not many, "functions of these with more than five parameters", "0",
         f"{len(many)} of {len(found)}" + "".join(f"; {name} {count}" for name, count in many[:8]))


def compile_times():
    readme = re.search(r"```cpp\n(// readme\.cpp.*?)```", (ROOT / "README.md").read_text(), re.S)[1]
    integrate = "#include <ricochet/integrate/integrate.hpp>\n"
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
        counts()
        compile_times()
    sys.exit(1 if missed else 0)
