"""Resets, modes, ready systems, simulations, results."""

import copy
import enum
import math
import pickle

import numpy as np
import pytest

import ricochet
from ricochet import Kind


def ball_events(restitution=0.9, **more):
    def floor(t, y):
        return y[0]

    floor.reset = lambda t, y: [0.0, -restitution * y[1]]
    floor.direction = -1
    for name, value in more.items():
        setattr(floor, name, value)
    return floor


def fall(t, y):
    return [y[1], -9.81]


class Ball(ricochet.System):
    unilateral = True
    restitution = 0.5

    def flow(self, t, x):
        return [x[1], -9.81]

    def guard(self, t, x):
        return x[0]

    def reset(self, t, x):
        return [0.0, -self.restitution * x[1]]

    def rest(self, t, x):
        return np.zeros(2)


def test_impacts_by_callbacks_are_those_of_the_closed_form():
    ready = ricochet.BouncingBall()
    exact = [ready.impact_time(n, 10.0) for n in range(13)]
    result = ricochet.solve_ivp(fall, (0, 20.5), [10.0, 0.0], events=ball_events(), rtol=1e-10,
                                atol=1e-10)
    assert np.abs(result.t_events[0] - exact).max() < 4e-14
    assert result.y_events[0].shape == result.y_events_after[0].shape == (13, 2)
    np.testing.assert_allclose(result.y_events_after[0][:, 1], -0.9 * result.y_events[0][:, 1])
    assert result.kinds == [["crossing"] * 13]
    assert result.statistics.evidence.checked > 0
    # Both sides of every reset are shown.
    assert np.count_nonzero(np.diff(result.t) == 0) == 13
    run = ricochet.integrate(ready, [10.0, 0.0], 20.5, rtol=1e-10)
    assert np.abs(run.events["t"] - exact).max() < 4e-14


def test_a_ball_that_comes_to_rest():
    exact = ricochet.BouncingBall(restitution=0.5).zeno_time(1.0)
    floor = ball_events(0.5, rest=lambda t, y: [0.0, 0.0], unilateral=True, name="floor")
    result = ricochet.solve_ivp(fall, (0, 10), [1.0, 0.0], events=floor, t_eval=[5.0])
    assert result.kinds[0][-1] == "accumulation" and np.array_equal(result.y[:, -1], [0, 0])
    run = ricochet.integrate(Ball(), [1.0, 0.0], 10.0)
    assert run.outcome == "reached_end" and run.events["kind"][-1] == Kind.ACCUMULATION
    assert run.events["t"][-1] == pytest.approx(exact, abs=1e-12)
    without = ricochet.solve_ivp(fall, (0, 10), [1.0, 0.0], events=ball_events(0.5))
    assert without.status == -1 and without.outcome == "zeno" and without.message


def test_a_thrown_ball_slides_on_where_it_rests():
    floor = lambda t, y: y[1]
    floor.reset = lambda t, y: [y[0], 0.0, y[2], -0.5 * y[3]]
    floor.rest = lambda t, y: [y[0], 0.0, y[2], 0.0]
    fly = lambda t, y: [y[2], y[3], 0.0, -10.0]
    for method in ("RK45", "DOP853"):
        result = ricochet.solve_ivp(fly, (0, 4), [0.0, 0.1, 1.0, 0.0], method=method, events=floor)
        assert result.kinds[0][-1] == "accumulation" and result.status == 0
        # sqrt(2 0.1 / 10) (1 + e) / (1 - e), with e = 0.5; x is the time, exact by any method
        assert result.t_events[0][-1] == pytest.approx(3 * np.sqrt(0.02), abs=1e-12)
        assert result.y[:, -1] == pytest.approx([4.0, 0.0, 1.0, 0.0], abs=1e-12)


def test_a_reset_is_told_the_direction_of_its_crossing():
    # sin t from 0.5: falls at pi, rises at 2 pi, and so on to 10.
    seen = []

    def note(t, x, direction):
        seen.append(direction)
        return x + direction

    wave = lambda t, x: np.sin(t)
    system = ricochet.System(lambda t, x: [0.0], [ricochet.Guard(wave, direction=0, reset=note,
                                                                 directed=True)])
    run = ricochet.integrate(system, [0.0], 10.0, t_start=0.5, h_max=0.5)
    assert seen == [-1, 1, -1] and run.x[0] == -1
    with pytest.raises(ValueError, match="found directed, expected a reset"):
        ricochet.integrate(ricochet.System(lambda t, x: [0.0], [
            ricochet.Guard(wave, directed=True)]), [0.0], 1.0)


