#!/usr/bin/env python3
"""The playground: its closed forms, the module beside the native library, its programs, its page in a browser.

    playground_test.py forms VALUES                       native runs against their closed forms
    playground_test.py module VALUES BUILD LIBRARIES...   builds the module in BUILD and compares it

VALUES is the program of values.cpp, LIBRARIES what its programs are linked with. Exit status 77: emscripten or node is missing.
"""
import contextlib
import functools
import html
import http.server
import math
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import unittest
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]
MODE, VALUES, *REST = sys.argv[1:]
NODE = shutil.which("node") or shutil.which("nodejs")
CHROMIUM = shutil.which("chromium")

# Number of a system, its parameters; the order of play.cpp.
RUNS = """0 9.81 0.9 10 0 20.5
0 9.81 0.8 10 0 40
0 3.7 0.5 2 -3 10
1 0.3 1 0.6 60
1 0.1 0.9 0.2 80
2 9.81 0.9 1 20
2 4 1 2.5 40
3 0.1 0 30 18 22 20 60
3 0.5 10 50 17 24 23 100
4 0.8 1.4285714285714286 9.998048 20
4 1.5 2 5 30
5 100 1 1
5 10000 1 1
5 1 0.5 2
0 9.81 -2 10 0 20
1 0.3 0.5 0.6 60
9 1"""
BALL, BELT, PENDULUM, THERMOSTAT, DIODE, DISCS = range(6)


def runs_of(text):
    """Lists of (events or -1, message, rows of six numbers)."""
    runs = []
    for line in text.splitlines():
        if re.match(r"-?\d+ [A-Za-z]", line):
            count, message = line.split(" ", 1)
            runs.append((int(count), message, []))
        else:
            runs[-1][2].append([float(word) for word in line.split()])
    return runs


@functools.lru_cache(None)
def native():
    return runs_of(subprocess.run([VALUES], input=RUNS, capture_output=True, text=True, check=True).stdout)


def systems():
    return [int(line.split()[0]) for line in RUNS.splitlines()]


class Forms(unittest.TestCase):
    def test_times_agree_with_their_closed_forms(self):
        # Runs have rtol = atol = 1e-13, and take up to 1e3 steps: 1e-10 if the errors of all add up. The ball and
        # the discs have flights without an error of method: each of n adds its rounding, of the discs that of an
        # impact whose velocities are a hundredth of their terms.
        for system, (count, message, rows) in zip(systems(), native()):
            if count < 0:
                continue
            self.assertEqual(message, "the end time was reached")
            self.assertEqual(count, len(rows))
            self.assertGreater(count, 0)
            for k, row in enumerate(rows):
                rounding = (k + 1) * 2 * math.ulp(max(row[0], 1))
                allowed = rounding if system == BALL else 100 * rounding if system == DISCS else 1e-10
                self.assertLessEqual(abs(row[0] - row[2]), allowed, (system, k, row))

    def test_counts(self):
        counts = [count for count, _, _ in native()]
        self.assertEqual(counts[0], 13)
        # The digits of pi, and for equal masses three impacts: 3, 31, 314.
        self.assertEqual([counts[11], counts[12], counts[13]], [31, 314, 3])

    def test_what_is_wrong_is_said(self):
        refused = [message for count, message, _ in native() if count < 0]
        self.assertEqual(len(refused), 3)
        self.assertIn("restitution must lie in [0, 1]", refused[0])
        self.assertIn("static_friction", refused[1])
        self.assertIn("system must be 0 to 5, got 9", refused[2])

    def test_the_ball_rests_last(self):
        rows = native()[1][2]
        self.assertEqual([row[1] for row in rows], [0] * (len(rows) - 1) + [1])


