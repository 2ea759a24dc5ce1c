"""Events of motions that a host in Python integrates."""

import math
import pickle
import threading

import numpy as np
import pytest

import ricochet
from ricochet import Kind, Monitor, Verdict


def rk4(f, t, x, h):
    k1 = f(t, x)
    k2 = f(t + h / 2, x + h / 2 * k1)
    k3 = f(t + h / 2, x + h / 2 * k2)
    k4 = f(t + h, x + h * k3)
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def fall(t, x):
    return np.array([x[1], -9.81])


def drive(monitor, f, t, x, t_end, h=0.1, cuts=None):
    """Steps of h by a host without dense output, whose flow may ask for the mode."""
    cuts = [] if cuts is None else cuts
    verdict = monitor.start(t, x, h)
    while verdict in (Verdict.STANDS, Verdict.CUT) and t < t_end:
        if verdict == Verdict.CUT:
            cuts.append(monitor.cut)
            t, x = monitor.cut.t, monitor.cut.after
            verdict = monitor.resume(h)
            continue
        step = min(h, t_end - t, monitor.must_stop_at - t)
        after = rk4(f, t, x, step)
        verdict = monitor.examine(t, step, x, after, f(t, x), f(t + step, after))
        t, x = t + step, after
    return verdict


def test_scipys_stepper_with_its_dense_output_has_the_impacts_of_a_ball():
    integrate = pytest.importorskip("scipy.integrate")
    ball = ricochet.BouncingBall()
    monitor = Monitor(ball, [10.0, 0.0])

    def stepper(t, x):
        return integrate.RK45(fall, t, x, 20.5, rtol=1e-10, atol=1e-10)

    host = stepper(0.0, [10.0, 0.0])
    assert monitor.start(host.t, host.y, host.h_abs) is Verdict.STANDS
    while host.status == "running":
        rate = host.f
        host.step()
        verdict = monitor.examine(host.t_old, host.t - host.t_old, host.y_old, host.y, rate, host.f,
                                  host.dense_output())
        while verdict == Verdict.CUT:
            host = stepper(monitor.cut.t, monitor.cut.after)
            verdict = monitor.resume(host.h_abs, host.f)
    exact = [ball.impact_time(n, 10.0) for n in range(13)]
    # The host's interpolant is a function of the time, whose neighbours are 4e-15 s apart at 20 s:
    # each of 13 flights may begin that much off, twice, and end as much later where its condition
    # holds.
    assert np.abs(monitor.events["t"] - exact).max() < 52 * 4e-15
    assert monitor.run.statistics.events == 13 and monitor.t == 20.5
    assert monitor.events["kind"].tolist() == [Kind.CROSSING] * 13


def test_the_cubic_is_exact_for_a_parabola():
    ball = ricochet.BouncingBall()
    monitor = Monitor(ball, [10.0, 0.0])
    cuts = []
    assert drive(monitor, fall, 0.0, np.array([10.0, 0.0]), 20.5, cuts=cuts) is Verdict.STANDS
    exact = [ball.impact_time(n, 10.0) for n in range(13)]
    assert [cut.t for cut in cuts] == monitor.events["t"].tolist()
    # Steps of 0.1 s lose up to 8e-15 m by rounding each, 200 of them; v >= 3.5 m/s at impact.
    assert np.abs(monitor.events["t"] - exact).max() < 200 * 8e-15 / 3.5
    first = cuts[0]
    assert first.fired == [0] and first.fired_names == ["floor"] and first.state_changed
    assert not first.on_time and not first.accumulation and 0 < first.s < 0.1
    assert first.after[1] == pytest.approx(-0.9 * first.before[1], rel=1e-15)


class Ball(ricochet.System):
    unilateral = True

    def flow(self, t, x):
        return fall(t, x)

    def guard(self, t, x):
        return x[0]

    def reset(self, t, x):
        return [0.0, -0.5 * x[1]]

    def rest(self, t, x):
        return [0.0, 0.0]


