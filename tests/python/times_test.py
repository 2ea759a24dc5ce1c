"""Times of events: lists, clocks, timers in the state; the start and the end of a run."""

import math
import pickle

import pytest

import ricochet
from ricochet import Guard, Stop, System, Times, every


def still(t, x):
    return [0.0] * len(x)


def doses(times, amount=1.0, **more):
    return System(still, time_events=times, time_reset=lambda t, x: x + amount, **more)


# --- lists and clocks ---

def test_a_list_includes_both_ends_and_every_entry():
    run = ricochet.integrate(doses([24, 0, 12], 100), [0.0], 24.0)
    assert run.x[0] == 300 and list(run.events["t"]) == [0, 12, 24]
    assert ricochet.integrate(doses([1, 1], 100), [0.0], 2.0).x[0] == 200
    assert ricochet.integrate(doses(iter([1, 1]), 100), [0.0], 2.0).x[0] == 200
    assert ricochet.integrate(doses(Times([0, 0, 2]), 1), [0.0], 2.0).x[0] == 3
    backward = ricochet.integrate(doses([0, 1, 1, 2]), [0.0], 0.0, t_start=2.0)
    assert list(backward.events["t"]) == [2, 1, 1, 0]


def test_chained_runs_have_each_entry_once():
    system = doses([0, 12, 24], 100)
    first = ricochet.integrate(system, [0.0], 12.0)
    second = ricochet.integrate(system, first.x, 24.0, t_start=12.0, continues=True)
    assert second.x[0] == 300


def test_a_clock_ticks_from_start_to_end_without_drift():
    run = ricochet.integrate(doses(every(0.1)), [0.0], 100.0)
    assert list(run.events["t"]) == [k * 0.1 for k in range(1001)]
    later = ricochet.integrate(doses(every(0.5, phase=0.25)), [0.0], 1.0)
    assert list(later.events["t"]) == [0.25, 0.75]
    clock = every(0.1)
    assert clock.next(0.3) == 4 * 0.1 or clock.next(0.3) == 3 * 0.1
    assert clock.count(7 * 0.1) == 1 and clock.previous(0) == -0.1


def test_a_function_is_never_asked_before_the_start_and_excludes_it():
    asked = []

    def following(t):
        asked.append(t)
        return math.floor(2 * t + 1) / 2

    system = System(still, next_time_event=following, time_reset=lambda t, x: x + 1)
    assert ricochet.integrate(system, [0.0], 2.0).x[0] == 4
    assert min(asked) == 0


def test_wrong_times_are_refused_by_name():
    with pytest.raises(ValueError, match="sampler: period must be positive and finite, got -1"):
        every(-1, name="sampler")
    with pytest.raises(ValueError, match="every: phase must be finite, got inf"):
        every(1, math.inf)
    with pytest.raises(TypeError, match="period: found 'a'"):
        every("a")
    with pytest.raises(ValueError, match="time_events: found nan, expected times"):
        ricochet.integrate(doses([math.nan]), [0.0], 1.0)
    with pytest.raises(TypeError, match=r"time_events: found 5, expected a sequence of times"):
        ricochet.integrate(doses(5), [0.0], 1.0)
    with pytest.raises(ValueError, match="time_events: found next_time_event"):
        ricochet.integrate(doses([1], next_time_event=lambda t: t + 1), [0.0], 1.0)
    with pytest.raises(TypeError, match=r"next_time_event: found \(t, x, y\), expected \(t\) or "
                                        r"\(t, x\)"):
        ricochet.integrate(System(still, next_time_event=lambda t, x, y: t), [0.0], 1.0)


# --- timers in the state ---

class Monostable(System):
    """x' = 1 reaches 1, which starts a timer of 0.25 s; then x is 0 again."""

    modes = ("rises", "waits")

    def flow(self, mode, t, x):
        return [1.0 if mode == "rises" else 0.0, 0.0]

    @ricochet.guard(in_modes=["rises"])
    def top(self, mode, t, x):
        return 1 - x[0]

    @top.reset
    def top(self, mode, t, x):
        return "waits", [x[0], t + 0.25]

    def next_time_event(self, mode, t, x):
        return x[1] if mode == "waits" else None

    def time_reset(self, mode, t, x):
        return "rises", [0.0, x[1]]