def test_the_solution_has_the_state_after_a_last_reset_and_at_rest():
    def event(t, y):
        return y[0]

    event.terminal = 2
    event.unilateral = True
    event.reset = lambda t, y: [0.0, -0.5 * y[1]]
    result = ricochet.solve_ivp(lambda t, y: [y[1], -9.81], (0, 3), [1.0, 0.0], events=event,
                                dense_output=True)
    assert result.status == 1 and result.y[1, -1] > 0
    np.testing.assert_array_equal(result.sol(result.t[-1]), result.y[:, -1])
    event.terminal = False
    event.rest = lambda t, y: [0.0, 0.0]
    result = ricochet.solve_ivp(lambda t, y: [y[1], -9.81], (0, 3), [1.0, 0.0], events=event,
                                dense_output=True)
    np.testing.assert_array_equal(result.sol(2.5), [0, 0])
    assert result.sol.t_max == 3


def test_python_and_cpp_give_the_same_bits():
    # With the guard's rate in closed form, as in C++, both take the same steps.
    class Same(Ball):
        restitution = 0.9

        def guard_rate(self, t, x, dxdt):
            return dxdt[0]

        def reset(self, t, x):
            return [0.0, x[1] * -0.9]

    ready = ricochet.integrate(ricochet.BouncingBall(), [10.0, 0.0], 20.5)
    own = ricochet.integrate(Same(), [10.0, 0.0], 20.5)
    assert np.array_equal(ready.events["t"], own.events["t"])
    assert np.array_equal(ready.events["before"], own.events["before"])


class Room(enum.Enum):
    OFF = 0
    ON = 1


class Thermostat(ricochet.System):
    modes = Room

    def flow(self, mode, t, x):
        return [-0.1 * (x[0] - (0.0 if mode is Room.OFF else 30.0))]

    @ricochet.guard(in_modes=[Room.OFF])
    def too_cold(self, mode, t, x):
        return x[0] - 18

    @too_cold.reset
    def too_cold(self, mode, t, x):
        return Room.ON

    @ricochet.guard(in_modes=[Room.ON])
    def too_warm(self, mode, t, x):
        return 22 - x[0]

    @too_warm.reset
    def too_warm(self, mode, t, x):
        return Room.OFF, x


def test_former_names_of_options_and_counts():
    ball = ricochet.BouncingBall()
    now, former = (ricochet.integrate(ball, [10.0, 0.0], 3.0, **{name: False})
                   for name in ("check_inside", "look_inside"))
    always = ricochet.integrate(ball, [10.0, 0.0], 3.0)
    assert former.statistics.guard_calls == now.statistics.guard_calls
    assert former.statistics.guard_calls < always.statistics.guard_calls
    assert now.statistics.checks_put_off == now.statistics.checks_deferred
    monitor = ricochet.Monitor(ball, [10.0, 0.0], look_inside=False)
    assert monitor.start(0.0, [10.0, 0.0], 0.1) == ricochet.Verdict.STANDS


def test_modes_of_a_thermostat():
    ready = ricochet.Thermostat()
    exact = [ready.switch_time(n) for n in range(16)]
    own = ricochet.integrate(Thermostat(), [20.0], 48.0, mode=Room.OFF)
    theirs = ricochet.integrate(ready, [20.0], 48.0, mode="off")
    for run, on in ((own, Room.ON), (theirs, "on")):
        np.testing.assert_allclose(run.events["t"], exact[:len(run.events)], rtol=1e-8)
        assert len(run.events) == 16
        assert run.events["mode_after"].tolist() == [1, 0] * 8
        assert run.event_modes == [tuple(run.modes), tuple(run.modes)[::-1]] * 8
        assert run.mode == (Room.OFF if on is Room.ON else "off")
    assert own.guard_names == ["too_cold", "too_warm"]
    for system, mode in ((Thermostat(), Room.OFF), (ready, "off"), (ready, 0)):
        result = ricochet.solve_ivp(system, (0, 48), [20.0], rtol=1e-8, mode=mode)
        assert result.modes[0].tolist() == [[0, 1]] * 8 and len(result.t_events) == 2


