"""Ensembles of systems written in Python, in this process and by executors."""

import concurrent.futures
import itertools
import multiprocessing
import pickle

import numpy as np
import pytest

import ricochet


class Ball(ricochet.System):
    """A ball under gravity on a floor."""

    def __init__(self, restitution=0.9, gravity=9.81):
        super().__init__()
        self.bounciness = restitution
        self.pull = gravity

    def flow(self, t, x):
        return [x[1], -self.pull]

    @ricochet.guard(unilateral=True)
    def floor(self, t, x):
        return x[0]

    @floor.reset
    def floor(self, t, x):
        if self.bounciness > 1:
            raise ArithmeticError(f"a ball of restitution {self.bounciness:.17g}")
        return [0.0, -self.bounciness * x[1]]


class Room(ricochet.System):
    """A thermostat, whose state loses its clock when the heater goes on."""

    modes = ("off", "on")
    changes_dimension = True

    def flow(self, mode, t, x):
        return [-1.0, 1.0] if mode == "off" else [1.0]

    @ricochet.guard(in_modes=["off"])
    def cold(self, mode, t, x):
        return x[0] - 18

    @cold.reset
    def cold(self, mode, t, x):
        return "on", x[:1]


def drops(rows=50):
    random = np.random.default_rng(1)
    starts = np.column_stack([random.uniform(1, 10, rows), np.zeros(rows)])
    return starts, {"restitution": random.uniform(0.7, 0.9, rows)}


def content(found):
    return pickle.dumps([found.rows.tobytes(), found.event_table.tobytes(), found.failures,
                         found.complete, found.guard_names,
                         None if found.states is None else found.states.tobytes()])


def test_rows_are_runs_of_integrate():
    starts, parameters = drops()
    balls = ricochet.ensemble(Ball, starts, 3.0, parameters=parameters)
    assert balls.complete and not balls.failures and len(balls) == 50
    assert balls.guard_names == ["floor"] and balls.states is None
    for i in (0, 15, 16, 49):
        run = ricochet.integrate(Ball(parameters["restitution"][i]), starts[i], 3.0)
        assert (balls.outcome[i], balls.t[i], balls.mode[i]) == (run.outcome, run.t, 0)
        assert balls.x[i].tobytes() == run.x.tobytes()
        assert balls.events[i] == len(run.events) and balls.steps[i] == run.statistics.steps
        events = balls.event_table[balls.event_table["row"] == i]
        for name in run.events.dtype.names:
            assert np.array_equal(events[name], run.events[name]), name
    assert np.all(np.diff(balls.event_table["row"]) >= 0)
    assert "50 reached_end" in repr(balls)


def test_they_are_the_runs_of_the_ready_system():
    starts, parameters = drops()
    ready = ricochet.ensemble(ricochet.BouncingBall, {"height": starts[:, 0], **parameters}, 3.0)
    assert ready.event_table is None
    kept = ricochet.ensemble(ricochet.BouncingBall, starts, 3.0, parameters=parameters)
    assert kept.rows.tobytes() == ready.rows.tobytes()
    assert len(kept.event_table) == ready.events.sum()


def test_systems_parameters_and_starts_are_given_in_several_forms():
    starts, parameters = drops()
    expected = content(ricochet.ensemble(Ball, starts, 3.0, parameters=parameters))
    fields = np.array(list(zip(parameters["restitution"])), [("restitution", float)])
    for given in (fields, parameters["restitution"], parameters["restitution"][:, None],
                  np.column_stack([parameters["restitution"], np.full(50, 9.81)])):
        assert content(ricochet.ensemble(Ball, starts, 3.0, parameters=given)) == expected
    one = ricochet.ensemble(Ball, starts[0], 3.0, parameters=parameters)
    each = ricochet.ensemble(Ball, np.tile(starts[0], (50, 1)), 3.0, parameters=parameters)
    assert content(one) == content(each)
    made = ricochet.ensemble(Ball(0.8), starts, 3.0)
    assert content(made) == content(ricochet.ensemble(lambda: Ball(0.8), starts.tolist(), 3.0))


