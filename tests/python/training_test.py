"""Training and certification, progress and interrupts."""

import math
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

import ricochet
from ricochet import certify, train_classifier, train_gate

pytest.importorskip("ricochet._learn", reason="built without RICOCHET_LEARN")

BOX = ([-1.0, -2.0], [1.0, 2.0])
SMALL = dict(step=0.01, surface_points=300, states=8000, fresh_states=2000, iterations=1500,
             trial_events=100, progress=False)


class Wall(ricochet.System):
    """A pendulum that bounces off a wall at angle 0."""

    name = "wall"
    parameters = {"length": 1.0}

    def flow(self, t, x):
        return [x[1], -9.8 * math.sin(x[0])]

    def guard(self, t, x):
        return x[0]

    def reset(self, t, x):
        return [0.0, -0.9 * x[1]]


@pytest.fixture(scope="module")
def trained():
    return train_classifier(ricochet.Pendulum(), BOX, **SMALL)


def test_a_classifier_spares_calls_of_the_guard(trained):
    pendulum = ricochet.Pendulum()
    assert trained.outcome == "finished" and trained.misses_none and trained.report
    assert trained.trial.missed == 0 and trained.trial.events >= 100
    assert trained.trial.network_calls < trained.trial.exact_calls / 2
    # One verdict, on which way was the fastest, as it was measured.
    assert trained.verdict.startswith("the network is ") and "faster" not in trained.verdict
    network = trained.network
    assert network.system == "pendulum" and network.parameters == pendulum.parameters
    assert network.step_range == (0.01, 0.01)
    options = dict(method="rk4", fixed=True, step=0.01)
    exact = ricochet.integrate(pendulum, [0.5, 0.0], 10.0, detector="ends", **options)
    asked = ricochet.integrate(pendulum, [0.5, 0.0], 10.0, detector="network", gate=network,
                               **options)
    assert np.array_equal(asked.events["t"], exact.events["t"]) and exact.events.size > 5


def test_the_seed_gives_the_same_network(trained):
    assert train_classifier(ricochet.Pendulum(), BOX, **SMALL).network == trained.network
    other = train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, seed=2))
    assert other.network != trained.network and other.network.seed == 2


def test_a_system_in_python_is_trained_as_well():
    states = np.random.default_rng(1).uniform([0.2, -1.0], [1.0, 1.0], (50, 2))
    trained = train_classifier(Wall(), states, step=0.02, run_length=4.0, surface_points=30,
                               states=400, fresh_states=100, iterations=1000, trial_events=10,
                               progress=False)
    assert trained.network.system == "wall" and trained.network.parameters == {"length": 1.0}
    assert trained.trial.events >= 10
    ricochet.integrate(Wall(), [0.5, 0.0], 2.0, method="rk4", fixed=True, step=0.02,
                       detector="network", gate=trained.network)


def test_a_gate_is_trained_and_asked():
    oscillator = ricochet.ImpactOscillator()
    seen = []
    trained = train_gate(oscillator, ([-0.5, -1.0], [0.5, 1.0]), step=0.02,
                         recipe="state-phase(0.7)", run_length=50.0, events=600, states=20_000,
                         validation_events=300, fresh_events=500, iterations=600, rounds=1,
                         progress=seen.append)
    assert trained.outcome in ("finished", "misses_remain")
    assert trained.trial.events >= 500 and "confidence" in trained.verdict
    assert trained.network.kind == "gate-horizon" and trained.network.outputs == 5
    assert trained.network.calibration["events"] == trained.trial.events
    assert {now.stage for now in seen} >= {"sampling", "testing"}
    assert all(now.seconds >= 0 for now in seen)
    run = ricochet.integrate(oscillator, oscillator.start, 50.0, method="rk4", fixed=True,
                             step=0.02, gate=trained.network, detector="calibrated")
    assert run.statistics.evidence.gated > 0