def test_systems_from_functions_time_events_and_sets():
    # A capacitor that is charged at known times and discharged at a threshold, both at once
    # at t = 2.
    fired = []

    def together(t, x, numbers):
        fired.append((t, numbers))
        return [0.0]

    system = ricochet.System(lambda t, x: [1.0], name="capacitor", time_events=[1, 2, 4],
                             guards=[ricochet.Guard(lambda t, x: 2.0 - x[0], name="full"),
                                     ricochet.Guard(lambda t, x: 2.0 - x[0], name="again")],
                             reset_set=together)
    run = ricochet.integrate(system, [0.0], 5.0)
    assert run.outcome == "reached_end"
    assert fired[0] == (2.0, [0, 1, "time"]) or fired[0] == (2.0, [0, 1])
    assert Kind.TIME in run.events["kind"]
    timed = ricochet.System(lambda t, x: [1.0], time_events=[1, 3],
                            time_reset=lambda t, x: [x[0] + 10])
    assert ricochet.integrate(timed, [0.0], 5.0).x[0] == pytest.approx(25)
    assert ricochet.integrate(timed, [0.0], 0.0, t_start=5.0).x[0] == pytest.approx(15)


def test_states_that_change_their_length():
    class Growing(ricochet.System):
        def flow(self, t, x):
            return np.ones(len(x))

        @ricochet.guard(direction=1)
        def whole(self, t, x):
            return x[0] - 1

        @whole.reset
        def whole(self, t, x):
            return [x[0] - 1, 0.0, *x[1:]]

    system = Growing(changes_dimension=True)
    run = ricochet.integrate(system, [0.0], 3.5, record_steps=True)
    assert run.x == pytest.approx([0.5, 0.5, 1.5, 2.5])
    assert run.events["before"].shape == (3, 4) and np.isnan(run.events["before"][0, 1:]).all()
    assert len(run.solution(1.5)) == 2


def test_joint_guards_and_planned_checks():
    class Box(ricochet.System):
        guards = [ricochet.Guard(name=n) for n in ("floor", "wall")]

        def flow(self, t, x):
            return [x[1], -1.0]

        def guard_values(self, t, x):
            return np.array([x[0], 5.0 - x[0]])

    run = ricochet.integrate(Box(), [1.0, 0.0], 3.0)
    assert run.events["guard"].tolist() == [0]
    assert run.events["t"][0] == pytest.approx(math.sqrt(2), abs=1e-12)

    def planned(**options):
        bounded = ricochet.Guard(lambda t, x: x[0], reset=lambda t, x: [0.0, -0.9 * x[1]],
                                 speed_bound=lambda t, x: abs(x[1]),
                                 acceleration_bound=lambda t, x: 9.81)
        system = ricochet.System(fall, [bounded])
        return ricochet.integrate(system, [10.0, 0.0], 15.0, method="rk4", fixed=True, step=0.01,
                                  **options)

    sparse, dense = planned(detector="planned"), planned()
    assert np.array_equal(sparse.events["t"], dense.events["t"])
    assert sparse.statistics.guard_calls < dense.statistics.guard_calls / 4
    assert sparse.statistics.evidence.proved > 0


def test_ready_systems_agree_with_what_is_known():
    impact = ricochet.ImpactOscillator()
    run = ricochet.integrate(impact, impact.start, 100.0, rtol=1e-11, atol=1e-12)
    exact = impact.impacts(100.0)
    assert len(exact) == len(run.events)
    np.testing.assert_allclose(run.events["t"], exact, atol=1e-7)
    pendulum = ricochet.Pendulum(length=2.0)
    run = ricochet.integrate(pendulum, [-0.5, 0.0], 10.0, method="fehlberg78", rtol=1e-12)
    half = pendulum.half_period(-0.5)
    np.testing.assert_allclose(run.events["t"], half * np.arange(1, len(run.events) + 1), rtol=1e-9)
    coulomb = ricochet.CoulombOscillator()
    run = ricochet.integrate(coulomb, coulomb.start, 20.0)
    assert run.mode == "stick"
    assert run.x[0] == pytest.approx(coulomb.turning_point(3), abs=1e-6)
    slip = ricochet.StickSlip()
    run = ricochet.integrate(slip, slip.start, slip.period, rtol=1e-11, atol=1e-12)
    assert run.events["t"][-1] == pytest.approx(slip.period, abs=1e-8)
    assert slip.weakening == 3.0 and slip.parameters["mass"] == 1.0
    assert repr(pickle.loads(pickle.dumps(slip))) == repr(slip)