def executors():
    yield concurrent.futures.ThreadPoolExecutor(3)
    for processes in (1, 2):
        yield concurrent.futures.ProcessPoolExecutor(processes, multiprocessing.get_context("fork"))


def test_the_bits_depend_neither_on_executors_nor_on_workers():
    starts, parameters = drops()
    parameters["restitution"][[7, 40]] = 1.5
    given = dict(parameters=parameters, sample_times=np.linspace(0, 3, 7))
    expected = content(ricochet.ensemble(Ball, starts, 3.0, **given))
    for threads in (1, 2, 4):
        assert content(ricochet.ensemble(Ball, starts, 3.0, threads=threads, **given)) == expected
    for executor in executors():
        with executor:
            found = ricochet.ensemble(Ball, starts, 3.0, executor=executor, **given)
        assert content(found) == expected


@pytest.mark.parametrize("formula", [None, 2])
def test_a_system_that_is_made_serves_all_rows_and_threads(formula):
    swing = ricochet.System(
        lambda t, x: [x[1], -np.sin(x[0])],
        [ricochet.Guard(lambda t, x: x[0], unilateral=True, reset=lambda t, x: [0.0, -0.8 * x[1]])],
        formula=formula)
    starts = np.column_stack([np.linspace(0.1, 2.0, 40), np.zeros(40)])
    one = ricochet.ensemble(swing, starts, 8.0)
    assert content(ricochet.ensemble(swing, starts, 8.0, threads=3)) == content(one)
    for i in (0, 17, 39):
        assert one.x[i].tobytes() == ricochet.integrate(swing, starts[i], 8.0).x.tobytes()


