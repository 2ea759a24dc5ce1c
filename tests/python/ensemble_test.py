"""Ensembles of ready systems, on threads and by executors."""

import concurrent.futures
import multiprocessing
import os
import signal
import threading

import numpy as np
import pytest

import ricochet


def table(rows=300):
    random = np.random.default_rng(1)
    return {"height": random.uniform(1, 10, rows), "restitution": random.uniform(0.7, 0.9, rows)}


def same(a, b):
    return a.rows.tobytes() == b.rows.tobytes() and a.failures == b.failures


def test_rows_are_runs_of_integrate():
    drops = table(100)
    balls = ricochet.ensemble(ricochet.BouncingBall, drops, 3.0)
    assert balls.complete and not balls.failures and len(balls) == 100
    for i in (0, 63, 64, 99):
        ball = ricochet.BouncingBall(restitution=drops["restitution"][i])
        run = ricochet.integrate(ball, [drops["height"][i], 0.0], 3.0)
        assert balls.outcome[i] == run.outcome
        assert balls.rows["t"][i] == run.t
        np.testing.assert_array_equal(balls.x[i], run.x)
        assert balls.events[i] == len(run.events)
        assert balls.steps[i] == run.statistics.steps
    assert "100 reached_end" in repr(balls)


def test_results_are_the_same_for_any_number_of_threads():
    one = ricochet.ensemble(ricochet.BouncingBall, table(), 3.0, threads=1)
    for threads in (2, 4):
        assert same(ricochet.ensemble(ricochet.BouncingBall, table(), 3.0, threads=threads), one)


def test_tables_may_be_arrays():
    drops = table()
    expected = ricochet.ensemble(ricochet.BouncingBall(gravity=1.62), drops, 3.0)
    plain = np.column_stack([drops["height"], drops["restitution"]])
    assert same(ricochet.ensemble(ricochet.BouncingBall(gravity=1.62), plain, 3.0,
                                  columns=["height", "restitution"]), expected)
    fields = np.zeros(300, [("restitution", float), ("height", float)])
    for name in fields.dtype.names:
        fields[name] = drops[name]
    assert same(ricochet.ensemble(ricochet.BouncingBall(gravity=1.62), fields, 3.0), expected)


def test_options_modes_and_other_loops():
    rooms = {"temperature": np.linspace(18.5, 21.5, 70)}
    for options in ({}, {"detector": "bernstein"}, {"method": "rk4", "fixed": True, "step": 0.01}):
        all_rooms = ricochet.ensemble(ricochet.Thermostat, rooms, 5.0, mode="on", **options)
        run = ricochet.integrate(ricochet.Thermostat(), [rooms["temperature"][69]], 5.0, mode="on",
                                 **options)
        np.testing.assert_array_equal(all_rooms.x[69], run.x)
        assert ricochet.Thermostat.modes[all_rooms.mode[69]] == run.mode
        assert all_rooms.events[69] == len(run.events)


def test_a_row_that_cannot_be_run_is_an_outcome():
    for options in ({}, {"executor": concurrent.futures.ThreadPoolExecutor(2)}):
        rooms = ricochet.ensemble(ricochet.Thermostat, {"low": np.r_[np.full(299, 18.0), 25.0]},
                                  1.0, **options)
        assert rooms.complete
        assert list(rooms.failures) == [299] and "low" in rooms.failures[299]
        assert rooms.outcome[299] == "failed" and np.isnan(rooms.x[299]).all()


def test_networks_are_asked_for_every_row():
    path = os.path.join(os.environ["RICOCHET_SOURCE"], "models", "bouncing-ball-step-0.01.safetensors")
    options = {"detector": "network", "gate": path, "method": "rk4", "fixed": True, "step": 0.01}
    drops = {"height": np.linspace(1, 10, 70)}
    balls = ricochet.ensemble(ricochet.BouncingBall, drops, 3.0, **options)
    assert balls.complete and not balls.failures
    run = ricochet.integrate(ricochet.BouncingBall(), [10.0, 0.0], 3.0, **options)
    np.testing.assert_array_equal(balls.x[69], run.x)
    # What a row changes the network is told of: this one is for one gravity.
    moon = ricochet.ensemble(ricochet.BouncingBall, {"gravity": [9.81, 1.62]}, 3.0, **options)
    assert list(moon.failures) == [1] and "gravity" in moon.failures[1]


def test_progress_is_shown_and_stops():
    seen = []
    ricochet.ensemble(ricochet.BouncingBall, table(), 3.0,
                      progress=lambda done, rows: seen.append((done, rows)))
    assert seen[-1] == (300, 300)

    def stop(done, rows):
        return False

    for options in ({"threads": 1}, {"executor": concurrent.futures.ThreadPoolExecutor(1)}):
        # Seconds of work, which end at the first look, 20 ms after the start.
        drops = table(20_000)
        balls = ricochet.ensemble(ricochet.BouncingBall, drops, 20.0, progress=stop, **options)
        assert not balls.complete and len(balls) == 20_000
        ended = balls.outcome == "reached_end"
        assert 0 < ended.sum() < 20_000
        assert (balls.outcome[~ended] == "").all() and np.isnan(balls.rows["t"][~ended]).all()


def test_exceptions_of_progress_arrive():
    def fail(done, rows):
        raise KeyError("progress")

    with pytest.raises(KeyError, match="progress"):
        ricochet.ensemble(ricochet.BouncingBall, table(), 3.0, progress=fail)


