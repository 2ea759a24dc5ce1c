"""Fields at switching surfaces: sliding, exits, two surfaces, guards beside them."""

import ctypes

import numpy as np
import pytest

import ricochet


def block(t, x, friction):
    return [x[1], -x[0] - friction]


def block_on_spring(rated=True, **members):
    """A mass of 1 kg on a spring of 1 N/m with dry friction 0.3 N."""
    rate = (lambda t, x, dxdt: dxdt[1]) if rated else None
    surface = ricochet.Guard(lambda t, x: x[1], name="rest", rate=rate)
    return ricochet.Filippov(surface, [lambda t, x: block(t, x, -0.3), lambda t, x: block(t, x, 0.3)],
                             **members)


@pytest.mark.parametrize("rated", [True, False])
def test_a_block_turns_and_sticks_where_friction_says(rated):
    system = block_on_spring(rated)
    run = ricochet.integrate(system, [2.0, 0.0], 12.0, rtol=1e-10, atol=1e-10)
    # Half a period each, about -+0.3: 2, -1.4, 0.8, -0.2, where friction holds. Some 60 steps with
    # errors of 1e-10 (2 + 1) each at most.
    np.testing.assert_allclose(run.events["t"], np.pi * np.array([1, 2, 3]), atol=2e-8)
    np.testing.assert_allclose(run.events["after"][:, 0], [-1.4, 0.8, -0.2], atol=2e-8)
    assert run.event_modes == [("below", "above"), ("above", "below"), ("below", "sliding")]
    assert run.mode == "sliding" and run.x[1] == 0.0 and run.t == 12.0
    assert run.guard_names == ["rest: from below", "rest: from above", "rest: exit below",
                               "rest: exit above"]
    # The spring pulls with 0.2 N, and friction with as much: 0.3 (1 - 2 share) = -0.2.
    np.testing.assert_allclose(system.shares(run.mode, run.t, run.x), [5 / 6], atol=1e-7)


def test_a_run_starts_where_the_fields_say():
    system = block_on_spring()
    assert system.start_mode(0.0, [2.0, 0.0]) == "below"  # the spring pulls harder than friction
    assert system.start_mode(0.0, [0.1, 0.0]) == "sliding"
    assert system.start_mode(0.0, [0.1, 1e-9]) == "above"
    assert system.start_mode(0.0, [0.1, 1e-9], tolerance=1e-8) == "sliding"
    held = ricochet.integrate(system, [0.1, 0.0], 1.0)
    assert held.mode == "sliding" and held.x.tolist() == [0.1, 0.0] and len(held.events) == 0
    chosen = ricochet.integrate(system, [2.0, 0.0], 0.5, mode="below")
    assert np.array_equal(chosen.x, ricochet.integrate(system, [2.0, 0.0], 0.5).x)


def test_sliding_ends_where_a_field_turns_away():
    relay = ricochet.Filippov([lambda t, x: x[0]],
                              [lambda t, x: [1 + 0.1 * t], lambda t, x: [-1 + 0.1 * t]])
    run = ricochet.integrate(relay, [-0.5], 12.0)
    # -0.5 + t + 0.05 t^2 = 0, and the field above turns at t = 10; both are polynomials of the second
    # degree, on which the method is exact.
    np.testing.assert_allclose(run.events["t"], [-10 + np.sqrt(110), 10.0], rtol=1e-12)
    assert run.event_modes == [("below", "sliding"), ("sliding", "above")]
    np.testing.assert_allclose(run.x, [0.2], rtol=1e-10)  # 0.05 (12 - 10)^2
    np.testing.assert_allclose(relay.shares("sliding", 5.0, [0.0]), [0.75])


def corner(t, x, first, second):
    return [0.2 - first, 0.1 - second]