def test_a_ball_comes_to_rest_and_is_held():
    monitor = Monitor(Ball(), [1.0, 0.0])
    cuts = []
    assert drive(monitor, fall, 0.0, np.array([1.0, 0.0]), 10.0, cuts=cuts) is Verdict.RESTS
    assert cuts[-1].accumulation
    exact = ricochet.BouncingBall(restitution=0.5).zeno_time(1.0)
    assert cuts[-1].t == pytest.approx(exact, abs=1e-9)
    assert monitor.hold(10.0) is Verdict.RESTS and monitor.t == 10.0
    assert np.array_equal(monitor.x, [0, 0])
    with pytest.raises(RuntimeError, match="hold"):
        monitor.examine(10.0, 0.1, [0, 0], [0, 0], [0, 0], [0, 0])


def test_another_guard_that_moves_a_standing_one_outward_gives_it_its_event():
    # A cart (x, v) that stands at 0, and a clock that pushes it outward once a second.
    def flow(t, x):
        return np.array([x[1], 0.0, 1.0])

    cart = ricochet.System(flow, [
        ricochet.Guard(lambda t, x: x[0], name="stop", reset=lambda t, x: [x[0], 0.0, x[2]]),
        ricochet.Guard(lambda t, x: 1 - x[2], name="push", reset=lambda t, x: [x[0], -1.0, 0.0])])
    monitor = Monitor(cart, [0.0] * 3)
    assert drive(monitor, flow, 0.0, np.zeros(3), 3.5, cuts=[]) is Verdict.STANDS
    assert monitor.events["guard"].tolist() == [1, 0] * 3
    assert monitor.events["t"] == pytest.approx([1, 1, 2, 2, 3, 3], abs=1e-13)
    assert monitor.x[0] == 0


def test_a_host_keeps_what_a_rest_holds_while_the_rest_moves():
    # x, y and their rates; y is lifted from 1 s on, and hangs free at 2 s.
    def free(t, x):
        return np.array([x[2], x[3], 0.0, -10.0 + (10.0 * (t - 1.0) if t > 1 else 0.0)])

    def kept(t, x):
        rate = free(t, x)
        rate[monitor.held] = 0.0
        return rate

    system = ricochet.System(free, [ricochet.Guard(
        lambda t, x: x[1], reset=lambda t, x: [x[0], 0.0, x[2], -0.5 * x[3]],
        rest=lambda t, x: [x[0], 0.0, x[2], 0.0], name="floor")])
    monitor = Monitor(system, [0.0] * 4)
    assert monitor.held == []
    cuts = []
    assert drive(monitor, kept, 0.0, np.array([0.0, 0.1, 1.0, 0.0]), 1.5, cuts=cuts) is Verdict.STANDS
    assert cuts[-1].accumulation and monitor.held == [1, 3]
    # sqrt(2 0.1 / 10) (1 + e) / (1 - e), with e = 0.5
    assert cuts[-1].t == pytest.approx(3 * math.sqrt(0.02), abs=1e-12)
    assert monitor.x[0] == pytest.approx(1.5, abs=1e-12) and monitor.x[1] == 0

    monitor = Monitor(system, [0.0] * 4)
    assert drive(monitor, kept, 0.0, np.array([0.0, 0.1, 1.0, 0.0]), 3.0, cuts=cuts) is Verdict.STANDS
    assert cuts[-1].t == pytest.approx(2.0, abs=1e-12) and cuts[-1].fired == []
    assert monitor.held == [] and monitor.events["kind"][-1] == Kind.MODE
    # y = 5/3 (t - 2)^3, which steps of rk4 follow exactly
    assert monitor.x[:2] == pytest.approx([3.0, 5 / 3], abs=1e-11)


