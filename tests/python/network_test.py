"""Trained networks, and runs that ask them."""

import math
import os
import pickle
from pathlib import Path

import numpy as np
import pytest

import ricochet
from ricochet import Network

MODELS = Path(os.environ.get("RICOCHET_SOURCE", Path(__file__).parents[2])) / "models"
GATE = MODELS / "impact-oscillator-gate-adaptive.safetensors"


@pytest.fixture(scope="module")
def classifier():
    return Network(MODELS / "bouncing-ball-step-0.01.safetensors")


def test_outputs_are_those_of_the_layers(classifier):
    states = np.column_stack((np.linspace(0.01, 5, 50), np.linspace(-9, 9, 50)))
    x = (states - classifier.offset) * classifier.scale
    for weight, bias in classifier.layers[:-1]:
        x = np.maximum(x @ weight.T + bias, 0)
    weight, bias = classifier.layers[-1]
    expected = x @ weight.T + bias
    found = classifier(states)
    assert found.shape == (50, 1) and classifier.precision == "f32"
    # Sums of 16 terms in float, six of them one after the other.
    np.testing.assert_allclose(found, expected, rtol=16 * 6 * 2 ** -24,
                               atol=16 * 6 * 2 ** -24 * np.abs(expected).max())
    assert np.array_equal(classifier(states[3]), found[3])
    assert np.array_equal(classifier.alarm(states), found[:, 0] >= classifier.threshold)
    # Whatever the layout, with the same bits.
    assert np.array_equal(classifier(np.asfortranarray(states)), found)
    assert np.array_equal(classifier(np.repeat(states, 2, axis=0)[::2]), found)
    assert classifier(np.empty((0, 2))).shape == (0, 1)


def test_what_a_model_says_of_itself(classifier):
    assert (classifier.kind, classifier.system) == ("event-classifier", "bouncing-ball")
    assert classifier.recipe == "state" and classifier.step_range == (0.01, 0.01)
    assert classifier.parameters == {"gravity": 9.81} and not classifier.certified
    assert classifier.inputs == 2 and classifier.outputs == 1 and classifier.levels == []
    assert classifier.domain.shape == (2, 2) and classifier.calibration is None
    assert classifier.in_domain(classifier.domain.mean(1)) is True
    outside = [classifier.domain[:, 1] + 1, [math.nan, 0.0], [0.0, math.inf]]
    assert not classifier.in_domain(outside).any()
    with pytest.raises(ValueError, match="read-only"):
        classifier.layers[0][0][0, 0] = 1
    gate = Network(GATE)
    assert gate.kind == "gate-horizon" and len(gate.levels) == gate.outputs == 4
    assert gate.calibration["misses"] == 0 and gate.calibration["events"] >= 30_000
    horizons = [0] + [value for value, _ in gate.levels]
    assert set(gate.cleared(np.random.default_rng(1).uniform(-1, 1, (200, 4)))) <= set(horizons)
    proved = Network(MODELS / "eigenvalue-certified.safetensors")
    assert proved.certified and proved.cleared(proved.domain.mean(1)) >= -math.inf
    with pytest.raises(TypeError, match="cleared"):
        classifier.cleared([1.0, 0.0])


def test_networks_are_kept(classifier, tmp_path):
    again = pickle.loads(pickle.dumps(classifier))
    assert again == classifier and repr(again) == repr(classifier)
    classifier.save(tmp_path / "copy.safetensors")
    assert Network(tmp_path / "copy.safetensors") == classifier
    assert os.listdir(tmp_path) == ["copy.safetensors"]


class Oscillator(ricochet.System):
    """`ImpactOscillator`, written in Python."""

    name = "impact-oscillator"
    parameters = ricochet.ImpactOscillator().parameters
    unilateral = True
    calls = 0

    def flow(self, t, x):
        return [x[1], math.cos(0.7 * t) - x[0] - 0.2 * x[1]]

    def guard(self, t, x):
        self.calls += 1
        return 1 - x[0]

    def reset(self, t, x):
        return [1.0, -0.8 * x[1]]


@pytest.mark.parametrize("system", [ricochet.ImpactOscillator(), Oscillator()],
                         ids=["ready", "own"])
def test_a_gate_spares_calls_of_the_guard(system):
    start = (0.0, 0.0)
    exact = ricochet.integrate(system, start, 60.0)
    gated = ricochet.integrate(system, start, 60.0, gate=GATE, detector="calibrated")
    assert np.array_equal(gated.events["t"], exact.events["t"]) and exact.events.size > 3
    assert gated.statistics.guard_calls < exact.statistics.guard_calls / 2
    assert gated.statistics.evidence.gated > gated.statistics.evidence.checked
    # Without bounds nothing can be verified: every step is checked.
    foreseen = ricochet.integrate(system, start, 60.0, gate=Network(GATE), detector="foreseen")
    assert np.array_equal(foreseen.events["t"], exact.events["t"])
    assert foreseen.statistics.evidence.gated == 0
    simulation = ricochet.Simulation(system, start, 60.0, gate=str(GATE), detector="calibrated")
    assert np.array_equal(simulation.run_to_end().events, gated.events)
    if isinstance(system, Oscillator):
        found = ricochet.solve_ivp(system, (0, 60), start, rtol=1e-8, atol=1e-10, gate=GATE,
                                   detector="calibrated")
        assert np.array_equal(found.t_events[0], exact.events["t"])


