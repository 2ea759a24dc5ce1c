"""Code written for SciPy, run with our solve_ivp."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import ricochet


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


def spiral(t, z, rate=1.0):
    return (-0.3 + 2j * rate) * z


@pytest.mark.parametrize("method", ["RK45", "DOP853"])
def test_complex_states_are_scipys(method):
    solve = pytest.importorskip("scipy.integrate").solve_ivp

    def imaginary(t, z, rate):
        return z[0].imag

    given = dict(t_span=(0, 6), y0=[1 + 0j, 2j], args=(1.5,), events=imaginary, method=method,
                 rtol=1e-9, atol=[1e-9, 1e-10], dense_output=True, t_eval=np.linspace(0, 6, 9))
    ours, scipys = ricochet.solve_ivp(spiral, **given), solve(spiral, **given)
    assert ours.y.dtype == complex and ours.y.shape == (2, 9)
    np.testing.assert_allclose(ours.y, scipys.y, atol=1e-7)
    np.testing.assert_allclose(ours.sol([0.5, 1.0]), scipys.sol([0.5, 1.0]), atol=1e-7)
    assert ours.sol(1.0).shape == (2,) and ours.sol(1.0).dtype == complex
    after = scipys.t_events[0][scipys.t_events[0] > 0]
    np.testing.assert_allclose(ours.t_events[0], after, atol=1e-7)
    assert ours.y_events[0].shape == (after.size, 2) and ours.y_events[0].dtype == complex
    assert ours.run.x.shape == (4,)  # pairs


def test_resets_of_complex_states():
    def turned(t, z):
        return z[0].imag

    turned.direction = -1
    turned.reset = lambda t, z: [1 + 1j]
    result = ricochet.solve_ivp(lambda t, z: 1j * z, (0, 8), [1 + 1j], events=turned, rtol=1e-10,
                                atol=1e-10, dense_output=True)
    # From pi/4 to pi, again and again.
    np.testing.assert_allclose(result.t_events[0], 0.75 * np.pi * np.arange(1, 4), atol=1e-8)
    np.testing.assert_allclose(result.y_events[0], -np.sqrt(2), atol=1e-8)
    assert np.array_equal(result.y_events_after[0], np.full((3, 1), 1 + 1j))
    at = result.t_events[0][0]
    np.testing.assert_allclose(result.sol.before(at), -np.sqrt(2), atol=1e-8)
    assert result.sol(at) == [1 + 1j]

    turned.reset = lambda t, z: ricochet.Stop("turned", [3j])
    result = ricochet.solve_ivp(lambda t, z: 1j * z, (0, 8), [1 + 1j], events=turned)
    assert result.run.reason == "turned" and result.y[0, -1] == 3j


def test_complex_states_of_another_size_are_refused():
    with pytest.raises(ValueError, match="fun returned 2 numbers for a state of 1"):
        ricochet.solve_ivp(lambda t, z: [1j, 1j], (0, 1), [1j])
    with pytest.raises(ValueError, match="y0: found a complex y0 beside a system"):
        ricochet.solve_ivp(ricochet.BouncingBall(), (0, 1), [1j, 0])
    with pytest.raises(TypeError, match="fun: found a compiled function beside a complex y0"):
        ricochet.solve_ivp(ricochet.Compiled(4096), (0, 1), [1j])
    with pytest.raises(ValueError, match="found complex numbers"):
        ricochet.integrate(ricochet.System(lambda t, x: x), [1j], 1.0)


def test_a_state_without_components():
    def half(t, y):
        assert y.shape == (0,)
        return t - 0.5

    def fun(t, y):
        assert y.shape == (0,)
        return []

    for options in ({}, {"events": half}):
        result = ricochet.solve_ivp(fun, (0, 2), [], dense_output=True, **options)
        assert result.success and result.y.shape == (0, result.t.size)
        assert result.t[0] == 0 and result.t[-1] == 2
        assert result.sol(1.0).shape == (0,) and result.sol([0.5, 1.0]).shape == (0, 2)
    assert result.t_events[0] == [0.5] and result.y_events[0].shape == (1, 0)
    sampled = ricochet.solve_ivp(fun, (0, 2), [], t_eval=[0.5, 1.5])
    assert sampled.t.tolist() == [0.5, 1.5] and sampled.y.shape == (0, 2)


def test_a_method_of_another_order_says_so():
    result = ricochet.solve_ivp(swing, (0, 1), [1.0, 0.0], method="RK23")
    same = ricochet.solve_ivp(swing, (0, 1), [1.0, 0.0])
    assert result.success and np.array_equal(result.y, same.y)
    assert result.message.startswith(same.message) and "'RK23' was run as 'RK45'" in result.message


def test_results_have_scipys_types_where_scipy_is_loaded():
    integrate = pytest.importorskip("scipy.integrate")
    from scipy.optimize import OptimizeResult

    result = ricochet.solve_ivp(swing, (0, 1), [1.0, 0.0], dense_output=True)
    assert isinstance(result, OptimizeResult) and isinstance(result, ricochet.OdeResult)
    assert isinstance(result.sol, integrate.OdeSolution)
    assert np.array_equal(result.sol.ts, result.t)
    last = result.sol.interpolants[-1]
    assert np.array_equal(last(result.t[-1]), result.y[:, -1])
    assert last(result.t[-2:]).shape == (2, 2)
    again = pickle.loads(pickle.dumps(result))
    assert isinstance(again, OptimizeResult) and np.array_equal(again.sol(0.3), result.sol(0.3))
    code = ("import sys, ricochet; r = ricochet.solve_ivp(lambda t, y: -y, (0, 1), [1.0]); "
            "assert type(r) is ricochet.OdeResult; assert 'scipy' not in sys.modules")
    subprocess.run([sys.executable, "-c", code], check=True)