def test_a_cluster_of_dask_gives_the_same_bits():
    distributed = pytest.importorskip("distributed")
    starts, parameters = drops()
    expected = content(ricochet.ensemble(Ball, starts, 3.0, parameters=parameters))
    with distributed.LocalCluster(2, processes=True, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        with distributed.Client(cluster) as client:
            found = ricochet.ensemble(Ball, starts, 3.0, parameters=parameters, executor=client)
            assert content(found) == expected
            # Functions that no pool of processes takes.
            found = ricochet.ensemble(lambda restitution: Ball(restitution), starts, 3.0,
                                      parameters=parameters, executor=client)
            assert content(found) == expected


def test_a_row_that_fails_is_a_row():
    starts, parameters = drops()
    parameters["restitution"][33] = 1.5
    for options in ({}, {"executor": concurrent.futures.ThreadPoolExecutor(2)}):
        balls = ricochet.ensemble(Ball, starts, 3.0, parameters=parameters, **options)
        assert balls.complete and list(balls.failures) == [33]
        said = balls.failures[33]
        first = np.sqrt(2 * starts[33, 0] / 9.81)
        assert said.startswith("row 33: ArithmeticError: a ball of restitution 1.5 (after t = ")
        assert 0 < float(said.rpartition(" ")[2][:-1]) <= first  # the end of the step before
        assert balls.outcome[33] == "failed" and np.isnan(balls.x[33]).all()
        assert not (balls.event_table["row"] == 33).any()
    # One that cannot be made, one that cannot start, and one that goes to infinity.
    made = ricochet.ensemble(lambda restitution: 1 / restitution and Ball(restitution),
                             [1.0, 0.0], 1.0, parameters=[0.5, 0.0])
    assert list(made.failures) == [1] and "row 1: ZeroDivisionError" in made.failures[1]
    begun = ricochet.ensemble(Ball(), [[1.0, 0.0], [-1.0, 0.0]], 1.0)
    assert list(begun.failures) == [1] and "row 1: ValueError: integrate: " in begun.failures[1]
    with np.errstate(over="ignore"):
        grown = ricochet.ensemble(ricochet.System(lambda t, x: x * x), [[0.0], [1.0]], 2.0)
    assert grown.outcome[0] == "reached_end" and not grown.failures
    assert grown.outcome[1] not in ("reached_end", "failed")


def test_states_of_other_lengths_end_in_nan():
    rooms = ricochet.ensemble(Room(), [[20.0, 0.0], [30.0, 0.0]], 4.0, mode="off",
                              sample_times=[0, 1, 4])
    assert rooms.modes == ["off", "on"] and rooms.mode.tolist() == [1, 0]
    np.testing.assert_allclose(rooms.x, [[20.0, np.nan], [26.0, 4.0]])
    np.testing.assert_allclose(rooms.states[0], [[20, 0], [19, 1], [20, np.nan]])
    assert np.isnan(rooms.event_table["after"][0]).tolist() == [False, True]


def test_samples_after_the_end_of_a_run_are_nan():
    stops = ricochet.System(lambda t, x: [-1.0], [ricochet.Guard(lambda t, x: x[0], stop_after=1)])
    found = ricochet.ensemble(stops, [[1.5], [9.0]], 3.0, sample_times=[0, 1, 2, 3])
    np.testing.assert_allclose(found.states[:, :, 0], [[1.5, 0.5, np.nan, np.nan], [9, 8, 7, 6]])
    assert found.outcome.tolist() == ["stopped_by_event", "reached_end"]


def test_progress_is_shown_and_stops():
    starts, parameters = drops()
    seen = []
    ricochet.ensemble(Ball, starts, 1.0, parameters=parameters,
                      progress=lambda done, rows: seen.append((done, rows)))
    assert seen == [(16, 50), (32, 50), (48, 50), (50, 50)]
    for options in ({}, {"threads": 2}):
        balls = ricochet.ensemble(Ball, starts, 1.0, parameters=parameters,
                                  progress=lambda done, rows: False, **options)
        assert not balls.complete and (balls.outcome[:16] == "reached_end").all()
        assert (balls.outcome[16:] == "").all() and np.isnan(balls.t[16:]).all()


def test_an_interrupt_of_a_function_arrives():
    def interrupts(t, x):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ricochet.ensemble(ricochet.System(interrupts), [[1.0]], 1.0)


def test_no_rows_are_an_ensemble():
    balls = ricochet.ensemble(Ball(), np.empty((0, 2)), 1.0)
    assert balls.complete and len(balls) == 0


def test_a_process_pool_says_what_it_cannot_send():
    class Local(Ball):
        pass

    for system in (ricochet.System(lambda t, x: -x), Local()):
        refused_by_a_process_pool(system)


def refused_by_a_process_pool(system):
    with concurrent.futures.ProcessPoolExecutor(1, multiprocessing.get_context("fork")) as executor:
        with pytest.raises(TypeError, match="cannot be sent to another process .*top level"):
            ricochet.ensemble(system, [[1.0, 2.0]], 1.0, executor=executor)


def test_compiled_functions_are_not_sent_to_other_processes():
    with pytest.raises(TypeError, match="address"):
        pickle.dumps(ricochet.Compiled(4096))


@pytest.mark.parametrize("arguments, options, error, said", [
    ((Ball(), [[1.0, 2.0]], 1.0), {"parameters": [1.0]}, TypeError, "parameters: .*its class"),
    ((Ball, [[1.0, 2.0]], 1.0), {"parameters": [1.0, 2.0]}, ValueError, "found 2 rows, expected 1"),
    ((Ball, [[1.0, 2.0]], 1.0), {"parameters": {"a": [1.0], "b": [1.0, 2.0]}}, ValueError, "length"),
    ((Ball(), [1.0, 2.0], 1.0), {}, ValueError, r"starts: found shape \(2,\)"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"columns": ["a"]}, TypeError, "columns"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"rtoll": 1}, TypeError, "did you mean 'rtol'"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"rtol": -1}, ValueError, "rtol must"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"record_steps": True}, TypeError, "record_steps"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"threads": 0}, ValueError, "threads"),
    ((Ball(), [[1.0, 2.0]], 1.0), {"executor": 3}, TypeError, "executor"),
    ((Room(), [[1.0, 2.0]], 1.0), {"mode": "of"}, ValueError, "mode"),
    ((ricochet.System(), [[1.0, 2.0]], 1.0), {}, TypeError, "no flow"),
    ((3, [[1.0, 2.0]], 1.0), {}, TypeError, "system: found a int"),
    ((ricochet.BouncingBall(), {"height": [1.0]}, 1.0), {"parameters": [1.0]}, TypeError, "class"),
])
def test_what_no_row_can_be_run_with_is_refused(arguments, options, error, said):
    with pytest.raises(error, match=said):
        ricochet.ensemble(*arguments, **options)


