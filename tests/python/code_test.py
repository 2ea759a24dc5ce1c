"""Formulas give the same bits whether they are interpreted, made into code, or written in C++."""

import ctypes
import gc
import math
import os
import random
import shutil
import struct
import subprocess
import sys
import textwrap
import time

import numpy as np
import pytest

import ricochet
from ricochet import _ricochet

TWO = {"add": "a + b", "subtract": "a - b", "multiply": "a * b", "divide": "a / b",
       "power": "std::pow(a, b)", "atan2": "std::atan2(a, b)", "hypot": "std::hypot(a, b)"}
ONE = {"negate": "-a", **{name: f"std::{name}(a)" for name in (
    "sqrt", "cbrt", "exp", "log", "sin", "cos", "tan", "asin", "acos", "atan", "sinh", "cosh", "tanh")}}
COUNT = 1000


def has_code():
    formula = _ricochet.Formula(1, [([("component", 0, 0, 0.0)], [0])])
    return formula.values(0.0, [1.0], 1, True) is not None


needs_code = pytest.mark.skipif(not has_code(), reason="this build or processor makes no code")


class Random:
    """A formula of random operations: its operations, as the module takes them, and results."""

    def __init__(self, seed):
        rng = random.Random(seed)
        self.components = rng.randint(1, 4)
        self.ops = [("component", i, 0, 0.0) for i in range(self.components)] + [("time", 0, 0, 0.0)]
        for _ in range(rng.randint(1, 24)):
            self._add(rng)
        last = len(self.ops) - 1
        self.results = [rng.randint(max(0, last - 8), last) for _ in range(self.components)]
        self.guard = last
        self.t = rng.uniform(0, 2)
        self.x = [rng.choice((rng.uniform(-1.5, 1.5), rng.uniform(0.1, 1), 0.0)) for _ in range(self.components)]

    def _add(self, rng):
        def operand():
            return rng.randint(max(0, len(self.ops) - 12), len(self.ops) - 1)

        kind = rng.random()
        if kind < 0.15:
            self._constant(rng.choice((0.0, -0.0, 1.0, -1.0, 2.0, 1 / 3, rng.uniform(-2, 2))))
        elif kind < 0.7:
            a = operand()
            name = rng.choice(("add", "add", "subtract", "multiply", "multiply", "multiply", "divide",
                               "power", "atan2", "hypot"))
            b = self._constant(rng.choice((2.0, 3.0, 0.5, -1.0, 1.5, 1 / 3))) if name == "power" else operand()
            self.ops.append((name, a, b, 0.0))
        else:
            self.ops.append((rng.choice(list(ONE)), operand(), 0, 0.0))

    def _constant(self, value):
        self.ops.append(("constant", 0, 0, value))
        return len(self.ops) - 1

    @property
    def outputs(self):
        return self.results + [self.guard]

    def formula(self, outputs):
        return _ricochet.Formula(self.components, [(self.ops, outputs)])

    def in_cpp(self, number):
        lines = []
        for i, (name, a, b, value) in enumerate(self.ops):
            text = (f"x[{a}]" if name == "component" else "t" if name == "time"
                    else value.hex() if name == "constant" else TWO.get(name) or ONE[name])
            operands = f"const double a = v{a}, b = v{b}; " if name in TWO or name in ONE else ""
            lines.append(f"    double v{i}; {{ {operands}v{i} = {text}; {'(void)b; ' if operands else ''}}}")
        lines += [f"    out[{i}] = v{output};" for i, output in enumerate(self.outputs)]
        return f"static void f{number}(double t, const double* x, double* out)\n{{\n    (void)t;\n" + (
            "\n".join(lines)) + "\n}\n"


def bits(numbers):
    """The bits of numbers; of those that are none, that they are none."""
    return [None if x != x else struct.pack("<d", x) for x in numbers]


ALL = [Random(seed) for seed in range(COUNT)]


