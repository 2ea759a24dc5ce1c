"""FMUs in Python: those that the tests in C++ have built."""

import math
import os
import zipfile

import numpy as np
import pytest

import ricochet

FMUS = os.environ.get("RICOCHET_FMUS", "")
pytestmark = pytest.mark.skipif(not os.path.exists(f"{FMUS}/fmu_ball.fmu"), reason="a build without FMI")


def impacts(e, until):
    """Of a ball that falls from 10 m."""
    first = math.sqrt(20 / 9.81)
    times, flight = [first], 2 * first * e
    while times[-1] + flight < until:
        times.append(times[-1] + flight)
        flight *= e
    return times


@pytest.mark.parametrize("name", ["fmu_ball.fmu", "fmu_ball-2.fmu"])
def test_impacts_of_a_ball_by_model_exchange(name):
    ball = ricochet.load_fmu(f"{FMUS}/{name}")
    assert ball.states == ["height", "velocity"] and ball.variables["height"].unit == "m"
    ball.parameters["restitution"] = 0.5
    run = ball.simulate(t_end=4, rtol=1e-4, output=["height", "events"])
    assert run.success and run.method == "dopri5"
    expected = impacts(0.5, 4)
    # The motion is a quadratic: what is left is the location, a double of 4.4e-16 s, and the rounding of the sum.
    np.testing.assert_allclose([event.t for event in run.events], expected, rtol=0, atol=2e-15)
    assert all(event.causes == ["state"] and event.before[1] < 0 < event.after[1] for event in run.events)
    assert run["events"][-1] == len(expected)
    assert np.all(np.diff(run.t) >= 0) and np.count_nonzero(run.sides) == 2 * len(expected)
    assert run["height"][0] == 10 and run.t[-1] == 4


def test_inputs_are_tables_or_functions():
    model = ricochet.load_fmu(f"{FMUS}/fmu_sampled.fmu")
    constant = model.simulate(t_end=3, output=["x"])
    table = model.simulate(t_end=3, inputs={"u": ([0, 3], [0.5, 0.5])}, output=["x"])
    function = model.simulate(t_end=3, inputs={"u": lambda t: 0.5}, output=["x"])
    assert table["x"][-1] == pytest.approx(constant["x"][-1], abs=1e-12)
    assert function["x"][-1] == pytest.approx(constant["x"][-1], abs=1e-7)
    with pytest.raises(ZeroDivisionError):
        model.simulate(t_end=3, inputs={"u": lambda t: 1 / 0})
    with pytest.raises(ValueError, match="expected a table"):
        model.simulate(inputs={"u": 3})


def test_co_simulation():
    run = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu").simulate(t_end=4, step=0.5, co_simulation=True,
                                                             output=["height"], sample_times=[4])
    expected = impacts(0.9, 4)
    np.testing.assert_allclose([event.t for event in run.events], expected, rtol=0, atol=1e-14)


def test_a_watched_level_is_located_in_co_simulation():
    ball = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu")
    run = ball.simulate(t_end=3, step=0.1, watch={"height": (2, -1)})
    passed = [event for event in run.events if event.watch == "height"]
    # Falls through 2 m from 10 m, and after an impact at 0.9 of the speed.
    first, speed = math.sqrt(20 / 9.81), 0.9 * math.sqrt(2 * 9.81 * 10)
    expected = [math.sqrt(16 / 9.81), first + (speed + math.sqrt(speed**2 - 4 * 9.81)) / 9.81]
    assert all(event.causes == ["passage"] for event in passed)
    # To neighbouring doubles at a speed of 12 m/s of a height that is rounded to 4e-16 m.
    np.testing.assert_allclose([event.t for event in passed], [t for t in expected if t < 3], rtol=0, atol=2e-15)
    with pytest.raises(ValueError, match="'depth'"):
        ball.simulate(watch={"depth": 2})


def test_an_ensemble_has_the_runs_of_its_rows():
    ball = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu")
    ball.parameters["gravity"] = 5
    rows = {"restitution": [0.5, 0.7, 0.9, 0.6], "height": np.arange(1, 5)}
    runs = ball.ensemble(rows, 3, threads=2, output=["height", "velocity"], samples=5)
    assert len(runs) == 4
    for i, run in enumerate(runs):
        alone = ball.simulate(3, start={name: values[i] for name, values in rows.items()}, output=["height", "velocity"], samples=5)
        assert run.success and np.array_equal(run["height"], alone["height"])
        assert [event.t for event in run.events] == [event.t for event in alone.events]
        # Gravity is that of `parameters`, the height that of the row.
        assert run.events[0].t == pytest.approx(math.sqrt(2 * (i + 1) / 5), abs=1e-15)
    assert ball.ensemble({"height": []}, 1) == []


def test_an_ensemble_of_an_fmu_for_one_instance_a_process_takes_processes(tmp_path):
    file = tmp_path / "once.fmu"
    with zipfile.ZipFile(f"{FMUS}/fmu_ball.fmu") as whole, zipfile.ZipFile(file, "w") as changed:
        for name in whole.namelist():
            content = whole.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b"modelIdentifier=", b'canBeInstantiatedOnlyOncePerProcess="true" modelIdentifier=')
            changed.writestr(name, content)
    ball = ricochet.load_fmu(file)
    rows = {"restitution": [0.5, 0.7, 0.9]}
    runs = ball.ensemble(rows, 3, threads=2, output=["height"], samples=3)
    usual = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu").ensemble(rows, 3, output=["height"], samples=3)
    for run, expected in zip(runs, usual):
        assert np.array_equal(run["height"], expected["height"]) and len(run.events) == len(expected.events)


def test_a_table_that_does_not_fit_is_named():
    ball = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu")
    with pytest.raises(ValueError, match="2 and 3 rows"):
        ball.ensemble({"height": [1, 2], "gravity": [1, 2, 3]})
    with pytest.raises(ValueError, match="no rows"):
        ball.ensemble({})
    with pytest.raises(ValueError, match="no variable 'mass'"):
        ball.ensemble({"mass": [1, 2]})
    for threads in (0, 1.5, True):
        with pytest.raises(ValueError, match="threads: found"):
            ball.ensemble({"height": [1]}, threads=threads)


def test_what_does_not_fit_is_named(tmp_path):
    (tmp_path / "m.fmu").write_text("no zip")
    with pytest.raises(ValueError, match="no zip archive"):
        ricochet.load_fmu(tmp_path / "m.fmu")
    ball = ricochet.load_fmu(f"{FMUS}/fmu_ball.fmu")
    with pytest.raises(KeyError, match="there are gravity, restitution"):
        ball.parameters["mass"] = 1
    with pytest.raises(ValueError, match="no variable 'mass'"):
        ball.simulate(output=["mass"])
    with pytest.raises(ValueError, match="expected automatic"):
        ball.simulate(method="euler")
    with pytest.raises(KeyError, match="recorded are height"):
        ball.simulate(t_end=1, output=["height"])["velocity"]