def test_results_become_frames_of_pandas():
    starts, parameters = drops(5)
    balls = ricochet.ensemble(Ball, starts, 3.0, parameters=parameters)
    try:
        import pandas  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="to_pandas needs pandas"):
            balls.to_pandas()
        pytest.skip("pandas was not found")
    frame = balls.to_pandas()
    assert list(frame.columns[:5]) == ["restitution", "outcome", "t", "x[0]", "x[1]"]
    assert np.array_equal(frame["x[1]"], balls.x[:, 1]) and frame.index.name == "row"
    events = balls.to_pandas(events=True)
    assert len(events) == len(balls.event_table)
    assert np.array_equal(events.groupby("row")["t"].count(), balls.events)
    rooms = ricochet.ensemble(ricochet.Thermostat, {"temperature": [19.0, 20.0]}, 1.0, mode="on")
    assert rooms.to_pandas()["mode"].tolist() == ["on", "on"]
    with pytest.raises(ValueError, match="counts them"):
        rooms.to_pandas(events=True)


def test_results_become_datasets_of_xarray():
    starts, parameters = drops(5)
    balls = ricochet.ensemble(Ball, starts, 3.0, parameters=parameters, sample_times=[0.0, 1.0])
    try:
        import xarray  # noqa: F401
    except ImportError:
        with pytest.raises(ImportError, match="to_xarray needs xarray"):
            balls.to_xarray()
        pytest.skip("xarray was not found")
    data = balls.to_xarray()
    assert data.sizes["row"] == 5 and data.sizes["component"] == 2 and data.sizes["time"] == 2
    assert np.array_equal(data["states"].sel(time=1.0), balls.states[:, 1])
    assert np.array_equal(data.coords["restitution"], parameters["restitution"])
    assert np.array_equal(data["event_t"], balls.event_table["t"])
    ready = ricochet.ensemble(ricochet.BouncingBall, {"height": [1.0, 2.0]}, 1.0).to_xarray()
    assert ready["x"].shape == (2, 2) and "event_t" not in ready


# --- systems of formulas, whose rows need no interpreter ---


class Drop(Ball):
    """The same as a formula."""

    formula = 2

    @Ball.floor.reset
    def floor(self, t, x):
        return [0.0, -self.bounciness * x[1]]

    @floor.rest
    def lie(self, t, x):
        return [0.0, 0.0]


class Heater(ricochet.System):
    """A thermostat with a time constant and a clock; its modes know their parameters, too."""

    modes = ("off", "on")
    formula = 3

    def __init__(self, power, loss):
        super().__init__()
        self.rate = np.sqrt(power) / loss ** 2
        self.low = 18 + 0.5 * power
        self.time_events = [0.5, 1.5]

    def flow(self, mode, t, x):
        heat = self.rate if mode == "on" else 0.0
        return [heat - 0.3 * x[0], np.cos(self.rate * t), x[1]]

    @ricochet.guard(in_modes=["off"])
    def cold(self, mode, t, x):
        return x[0] - self.low

    @cold.reset
    def cold(self, mode, t, x):
        return "on", [x[0], x[1] + self.rate, x[2]]

    @ricochet.guard(in_modes=["on"], direction=1)
    def warm(self, mode, t, x):
        return x[0] - 20

    @warm.reset
    def warm(self, mode, t, x):
        return "off"

    def time_reset(self, mode, t, x):
        return mode, [x[0], x[1] / self.low, x[2]]