@pytest.mark.parametrize("system", [
    ricochet.BouncingBall(restitution=0.8), ricochet.Pendulum(length=2.0),
    ricochet.ImpactOscillator(frequency=0.8), ricochet.CoulombOscillator(),
    ricochet.StickSlip(), ricochet.Thermostat()], ids=lambda system: type(system).__name__)
def test_ready_systems_run_by_taylor_series(system):
    options = dict(rtol=1e-12, atol=1e-13)
    run = ricochet.integrate(system, system.start, 15.0, method="taylor", **options)
    expected = ricochet.integrate(system, system.start, 15.0, method="fehlberg78", **options)
    assert run.success and len(run.events) == len(expected.events) > 1
    np.testing.assert_allclose(run.events["t"], expected.events["t"], atol=1e-10)
    assert run.statistics.flow_calls < expected.statistics.flow_calls
    # With everything kept, by hand, and saved on the way: the same bits.
    kept = ricochet.integrate(system, system.start, 15.0, method="taylor", record_steps=True,
                              **options)
    assert np.array_equal(kept.events["t"], run.events["t"])
    np.testing.assert_allclose(kept.solution(7.0), ricochet.integrate(
        system, system.start, 7.0, method="taylor", **options).x, atol=1e-11)
    driven = ricochet.Simulation(system, system.start, 15.0, method="taylor", **options)
    driven.advance()
    snapshot = driven.save()
    assert np.array_equal(driven.run_to_end().events["t"], run.events["t"])
    again = ricochet.Simulation(system, system.start, 15.0, method="taylor", **options)
    again.restore(snapshot)
    assert np.array_equal(again.run_to_end().x, run.x)
    other = ricochet.Simulation(system, system.start, 15.0, method="fehlberg78", **options)
    with pytest.raises(ValueError):
        other.restore(snapshot)
    fixed = ricochet.integrate(system, system.start, 15.0, method="taylor", fixed=True, step=0.05)
    np.testing.assert_allclose(fixed.events["t"], expected.events["t"], atol=1e-10)
    solved = ricochet.solve_ivp(system, (0, 15), system.start, method="Taylor", **options)
    assert np.array_equal(solved.y[:, -1], run.x)


def test_taylor_series_have_the_bits_of_a_run_in_an_ensemble():
    lengths = {"length": [0.5, 1.0, 2.0]}
    all = ricochet.ensemble(ricochet.Pendulum, lengths, 9.0, method="taylor", rtol=1e-13)
    for i, length in enumerate(lengths["length"]):
        run = ricochet.integrate(ricochet.Pendulum(length=length), ricochet.Pendulum.start, 9.0,
                                 method="taylor", rtol=1e-13)
        assert np.array_equal(np.asarray(all.x)[i], run.x)


def test_results_are_views_and_survive_what_they_came_from():
    run = ricochet.integrate(ricochet.BouncingBall(), [10.0, 0.0], 20.5, record_steps=True)
    events = run.events
    assert events.base is not None and not events.flags.writeable
    assert np.shares_memory(events, run.events) and np.shares_memory(run.states, run.states)
    with pytest.raises(ValueError):
        events["t"][0] = 1
    kept = events["t"].copy()
    del run
    assert np.array_equal(events["t"], kept)


