"""Stiff systems: Rosenbrock's method, Jacobians, and SciPy's implicit names."""

import numpy as np
import pytest

import ricochet

RATE = 1e4  # [1/s] of the fast component of `chase`


def chase(t, x):
    return [-RATE * (x[0] - np.cos(t))]


def chased(t):
    """The slow solution of `chase`: (rate^2 cos t + rate sin t) / (rate^2 + 1)."""
    return (RATE**2 * np.cos(t) + RATE * np.sin(t)) / (RATE**2 + 1)


def robertson(t, y):
    slow, fast, twice = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
    return [fast - slow, slow - fast - twice, twice]


def robertson_jacobian(t, y):
    return [[-0.04, 1e4 * y[2], 1e4 * y[1]],
            [0.04, -1e4 * y[2] - 6e7 * y[1], -1e4 * y[1]],
            [0.0, 6e7 * y[1], 0.0]]


class Counted:
    """A function that counts its calls."""

    def __init__(self, function):
        self.function, self.calls = function, 0

    def __call__(self, *given):
        self.calls += 1
        return self.function(*given)


@pytest.mark.parametrize("more", [{}, {"jacobian": lambda t, x: [[-RATE]]}, {"formula": 1}])
def test_a_fast_component_does_not_limit_the_steps(more):
    system = ricochet.System(chase, **more)
    options = dict(rtol=1e-6, atol=1e-8)
    run = ricochet.integrate(system, [chased(0.0)], 10.0, method="rosenbrock4", **options)
    # The error of every step is below 1e-6 |x| + 1e-8, and the flow forgets it before the next.
    assert abs(run.x[0] - chased(10.0)) < 2e-6
    explicit = ricochet.integrate(ricochet.System(chase), [chased(0.0)], 10.0, **options)
    # Its steps are bounded by 3.3 / RATE, so that there are 30 000 of them.
    assert explicit.statistics.steps > 25_000
    assert run.statistics.steps < 500


@pytest.mark.parametrize("method", ["Radau", "BDF", "LSODA", "rosenbrock4"])
def test_robertson_keeps_its_mass_and_meets_the_published_state(method):
    result = ricochet.solve_ivp(robertson, (0, 40), [1.0, 0.0, 0.0], method, jac=robertson_jacobian,
                                rtol=1e-8, atol=1e-12)
    assert result.success
    # Every stage of a linearly implicit method keeps a linear invariant of f and J up to the
    # rounding of the linear systems, some 1e-16 a step.
    assert np.abs(result.y.sum(axis=0) - 1).max() < 1e-12
    # Hairer and Wanner II, section IV.1: the state at t = 40 to ten digits; the tolerance is rtol with the
    # factor 10 that the accumulation over some 100 steps may make of it.
    np.testing.assert_allclose(result.y[:, -1], [0.7158270688, 9.185534765e-6, 0.2841637457],
                               rtol=1e-7)
    assert ("was run as 'rosenbrock4'" in result.message) == (method != "rosenbrock4")
    assert result.message.startswith("The solver successfully reached the end")


def test_jacobians_and_calls_are_counted():
    fun, jac = Counted(robertson), Counted(robertson_jacobian)
    result = ricochet.solve_ivp(fun, (0, 40), [1.0, 0.0, 0.0], "BDF", jac=jac, rtol=1e-6, atol=1e-10)
    assert result.njev == jac.calls > 0
    assert result.nfev == fun.calls
    # A step that was accepted has a Jacobian of its own, and a matrix of its length.
    assert result.njev >= result.statistics.steps
    assert result.nlu >= result.statistics.steps + result.statistics.rejected
    explicit = ricochet.solve_ivp(chase, (0, 0.01), [1.0])
    assert explicit.njev == explicit.nlu == 0


def test_differences_are_counted_as_calls_of_the_function():
    fun = Counted(robertson)
    result = ricochet.solve_ivp(fun, (0, 40), [1.0, 0.0, 0.0], "Radau", rtol=1e-6, atol=1e-10)
    assert result.success and result.nfev == fun.calls
    # Three components and the state itself, and at least five stages a step.
    assert result.nfev > 4 * result.njev + 5 * result.statistics.steps


def test_a_formula_counts_its_jacobians():
    system = ricochet.System(lambda t, y: robertson(t, y), formula=3)
    run = ricochet.integrate(system, [1.0, 0.0, 0.0], 40.0, method="rosenbrock4", rtol=1e-6,
                             atol=1e-10)
    by_hand = ricochet.integrate(ricochet.System(robertson, jacobian=robertson_jacobian),
                                 [1.0, 0.0, 0.0], 40.0, method="rosenbrock4", rtol=1e-6, atol=1e-10)
    counts, others = run.statistics, by_hand.statistics
    assert counts.jacobians >= counts.steps and counts.factorizations >= counts.steps
    assert abs(counts.steps - others.steps) <= 2 + 0.02 * others.steps
    np.testing.assert_allclose(run.x, by_hand.x, rtol=1e-5)