@needs_code
def test_values_by_code_have_the_bits_of_the_interpreter():
    finite = 0
    for each in ALL:
        formula = each.formula(each.outputs)
        expected = formula.values(each.t, each.x, len(each.outputs), False)
        found = formula.values(each.t, each.x, len(each.outputs), True)
        assert bits(found) == bits(expected), each.ops
        finite += all(map(np.isfinite, expected))
    assert finite > COUNT / 2  # else the comparison would be one of few numbers


@needs_code
def test_parameters_have_the_bits_of_constants():
    for each in ALL:
        constants = [value for name, _, _, value in each.ops if name == "constant"]
        numbers = iter(range(len(constants)))
        ops = [("parameter", next(numbers), 0, 0.0) if op[0] == "constant" else op for op in each.ops]
        expected = each.formula(each.outputs).values(each.t, each.x, len(each.outputs), False)
        formula = _ricochet.Formula(each.components, [(ops, each.outputs)])
        for by_code in (False, True):
            found = formula.values(each.t, each.x, len(each.outputs), by_code, constants)
            assert bits(found) == bits(expected), each.ops


@needs_code
@pytest.mark.parametrize("order", (12, 20))
def test_series_by_code_have_the_bits_of_the_interpreter(order):
    made, finite = 0, 0
    for each in ALL:
        flow, guard = each.formula(each.results), each.formula([each.guard])
        try:
            expected = flow.series(guard, each.t, each.x, order, False)
        except ValueError:  # a constant that is not finite
            continue
        found = flow.series(guard, each.t, each.x, order, True)
        if found is None:  # too many operations
            continue
        made += 1
        for mine, other in zip(found, expected):
            assert bits(mine) == bits(other), each.ops
        finite += all(map(np.isfinite, expected[0]))
    assert made > 0.95 * COUNT and finite > COUNT / 4


def test_values_have_the_bits_of_cpp(tmp_path):
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no compiler of C++")
    table = ", ".join(f"f{number}" for number in range(COUNT))
    source = tmp_path / "formulas.cpp"
    source.write_text("#include <cmath>\n" + "".join(each.in_cpp(i) for i, each in enumerate(ALL)) + (
        f"static void (*const all[])(double, const double*, double*) = {{{table}}};\n"
        'extern "C" void evaluate(int which, double t, const double* x, double* out)\n'
        "{\n    all[which](t, x, out);\n}\n"))
    library = tmp_path / "formulas.so"
    subprocess.run([compiler, "-O0", "-ffp-contract=off", "-shared", "-fPIC", "-o", library, source], check=True)
    evaluate = ctypes.CDLL(str(library)).evaluate
    for number, each in enumerate(ALL):
        x, out = (ctypes.c_double * 4)(*each.x), (ctypes.c_double * 5)()
        evaluate(number, ctypes.c_double(each.t), x, out)
        count = len(each.outputs)
        found = each.formula(each.outputs).values(each.t, each.x, count, False)
        assert bits(found) == bits(out[:count]), each.ops