@pytest.mark.parametrize("method", ["dopri5", "fehlberg78"])
def test_a_timer_that_an_event_starts(method):
    run = ricochet.integrate(Monostable(), [0.0, 0.0], 10.5, method=method)
    times = [1 + 1.25 * (k // 2) + 0.25 * (k % 2) for k in range(16)]
    assert run.events["t"].tolist() == pytest.approx(times, abs=1e-13)


def test_spikes_that_are_due_together_each_happen():
    def least(t, x):
        return min(x[1:])

    def spike(t, x):
        x[1 + x[1:].argmin()] = 1e9
        x[0] += 1
        return x

    system = System(still, next_time_event=least, time_reset=spike)
    run = ricochet.integrate(system, [0.0, 1.0, 1.0, 1.0], 2.0)
    assert run.x[0] == 3 and run.outcome == "reached_end"
    assert list(ricochet.integrate(system, [0.0, 0.0, 1.0], 2.0).events["t"]) == [0, 1]


def test_a_timer_that_is_due_where_a_run_goes_on_happens_there():
    # The second spike ends the run; the third is due at the same time, and still in the state.
    def spike(t, x):
        x[1 + x[1:].argmin()] = 1e9
        x[0] += 1
        return x

    system = System(still, [Guard(lambda t, x: 1.5 - x[0], stop_after=1)],
                    next_time_event=lambda t, x: min(x[1:]), time_reset=spike)
    simulation = ricochet.Simulation(system, [0.0, 1.0, 1.0, 1.0], 2.0)
    first = simulation.run_to_end()
    assert first.outcome == "stopped_by_event" and first.t == 1 and first.x[0] == 2
    second = ricochet.integrate(system, first.x, 2.0, t_start=1.0, continues=True)
    assert second.x[0] == 3 and list(second.events["t"]) == [1]
    simulation.restart(1.0, first.x)
    assert simulation.run_to_end().x[0] == 3


def test_a_timer_that_stays_due_ends_the_run():
    system = System(still, next_time_event=lambda t, x: 1.0)
    run = ricochet.integrate(system, [0.0], 2.0)
    assert run.outcome == "time_event_not_ahead" and run.t == 1
    with pytest.raises(ValueError, match="must return t or a time after it"):
        ricochet.integrate(system, [0.0], 3.0, t_start=2.0)
    counting = System(still, next_time_event=lambda t, x: 1.0, time_reset=lambda t, x: x + 1)
    assert ricochet.integrate(counting, [0.0], 2.0).outcome == "endless_cascade"


def test_a_timer_stops_the_steps_of_a_host():
    system = System(lambda t, x: [1.0, 0.0], next_time_event=lambda t, x: x[1],
                    time_reset=lambda t, x: [x[0], x[1] + 0.5])
    monitor = ricochet.Monitor(system, [0.0, 0.5])
    monitor.start(0.0, [0.0, 0.5], 0.1)
    assert monitor.must_stop_at == 0.5
    verdict = monitor.examine(0.0, 0.5, [0.0, 0.5], [0.5, 0.5], [1.0, 0.0], [1.0, 0.0])
    assert verdict == ricochet.Verdict.CUT and monitor.cut.on_time
    monitor.resume(0.1)
    assert monitor.must_stop_at == 1


# --- the start, and the entry of a mode ---

def limit(rate, **options):
    return System(lambda t, x: [rate], [Guard(lambda t, x: x[0], name="limit",
                                              reset=lambda t, x: x + 10, **options)])


@pytest.mark.parametrize("x, rate, direction, events", [
    (-1, 1, -1, 1), (1, 1, -1, 0), (1, 1, 1, 1), (-1, -1, 1, 0),
    (0, 1, -1, 0), (0, -1, -1, 1), (0, 0, -1, 1), (0, 1, 1, 1), (0, -1, 1, 0)])
def test_a_guard_fires_at_the_start_where_its_condition_holds(x, rate, direction, events):
    system = limit(float(rate), direction=direction, at_start=True)
    assert len(ricochet.integrate(system, [float(x)], 1e-3).events) == events
    assert len(ricochet.integrate(system, [float(x)], 1e-3, continues=True).events) == 0


def test_a_guard_that_begins_beyond_its_surface_is_counted_and_named():
    run = ricochet.integrate(limit(1.0), [-1.0], 3.0)
    assert len(run.events) == 0 and run.statistics.armed_beyond == 1
    assert run.message.endswith("limit") and "beyond their surface" in run.message
    assert pickle.loads(pickle.dumps(run)).message == run.message
    assert ricochet.integrate(limit(1.0), [1.0], 3.0).statistics.armed_beyond == 0
    with pytest.raises(ValueError, match=r"guard 0 \(limit\) has at_start, so it must be falling"):
        ricochet.integrate(limit(1.0, direction=0, at_start=True), [1.0], 1.0)


@pytest.mark.parametrize("at_entry", [True, False])
def test_a_comparator_beyond_its_limit_where_its_mode_begins(at_entry):
    system = System(lambda mode, t, x: [2.0 if mode == "on" else -0.1],
                    [Guard(lambda mode, t, x: 1 - x[0], in_modes=["on"], at_entry=at_entry,
                           reset=lambda mode, t, x: "off")],
                    modes=("off", "on"), time_events=every(1), time_reset=lambda mode, t, x: "on")
    run = ricochet.integrate(system, [2.0], 4.5)
    assert run.x[0] == pytest.approx(1.55 if at_entry else 11.0, abs=1e-12)
    assert run.statistics.armed_beyond == (not at_entry)


# --- runs without an end, and resets that end them ---

def test_a_run_without_an_end_is_ended_by_an_event():
    def decay(**options):
        return System(lambda t, x: -x, [Guard(lambda t, x: x[0] - math.exp(-1), **options)])

    run = ricochet.integrate(decay(stop_after=1), [1.0], math.inf)
    assert run.outcome == "stopped_by_event" and abs(run.t - 1) < 1e-7
    with pytest.raises(ValueError, match="t_end must be a finite time where nothing else may end"):
        ricochet.integrate(decay(), [1.0], math.inf)
    with pytest.raises(ValueError, match="t_end must be a finite time where nothing else"):
        ricochet.integrate(ricochet.Pendulum(), (0.1, 0.0), math.inf)
    assert ricochet.integrate(decay(), [1.0], math.inf, max_steps=50).outcome == "step_limit"


@pytest.mark.parametrize("rate", [0.0, 1.0])
def test_a_run_without_an_end_that_nothing_ends_stalls(rate):
    # A terminal guard that is never reached by a motion that stands still, or recedes.
    system = System(lambda t, x: [rate], [Guard(lambda t, x: x[0], stop_after=1)])
    run = ricochet.integrate(system, [1.0], math.inf)
    assert run.outcome == "stalled"
    assert run.message.startswith("stall_steps steps hardly advanced the time, or nothing")


def falling(reset):
    return System(lambda t, x: [-1.0, 0.0], [Guard(lambda t, x: x[0], reset=reset)])


def test_a_reset_ends_the_run():
    def returned(t, x):
        return Stop("empty", [0.0, 7.0])

    def raised(t, x):
        raise Stop("empty")

    run = ricochet.integrate(falling(returned), [1.0, 0.0], 5.0)
    assert run.outcome == "stopped_by_event" and run.success and run.guard == 0
    assert run.reason == "empty" and run.message == "a reset ended the run: empty"
    assert list(run.x) == [0, 7] and abs(run.t - 1) < 1e-15
    assert pickle.loads(pickle.dumps(run)).reason == "empty"
    run = ricochet.integrate(falling(raised), [1.0, 2.0], 5.0)
    assert run.reason == "empty" and run.x[1] == 2
    simulation = ricochet.Simulation(falling(raised), [1.0, 2.0], math.inf, max_steps=10**6)
    assert simulation.run_to_end().reason == "empty"


def test_solve_ivp_says_why_a_reset_ended_it():
    def floor(t, y):
        return y[0]

    def stop(t, y):
        raise Stop("empty")

    floor.reset = stop
    result = ricochet.solve_ivp(lambda t, y: [-1.0], (0, 5), [1.0], events=floor)
    assert result.status == 1 and result.message == "a reset ended the run: empty"


def test_time_resets_and_resets_of_sets_end_the_run_in_a_mode():
    ticks = System(lambda mode, t, x: [0.0], modes=("on", "off"), time_events=every(1),
                   time_reset=lambda mode, t, x: Stop("done", ("off", [t])) if t > 2 else mode)
    run = ricochet.integrate(ticks, [0.0], math.inf, max_steps=1000)
    assert (run.t, run.mode, run.x[0], run.reason) == (3, "off", 3, "done")
    both = System(lambda t, x: [-1.0], [Guard(lambda t, x: x[0])],
                  reset_set=lambda t, x, fired: Stop(f"{fired}"))
    assert ricochet.integrate(both, [1.0], 5.0).reason == "[0]"


def test_a_stop_is_a_text_and_no_end_of_a_rest():
    with pytest.raises(TypeError, match="Stop: found 3, expected a text"):
        Stop(3)

    def other(t, x):
        raise KeyError("a defect")

    with pytest.raises(KeyError):
        ricochet.integrate(falling(other), [1.0, 0.0], 5.0)