def test_pickled_results_are_the_same():
    run = ricochet.integrate(Ball(), [1.0, 0.0], 2.0, record_steps=True)
    for again in (pickle.loads(pickle.dumps(run)), copy.deepcopy(run)):
        assert again.events.tobytes() == run.events.tobytes()
        assert np.array_equal(again.states, run.states) and again.outcome == run.outcome
        assert vars(again.statistics) == vars(run.statistics)
        t = np.linspace(0, 2, 33)
        assert np.array_equal(again.solution(t), run.solution(t))
    result = ricochet.solve_ivp(fall, (0, 5), [1.0, 0.0], events=ball_events(), dense_output=True)
    again = pickle.loads(pickle.dumps(result))
    assert np.array_equal(again.sol(t), result.sol(t)) and again.kinds == result.kinds
    with pytest.raises(ValueError, match="another version"):
        ricochet.Solution.__new__(ricochet.Solution).__setstate__((b"", [], [], None))


def test_what_a_callback_keeps_does_not_change():
    kept = []

    def flow(t, y):
        kept.append((t, y, y.copy(), y[::2]))
        return [y[1], -9.81]

    ricochet.solve_ivp(flow, (0, 1), [1.0, 0.0])
    for _, y, then, part in kept:
        assert np.array_equal(y, then) and np.array_equal(part, then[::2])


def test_a_simulation_by_hand():
    ball = Ball()
    ball.restitution = 0.9
    simulation = ricochet.Simulation(ball, [10.0, 0.0], 20.5)
    times = []
    while simulation.advance():
        times.append(simulation.t)
        if len(times) == 4:
            snapshot = pickle.loads(pickle.dumps(simulation.save()))
    run = simulation.finish()
    assert run.events["t"].tolist()[:len(times)] == times[:13]
    other = ricochet.Simulation(ball, [10.0, 0.0], 20.5)
    other.restore(ricochet.Snapshot.from_text(snapshot.text))
    assert other.t == times[3]
    rest = other.run_to_end()
    assert np.array_equal(rest.events["t"], run.events["t"][4:])
    assert np.array_equal(rest.x, run.x)
    ready = ricochet.Simulation(ricochet.StickSlip(), [1.0, 0.2], 30.0, sample_times=[1, 2])
    modes = {ready.mode for _ in ready}
    assert modes == {"stick", "slip-left"}
    steps = 0
    stepped = ricochet.Simulation(ricochet.Pendulum(), [0.1, 0.0], 1.0)
    while stepped.step():
        steps += 1
    assert steps > 3 and stepped.ended and not stepped.step()
    assert stepped.run.t == 1.0


@pytest.mark.parametrize("system, start, t_end, more", [
    (ricochet.BouncingBall(), [10.0, 0.0], 20.5, {}),
    (ricochet.BouncingBall(), [10.0, 0.0], 20.5, {"event_states": False}),
    (ricochet.Thermostat(), [20.0], 20.0, {"method": "taylor"}),
    (ricochet.System(fall), [1.0, 0.0], -2.0, {}),
    (ricochet.System(lambda t, x: [-x[0]], time_events=[0.5, 0.5, 1.0],
                     time_reset=lambda t, x: [x[0] + 1]), [1.0], 1.0, {}),
])
def test_a_driven_run_keeps_the_ends_of_its_steps(system, start, t_end, more):
    whole = ricochet.integrate(system, start, t_end, record_steps=True, **more)
    driven = ricochet.Simulation(system, start, t_end, record_steps=True, **more)
    driven.step()
    assert driven.run.times.tolist()[0] == 0.0 and driven.run.times[-1] == driven.t
    for _ in driven:
        pass
    run = driven.finish()
    assert np.array_equal(run.times, whole.times)
    assert np.array_equal(run.states, whole.states)
    sampled = ricochet.Simulation(system, start, t_end, record_steps=True,
                                  sample_times=[0.25 * t_end], **more).run_to_end()
    assert sampled.times.tolist() == [0.25 * t_end] and sampled.solution is not None
    assert ricochet.Simulation(system, start, t_end).run_to_end().times.size == 0


