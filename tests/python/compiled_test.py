"""Compiled functions of every kind, bare and wrapped, and states as lists."""

import ctypes

import numpy as np
import pytest

import ricochet

FLOW = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_double, ctypes.POINTER(ctypes.c_double),
                        ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p)
GUARD = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_uint32, ctypes.c_double,
                         ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p)
RESET = ctypes.CFUNCTYPE(ctypes.c_uint32, ctypes.c_uint32, ctypes.c_double,
                         ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p)


def fall(mode, t, x, dxdt, size, user):
    dxdt[0] = x[1]
    dxdt[1] = -9.81


def height(mode, t, x, size, user):
    return x[0]


def bounce(mode, t, x, size, user):
    x[0] = 0.0
    x[1] *= -0.9
    return mode


def by_ctypes():
    return FLOW(fall), GUARD(height), RESET(bounce)


def by_cffi():
    ffi = pytest.importorskip("cffi").FFI()
    return (ffi.callback(ricochet.C_FLOW)(fall), ffi.callback(ricochet.C_GUARD)(height),
            ffi.callback(ricochet.C_RESET)(bounce))


def by_numba():
    numba = pytest.importorskip("numba")
    n = numba.types
    state = n.CPointer(n.double)
    return (numba.cfunc(n.void(n.uint32, n.double, state, state, n.uintp, n.voidptr))(fall),
            numba.cfunc(n.double(n.uint32, n.double, state, n.uintp, n.voidptr))(height),
            numba.cfunc(n.uint32(n.uint32, n.double, state, n.uintp, n.voidptr))(bounce))


def by_low_level_callable():
    scipy = pytest.importorskip("scipy")
    return tuple(scipy.LowLevelCallable(each) for each in by_ctypes())


KINDS = [by_ctypes, by_cffi, by_numba, by_low_level_callable]