def test_time_events_and_modes_by_name():
    system = ricochet.System(
        lambda mode, t, x: [1.0 if mode == "up" else -1.0],
        [ricochet.Guard(lambda mode, t, x: 1.0 - x[0], name="top", in_modes=["up"],
                        reset=lambda mode, t, x: "down")],
        modes=("up", "down"), time_events=[0.5], time_reset=lambda mode, t, x: (mode, x + 0.25))
    monitor = Monitor(system, [0.0])
    monitor.start(0.0, [0.0], 0.1, mode="up")
    assert monitor.must_stop_at == 0.5 and monitor.mode == "up"
    with pytest.raises(RuntimeError, match="beyond the time event"):
        monitor.examine(0.0, 0.6, [0.0], [0.6], [1.0], [1.0])
    assert monitor.examine(0.0, 0.5, [0.0], [0.5], [1.0], [1.0]) is Verdict.CUT
    assert monitor.cut.on_time and monitor.cut.fired == [] and monitor.cut.after == [0.75]
    assert monitor.resume(0.1) is Verdict.STANDS and monitor.must_stop_at == math.inf
    assert monitor.examine(0.5, 0.5, [0.75], [1.25], [1.0], [1.0]) is Verdict.CUT
    cut = monitor.cut
    assert cut.t == pytest.approx(0.75, abs=1e-15) and cut.fired_names == ["top"]
    assert (cut.mode_before, cut.mode_after) == ("up", "down") and not cut.state_changed
    # The host may continue from a state and a mode of its own.
    assert monitor.resume(0.1, after=[0.5], mode="up") is Verdict.STANDS
    assert monitor.mode == "up" and monitor.x == [0.5]
    assert monitor.events["kind"].tolist() == [Kind.TIME, Kind.CROSSING]
    with pytest.raises(ValueError, match="mode"):
        monitor.start(0.0, [0.0], 0.1, mode="sideways")


def test_a_start_behind_a_floor_is_refused_by_the_monitor():
    with pytest.raises(ValueError, match="^EventMonitor: the start lies behind guard 0"):
        Monitor(ricochet.BouncingBall(), [1.0, 0.0]).start(0.0, [-1.0, 0.0], 0.1)


def test_hosts_that_change_the_state_themselves_are_cut_at_every_crossing():
    system = ricochet.System(fall, [ricochet.Guard(lambda t, x: x[0], name="floor")])
    for cuts in (False, True):
        monitor = Monitor(system, [1.0, 0.0], cut_at_all=cuts)
        monitor.start(0.0, [1.0, 0.0], 1.0)
        x1 = [1.0 - 9.81 / 2, -9.81]
        verdict = monitor.examine(0.0, 1.0, [1.0, 0.0], x1, [0.0, -9.81], [-9.81, -9.81])
        assert verdict is (Verdict.CUT if cuts else Verdict.STANDS)
        assert monitor.events["t"] == pytest.approx([math.sqrt(2 / 9.81)], abs=1e-15)
    assert not monitor.cut.state_changed
    with pytest.raises(ValueError, match="components|shape|numbers"):
        monitor.resume(1.0, after=[[1.0]])


def test_a_host_may_skip_to_where_no_guard_needs_a_check():
    def speed(t, x):
        return 2.0

    system = ricochet.System(lambda t, x: [-1.0], [ricochet.Guard(
        lambda t, x: x[0], reset=lambda t, x: [1.0], speed_bound=speed)])
    monitor = Monitor(system, [1.0], detector="planned")
    monitor.start(0.0, [1.0], 0.01)
    monitor.examine(0.0, 0.01, [1.0], [0.99], [-1.0], [-1.0])
    until = monitor.quiet_until
    assert 0.01 < until <= 0.5
    monitor.skip_to(until, [1.0 - until], [-1.0])
    assert monitor.t == until and monitor.run.statistics.evidence.proved > 0
    with pytest.raises(RuntimeError, match="quiet_until"):
        monitor.skip_to(0.9, [0.1], [-1.0])
    assert Monitor(Ball(), [1.0, 0.0]).quiet_until == 0.0


