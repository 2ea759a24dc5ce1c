"""Code written for SciPy, run with our solve_ivp."""

import inspect

import numpy as np
import pytest

import ricochet


@pytest.fixture
def theirs(monkeypatch):
    """SciPy's own tests, with solve_ivp replaced.

    Their loops over methods include some that ricochet does not have: for these DOP853 stands
    in, at a tenth of the tolerances. (test_args asks of Radau at 1e-10 for what neither of
    SciPy's explicit methods reaches there.)
    """
    tests = pytest.importorskip("scipy.integrate._ivp.tests.test_ivp")

    def solve(fun, t_span, y0, method="RK45", **options):
        options.pop("jac", None)
        if method not in ("RK45", "DOP853"):
            method = "DOP853"
            for name in ("rtol", "atol"):
                if np.ndim(options.get(name, [0])) == 0:
                    options[name] /= 10
        result = ricochet.solve_ivp(fun, t_span, y0, method, **options)
        if result.t.size == 0:
            # SciPy has lists there, and asks whether they are true; an empty array is refused that.
            result.t, result.y = [], []
        return result

    monkeypatch.setattr(tests, "solve_ivp", solve)
    return tests


@pytest.mark.parametrize("name", [
    "test_events", "test_t_eval_early_event", "test_args", "test_args_single_value",
    "test_t_eval", "test_t_eval_dense_output", "test_no_integration", "test_max_step",
    "test_first_step", "test_array_rtol"])
def test_scipys_own_tests_pass(theirs, name):
    if not hasattr(theirs, name):
        pytest.skip("this SciPy has no such test")
    test = getattr(theirs, name)
    # a fixture of SciPy's own for the threads of a run of its tests
    has_threads = "num_parallel_threads" in inspect.signature(test).parameters
    test(*[1] * has_threads)


def test_times_that_an_event_cuts_off_leave_empty_arrays():
    def early(t, y):
        return t - 1.0

    early.terminal = True
    result = ricochet.solve_ivp(lambda t, y: -y, (0, 2), [1.0, 2.0], events=early,
                                t_eval=[1.5, 2.0])
    assert result.t.shape == (0,) and result.y.shape == (2, 0)


def test_all_roots_of_a_cubic_within_one_step_are_found():
    # SciPy examines the signs at the ends of a step: of three roots within it finds one.
    def cubic(t, y):
        return (t - 1) * (t - 1.2) * (t - 1.3)

    for options in ({}, {"first_step": 5.0}, {"method": "DOP853"}):
        result = ricochet.solve_ivp(lambda t, y: [0.0], (0, 10), [1.0], events=cubic, **options)
        np.testing.assert_allclose(result.t_events[0], [1, 1.2, 1.3], rtol=1e-12)


def test_results_agree_with_scipy():
    solve = pytest.importorskip("scipy.integrate").solve_ivp

    def fun(t, y, a):
        return [y[1], -a * np.sin(y[0])]

    def event(t, y, a):
        return y[1]

    event.direction = -1
    given = dict(t_span=(0, 12), y0=[1.0, 0.0], args=(2.0,), events=[event, lambda t, y, a: y[0]],
                 rtol=1e-9, atol=1e-9, t_eval=np.linspace(0, 12, 50), dense_output=True)
    for method in ("RK45", "DOP853"):
        ours, scipys = (f(fun, method=method, **given) for f in (ricochet.solve_ivp, solve))
        np.testing.assert_allclose(ours.y, scipys.y, atol=2e-7)
        assert ours.y.shape == scipys.y.shape and ours.t.shape == scipys.t.shape
        for mine, theirs in zip(ours.t_events, scipys.t_events):
            # A start on the surface is no event here, and one in SciPy.
            np.testing.assert_allclose(mine, theirs[theirs > 0], atol=1e-6)
        t = np.linspace(0, 12, 7)
        np.testing.assert_allclose(ours.sol(t), scipys.sol(t), atol=2e-7)
        assert ours.sol(1.0).shape == scipys.sol(1.0).shape
        assert set(scipys) <= set(ours)


def test_terminal_counts_and_result_of_no_events():
    def event(t, y):
        return y[0]

    event.terminal = 3
    result = ricochet.solve_ivp(lambda t, y: [y[1], -y[0]], (0, 100), [1.0, 0.0], events=event,
                                rtol=1e-9, atol=1e-9)
    assert result.status == 1 and result.t_events[0].size == 3
    assert result.t[-1] == pytest.approx(2.5 * np.pi, abs=1e-6)
    nothing = ricochet.solve_ivp(lambda t, y: -y, (0, 1), [1.0])
    assert nothing.t_events is None and nothing.y_events is None and nothing.sol is None