class Module(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = REST[0]
        done = subprocess.run([NODE, ROOT / "tests/playground/values.cjs", cls.folder], input=RUNS, capture_output=True,
                              text=True, check=True)
        cls.runs = runs_of(done.stdout)

    def test_numbers_are_those_of_the_native_library(self):
        # To the bit, but for the pendulum: the sine of the module's C library may differ in its last place, which
        # changes a step of 1e-13 or so, of up to 1e3.
        for system, (count, message, rows), (native_count, native_message, native_rows) in zip(
                systems(), self.runs, native()):
            self.assertEqual(count, native_count)
            self.assertEqual(message, native_message)
            for row, other in zip(rows, native_rows):
                self.assertEqual(row[1], other[1])
                if system != PENDULUM:
                    self.assertEqual(row[0], other[0])
                    self.assertEqual(row[3:], other[3:])
                else:
                    self.assertLessEqual(abs(row[0] - other[0]), 1e-10)
                # In long double, whose functions are those of double in the module's C library.
                self.assertLessEqual(abs(row[2] - other[2]), 4 * math.ulp(other[2]))

    def test_programs_find_the_same_times(self):
        with tempfile.TemporaryDirectory() as into:
            subprocess.run([NODE, ROOT / "tests/playground/values.cjs", self.folder, "--programs", into], check=True)
            for program in sorted(pathlib.Path(into).glob("*.txt")):
                with self.subTest(program.stem):
                    self.check_programs(program)

    def check_programs(self, program):
        run = subprocess.run([VALUES], input=program.read_text(), capture_output=True, text=True, check=True)
        expected = [row[0] for row in runs_of(run.stdout)[0][2]]
        self.assertGreater(len(expected), 2)
        built = program.with_suffix("")
        subprocess.run(["c++", "-std=c++20", "-O1", "-I", ROOT / "include", "-isystem", "/usr/include/eigen3",
                        program.with_suffix(".cpp"), "-o", built, *REST[1:], "-lfmt", "-pthread"], check=True)
        self.assertEqual(times_of([built]), expected)
        if not os.environ.get("PYTHONPATH"):
            self.skipTest("the Python package is not built")
        found = times_of(["/usr/bin/python3", program.with_suffix(".py")])
        self.assertEqual(len(found), len(expected))
        for t, other in zip(found, expected):
            self.assertLessEqual(abs(t - other), 1e-10)

    def test_page_shows_the_numbers(self):
        if not CHROMIUM:
            self.skipTest("no chromium")
        with served(self.folder) as address:
            for system, link in ((0, "system=ball"), (9, "system=diode&resistance=1.4285714285714286&voltage=9.998048")):
                page = shown(f"{address}/index.html#{link}")
                rows = [re.findall(r"<td>([^<]*)", row) for row in re.findall(r"<tr>(<td>.*?)</tr>", page)]
                self.assertEqual([float(row[2]) for row in rows],
                                 [float(f"{row[0]:.16g}") for row in self.runs[system][2]])
                self.assertIn("How it ended: the end time was reached", page)

    def test_page_says_what_is_wrong(self):
        if not CHROMIUM:
            self.skipTest("no chromium")
        with served(self.folder) as address:
            page = shown(f"{address}/index.html#" + urllib.parse.urlencode({"system": "belt", "static-friction": "0.5"}))
        self.assertRegex(html.unescape(page), r'id="status"[^>]*class="wrong"[^>]*>[^<]*friction')

    def test_page_is_no_wider_than_a_telephone(self):
        if not CHROMIUM:
            self.skipTest("no chromium")
        frame = pathlib.Path(self.folder) / "narrow.html"
        frame.write_text("""<!doctype html><iframe id="f" width="390" height="800" src="index.html"></iframe><p id="w"></p>
<script>setTimeout(() => { const page = f.contentDocument.documentElement;
w.textContent = `width ${page.scrollWidth} rows ${f.contentDocument.querySelectorAll("tbody tr").length}`; }, 3000);</script>""")
        with served(self.folder) as address:
            page = shown(f"{address}/narrow.html")
        frame.unlink()
        width, rows = map(int, re.search(r"width (\d+) rows (\d+)", page).groups())
        self.assertLessEqual(width, 390)
        self.assertEqual(rows, 13)


def times_of(command):
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [float(t) for t in re.findall(r"^(\S+) s$", done.stdout, re.MULTILINE)]


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


@contextlib.contextmanager
def served(folder):
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder)) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def shown(address):
    """The page after its scripts have run."""
    with tempfile.TemporaryDirectory() as profile:
        command = [CHROMIUM, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={profile}",
                   "--virtual-time-budget=20000", "--timeout=60000", "--dump-dom", address]
        return subprocess.run(command, capture_output=True, text=True, check=True, timeout=300).stdout


def build():
    if not NODE:
        print("node is missing")
        sys.exit(77)
    done = subprocess.run([ROOT / "scripts/playground", REST[0]], check=False).returncode
    if done:
        sys.exit(done)


if __name__ == "__main__":
    if MODE == "module":
        build()
        del Forms
    else:
        del Module
    unittest.main(argv=sys.argv[:1])