def test_time_may_run_backward():
    # From t = 1 to 0 along x = t - 1/4, with dx/dt as it is.
    system = ricochet.System(lambda t, x: [1.0], [ricochet.Guard(lambda t, x: x[0], direction=0)])
    monitor = Monitor(system, [0.75], backward=True, cut_at_all=True)
    assert monitor.start(1.0, [0.75], 1.0) is Verdict.STANDS
    for interpolate in (None, lambda t: [t - 0.25]):
        monitor.start(1.0, [0.75], 1.0, [1.0])
        verdict = monitor.examine(1.0, 1.0, [0.75], [-0.25], [1.0], [1.0], interpolate)
        assert verdict is Verdict.CUT and monitor.cut.t == pytest.approx(0.25, abs=1e-15)


def test_a_snapshot_goes_on_with_the_same_bits():
    def steps(monitor, first, last):
        for k in range(first, last):
            x = np.array([[math.cos(t), -math.sin(t)] for t in (k / 2, (k + 1) / 2)])
            rates = np.column_stack((x[:, 1], -x[:, 0]))
            if k > first:  # the state at the end of one step is that at the start of the next
                assert np.array_equal(monitor.x, x[0])
            assert monitor.examine(k / 2, 0.5, *x, *rates) is Verdict.STANDS

    system = ricochet.Pendulum(gravity=1.0)
    monitor = Monitor(system, [1.0, 0.0])
    monitor.start(0.0, [1.0, 0.0], 0.5)
    steps(monitor, 0, 10)
    snapshot = pickle.loads(pickle.dumps(monitor.save()))
    monitor.clear_events()
    assert monitor.events.size == 0
    steps(monitor, 10, 20)
    again = Monitor(system, [1.0, 0.0])
    again.restore(snapshot)
    assert again.t == 5.0
    steps(again, 10, 20)
    assert again.events.size == 2 and np.array_equal(again.events, monitor.events)
    with pytest.raises(ValueError, match="monitor|guards"):
        Monitor(ricochet.BouncingBall(), [1.0, 0.0]).restore(snapshot)
    with pytest.raises(ValueError):
        ricochet.Simulation(system, [1.0, 0.0], 1.0).restore(snapshot)


# --- wrong input ---

def started(**options):
    monitor = Monitor(ricochet.BouncingBall(), [1.0, 0.0], **options)
    monitor.start(0.0, [1.0, 0.0], 0.1)
    return monitor


def shown(monitor, t0=0.0, h=0.1, x0=(1.0, 0.0), x1=None, rate0=(0.0, -9.81), rate1=None,
          interpolate=None):
    x1 = [1.0 - 9.81 / 2 * h * h, -9.81 * h] if x1 is None else x1
    rate1 = [-9.81 * h, -9.81] if rate1 is None else rate1
    return monitor.examine(t0, h, x0, x1, rate0, rate1, interpolate)


@pytest.mark.parametrize("change, error, words", [
    ({"t0": 0.05}, RuntimeError, "begins where the last one ended"),
    ({"t0": -0.05}, RuntimeError, "begins where the last one ended"),
    ({"x0": (0.9, 0.0)}, RuntimeError, r"x0\[0\]"), ({"h": 0.0}, ValueError, "above 0"),
    ({"h": -0.1}, ValueError, "above 0"), ({"h": math.nan}, ValueError, "above 0"),
    ({"x0": (1.0,)}, ValueError, r"x0: found shape \(1,\), expected \(2,\)"),
    ({"x1": [[1.0, 0.0]]}, ValueError, r"x1: found shape \(1, 2\)"),
    ({"x1": [math.nan, 0.0]}, ValueError, "x1 must be finite, got nan in component 0"),
    ({"rate0": [0.0, math.inf]}, ValueError, "rate0 must be finite, got inf in component 1"),
    ({"rate1": [math.nan, 0.0]}, ValueError, "rate1 must be finite, got nan in component 0"),
    ({"rate0": [1.0] * 3}, ValueError, "rate0: found shape"),
    ({"rate1": 3.0}, ValueError, "rate1: found shape"), ({"x1": None, "interpolate": 3}, TypeError,
                                                         "interpolate: found a int"),
    ({"x1": "ab"}, (TypeError, ValueError), ""), ({"t0": "now"}, TypeError, "")])