def test_vectorized_functions_and_classes_of_methods():
    solvers = pytest.importorskip("scipy.integrate")
    result = ricochet.solve_ivp(lambda t, y: -y * np.ones((1, y.shape[1])), (0, 1), [1.0, 2.0],
                                vectorized=True, method=solvers.RK45)
    assert result.y[:, -1] == pytest.approx(np.exp(-1) * np.array([1, 2]), rel=2e-3)


def test_tolerances_of_components_hold():
    # A level of size 1 and an oscillator of size 1e-9: with one atol that suits the level, the
    # oscillator is not resolved.
    def fun(t, y):
        return [0.01, y[2], -y[1]]

    start = [1.0, 1e-9, 0.0]
    exact = np.array([1.2, 1e-9 * np.cos(20), -1e-9 * np.sin(20)])

    def error(atol):
        result = ricochet.solve_ivp(fun, (0, 20), start, rtol=1e-10, atol=atol)
        return abs(result.y[:, -1] - exact)[1:].max()

    assert error(1e-6) > 1e-10
    assert error([1e-6, 1e-17, 1e-17]) < 1e-15
    apart = ricochet.solve_ivp(fun, (0, 20), start, rtol=1e-6, atol=[1e-3, 1e-14, 0.0],
                               dense_output=True, events=lambda t, y: y[1])
    assert np.array_equal(apart.y[:, 0], start)
    np.testing.assert_allclose(apart.sol(20.0), exact, atol=1e-12)
    np.testing.assert_allclose(apart.t_events[0], np.pi * (0.5 + np.arange(6)), atol=1e-3)


def swing(t, y):
    return [y[1], -y[0]]


@pytest.mark.parametrize("y0", [[1.0], [1.0, 0.0]])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_equal_tolerances_of_components_are_one_tolerance(y0, method):
    fun = swing if len(y0) == 2 else lambda t, y: -y

    def solve(atol, rtol):
        return ricochet.solve_ivp(fun, (0, 20), y0, method, rtol=rtol, atol=atol, dense_output=True,
                                  events=lambda t, y: y[0] - 0.5)

    def expect_same(one, each):
        assert one.nfev == each.nfev
        for name in ("t", "y"):
            assert np.array_equal(one[name], each[name])
        assert np.array_equal(one.t_events[0], each.t_events[0])
        assert np.array_equal(one.sol(np.linspace(0, 20, 50)), each.sol(np.linspace(0, 20, 50)))

    expect_same(solve(1e-9, 1e-6), solve([1e-9] * len(y0), 1e-6))
    expect_same(solve(1e-9, 1e-6), solve(np.full(len(y0), 1e-9), 1e-6))
    # An rtol of zero counts as 100 eps, as in SciPy.
    with pytest.warns(UserWarning, match="rtol"):
        expect_same(solve(1e-9, 0.0), solve([1e-9] * len(y0), 0.0))


def test_a_tolerance_of_a_component_is_taken_as_it_is():
    # A looser tolerance for the position saves steps, also where it is less than twice the other.
    def steps(atol):
        return ricochet.solve_ivp(swing, (0, 20), [1.0, 0.0], rtol=1e-13, atol=atol).nfev

    assert steps([1.5e-9, 1e-9]) < steps([1e-9, 1e-9])


def test_a_start_without_length():
    result = ricochet.solve_ivp(lambda t, y: -y, (4, 4), [2.0, 3.0], dense_output=True)
    assert result.success and np.array_equal(result.sol(4), [2, 3])


@pytest.mark.parametrize("count", [5, 50, 500, 5000])
@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_samples_beside_a_dense_output_cost_no_further_calls(method, count):
    def solve(**more):
        return ricochet.solve_ivp(swing, (0, 20), [1.0, 0.0], method, rtol=1e-10, atol=1e-12,
                                  dense_output=True, **more)

    t_eval = np.linspace(0, 20, count)
    dense, both = solve(), solve(t_eval=t_eval)
    assert both.nfev <= 1.2 * dense.nfev
    # Both follow the motion to the error of an accepted step, at most 1e-10 + 1e-12.
    np.testing.assert_allclose(both.y, dense.sol(t_eval), rtol=0, atol=2.02e-10)