def test_an_interrupt_arrives():
    timer = threading.Timer(0.1, lambda: os.kill(os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        ricochet.ensemble(ricochet.BouncingBall, table(1_000_000), 20.0)


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_executors_give_the_same_results(kind):
    expected = ricochet.ensemble(ricochet.BouncingBall, table(1000), 3.0)
    if kind == "threads":
        executor = concurrent.futures.ThreadPoolExecutor(2)
    else:
        executor = concurrent.futures.ProcessPoolExecutor(
            2, mp_context=multiprocessing.get_context("fork"))
    with executor:
        seen = []
        found = ricochet.ensemble(ricochet.BouncingBall, table(1000), 3.0, executor=executor,
                                  progress=lambda done, rows: seen.append(done))
    assert same(found, expected)
    assert seen == [256, 512, 768, 1000]


def test_dask_gives_the_same_results():
    distributed = pytest.importorskip("distributed")
    expected = ricochet.ensemble(ricochet.BouncingBall, table(600), 3.0)
    with distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=False,
                                  dashboard_address=":0") as cluster:
        with distributed.Client(cluster) as client:
            found = ricochet.ensemble(ricochet.BouncingBall, table(600), 3.0, executor=client)
    assert same(found, expected)


def test_mpi_gives_the_same_results(tmp_path):
    pytest.importorskip("mpi4py")
    import shutil
    import subprocess
    import sys
    if shutil.which("mpiexec") is None:
        pytest.skip("no mpiexec")
    script = tmp_path / "balls.py"
    script.write_text(
        "import sys, numpy as np, ricochet\n"
        "from mpi4py.futures import MPICommExecutor\n"
        "with MPICommExecutor() as executor:\n"
        "    if executor is not None:\n"
        "        table = np.load(sys.argv[1])\n"
        "        balls = ricochet.ensemble(ricochet.BouncingBall, table, 3.0, executor=executor,\n"
        "                                  columns=['height', 'restitution'])\n"
        "        np.save(sys.argv[2], balls.rows)\n")
    drops = table(600)
    np.save(tmp_path / "table.npy", np.column_stack(list(drops.values())))
    environment = dict(os.environ, OMPI_ALLOW_RUN_AS_ROOT="1", OMPI_ALLOW_RUN_AS_ROOT_CONFIRM="1",
                       OMPI_MCA_rmaps_base_oversubscribe="1")
    subprocess.run(["mpiexec", "-n", "3", sys.executable, str(script),
                    str(tmp_path / "table.npy"), str(tmp_path / "rows.npy")],
                   check=True, env=environment, timeout=60)
    expected = ricochet.ensemble(ricochet.BouncingBall, drops, 3.0)
    assert np.load(tmp_path / "rows.npy").tobytes() == expected.rows.tobytes()


def test_an_empty_table_has_no_rows():
    for options in ({}, {"executor": concurrent.futures.ThreadPoolExecutor(1)}):
        balls = ricochet.ensemble(ricochet.BouncingBall, {"height": []}, 3.0, **options)
        assert balls.complete and len(balls) == 0


def test_row_seeds_differ():
    seeds = {ricochet.row_seed(1, i) for i in range(1000)}
    assert len(seeds) == 1000 and ricochet.row_seed(1, 7) == ricochet.row_seed(1, 7)


@pytest.mark.parametrize("arguments, error, pieces", [
    ((ricochet.BouncingBall, {"heigth": [1.0]}, 1.0), ValueError, "did you mean 'height'"),
    ((ricochet.BouncingBall, {}, 1.0), ValueError, "no columns"),
    ((ricochet.BouncingBall, {"height": [1.0, 2.0], "restitution": [0.5]}, 1.0), ValueError,
     "one length"),
    ((ricochet.BouncingBall, {"height": [[1.0]]}, 1.0), ValueError, "one length"),
    ((ricochet.BouncingBall, {"height": [1.0, np.nan]}, 1.0), ValueError, "nan in row 1"),
    ((ricochet.BouncingBall, {"height": ["high"]}, 1.0), TypeError, "numbers"),
    ((ricochet.BouncingBall, [[1.0]], 1.0), TypeError, "columns"),
    ((ricochet.System, {"height": [1.0]}, 1.0), TypeError, "ready system"),
    ((ricochet.BouncingBall, {"height": [1.0]}, np.nan), ValueError, "t_end"),
])
def test_what_cannot_be_right_is_refused(arguments, error, pieces):
    with pytest.raises(error, match=pieces):
        ricochet.ensemble(*arguments)


@pytest.mark.parametrize("options, error, pieces", [
    ({"threads": 0}, ValueError, "threads"),
    ({"threads": 2, "executor": concurrent.futures.ThreadPoolExecutor(1)}, TypeError, "executor"),
    ({"executor": 3}, TypeError, "submit"),
    ({"sample_times": [1.0]}, TypeError, "sample_times"),
    ({"x0": [1.0]}, ValueError, "x0"),
    ({"columns": ["height"]}, TypeError, "columns"),
    ({"speed": 1}, TypeError, "speed"),
    ({"rtol": -1.0}, ValueError, "rtol"),
])
def test_options_that_cannot_be_right_are_refused(options, error, pieces):
    with pytest.raises(error, match=pieces):
        ricochet.ensemble(ricochet.BouncingBall, {"height": [1.0]}, 1.0, **options)