def test_steps_that_are_refused_change_nothing(change, error, words):
    monitor = started()
    with pytest.raises(error, match=words):
        shown(monitor, **change)
    assert shown(monitor) is Verdict.STANDS and monitor.t == 0.1


def test_calls_out_of_turn():
    monitor = Monitor(ricochet.BouncingBall(), [1.0, 0.0])
    for call in (lambda: shown(monitor), monitor.save, lambda: monitor.resume(0.1),
                 lambda: monitor.hold(1.0), lambda: monitor.skip_to(0.0, [1.0, 0.0], [0.0, -9.81])):
        with pytest.raises(RuntimeError, match="expected"):
            call()
    monitor.start(0.0, [1.0, 0.0], 0.1)
    assert shown(monitor, h=0.5) is Verdict.CUT
    for call in (lambda: shown(monitor, t0=0.5), monitor.save):
        with pytest.raises(RuntimeError, match="resume"):
            call()  # a host that has forgotten to
    assert monitor.resume(0.1) is Verdict.STANDS
    with pytest.raises(RuntimeError, match="resume"):
        monitor.resume(0.1)


@pytest.mark.parametrize("make, error, words", [
    (lambda: Monitor(ricochet.System(fall), [1.0, 0.0]), ValueError, "without guards"),
    (lambda: Monitor(ricochet.BouncingBall(), [1.0]), ValueError, "components"),
    (lambda: Monitor(fall, [1.0, 0.0]), TypeError, "ricochet.System"),
    (lambda: Monitor(ricochet.BouncingBall(), [1.0, 0.0], rtol=1), TypeError, "'rtol'.*locator"),
    (lambda: Monitor(ricochet.BouncingBall(), [1.0, 0.0], event_tolerance=-1), ValueError,
     "event_tolerance"),
    (lambda: started(detector="none"), ValueError, "detector"),
    (lambda: started().start(0.0, [-1.0, 0.0], 0.1), ValueError, "guard"),
    (lambda: started().start(math.nan, [1.0, 0.0], 0.1), ValueError, "time"),
    (lambda: started().start(0.0, [math.nan, 0.0], 0.1), ValueError, "finite|nan"),
    (lambda: started().start(0.0, [1.0, 0.0], 0.0), ValueError, "scale"),
    (lambda: started().start(0.0, [1.0, 0.0], 0.1, [1.0]), ValueError, "rate: found shape"),
    (lambda: started().start(0.0, [1.0, 0.0], 0.1, [0.0, math.nan]), ValueError,
     "rate must be finite, got nan in component 1"),
    (lambda: started().cut, RuntimeError, "cut: found no set of events since the start"),
    (lambda: started().start(0.0, [1.0], 0.1), ValueError, r"x: found shape \(1,\), expected"),
    (lambda: started().start(0.0, [1.0, 0.0, 0.0], 0.1), ValueError, r"x: found shape \(3,\)"),
    (lambda: Monitor(ricochet.StickSlip(), [1.0, 0.2]).start(0.0, [1.0], 0.1), ValueError,
     "stick-slip: found a start of 1 components, expected 2"),
    (lambda: Monitor(ricochet.Thermostat(), [20.0]).start(0.0, [20.0], 0.1, mode=7), ValueError,
     "mode"),
    (lambda: started().start(0.0, [1.0, 0.0], 0.1, mode="up"), ValueError, "mode"),
    (lambda: started().start(0.0, [1.0, 0.0], 0.1, mode=-1), ValueError, "mode")])
def test_set_ups_that_are_none(make, error, words):
    with pytest.raises(error, match=words):
        make()