def test_pictures(tmp_path):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("Agg")
    from matplotlib import pyplot
    run = ricochet.integrate(Ball(), [1.0, 0.0], 2.0, record_steps=True)
    ax = ricochet.plot(run, labels=["height", "velocity"], ax=pyplot.subplots()[1])
    t, height = ax.lines[0].get_data()
    assert np.isnan(t).any()
    # The flight after the first impact, which is one step: up to r^2 of the height.
    first, second = run.events["t"][:2]
    assert abs(np.nanmax(height[(t > first) & (t < second)]) - 0.25) < 0.01
    plane = ricochet.plot(run, phase=(1, 0), ax=pyplot.subplots()[1])
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("x[1]", "x[0]")
    # Labels are those of the components, also in a plane and where one is drawn alone.
    plane = ricochet.plot(run, phase=(1, 0), labels=["height", "velocity"], ax=pyplot.subplots()[1])
    assert (plane.get_xlabel(), plane.get_ylabel()) == ("velocity", "height")
    alone = ricochet.plot(run, [1], labels=["velocity"], ax=pyplot.subplots()[1])
    assert (alone.get_xlabel(), alone.get_ylabel()) == ("t", "velocity")
    assert ax.get_ylabel() == "" and ax.get_legend() is not None
    with pytest.raises(ValueError, match="labels: found 1, expected one for each of 2"):
        ricochet.plot(run, phase=(0, 1), labels=["height"])
    pyplot.close("all")
    with pytest.raises(ValueError, match="without states"):
        ricochet.plot(ricochet.integrate(Ball(), [1.0, 0.0], 2.0))
    with pytest.raises(ValueError, match="labels: found 1, expected one for each of 2"):
        ricochet.plot(run, labels=["height"])
    with pytest.raises(ValueError, match="a result over no time"):
        ricochet.plot(ricochet.solve_ivp(lambda t, y: -y, (0, 0), [1.0]))


# --- compiled functions ---

SOURCE = """
#include <stdint.h>
#include <stddef.h>
void flow(uint32_t mode, double t, const double *x, double *dxdt, size_t n, void *user)
{ (void)mode; (void)t; (void)n; dxdt[0] = x[1]; dxdt[1] = -*(const double *)user; }
double height(uint32_t mode, double t, const double *x, size_t n, void *user)
{ (void)mode; (void)t; (void)n; (void)user; return x[0]; }
double rate(uint32_t mode, double t, const double *x, const double *dxdt, size_t n, void *user)
{ (void)mode; (void)t; (void)x; (void)n; (void)user; return dxdt[0]; }
uint32_t bounce(uint32_t mode, double t, double *x, size_t n, void *user)
{ (void)t; (void)n; (void)user; x[0] = 0; x[1] *= -0.9; return mode; }
"""


def compiled_ball(flow, height, rate, bounce):
    guard = ricochet.Guard(ricochet.Compiled(height), rate=ricochet.Compiled(rate),
                           reset=ricochet.Compiled(bounce), name="floor", unilateral=True)
    return ricochet.System(flow, [guard])


@pytest.mark.parametrize("ready", [ricochet.Pendulum(), ricochet.ImpactOscillator(),
                                   ricochet.StickSlip(), ricochet.Thermostat()])
def test_a_ready_system_takes_a_tolerance_for_each_component(ready):
    x0 = ready.start
    each = [1e-9] * len(x0)

    def expect_same(one, other):
        assert one.statistics == other.statistics
        assert np.array_equal(one.x, other.x)
        for name in ("t", "guard", "before", "after"):
            assert np.array_equal(one.events[name], other.events[name])

    # By the loop of the system, by the one for all systems, and driven by hand.
    for options in ({}, {"locator": "bisection"}, {"method": "fehlberg78"}):
        expect_same(ricochet.integrate(ready, x0, 12.0, atol=1e-9, **options),
                    ricochet.integrate(ready, x0, 12.0, atol=each, **options))
    expect_same(ricochet.integrate(ready, x0, 12.0, atol=1e-9),
                ricochet.Simulation(ready, x0, 12.0, atol=each).run_to_end())
    fine = ricochet.integrate(ready, x0, 12.0, rtol=1e-13, atol=[1e-13] + each[1:])
    coarse = ricochet.integrate(ready, x0, 12.0, rtol=1e-13, atol=[1e-3] + each[1:])
    assert fine.statistics.steps > coarse.statistics.steps


def test_components_that_a_reset_adds_have_the_smallest_tolerance():
    # y'' = -y is added to a constant at time 1: its steps are as many as those of a run in which
    # all components have its tolerance.
    def flow(t, x):
        return [0.0] if len(x) == 1 else [0.0, x[2], -x[1]]

    timer = ricochet.Guard(lambda t, x: 1.0 - t, reset=lambda t, x: [x[0], 1.0, 0.0])
    system = ricochet.System(flow, [timer], changes_dimension=True)

    def steps(atol, x0=(1.0,)):
        return ricochet.integrate(system, x0, 9.0, rtol=1e-13, atol=atol).statistics.steps

    assert steps([1e-6]) == steps(1e-6) < steps([1e-9]) == steps(1e-9)