def test_counts_are_kept_in_pickles_and_simulations():
    import pickle

    simulation = ricochet.Simulation(ricochet.System(chase), [0.0], 1.0, method="rosenbrock4")
    simulation.step()
    first = simulation.run.statistics.jacobians
    run = simulation.run_to_end()
    assert 0 < first < run.statistics.jacobians
    again = pickle.loads(pickle.dumps(run))
    assert again.statistics.jacobians == run.statistics.jacobians
    assert again.statistics.factorizations == run.statistics.factorizations


class VanDerPol(ricochet.System):
    """A relaxation oscillator, whose sign is recorded."""

    stiffness = 100.0

    def flow(self, t, x):
        return [x[1], self.stiffness * (1 - x[0] * x[0]) * x[1] - x[0]]

    @ricochet.guard(direction=0)
    def sign(self, t, x):
        return x[0]


class VanDerPolByHand(VanDerPol):
    def jacobian(self, t, x):
        return np.array([[0.0, 1.0], [-2 * self.stiffness * x[0] * x[1] - 1,
                                      self.stiffness * (1 - x[0] * x[0])]])


class VanDerPolByFormula(VanDerPol):
    formula = 2


def test_events_of_a_relaxation_oscillator_do_not_depend_on_the_jacobian():
    times = [ricochet.integrate(system, [2.0, 0.0], 300.0, method="rosenbrock4", rtol=1e-8,
                                atol=1e-10).events["t"]
             for system in (VanDerPol(), VanDerPolByHand(), VanDerPolByFormula())]
    assert len(times[0]) == 3
    explicit = ricochet.integrate(VanDerPol(), [2.0, 0.0], 300.0, rtol=1e-10, atol=1e-12)
    for found in times:
        # The period of 162.8 is that of jumps whose place depends on the state by a factor of 10
        # at most: 300 rtol 10.
        np.testing.assert_allclose(found, explicit.events["t"], atol=3e-5)


def test_resets_and_modes_of_a_stiff_system():
    def flow(mode, t, x):
        return [-RATE * (x[0] - (1 if mode == "up" else -1)), 1.0]

    def turned(mode, t, x):
        return ("down" if mode == "up" else "up", [x[0], 0.0])

    system = ricochet.System(flow, [ricochet.Guard(lambda mode, t, x: 1 - x[1], reset=turned)],
                             modes=("up", "down"),
                             jacobian=lambda mode, t, x: [[-RATE, 0.0], [0.0, 0.0]])
    run = ricochet.integrate(system, [0.0, 0.0], 3.5, method="rosenbrock4")
    # The clock is linear, so that any method is exact on it.
    np.testing.assert_allclose(run.events["t"], [1, 2, 3], atol=1e-14)
    assert run.mode == "down" and abs(run.x[0] + 1) < 1e-6


def test_ready_systems_take_the_method_too():
    thermostat = ricochet.Thermostat()
    run = ricochet.integrate(thermostat, thermostat.start, 24.0, method="rosenbrock4", rtol=1e-10,
                             atol=1e-10)
    exact = [thermostat.switch_time(n) for n in range(len(run.events))]
    assert len(exact) > 5
    # Errors of 1e-10 (20 + 1) a step, at rates of 2 degrees a unit of time: 1e-9 each, some ten steps.
    np.testing.assert_allclose(run.events["t"], exact, atol=1e-8)


def test_jac_may_be_an_array_sparse_or_take_args():
    def linear(t, y, a):
        return a @ y

    a = np.array([[-1000.0, 999.0], [0.0, -1.0]])
    expected = ricochet.solve_ivp(linear, (0, 5), [1.0, 1.0], "BDF", args=(a,),
                                  jac=lambda t, y, a: a)
    given = [a, a.tolist()]
    scipy = pytest.importorskip("scipy.sparse")
    given += [scipy.csr_matrix(a), lambda t, y, a: scipy.csc_matrix(a)]
    for jac in given:
        result = ricochet.solve_ivp(linear, (0, 5), [1.0, 1.0], "BDF", args=(a,), jac=jac)
        assert np.array_equal(result.y, expected.y)
        assert result.njev == (expected.njev if callable(jac) else 0) and result.nlu == expected.nlu
    np.testing.assert_allclose(expected.y[:, -1], np.exp(-5.0), rtol=1e-2)


def test_of_one_component_jac_may_be_a_number():
    number = ricochet.solve_ivp(lambda t, y: -3 * y, (0, 1), [1.0], method="Radau", jac=lambda t, y: -3.0)
    matrix = ricochet.solve_ivp(lambda t, y: -3 * y, (0, 1), [1.0], method="Radau", jac=lambda t, y: [[-3.0]])
    assert number.success and number.y[0, -1] == matrix.y[0, -1]