def test_a_callback_stops_a_training_and_what_was_learned_is_returned():
    stages = []

    def until_training(now):
        stages.append(now.stage)
        return now.stage != "training"

    trained = train_classifier(ricochet.Pendulum(), BOX,
                               **dict(SMALL, iterations=1_000_000, progress=until_training))
    assert trained.outcome in ("stopped", "misses_remain") and trained.network is not None
    assert trained.verdict == "" and "training" in stages and "comparing" not in stages
    trained = train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, progress=lambda now: False,
                                                               surface_points=1_000_000))
    assert trained.outcome == "stopped" and trained.network is None and trained.report is None


class Mine(Exception):
    pass


def test_exceptions_arrive_unchanged():
    thrown = Mine()

    def raises(now):
        raise thrown

    with pytest.raises(Mine) as raised:
        train_classifier(ricochet.Pendulum(), BOX,
                         **dict(SMALL, surface_points=1_000_000, progress=raises))
    assert raised.value is thrown and raised.value.ricochet_trained.outcome == "stopped"

    class Fails(Wall):
        calls = 0

        def guard(self, t, x):
            Fails.calls += 1
            if Fails.calls == 500:
                raise thrown
            return x[0]

    with pytest.raises(Mine) as raised:
        train_classifier(Fails(), ([0.1, 0.0], [1.0, 0.0]), **SMALL)
    assert raised.value is thrown
    Fails.calls = 0
    with pytest.raises(Mine):
        train_gate(Fails(), ([0.1, 0.0], [1.0, 0.0]), step=0.01, progress=False)


@pytest.fixture
def interruptible():
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.parametrize("work, after", [
    (lambda: train_classifier(ricochet.Pendulum(), BOX,
                              **dict(SMALL, surface_points=10_000_000)), 0.3),
    (lambda: train_classifier(ricochet.Pendulum(), BOX,
                              **dict(SMALL, iterations=100_000_000)), 0.8),
    (lambda: train_gate(ricochet.ImpactOscillator(), BOX, step=0.02, progress=False, events=300,
                        states=5000, validation_events=100, recipe="state-phase(0.7)",
                        iterations=10_000_000, patience=1_000_000), 0.8),
    (lambda: train_classifier(Wall(), ([0.1, 0.0], [1.0, 0.0]), **SMALL), 0.3)],
    ids=["sampling", "training", "gate", "callbacks"])
def test_an_interrupt_ends_a_training_and_keeps_what_was_learned(work, after, interruptible):
    sent = None

    def send():
        nonlocal sent
        time.sleep(after)
        sent = time.perf_counter()
        os.kill(os.getpid(), signal.SIGINT)

    thread = threading.Thread(target=send)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt) as raised:
            work()
        took = time.perf_counter() - sent
    finally:
        thread.join()
    # 0.1 s, and a loaded machine may let threads wait for as long again.
    assert took < 0.3
    kept = raised.value.ricochet_trained
    assert kept.outcome in ("stopped", "misses_remain")
    if after > 0.5:
        assert kept.network is not None


def test_proofs(trained, tmp_path, interruptible):
    pendulum = ricochet.Pendulum()
    # The guard is the rate: it changes by as much as the rate does.
    slack = [0.0, 1.0]
    proof = certify(trained.network, pendulum, slack, limit=60.0, progress=False)
    if proof.outcome == "proved":
        assert proof.network.certified and len(proof.levels) == 1 and proof.proved
    assert proof.message and proof.estimates
    # The same by a function, called from another thread.
    asked = []

    def reach(h):
        asked.append(h)
        return h[1]

    by_function = certify(trained.network, pendulum, reach, limit=60.0, threads=1, progress=False)
    assert by_function.outcome == proof.outcome and asked
    assert [level.threshold for level in by_function.levels] == \
        [level.threshold for level in proof.levels]
    # A slack that is too small is found out.
    with pytest.raises(ValueError, match="slack"):
        certify(trained.network, pendulum, [0.0, 1e-3], progress=False)
    with pytest.raises(Mine):
        def fails(h):
            raise Mine
        certify(trained.network, pendulum, fails, progress=False)
    with pytest.raises(TypeError, match="slack returned"):
        certify(trained.network, pendulum, lambda h: None, progress=False)
    stopped = certify(trained.network, pendulum, slack, progress=lambda now: False, limit=1e9,
                      closest=1e-6, margins=[1e-6, 1e-5, 1e-4, 1e-3], smallest=1e-9)
    assert stopped.outcome in ("interrupted", "proved")