RUNS = textwrap.dedent("""
    import hashlib
    import numpy as np
    import ricochet


    def henon(t, x):
        return [x[2], x[3], -x[0] - 2 * x[0] * x[1], x[1] * x[1] - x[1] - x[0] * x[0]]


    class Ball(ricochet.System):
        formula = 2
        restitution = 0.8

        def flow(self, t, x):
            return [x[1], -9.81 - 0.01 * x[1] * np.tanh(x[1])]

        def guard(self, t, x):
            return x[0]

        def reset(self, t, x):
            return [0.0, -self.restitution * x[1]]


    def chain(t, x):
        return [*x[3:], -np.sin(x[0]) + 0.1 * (x[1] - x[0]), -np.sin(x[1]) + 0.1 * (x[0] + x[2] - 2 * x[1]),
                -np.sin(x[2]) + 0.1 * (x[1] - x[2])]


    def switched(mode, t, x):
        return [1.0 - 0.3 * x[0] if mode == "on" else -0.5 * x[0]]


    def switches(mode, t, x):
        return "off" if mode == "on" else "on"


    cross = ricochet.Guard(lambda t, x: x[0], direction=1)
    thermostat = ricochet.System(switched, [
        ricochet.Guard(lambda mode, t, x: 2 - x[0], reset=switches, in_modes=["on"]),
        ricochet.Guard(lambda mode, t, x: x[0] - 1, reset=switches, in_modes=["off"])],
        modes=("on", "off"), formula=1)
    digest = hashlib.sha256()
    for system, x0, t_end in ((ricochet.System(henon, [cross], formula=4), [-0.25, -0.2, 0.0, 0.26], 60.0),
                              (Ball(), [10.0, 0.0], 12.0), (ricochet.System(henon, formula=4), [-0.25, -0.2, 0.0, 0.26], 30.0),
                              (thermostat, [1.5], 30.0), (ricochet.System(chain, [cross], formula=6), [1.0, 0.2, 0.0, 0.0, 0.1, 0.0], 20.0)):
        for method in "taylor", "dopri5", "fehlberg78":
            for _ in range(2):
                for options in {}, {"detector": "bernstein"}, {"locator": "bisection"}, {"record_steps": True}:
                    run = ricochet.integrate(system, x0, t_end, method=method, rtol=1e-12, atol=1e-12, **options)
                    for part in run.x, run.events["t"], run.events["slope"], run.events["before"], run.events["after"]:
                        digest.update(np.ascontiguousarray(part).tobytes())
                    if options == {"locator": "bisection"}:
                        continue
                    digest.update(repr((str(run.outcome), run.statistics.steps, len(run.events))).encode())
    print(digest.hexdigest())
""")