def test_a_monitor_asks_a_gate():
    system = Oscillator()
    steps = ricochet.integrate(system, [0.0, 0.0], 1.9, record_steps=True, h_max=0.1)
    assert steps.events.size == 0
    flow = [np.array(system.flow(t, x)) for t, x in zip(steps.times, steps.states)]
    monitor = ricochet.Monitor(system, [0.0, 0.0], gate=GATE, detector="calibrated")
    monitor.start(0.0, [0.0, 0.0], 0.1)
    for k in range(len(steps.times) - 1):
        t, end = steps.times[k:k + 2]
        verdict = monitor.examine(t, end - t, steps.states[k], steps.states[k + 1], flow[k],
                                  flow[k + 1])
        assert verdict is ricochet.Verdict.STANDS
    evidence = monitor.run.statistics.evidence
    assert evidence.gated > evidence.checked


def test_a_network_of_single_steps():
    ball = ricochet.BouncingBall(restitution=0.8)
    with pytest.raises(ValueError, match="step"):
        ricochet.integrate(ball, [2.0, 0.0], 1.0, method="rk4", fixed=True, step=0.1,
                           detector="network", gate=MODELS / "bouncing-ball-step-0.01.safetensors")
    options = dict(method="rk4", fixed=True, step=0.01)
    exact = ricochet.integrate(ball, [2.0, 0.0], 3.0, detector="ends", **options)
    asked = ricochet.integrate(ball, [2.0, 0.0], 3.0, detector="network",
                               gate=MODELS / "bouncing-ball-step-0.01.safetensors", **options)
    assert asked.statistics.guard_calls < exact.statistics.guard_calls
    assert np.array_equal(asked.events["t"], exact.events["t"])


# --- wrong input ---

@pytest.mark.parametrize("content, words", [
    (b"", ""), (b"nothing of the kind", ""), (GATE.read_bytes()[:-1], "bytes"),
    (GATE.read_bytes()[:200], "")])
def test_files_that_are_none(content, words, tmp_path):
    path = tmp_path / "model.safetensors"
    path.write_bytes(content)
    with pytest.raises(ValueError, match="model.safetensors.*" + words):
        Network(path)
    with pytest.raises(ValueError, match="model.safetensors"):
        ricochet.integrate(Oscillator(), [0, 0], 1.0, gate=path, detector="calibrated")


def test_features_and_gates_that_do_not_fit(classifier):
    with pytest.raises(FileNotFoundError):
        Network("nowhere.safetensors")
    with pytest.raises(TypeError):
        Network(3)
    for features in ([1.0], [[1.0]], [[[1.0, 2.0]]], 1.0, [1.0, 2.0, 3.0]):
        with pytest.raises(ValueError, match="features: found shape"):
            classifier(features)
    with pytest.raises((TypeError, ValueError)):
        classifier(["a", "b"])

    def run(system=None, **options):
        return ricochet.integrate(system or Oscillator(), [0.0, 0.0], 1.0, **options)

    with pytest.raises(ValueError, match="gate: found None"):
        run(detector="calibrated")
    with pytest.raises(ValueError, match="asks none"):
        run(gate=GATE)
    with pytest.raises(TypeError, match="gate: found a int"):
        run(gate=3, detector="calibrated")
    with pytest.raises(ValueError, match="detector: found 'x', expected one of 'extremum', 'ends'"):
        run(detector="x")
    with pytest.raises(ValueError, match="level"):
        run(gate=GATE, detector="calibrated-bounds")
    with pytest.raises(ValueError):
        run(gate=classifier, detector="calibrated")
    with pytest.raises(ValueError, match="certificate"):
        run(gate=GATE, detector="certified")
    with pytest.raises(ValueError, match="frequency = 0.7, got 0.8"):
        run(ricochet.ImpactOscillator(frequency=0.8), gate=GATE, detector="calibrated")
    with pytest.raises(ValueError, match="cannot be used for pendulum"):
        run(ricochet.Pendulum(), gate=GATE, detector="calibrated")
    nameless = Oscillator()
    nameless.parameters = None
    with pytest.raises(ValueError, match="does not declare"):
        run(nameless, gate=GATE, detector="calibrated")


def test_a_gate_serves_a_run_with_a_tolerance_for_each_component():
    # A gate omits checks of guards, and leaves the steps as they are.
    def run(atol, **options):
        return ricochet.integrate(Oscillator(), [0.0, 0.0], 60.0, atol=atol, **options)

    exact, gated = run([1e-9, 1e-6]), run([1e-9, 1e-6], gate=GATE, detector="calibrated")
    assert gated.statistics.evidence.gated > 0 and exact.events.size > 0
    assert gated.statistics.steps == exact.statistics.steps
    assert np.array_equal(gated.events["t"], exact.events["t"])


def test_planning_without_bounds_checks_every_step():
    for guards in ([], [ricochet.Guard(lambda t, x: x[0], reset=lambda t, x: [1.0])]):
        run = ricochet.integrate(ricochet.System(lambda t, x: [-1.0], guards), [1.0], 3.5,
                                 detector="planned")
        assert run.outcome == "reached_end" and run.events.size == 3 * len(guards)