# --- wrong input ---

@pytest.mark.parametrize("work, error, words", [
    (lambda: train_classifier(ricochet.Pendulum(), BOX, step=0.0, progress=False), ValueError,
     "step"),
    (lambda: train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, staets=3)), TypeError,
     "'staets', expected some of .*states"),
    (lambda: train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, states="many")), TypeError,
     "states: found 'many'"),
    (lambda: train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, states=3)), ValueError,
     "states"),
    (lambda: train_classifier(ricochet.Pendulum(), BOX, method="euler", **SMALL), ValueError,
     "euler"),
    (lambda: train_classifier(ricochet.Pendulum(), ([1.0, 2.0], [0.0, 0.0]), **SMALL), ValueError,
     "component 0"),
    (lambda: train_classifier(ricochet.Pendulum(), ([1.0, 2.0], [1.0]), **SMALL), ValueError,
     "corners"),
    (lambda: train_classifier(ricochet.Pendulum(), [1.0, 2.0], **SMALL), ValueError, "starts"),
    (lambda: train_classifier(ricochet.Pendulum(), [[1.0]], **SMALL), ValueError, "components"),
    (lambda: train_classifier(ricochet.Thermostat(), [[20.0]], **SMALL), ValueError, "2 guards"),
    (lambda: train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, progress=3)), TypeError,
     "progress"),
    (lambda: train_classifier(ricochet.System(lambda t, x: [0.0], [ricochet.Guard(
        lambda t, x: 1.0)]), [[1.0]], **dict(SMALL, most_steps=1000)), ValueError, "no event"),
    (lambda: train_gate(ricochet.Pendulum(), BOX, progress=False), ValueError, "levels"),
    (lambda: train_gate(ricochet.Pendulum(), BOX, [1.0], kind="level", progress=False), ValueError,
     "speed_bound"),
    (lambda: train_gate(ricochet.Pendulum(), BOX, [1.0], kind="other", progress=False), ValueError,
     "kind"),
    (lambda: train_gate(ricochet.Pendulum(), BOX, [1.0], recipe="other", progress=False),
     ValueError, "other"),
    (lambda: train_gate(ricochet.System(lambda t, x: x), BOX, [1.0], progress=False), ValueError,
     "without guards"),
    (lambda: certify("nowhere.safetensors", Wall(), [1.0, 0.0]), FileNotFoundError, "")])
def test_what_is_refused(work, error, words):
    with pytest.raises(error, match=words):
        work()


def test_proofs_that_are_refused(trained):
    for system, slack, words in ((Wall(), [1.0, 0.0], "wall|pendulum"),
                                 (ricochet.Pendulum(length=2.0), [1.0, 0.0], "length"),
                                 (ricochet.Pendulum(), [1.0], "slack: found 1"),
                                 (ricochet.Pendulum(), [-1.0, 0.0], "slack")):
        with pytest.raises(ValueError, match=words):
            certify(trained.network, system, slack, progress=False)


def test_a_package_without_training_says_so(tmp_path):
    package = tmp_path / "ricochet"
    package.mkdir()
    for file in Path(ricochet.__file__).parent.iterdir():
        if file.is_file() and not file.name.startswith("_learn"):
            os.symlink(file, package / file.name)
    code = ("import ricochet\n"
            "try: ricochet.train_classifier(ricochet.Pendulum(), [[0.1, 0.0]], step=0.1)\n"
            "except ImportError as error: print(error)")
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True,
                         env=dict(os.environ, PYTHONPATH=str(tmp_path)))
    assert "without training" in out.stdout and "RICOCHET_LEARN" in out.stdout


def test_training_is_imported_on_first_use():
    code = "import ricochet, sys; print('ricochet._learn' in sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert out.stdout.strip() == "False"


def test_the_bar_and_the_estimate_go_to_stderr(capfd):
    train_classifier(ricochet.Pendulum(), BOX, **dict(SMALL, progress=True))
    out, err = capfd.readouterr()
    assert out == "" and "calls of the guard" in err and "training [" in err