class Chain(ricochet.System):
    """Six components, by functions of parameters alone that are not rounded exactly."""

    formula = 6

    def __init__(self, stiffness=0.7, angle=0.1):
        super().__init__()
        self.stiffness = np.sin(stiffness) + stiffness ** 1.5 / np.hypot(angle, 2.0)
        self.other = -np.arctan2(stiffness, angle)

    def flow(self, t, x):
        return [*x[3:], self.stiffness * (x[1] - 2 * x[0]), self.stiffness * (x[0] + x[2] - 2 * x[1]),
                self.other * x[2]]

    @ricochet.guard(direction=0)
    def middle(self, t, x):
        return x[1]

    @middle.reset
    def middle(self, t, x):
        return [*x[:4], 0.9 * x[4], x[5]]


def of_functions(restitution):
    return ricochet.System(
        lambda t, x: [x[1], -9.81],
        [ricochet.Guard(lambda t, x: x[0], unilateral=True, reset=lambda t, x: [0.0, -restitution * x[1]])],
        formula=2)


def nothing_row_by_row(monkeypatch):
    def refuse(*_):
        raise AssertionError("a row was run by itself")
    monkeypatch.setattr(ricochet._rows, "run_each", refuse)


def row_by_row(system, starts, t_end, parameters, **options):
    """The same ensemble of systems that are made for each row."""
    class Unknown:  # nobody knows what it does with symbols
        def __call__(self, *given, **named):
            return system(*given, **named)
    return ricochet.ensemble(Unknown(), starts, t_end, parameters=parameters, **options)


CASES = [
    (Drop, np.column_stack([np.linspace(1, 9, 30), np.zeros(30)]),
     {"restitution": np.linspace(0.3, 0.9, 30), "gravity": np.linspace(5, 15, 30)}),
    (of_functions, [3.0, 0.5], np.linspace(0.3, 0.9, 30)),
    (Heater, [19.0, 0.1, 0.0], {"loss": np.linspace(0.4, 0.8, 30), "power": np.linspace(1, 3, 30)}),
    (Chain, np.linspace(0, 1, 180).reshape(30, 6), {"stiffness": np.linspace(0.5, 3, 30)}),
]


@pytest.mark.parametrize("system, starts, parameters", CASES)
@pytest.mark.parametrize("options", [
    {}, {"method": "taylor"}, {"method": "rosenbrock4", "rtol": 1e-5}, {"detector": "ends"},
    {"method": "rk4", "fixed": True, "step": 0.01}, {"sample_times": [0.0, 1.0, 2.5], "atol": 1e-10}])
def test_formulas_of_all_rows_have_the_bits_of_each(system, starts, parameters, options, monkeypatch):
    expected = content(row_by_row(system, starts, 3.0, parameters, **options))
    with concurrent.futures.ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as executor:
        by_processes = ricochet.ensemble(system, starts, 3.0, parameters=parameters,
                                         executor=executor, **options)
    assert content(by_processes) == expected
    nothing_row_by_row(monkeypatch)
    for threads in (None, 1, 3):
        found = ricochet.ensemble(system, starts, 3.0, parameters=parameters, threads=threads, **options)
        assert content(found) == expected and len(found.event_table) > 0