def output_of(program, **environment):
    path = os.pathsep.join([os.path.dirname(os.path.dirname(ricochet.__file__)), os.environ.get("PYTHONPATH", "")])
    run = subprocess.run([sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": path, **environment},
                         capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    return run.stdout


@needs_code
def test_runs_have_the_same_bits_without_code():
    # Flows, guards, resets and series, of small and larger states; each run again once there is code.
    assert output_of(RUNS) == output_of(RUNS, RICOCHET_CODE="0")


@needs_code
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a file of Linux")
def test_no_memory_is_writable_and_executable():
    system = ricochet.System(lambda t, x: [x[1], -np.sin(x[0])], [lambda t, x: x[0]], formula=2)
    for method in "taylor", "dopri5":
        for _ in range(3):
            ricochet.integrate(system, [1.0, 0.0], 100.0, method=method, rtol=1e-12)
    with open("/proc/self/maps") as maps:
        rights = [line.split()[1] for line in maps if len(line.split()) == 5]  # of no file
    assert any("x" in each for each in rights)
    assert not any("w" in each and "x" in each for each in rights)


@needs_code
@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="a system call of Linux")
def test_refused_memory_means_the_interpreter():
    # PR_SET_MDWE: from here on memory that was writable cannot become executable (Linux 6.3).
    refuse = textwrap.dedent("""
        import ctypes, sys
        refused = ctypes.CDLL(None).prctl(65, 1, 0, 0, 0) == 0
        from ricochet import _ricochet
        formula = _ricochet.Formula(1, [([("component", 0, 0, 0.0)], [0])])
        print("refused" if refused and formula.values(0.0, [1.0], 1, True) is None else "not refused")
    """)
    first, *rest = output_of(refuse + RUNS).splitlines()
    if first != "refused":
        pytest.skip("the kernel does not refuse it")
    assert rest == output_of(RUNS).splitlines()


@needs_code
def test_code_of_thirty_operations_takes_few_microseconds_to_make():
    ops = [("component", i, 0, 0.0) for i in range(4)] + [("time", 0, 0, 0.0)]
    for i in range(15):
        ops += [("multiply", len(ops) - 1, i % 4, 0.0), ("add", len(ops), i % 4, 0.0)]
    flow = _ricochet.Formula(4, [(ops, [len(ops) - 1 - i for i in range(4)])])
    guard = _ricochet.Formula(4, [(ops, [0])])
    took, size = min(flow.time_to_make_series(guard) for _ in range(50))
    # 50 us on one core of an EPYC; a machine of the tests may be as slow as a tenth of it.
    assert 0 < took < 500 and size < 50_000


def test_threads_have_code_in_common_and_the_memory_is_given_back():
    from concurrent.futures import ThreadPoolExecutor

    def ends(rate):
        system = ricochet.System(lambda t, x: [rate * x[1], -np.sin(x[0])], [lambda t, x: x[0]], formula=2)
        with ThreadPoolExecutor(4) as threads:
            return set(threads.map(lambda _: ricochet.integrate(
                system, [1.0, 0.0], 20.0, method="taylor", rtol=1e-12).x[0], range(20)))

    def mappings():
        with open("/proc/self/maps") as maps:
            return sum(1 for line in maps if " r-xp " in line)

    assert all(len(ends(rate)) == 1 for rate in (1.0, 1.1, 1.2))
    if sys.platform.startswith("linux"):
        gc.collect()
        before = mappings()
        for i in range(20):
            ends(1.0 + 0.01 * i)
        gc.collect()
        assert mappings() <= before + 3


@pytest.mark.parametrize("of", range(COUNT // 4))
def test_rates_are_derivatives_along_the_flow(of):
    formula = Random(of)
    guard = formula.formula([formula.guard])
    dxdt = [0.3 * (i + 1) - 0.7 for i in range(formula.components)]

    def value(s):
        x = [a + s * b for a, b in zip(formula.x, dxdt)]
        return guard.values(formula.t + s, x, 1, False)[0]

    rate = guard.rate().values(formula.t, formula.x + dxdt, 1, False)[0]
    # Differences over two lengths: where they agree the formula is smooth, and their error is a third of
    # their distance, besides rounding, 1e-16 of the largest intermediate result over the length.
    h = 1e-4
    near, far = ((value(s) - value(-s)) / (2 * s) for s in (h / 2, h))
    if not (math.isfinite(near) and abs(near) < 1e3 and abs(near - far) < 1e-5):
        pytest.skip("no smooth formula here")
    if not math.isfinite(rate):
        pytest.skip("an operation at the edge of its domain, such as hypot(0, 0): a run takes a difference")
    assert abs(rate - near) <= 2 * abs(near - far) + 1e-7 * (1 + abs(near))


def test_rates_of_every_operation():
    # Of each f(a(t), b(t)) with a = x0, b = x1 at a point inside all domains, by complex steps where NumPy has them.
    ops = [("component", 0, 0, 0.0), ("component", 1, 0, 0.0)]
    x, dxdt = [0.4, 0.7], [0.9, -0.6]
    two = {"add": lambda a, b: a + b, "subtract": lambda a, b: a - b, "multiply": lambda a, b: a * b,
           "divide": lambda a, b: a / b, "power": lambda a, b: a ** b,
           "atan2": lambda a, b: np.arctan(a / b), "hypot": lambda a, b: np.sqrt(a * a + b * b)}
    one = {"negate": lambda a: -a, "cbrt": lambda a: a ** (1 / 3), "asin": np.arcsin, "acos": np.arccos,
           "atan": np.arctan, **{name: getattr(np, name) for name in (
               "sqrt", "exp", "log", "sin", "cos", "tan", "sinh", "cosh", "tanh")}}
    assert set(two) == set(TWO) and set(one) == set(ONE)
    a, b = (complex(value, 1e-30 * slope) for value, slope in zip(x, dxdt))
    for name, function in (*two.items(), *one.items()):
        binary = name in two
        formula = _ricochet.Formula(2, [(ops + [(name, 0, 1 if binary else 0, 0.0)], [2])])
        expected = (function(a, b) if binary else function(a)).imag * 1e30
        rate = formula.rate()
        for by_code in (False, True) if has_code() else (False,):
            found = rate.values(0.0, x + dxdt, 1, by_code)[0]
            assert abs(found - expected) <= 8e-16 * (1 + abs(expected)), name