@pytest.mark.parametrize("rated", [True, False])
def test_two_surfaces_slide_together(rated):
    surfaces = [ricochet.Guard(lambda t, x, i=i: x[i],
                               rate=(lambda t, x, dxdt, i=i: dxdt[i]) if rated else None)
                for i in range(2)]
    fields = [lambda t, x, s=s: corner(t, x, *s) for s in [(-1, -1), (1, -1), (-1, 1), (1, 1)]]
    system = ricochet.Filippov(surfaces, fields)
    run = ricochet.integrate(system, [0.8, 1.8], 3.0)
    # x meets its surface at 0.8 / 0.8, y at 1.8 / 0.9; piecewise linear motion is exact.
    np.testing.assert_allclose(run.events["t"], [1.0, 2.0], rtol=1e-12)
    assert run.event_modes == [("above, above", "sliding, above"),
                               ("sliding, above", "sliding, sliding")]
    assert np.abs(run.x).max() < 1e-15
    np.testing.assert_allclose(system.shares(run.mode, 3.0, run.x), [0.6, 0.55], rtol=1e-12)
    assert len(run.guard_names) == 8 and run.guard_names[4] == "surface 1: from below"


def test_guards_and_time_events_of_the_fields_act_everywhere():
    kicked = []

    def kick(t, x):
        kicked.append(t)
        return [x[0], x[1] + 1.0]

    wall = ricochet.Guard(lambda t, x: 1.5 - x[0], name="wall", reset=lambda t, x: [1.5, -x[1]])
    system = block_on_spring(guards=[wall], time_events=[1.0, 4.0], time_reset=kick)
    run = ricochet.integrate(system, [0.1, 0.0], 5.0)
    assert kicked == [1.0, 4.0]
    assert run.guard_names[-1] == "wall"
    modes = run.event_modes
    assert modes[0] == ("sliding", "above")  # the kick at t = 1
    assert run.events["guard"][0] == -1
    stopped = ricochet.integrate(block_on_spring(guards=[ricochet.Guard(
        lambda t, x: x[0], name="middle", stop_after=1)]), [2.0, 0.0], 12.0)
    assert stopped.outcome == "stopped_by_event" and stopped.guard == 4
    # x = 0.3 + 1.7 cos t = 0
    assert abs(stopped.t - np.arccos(-0.3 / 1.7)) < 1e-7


def test_a_class_a_curved_surface_and_solve_ivp():
    class Circle(ricochet.Filippov):
        restoring_rate = 10.0

        def distance(self, t, x):
            return x[0] ** 2 + x[1] ** 2 - 1

        def turn(self, t, x, inward):
            return [-x[1] - inward * x[0], x[0] - inward * x[1]]

        @property
        def surfaces(self):
            return [self.distance]

        @property
        def fields(self):
            return [lambda t, x: self.turn(t, x, -1), lambda t, x: self.turn(t, x, 1)]

    result = ricochet.solve_ivp(Circle(), (0, 20), [2.0, 0.0], rtol=1e-8, atol=1e-10)
    # r' = -r from 2 to 1, at t = log 2, and then around by one radian a unit of time.
    assert result.success and result.run.mode == "sliding"
    np.testing.assert_allclose(np.hypot(*result.y[:, -1]), 1.0, atol=1e-7)
    np.testing.assert_allclose(result.y[:, -1], [np.cos(20), np.sin(20)], atol=1e-5)
    np.testing.assert_allclose(result.t_events[1][0], np.log(2), atol=1e-7)


def test_simulations_snapshots_and_ensembles():
    system = block_on_spring()
    simulation = ricochet.Simulation(system, [2.0, 0.0], 12.0)
    simulation.advance()
    snapshot = simulation.save()
    other = ricochet.Simulation(system, [2.0, 0.0], 12.0)
    other.restore(snapshot)
    assert np.array_equal(simulation.run_to_end().x, other.run_to_end().x)
    found = ricochet.ensemble(system, [[2.0, 0.0], [0.1, 0.0], [-3.0, 0.0]], 12.0)
    alone = [ricochet.integrate(system, x, 12.0).x for x in ([2.0, 0.0], [0.1, 0.0], [-3.0, 0.0])]
    assert np.array_equal(found.x, alone)


def test_compiled_fields_and_lists():
    flow = ctypes.CFUNCTYPE(None, ctypes.c_uint32, ctypes.c_double, ctypes.POINTER(ctypes.c_double),
                            ctypes.POINTER(ctypes.c_double), ctypes.c_size_t, ctypes.c_void_p)

    def field(friction):
        def function(mode, t, x, dxdt, size, user):
            dxdt[0] = x[1]
            dxdt[1] = -x[0] - friction
        return flow(function)

    expected = ricochet.integrate(block_on_spring(), [2.0, 0.0], 12.0)
    surface = ricochet.Guard(lambda t, x: x[1], rate=lambda t, x, dxdt: dxdt[1])
    compiled = ricochet.Filippov(surface, [field(-0.3), field(0.3)])
    assert np.array_equal(ricochet.integrate(compiled, [2.0, 0.0], 12.0).events["t"],
                          expected.events["t"])
    listed = ricochet.integrate(block_on_spring(vector="list"), [2.0, 0.0], 12.0)
    assert np.array_equal(listed.events["t"], expected.events["t"])