def test_rows_that_formulas_cannot_stand_for_are_run_by_themselves():
    parameters = {"stiffness": [0.7, 0.0, -1.0, np.inf, 1.0], "angle": [0.1, 0.0, 0.1, 0.1, np.nan]}
    starts = [1.0, 0.5, 0.2, 0.1, 0.0, 0.0]
    with np.errstate(all="ignore"):
        found = ricochet.ensemble(Chain, starts, 2.0, parameters=parameters)
        expected = row_by_row(Chain, starts, 2.0, parameters)
    assert content(found) == content(expected)
    assert list(found.failures) == [2] and found.outcome[0] == "reached_end"
    # A start that no run has, among others.
    starts = [[1.0, 0.0], [-1.0, 0.0], [2.0, 0.0]]
    found = ricochet.ensemble(Drop, starts, 1.0, parameters=[0.5, 0.6, 0.7])
    assert list(found.failures) == [1] and "row 1: ValueError: integrate: " in found.failures[1]
    assert set(found.event_table["row"]) == {0, 2} and found.complete
    assert content(found) == content(row_by_row(Drop, starts, 1.0, [0.5, 0.6, 0.7]))


class Numbered(Drop):
    numbers = itertools.count()

    def __init__(self, restitution):
        super().__init__(restitution * 0.99 ** next(self.numbers))


class Counted(Drop):
    count = 0

    def __init__(self, restitution):
        Counted.count += 1
        super().__init__(restitution)


class Distinguished(Drop):
    def __init__(self, restitution):
        super().__init__(restitution if isinstance(restitution, float) else 0.5)


class Caught(Drop):
    def __init__(self, restitution):
        try:
            restitution = float(restitution)
        except TypeError:
            restitution = 0.5
        super().__init__(restitution)


class Compared(Drop):
    def __init__(self, restitution):
        super().__init__(0.5 if restitution < 0.6 else restitution)


class Named(Drop):
    def __init__(self, restitution):
        super().__init__(restitution)
        self.bounciness = float(f"{restitution:.3f}")


class Noted(Drop):
    notes = []

    def __init__(self, restitution):
        self.notes.append(restitution)
        super().__init__(restitution)


class Distinguishing(Drop):
    def flow(self, t, x):
        return [x[1], -9.81 if isinstance(self.bounciness, float) else -5.0]


class Random(Drop):
    def __init__(self, restitution):
        super().__init__(restitution * np.random.uniform(0.9, 1.0))


def closure():
    count = 0

    def make(restitution):
        nonlocal count
        count += 1
        return Drop(restitution / count)
    return make


@pytest.mark.parametrize("maker, before", [
    (Numbered, lambda: setattr(Numbered, "numbers", itertools.count())),
    (Counted, lambda: None), (Distinguished, lambda: None), (Caught, lambda: None),
    (Compared, lambda: None), (Named, lambda: None), (Noted, Noted.notes.clear),
    (Distinguishing, lambda: None), (Random, lambda: np.random.seed(4)),
    (None, lambda: None)])
def test_systems_that_symbols_cannot_stand_for_are_made_for_each_row(maker, before):
    given = np.linspace(0.5, 0.9, 9)
    before()
    expected = content(row_by_row(maker or closure(), [2.0, 0.0], 2.0, given))
    before()
    Counted.count = 0
    assert content(ricochet.ensemble(maker or closure(), [2.0, 0.0], 2.0, parameters=given)) == expected
    assert Counted.count == (9 if maker is Counted else 0)
    assert Noted.notes == (given.tolist() if maker is Noted else [])
    Noted.notes.clear()


def test_whole_numbers_and_texts_as_parameters_are_passed_as_they_are():
    def make(kind, number):
        return Drop(0.5 + number % 2 / 5) if kind == "a" else Drop(0.9)

    found = ricochet.ensemble(make, [2.0, 0.0], 2.0, parameters={"kind": ["a", "b"], "number": [3, 4]})
    assert content(found) == content(row_by_row(Drop, [2.0, 0.0], 2.0, [0.7, 0.9]))