def test_complex_states_have_complex_jacobians():
    w = [-1000.0 + 2.0j, -1.0 + 1.0j]

    def fun(t, y):
        # Products of numbers: NumPy's of arrays of complex numbers depend on where these are in memory.
        return [w[0] * complex(y[0]), w[1] * complex(y[1])]

    options = dict(rtol=1e-8, atol=1e-10)
    result = ricochet.solve_ivp(fun, (0, 2), np.array([1.0 + 0j, 1j]), "Radau",
                                jac=lambda t, y: np.diag(w), **options)
    # Some 100 steps with errors of 1e-8 each at most.
    np.testing.assert_allclose(result.y[:, -1], np.exp(2 * np.array(w)) * [1, 1j], atol=1e-6)
    constant = ricochet.solve_ivp(fun, (0, 2), np.array([1.0 + 0j, 1j]), "Radau", jac=np.diag(w),
                                  **options)
    assert np.array_equal(constant.y, result.y)


def test_a_compiled_jacobian_gives_the_bits_of_pythons():
    numba = pytest.importorskip("numba")
    n = numba.types

    @numba.cfunc(n.void(n.uint32, n.double, n.CPointer(n.double), n.CPointer(n.double), n.uintp, n.voidptr))
    def flow(mode, t, y, out, size, user):
        slow, fast, twice = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] * y[1]
        out[0] = fast - slow
        out[1] = slow - fast - twice
        out[2] = twice

    @numba.cfunc(n.void(n.uint32, n.double, n.CPointer(n.double), n.CPointer(n.double), n.uintp, n.voidptr))
    def jacobian(mode, t, y, rows, size, user):
        rows[0] = -0.04
        rows[1] = 1e4 * y[2]
        rows[2] = 1e4 * y[1]
        rows[3] = 0.04
        rows[4] = -1e4 * y[2] - 6e7 * y[1]
        rows[5] = -1e4 * y[1]
        rows[6] = 0.0
        rows[7] = 6e7 * y[1]
        rows[8] = 0.0

    options = dict(rtol=1e-8, atol=1e-12)
    ours = ricochet.solve_ivp(flow, (0, 40), [1.0, 0.0, 0.0], "BDF", jac=jacobian, **options)
    pythons = ricochet.solve_ivp(robertson, (0, 40), [1.0, 0.0, 0.0], "BDF", jac=robertson_jacobian,
                                 **options)
    assert np.array_equal(ours.y, pythons.y)


@pytest.mark.parametrize("jac, error, said", [
    (lambda t, y: [[1.0, 2.0]], ValueError, r"jac returned the shape \(1, 2\), expected an array of shape \(1, 1\)"),
    (lambda t, y: None, TypeError, r"jac returned a None, expected an array of shape \(1, 1\)"),
    (lambda t, y: "one", TypeError, "jac returned a str"),
    (lambda t, y: [[1j]], TypeError, "jac returned a list"),
    (lambda t, y: 1 / 0, ZeroDivisionError, "division by zero"),
    (np.ones((2, 2)), ValueError, r"jac: found shape \(2, 2\), expected a function \(t, y\) or an array of shape \(1, 1\)"),
])
def test_other_jacobians_are_refused(jac, error, said):
    with pytest.raises(error, match=said):
        ricochet.solve_ivp(chase, (0, 1), [1.0], "Radau", jac=jac)


def test_what_does_not_go_together_is_refused():
    system = ricochet.System(chase)
    with pytest.raises(ValueError, match="jac: found one beside a system, expected it as its member"):
        ricochet.solve_ivp(system, (0, 1), [1.0], "Radau", jac=lambda t, y: [[1.0]])
    with pytest.raises(ValueError, match="lband: found beside jac"):
        ricochet.solve_ivp(chase, (0, 1), [1.0], "LSODA", jac=lambda t, y: [[1.0]], lband=0)
    with pytest.raises(ValueError, match="jacobian: found one beside formula"):
        ricochet.integrate(ricochet.System(chase, formula=1, jacobian=lambda t, x: [[1.0]]), [1.0], 1.0)
    with pytest.raises(TypeError, match="jacobian: found a int, expected a function"):
        ricochet.integrate(ricochet.System(chase, jacobian=3), [1.0], 1.0, method="rosenbrock4")
    friction = ricochet.Inclusion(lambda t, x: [0.0], lambda t, x: (-1.0, 1.0))
    with pytest.raises(ValueError, match="set_valued: found fixed steps, 'taylor' or 'rosenbrock4'"):
        ricochet.integrate(ricochet.System(chase, set_valued=friction), [1.0], 1.0,
                           method="rosenbrock4")
    with pytest.warns(UserWarning, match="no effect"):
        ricochet.solve_ivp(chase, (0, 1e-3), [1.0], jac=lambda t, y: [[1.0]])
    with pytest.raises(ValueError, match="did you mean 'Radau'"):
        ricochet.solve_ivp(chase, (0, 1), [1.0], "radau")


def test_hints_about_cost_are_taken_and_the_least_step_holds():
    sparse = np.ones((1, 1))
    result = ricochet.solve_ivp(chase, (0, 1), [1.0], "BDF", jac_sparsity=sparse)
    assert result.success
    least = ricochet.solve_ivp(chase, (0, 1), [0.0], "LSODA", min_step=0.5, rtol=1e-10)
    assert least.outcome == "step_underflow"