def test_other_methods_slide_too():
    expected = ricochet.integrate(block_on_spring(), [2.0, 0.0], 12.0)
    for method in ("rosenbrock4", "fehlberg78"):
        run = ricochet.integrate(block_on_spring(), [2.0, 0.0], 12.0, method=method, rtol=1e-8)
        # Tolerances of 1e-8 a step, for some hundred steps, at rates of 1.
        np.testing.assert_allclose(run.events["t"], expected.events["t"], atol=1e-6)
        assert run.mode == "sliding" and (run.statistics.jacobians > 0) == (method == "rosenbrock4")
    with pytest.raises(ValueError, match="needs the flow as a formula"):
        ricochet.integrate(block_on_spring(), [2.0, 0.0], 12.0, method="taylor")


def test_exceptions_pass_with_the_run_so_far():
    def field(t, x):
        if t > 1:
            raise KeyError("late")
        return [1.0]

    with pytest.raises(KeyError) as raised:
        ricochet.integrate(ricochet.Filippov(lambda t, x: x[0] - 5, [field, field]), [0.0], 3.0)
    assert 0 <= raised.value.ricochet_run.t <= 1


SURFACE = lambda t, x: x[0]  # noqa: E731
FIELDS = [lambda t, x: [1.0], lambda t, x: [-1.0]]


@pytest.mark.parametrize("system, error, said", [
    (lambda: ricochet.Filippov([], FIELDS), ValueError, "surfaces: found 0, expected one or two"),
    (lambda: ricochet.Filippov([SURFACE] * 3, FIELDS), ValueError, "surfaces: found 3"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS[:1]), ValueError, "fields: found 1, expected 2 for 1 of surfaces"),
    (lambda: ricochet.Filippov([SURFACE] * 2, FIELDS), ValueError, "fields: found 2, expected 4"),
    (lambda: ricochet.Filippov(SURFACE, [3, FIELDS[1]]), TypeError, r"fields\[0\]: found a int, expected a function"),
    (lambda: ricochet.Filippov(ricochet.Guard(SURFACE, reset=SURFACE), FIELDS), TypeError,
     r"surfaces\[0\]: found 'reset', expected only value, rate and name"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS, restoring_rate=-1.0), ValueError, "restoring"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS, formula=1), TypeError, "found 'formula' in a Filippov"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS, modes=2), TypeError, "found 'modes' in a Filippov"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS, guards=[ricochet.Guard(SURFACE, rest=SURFACE, reset=SURFACE)]),
     TypeError, "guard 0: found 'rest' in a guard of a Filippov"),
    (lambda: ricochet.Filippov(SURFACE, FIELDS, time_reset=SURFACE), ValueError, "time_reset: found one without"),
    (lambda: ricochet.Filippov(SURFACE, [lambda t, x: [1.0, 2.0], FIELDS[1]]), ValueError,
     r"fields\[0\] returned 2 numbers for a state of 1"),
    (lambda: ricochet.Filippov(lambda t, x: None, FIELDS), TypeError, r"surfaces\[0\] returned None, expected a number"),
])
def test_what_is_no_filippov_is_refused(system, error, said):
    with pytest.raises(error, match=said):
        ricochet.integrate(system(), [-1.0], 1.0)


def test_runs_backward_and_other_modes_are_refused():
    system = ricochet.Filippov(SURFACE, FIELDS)
    with pytest.raises(ValueError, match="forward in time only"):
        ricochet.integrate(system, [-1.0], -1.0)
    with pytest.raises(ValueError, match="mode: found 'beside', expected one of"):
        ricochet.integrate(system, [-1.0], 1.0, mode="beside")
    with pytest.raises(ValueError, match="mode: found 'beside', expected one of"):
        system.shares("beside", 0.0, [0.0])