def test_symbols_of_parameters_are_no_numbers_of_a_run():
    class Eager(Drop):
        def __init__(self, restitution):
            super().__init__(restitution)
            self.end = ricochet.integrate(self, [1.0, 0.0], 1.0).x

    tape = ricochet._formula.ParameterTape(1)
    with pytest.raises(ValueError, match="symbols of the parameters of an ensemble"):
        Eager(tape.symbols[0])
    for what in (str, repr, float, "{}".format, abs, bool):
        with pytest.raises(TypeError, match="formula: found a"):
            what(tape.symbols[0])
    given = [0.5, 0.8]
    found = ricochet.ensemble(Eager, [2.0, 0.0], 2.0, parameters=given)
    assert content(found) == content(row_by_row(Eager, [2.0, 0.0], 2.0, given))


def test_progress_of_formulas_is_shown_and_stops():
    starts, parameters = np.tile([5.0, 0.0], (200, 1)), np.full(200, 0.8)
    seen = []
    whole = ricochet.ensemble(Drop, starts, 1.0, parameters=parameters,
                              progress=lambda done, rows: seen.append((done, rows)))
    assert whole.complete and seen[-1] == (200, 200)
    many = np.tile([5.0, 0.0], (100_000, 1))
    part = ricochet.ensemble(Drop, many, 20.0, parameters=np.full(100_000, 0.9), threads=1,
                             progress=lambda done, rows: False)
    assert not part.complete and 0 < (part.outcome == "reached_end").sum() < 100_000
    assert set(part.outcome) == {"reached_end", ""}
    assert len(part.event_table) == part.events.sum()


def test_flow_calls_of_differences_are_counted_in_ensembles_of_ready_systems():
    run = ricochet.integrate(ricochet.StickSlip(), ricochet.StickSlip().start, 1.0, method="rosenbrock4")
    table = {name: [value] for name, value in ricochet.StickSlip().parameters.items()}
    found = ricochet.ensemble(ricochet.StickSlip, table, 1.0, method="rosenbrock4")
    assert found.flow_calls[0] == run.statistics.flow_calls


# --- by Taylor's method, four at a time ---


def sides(monkeypatch):
    """Whether each of the ensembles to come was computed side by side."""
    module, seen = ricochet._rows._ricochet, []
    whole = module.own_ensemble

    def watched(*given):
        found = whole(*given)
        seen.append("side_by_side" in found)
        return found
    monkeypatch.setattr(module, "own_ensemble", watched)
    return seen


def has_lanes():
    """Whether this processor computes four at a time."""
    import os
    try:
        flags = open("/proc/cpuinfo").read()
    except OSError:
        return False
    return "avx2" in flags and os.environ.get("RICOCHET_CODE") != "0"


needs_lanes = pytest.mark.skipif(not has_lanes(), reason="this processor has no registers of four doubles")


def by_series(system, starts, t_end, **options):
    """The ensemble, compared with the runs one by one in every bit."""
    found = ricochet.ensemble(system, starts, t_end, method="taylor", **options)
    events = found.event_table
    for i, x0 in enumerate(starts):
        try:
            run = ricochet.integrate(system, x0, t_end, method="taylor", **options)
        except ValueError:
            assert found.outcome[i] == "failed" and i in found.failures
            continue
        assert (found.outcome[i], found.t[i]) == (run.outcome, run.t)
        assert found.x[i].tobytes() == run.x.tobytes(), i
        counts = run.statistics
        assert [found.rows[name][i] for name in ("events", "steps", "flow_calls", "guard_calls")] == [
            counts.events, counts.steps, counts.flow_calls, counts.guard_calls]
        own = events[events["row"] == i]
        for name in run.events.dtype.names:
            assert own[name].tobytes() == run.events[name].tobytes(), name
        if "sample_times" in options:
            assert found.states[i, :len(run.states)].tobytes() == run.states.tobytes()
    return found


def star(**guard):
    guards = [ricochet.Guard(lambda t, q: q[0], **guard)] if guard else []
    return ricochet.System(lambda t, q: [q[2], q[3], -q[0] - 2.0 * q[0] * q[1], q[1] * q[1] - q[1] - q[0] * q[0]],
                           guards, formula=4)