@pytest.fixture(scope="module")
def expected():
    floor = ricochet.Guard(lambda t, x: x[0], reset=lambda t, x: [0.0, -0.9 * x[1]])
    return ricochet.integrate(ricochet.System(lambda t, x: [x[1], -9.81], [floor]), [10.0, 0.0], 20.5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("wrap", [lambda each: each, ricochet.Compiled], ids=["bare", "wrapped"])
def test_a_system_of_compiled_functions_has_the_bits_of_pythons(kind, wrap, expected):
    flow, guard, reset = map(wrap, kind())
    run = ricochet.integrate(ricochet.System(flow, [ricochet.Guard(guard, reset=reset)]), [10.0, 0.0],
                             20.5)
    assert len(run.events) == 13
    assert np.array_equal(run.events["t"], expected.events["t"])
    assert np.array_equal(run.x, expected.x)


@pytest.mark.parametrize("kind", KINDS)
def test_solve_ivp_takes_them_bare(kind, expected):
    flow, guard, reset = kind()
    result = ricochet.solve_ivp(flow, (0, 20.5), [10.0, 0.0], rtol=1e-8, atol=1e-10,
                                events=ricochet.Guard(guard, reset=reset))
    assert np.array_equal(result.t_events[0], expected.events["t"])
    recorded = ricochet.solve_ivp(flow, (0, 1.0), [1.0, 0.0], events=guard)
    assert len(recorded.t_events[0]) == 1
    listed = ricochet.solve_ivp(flow, (0, 1.0), [1.0, 0.0], events=[guard, lambda t, y: y[0] - 0.5])
    assert [len(times) for times in listed.t_events] == [1, 1]


@pytest.mark.parametrize("kind", KINDS)
def test_another_signature_is_refused(kind):
    flow, guard, reset = kind()
    plain = ricochet.System(lambda t, x: [x[1], -9.81], [ricochet.Guard(flow, name="floor")])
    with pytest.raises(TypeError, match=r"guard floor: found a compiled function .*, expected double \(uint32_t mode"):
        ricochet.integrate(plain, [1.0, 0.0], 1.0)
    with pytest.raises(TypeError, match="flow: found a compiled function .*, expected void"):
        ricochet.integrate(ricochet.System(guard), [1.0, 0.0], 1.0)
    with pytest.raises(TypeError, match="reset of guard (0|height): found a compiled function"):
        ricochet.integrate(ricochet.System(flow, [ricochet.Guard(guard, reset=guard)]), [1.0, 0.0], 1.0)
    with pytest.raises(TypeError, match="fun: found a compiled function"):
        ricochet.solve_ivp(ricochet.Compiled(reset), (0, 1), [1.0, 0.0])
    with pytest.raises(TypeError, match=r"events\[0\]: found a compiled function"):
        ricochet.solve_ivp(flow, (0, 1), [1.0, 0.0], events=reset)
    with pytest.raises(TypeError, match="jac: found a compiled function"):
        ricochet.solve_ivp(flow, (0, 1), [1.0, 0.0], "BDF", jac=guard)
    with pytest.raises(TypeError, match="enabled of guard (0|height): found a compiled function, expected one of Python"):
        ricochet.integrate(ricochet.System(flow, [ricochet.Guard(guard, enabled=guard)]), [1.0, 0.0], 1.0)


def test_data_of_a_low_level_callable_reaches_the_function():
    scipy = pytest.importorskip("scipy")
    weight = np.array([4.0])

    def flow(mode, t, x, dxdt, size, user):
        dxdt[0] = ctypes.cast(user, ctypes.POINTER(ctypes.c_double))[0]

    given = scipy.LowLevelCallable(FLOW(flow), ctypes.c_void_p(weight.ctypes.data))
    assert ricochet.solve_ivp(given, (0, 1), [1.0]).y[0, -1] == 5.0


def test_addresses_are_not_checked():
    flow = by_ctypes()[0]
    address = ctypes.cast(flow, ctypes.c_void_p).value
    run = ricochet.integrate(ricochet.System(ricochet.Compiled(address)), [1.0, 0.0], 1.0)
    assert abs(run.x[1] + 9.81) < 1e-12


# --- states as lists ---

def lorenz(t, x):
    u, v, w = x
    return [10.0 * (v - u), u * (28.0 - w) - v, u * v - 8.0 / 3.0 * w]


def test_lists_give_the_bits_of_arrays():
    guard = ricochet.Guard(lambda t, x: x[2] - 27, direction=0)
    runs = [ricochet.integrate(ricochet.System(lorenz, [guard], vector=vector), [1.0, 1.0, 1.0], 5.0)
            for vector in ("array", "list")]
    assert len(runs[0].events) > 3
    assert np.array_equal(runs[0].events["t"], runs[1].events["t"])
    assert np.array_equal(runs[0].x, runs[1].x)
    results = [ricochet.solve_ivp(lorenz, (0, 5), [1.0, 1.0, 1.0], vector=vector, events=guard)
               for vector in ("array", "list")]
    assert np.array_equal(results[0].y, results[1].y)


def test_functions_get_lists_of_floats_that_they_may_keep():
    seen = []

    def flow(t, x):
        seen.append(x)
        return [x[1], -9.81]

    class Ball(ricochet.System):
        vector = "list"

        def flow(self, t, x):
            return flow(t, x)

        def guard(self, t, x):
            seen.append(x)
            return x[0]

        def reset(self, t, x):
            seen.append(x)
            x.append(3.0)  # its own, so that nothing comes of it
            return [0.0, -0.5 * x[1]]

    run = ricochet.integrate(Ball(), [1.0, 0.0], 1.0)
    assert len(run.events) >= 1
    assert all(type(x) is list and type(x[0]) is float for x in seen)
    assert len({id(x) for x in seen}) == len(seen)
    assert seen[0] == [1.0, 0.0]


def test_lists_in_the_first_call_of_an_event():
    def event(t, y):
        assert type(y) is list
        return y[0] - 0.5

    result = ricochet.solve_ivp(lambda t, y: [-y[0]], (0, 1), [1.0], vector="list", events=event)
    assert len(result.t_events[0]) == 1


@pytest.mark.parametrize("more", [{"vectorized": True}, {"y0": [1j]}, {"y0": []}])
def test_lists_beside_what_needs_arrays_are_refused(more):
    given = {"y0": [1.0], **more}
    with pytest.raises(ValueError, match="vector: found 'list' beside"):
        ricochet.solve_ivp(lambda t, y: y, (0, 1), vector="list", **given)


def test_other_vectors_are_refused():
    with pytest.raises(ValueError, match="vector: found 'tuple', expected 'array' or 'list'"):
        ricochet.solve_ivp(lambda t, y: y, (0, 1), [1.0], vector="tuple")
    with pytest.raises(ValueError, match="vector: found 3, expected 'array' or 'list'"):
        ricochet.integrate(ricochet.System(lambda t, x: x, vector=3), [1.0], 1.0)
    with pytest.raises(ValueError, match="vector: found 'list' beside"):
        ricochet.solve_ivp(ricochet.System(lambda t, x: x), (0, 1), [1.0], vector="list")