def test_a_snapshot_belongs_to_the_tolerances_of_its_run():
    def simulation(atol):
        return ricochet.Simulation(ricochet.Pendulum(), ricochet.Pendulum.start, 5.0, atol=atol)

    saved = simulation([1e-9, 1e-6]).save()
    simulation([1e-9, 1e-6]).restore(saved)
    with pytest.raises(ValueError, match="component_atol"):
        simulation([1e-9, 1e-7]).restore(saved)


def expect_ball(system):
    run = ricochet.integrate(system, [10.0, 0.0], 20.5)
    ready = ricochet.integrate(ricochet.BouncingBall(), [10.0, 0.0], 20.5)
    assert np.array_equal(run.events["t"], ready.events["t"])


def test_functions_of_ctypes(tmp_path):
    import ctypes
    import shutil
    import subprocess
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None:
        pytest.skip("no compiler of C was found")
    (tmp_path / "ball.c").write_text(SOURCE)
    subprocess.run([compiler, "-O2", "-shared", "-fPIC", "-o", tmp_path / "ball.so",
                    tmp_path / "ball.c"], check=True)
    library = ctypes.CDLL(str(tmp_path / "ball.so"))
    gravity = np.array([9.81])
    flow = ricochet.Compiled(library.flow, user=gravity)
    expect_ball(compiled_ball(flow, library.height, library.rate, library.bounce))
    result = ricochet.solve_ivp(ricochet.Compiled(library.flow, gravity), (0, 1), [10.0, 0.0],
                                events=ricochet.Compiled(library.height), atol=[1e-6, 1e-3])
    assert result.y[0, -1] == pytest.approx(10 - 9.81 / 2, rel=1e-9)


def test_functions_of_cffi():
    cffi = pytest.importorskip("cffi")
    ffi = cffi.FFI()
    gravity = ffi.new("double *", 9.81)

    @ffi.callback(ricochet.C_FLOW)
    def flow(mode, t, x, dxdt, n, user):
        dxdt[0], dxdt[1] = x[1], -ffi.cast("double *", user)[0]

    result = ricochet.solve_ivp(ricochet.Compiled(flow, gravity), (0, 1), [10.0, 0.0])
    assert result.y[0, -1] == pytest.approx(10 - 9.81 / 2, rel=1e-9)


def test_functions_of_numba():
    numba = pytest.importorskip("numba")
    from numba import types as n

    @numba.cfunc(n.void(n.uint32, n.float64, n.CPointer(n.float64), n.CPointer(n.float64),
                        n.uintp, n.voidptr))
    def flow(mode, t, x, dxdt, size, user):
        dxdt[0] = x[1]
        dxdt[1] = -9.81

    result = ricochet.solve_ivp(ricochet.Compiled(flow), (0, 1), [10.0, 0.0])
    assert result.y[0, -1] == pytest.approx(10 - 9.81 / 2, rel=1e-9)


@pytest.mark.parametrize("rate", [None, lambda t, x, dxdt: dxdt[0] / (2 * np.sqrt(x[0]))])
def test_a_rate_that_is_not_finite_on_the_surface_is_replaced_by_a_difference(rate):
    floor = ricochet.Guard(lambda t, x: np.sqrt(x[0]), rate=rate,
                           reset=lambda t, x: [0.0, -0.8 * x[1]])
    system = ricochet.System(fall, [floor])
    with np.errstate(all="ignore"):
        run = ricochet.integrate(system, [0.0, 5.0], 2.0)
    assert run.outcome == "reached_end"
    np.testing.assert_allclose(run.events["t"], [10 / 9.81, 18 / 9.81], rtol=1e-9)