ORBITS = np.array([[-0.05, 0.1, 0.3, 0.0006 * i] for i in range(75)])


@needs_lanes
@pytest.mark.parametrize("guard", [{}, {"direction": 1}, {"direction": 0, "reset": lambda t, q: [*q[:2], 0.9 * q[2], q[3]]},
                                   {"stop_after": 3}])
@pytest.mark.parametrize("options", [
    {"rtol": 1e-13, "atol": 1e-13}, {"rtol": 1e-6}, {"t_start": 20.0}, {"sample_times": [0.0, 3.0, 19.0]},
    {"atol": [1e-9, 1e-10, 1e-9, 1e-11], "h_max": 0.3}])
def test_rows_side_by_side_have_the_bits_of_runs_alone(guard, options, monkeypatch):
    seen = sides(monkeypatch)
    found = by_series(star(**guard), ORBITS, 0.0 if "t_start" in options else 20.0, **options)
    assert seen == [True] and found.complete
    assert content(ricochet.ensemble(star(**guard), ORBITS, 0.0 if "t_start" in options else 20.0,
                                     method="taylor", threads=3, **options)) == content(found)


@needs_lanes
@pytest.mark.parametrize("system, starts", [
    (ricochet.System(lambda t, x: [x[0] * (1 - x[0]) / (1 + t * t)], [ricochet.Guard(lambda t, x: x[0] - 0.7, direction=1)],
                     formula=1), np.linspace(0.05, 0.6, 41)[:, None]),
    (ricochet.System(lambda t, x: [x[1], (1 - x[0] ** 2) * x[1] - x[0] / np.sqrt(1 + x[1] * x[1])],
                     [ricochet.Guard(lambda t, x: x[0] * x[0] - x[1] / (2 + x[0] ** 2))], formula=2),
     np.column_stack([np.linspace(0.5, 2, 41), np.linspace(0, 1, 41)])),
    (ricochet.System(lambda t, x: [10 * (x[1] - x[0]), x[0] * (28 - x[2]) - x[1], x[0] * x[1] - 8 / 3 * x[2]],
                     [ricochet.Guard(lambda t, x: x[2] - 27, direction=1)], formula=3),
     np.random.default_rng(2).normal(size=(41, 3))),
])
def test_operations_side_by_side_have_the_bits_of_one(system, starts, monkeypatch):
    seen = sides(monkeypatch)
    found = by_series(system, starts, 5.0, rtol=1e-12, atol=1e-12)
    assert seen == [True] and len(found.event_table) > 0


@needs_lanes
def test_rows_that_end_early_or_fail_leave_their_lane(monkeypatch):
    seen = sides(monkeypatch)
    blow = ricochet.System(lambda t, x: [x[0] * x[0]], formula=1)
    starts = np.array([[0.1], [2.0], [np.nan], [0.3], [-1.0], [5.0], [0.0], [np.inf], [0.2]])
    found = by_series(blow, starts, 1.0)
    assert seen == [True] and list(found.failures) == [2, 7] and "row 2: ValueError" in found.failures[2]
    assert {"reached_end", "failed"} < set(found.outcome)


def test_what_does_not_fit_side_by_side_is_run_alone(monkeypatch):
    seen = sides(monkeypatch)
    swing = ricochet.System(lambda t, x: [x[1], -np.sin(x[0])], formula=2)
    starts = np.column_stack([np.linspace(0.1, 2.0, 9), np.zeros(9)])
    by_series(swing, starts, 5.0)  # calls a function
    fall = ricochet.System(lambda t, x: [x[1], -9.81], formula=2)
    by_series(fall, starts, 5.0)  # is a polynomial
    two = ricochet.System(lambda t, x: [x[1], -x[0]], [ricochet.Guard(lambda t, x: x[0]), ricochet.Guard(lambda t, x: x[1])], formula=2)
    by_series(two, starts, 5.0)
    by_series(star(direction=1), ORBITS[:9], 5.0, detector="ends")
    assert seen == [False] * 4