class Mine(Exception):
    pass


@pytest.mark.parametrize("where", ["guard", "reset", "interpolate"])
def test_exceptions_arrive_unchanged_and_the_monitor_starts_anew(where):
    thrown = Mine("unchanged")
    armed = True

    def maybe(name, value):
        if armed and name == where:
            raise thrown
        return value

    system = ricochet.System(fall, [ricochet.Guard(
        lambda t, x: maybe("guard", x[0]) if t > 0.1 else x[0],
        reset=lambda t, x: maybe("reset", [0.0, -x[1]]))])
    monitor = Monitor(system, [1.0, 0.0])
    monitor.start(0.0, [1.0, 0.0], 0.5)

    def interpolate(t):
        return maybe("interpolate", [1.0 - 9.81 / 2 * t * t, -9.81 * t])

    with pytest.raises(Mine) as raised:
        shown(monitor, h=0.5, interpolate=interpolate)
    assert raised.value is thrown and raised.value.ricochet_run.t == 0.0
    with pytest.raises(RuntimeError, match="start"):
        shown(monitor, h=0.5)
    armed = False
    monitor.start(0.0, [1.0, 0.0], 0.5)
    assert shown(monitor, h=0.5, interpolate=interpolate) is Verdict.CUT
    assert monitor.cut.t == pytest.approx(math.sqrt(2 / 9.81), abs=1e-15)


def test_interpolants_that_return_something_else():
    for result, error in ((None, TypeError), ([1.0], ValueError), ("ab", TypeError)):
        monitor = started()
        with pytest.raises(error, match="interpolate returned"):
            shown(monitor, h=0.5, interpolate=lambda t: result)


def test_one_caller_at_a_time():
    entered, leave = threading.Event(), threading.Event()

    def guard(t, x):
        if t > 0:
            entered.set()
            leave.wait(5)
        return x[0]

    monitor = Monitor(ricochet.System(fall, [ricochet.Guard(guard)]), [1.0, 0.0])
    monitor.start(0.0, [1.0, 0.0], 0.1)
    thread = threading.Thread(target=lambda: shown(monitor))
    thread.start()
    assert entered.wait(5)
    for use in (lambda: shown(monitor), lambda: monitor.t, lambda: monitor.events, monitor.save,
                lambda: monitor.cut):
        with pytest.raises(RuntimeError, match="Monitor: found in use"):
            use()
    leave.set()
    thread.join()
    assert monitor.t == 0.1


@pytest.mark.parametrize("backward", [False, True])
def test_an_interpolant_of_offsets_is_refused(backward):
    sign = -1 if backward else 1

    def height(s):  # at the offset s from the start
        return [1 - s, -1.0 * sign]

    system = ricochet.System(lambda t, x: [x[1], 0.0],
                             [ricochet.Guard(lambda t, x: x[0] - 0.25, name="low")])
    for of_offsets in False, True:
        monitor = Monitor(system, [1.0, 0.0], backward=backward, cut_at_all=True)
        monitor.start(sign * 5.0, height(0), 0.5)

        def show(k):
            t0, s0 = sign * (5.0 + 0.5 * k), 0.5 * k
            path = (lambda s: height(s0 + s)) if of_offsets else (
                lambda t: height(s0 + sign * (t - t0)))
            rate = [-1.0 * sign, 0.0]
            return monitor.examine(t0, 0.5, height(s0), height(s0 + 0.5), rate, rate, path)

        if of_offsets:
            with pytest.raises(ValueError, match="interpolate: found the state as a function of "
                                                 "the offset from t0, expected a function of the"):
                [show(k) for k in range(2)]
        else:
            assert [show(k) for k in range(2)] == [Verdict.STANDS, Verdict.CUT]
            assert monitor.cut.t == pytest.approx(sign * 5.75)
            assert f"{Verdict.CUT} {Verdict.CUT:d}" == "CUT 1" and str(ricochet.Kind.TIME) == "TIME"