@pytest.mark.parametrize("options", [{}, {"rtol": 1e-6}, {"max_steps": 7}, {"check_inside": False},
                                     {"t_start": 0.5, "h_max": 0.25}, {"stop_at_event": True},
                                     {"component_atol": 1.0}, {"atol": "x"}, {"rtol": -1.0},
                                     {"mode": 1.0}, {"gate": 1.0}, {"record_steps": True},
                                     {"sample_times": 1.0}, {"heigth": 1.0}])
def test_plain_numbers_and_arrays_give_the_same_run(options):
    """Ready systems have a shorter way for arguments that are numbers of Python."""
    def run_from(x0, t_end):
        try:
            return ricochet.integrate(ricochet.BouncingBall(), x0, t_end, **options)
        except (TypeError, ValueError) as error:
            return error

    plain = run_from((10.0, 0.0), 20.5)
    other = run_from(np.array([10.0, 0.0]), np.float64(20.5))
    assert type(plain) is type(other)
    if isinstance(plain, Exception):
        assert str(plain) == str(other)
        return
    assert plain.outcome == other.outcome and plain.t == other.t
    assert np.array_equal(plain.x, other.x) and np.array_equal(plain.times, other.times)
    assert plain.events.tobytes() == other.events.tobytes()
    assert plain.statistics.steps == other.statistics.steps


@pytest.mark.parametrize("wrap", [np.array, np.atleast_1d, np.atleast_2d,
                                  lambda value: np.array([value], dtype=object)])
@pytest.mark.parametrize("options", [{}, {"detector": "planned"}, {"t_start": 3.5, "t_end": 0.0}])
def test_functions_may_return_an_array_of_one_number(wrap, options):
    """NumPy does not turn these into floats from 2.4 on."""
    def run_with(wrap):
        floor = ricochet.Guard(
            lambda t, x: wrap(x[0]), reset=lambda t, x: [0.0, -0.8 * x[1]],
            rate=lambda t, x, dxdt: wrap(dxdt[0]), enabled=lambda t, x: wrap(t > 0.5),
            speed_bound=lambda t, x: wrap(abs(x[1])), acceleration_bound=lambda t, x: wrap(9.81),
            lower_bound=lambda t, x: wrap(x[0]), upper_bound=lambda t, x: wrap(x[0]))
        system = ricochet.System(
            fall, [floor], next_time_event=lambda t: wrap(3.0 if t < 3 else math.inf),
            previous_time_event=lambda t: wrap(3.0 if t > 3 else -math.inf),
            time_reset=lambda t, x: x + [0.5, 0.0])
        return ricochet.integrate(system, [2.0, 0.0], **{"t_end": wrap(3.5), **options})

    plain, other = run_with(float), run_with(wrap)
    assert len(plain.events) > 1
    assert other.events.tobytes() == plain.events.tobytes()
    assert np.array_equal(other.x, plain.x)


def test_an_event_of_scipy_may_return_a_slice_of_the_state():
    def low(t, y):
        return y[:1] - 0.5

    run = ricochet.solve_ivp(lambda t, y: -y, (0, 1), [1.0], events=low)
    assert run.t_events[0] == pytest.approx([math.log(2)], rel=1e-3)


def test_functions_of_a_guard_may_have_names_of_their_own():
    class Tank(ricochet.System):
        def flow(self, t, x):
            return [-1.0]

        @ricochet.guard()
        def low(self, t, x):
            return x[0]

        @low.reset
        def refill(self, t, x):
            return [x[0] + 1.5]

        @low.enabled
        def when(self, t, x):
            return t < 2

    class Half(Tank):
        @Tank.refill.reset
        def refill(self, t, x):
            return [x[0] + 0.5]

    class Lower(Tank):
        @ricochet.guard()
        def low(self, t, x):
            return x[0] + 1

    class Twice(Tank):
        @Tank.refill.reset
        def again(self, t, x):
            return [x[0] + 0.5]

    for system, times in ((Tank(), [1]), (Half(), [1, 1.5])):
        run = ricochet.integrate(system, [1.0], 3.0)
        assert run.guard_names == ["low"]
        assert run.events["t"] == pytest.approx(times)
    with pytest.raises(TypeError, match="Lower: found another guard 'low' in place of one that"):
        ricochet.integrate(Lower(), [1.0], 3.0)
    with pytest.raises(TypeError, match="guard low: found two functions 'reset', expected one"):
        ricochet.integrate(Twice(), [1.0], 3.0)
