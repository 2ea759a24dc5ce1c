"""Training of networks, and proofs about them, from runs of a system."""

import sys
from time import perf_counter
from types import SimpleNamespace

import numpy as np

from . import _ricochet
from ._network import Network
from ._run import integrate, set_mode, source_of, state_from

_OUTCOMES = ("finished", "stopped", "misses_remain", "diverged")
_PROOFS = ("proved", "partly_proved", "refuted", "not_provable", "too_long", "out_of_time",
           "out_of_memory", "interrupted")


def _learn():
    from importlib import import_module
    try:
        return import_module("._learn", __package__)
    except ModuleNotFoundError as error:
        raise ImportError(
            "ricochet: found a package without training, expected the module ricochet._learn: "
            "build it with the CMake option RICOCHET_LEARN, or install the source distribution by "
            "CMAKE_ARGS=-DRICOCHET_LEARN=ON pip install") from error


class Trained:
    """Result of a training.

    network : Network or None
        None if the training was stopped before anything was learned.
    outcome : str
        ``"finished"``, ``"stopped"``, ``"misses_remain"`` or ``"diverged"``; ``message`` says it as
        a sentence.
    misses_none : bool
        Whether no event was missed on any of the examined sets.
    trial : SimpleNamespace
        Counts of the runs that compare the network with the exact detector.
    verdict : str
        The result of these runs as a sentence, which says whether the network pays.
    report : dict or None
        Report of the training, with its sets.
    """

    def __init__(self, network, outcome, message, misses_none, trial, verdict, report):
        self.network = network
        self.outcome = outcome
        self.message = message
        self.misses_none = misses_none
        self.trial = trial
        self.verdict = verdict
        self.report = report

    def __repr__(self):
        return f"<Trained: {self.outcome}, {self.network!r}, {self.verdict or self.message}>"


class Certified:
    """Result of a proof.

    network : Network
        The network with its certificate, which contains the levels that were finished.
    proved : bool
        Whether all levels were proved, except for boxes that the certificate lists.
    outcome : str
        ``"proved"``, ``"partly_proved"``, ``"refuted"``, ``"not_provable"``, ``"too_long"``,
        ``"out_of_time"``, ``"out_of_memory"`` or ``"interrupted"``; ``message`` says it as a
        sentence.
    levels : list of SimpleNamespace
        ``margin, threshold, clears, boxes, seconds, unproved`` of each level that was finished;
        ``clears`` is the fraction of the domain where the level clears the state.
    estimates : list of SimpleNamespace
        ``boxes, seconds, unproved, error``, of these and of the one that was not.
    counterexample : ndarray or None
        A state that refutes the first level.
    """

    def __init__(self, network, proved, outcome, message, levels, estimates, counterexample,
                 seconds):
        self.network = network
        self.proved = proved
        self.outcome = outcome
        self.message = message
        self.levels = levels
        self.estimates = estimates
        self.counterexample = counterexample
        self.seconds = seconds

    def __repr__(self):
        return f"<Certified: {self.outcome}, {len(self.levels)} levels>"


def _network(content):
    return None if content is None else Network.from_bytes(content, "the trained model")


def _trained(found):
    import json

    trial = SimpleNamespace(**found["trial"])
    verdict = found.get("verdict", "")
    if "gated_calls" in found["trial"] and trial.events:
        verdict = _gate_verdict(trial)
    report = None if found["report"] is None else json.loads(found["report"])
    return Trained(_network(found["content"]), _OUTCOMES[found["outcome"]], found["outcome_text"],
                   found["misses_none"], trial, verdict, report)


def _gate_verdict(trial):
    gain = trial.exact_calls / max(trial.gated_calls, 1)
    missed = (f"misses {trial.missed} of {trial.events} events (at most a share of "
              f"{trial.miss_bound:.1g} at 95 % confidence)")
    if gain > 1:
        return (f"guard calls are {gain:.2g} times fewer than with a check at every step, at the "
                f"price of {trial.network_calls} network calls; the gate {missed}")
    return (f"a check at every step takes fewer guard calls, {trial.exact_calls} instead of "
            f"{trial.gated_calls}: the gate saves nothing; it {missed}")


def _certified(found):
    counterexample = np.array(found["counterexample"]) if found["counterexample"] else None
    return Certified(_network(found["content"]), found["proved"], _PROOFS[found["outcome"]],
                     found["outcome_text"], [SimpleNamespace(**one) for one in found["levels"]],
                     [SimpleNamespace(**one) for one in found["estimates"]], counterexample,
                     found["seconds"])


class _Bar:
    """Shows the progress of a training in one line on stderr."""

    def __init__(self):
        self.last = 0.0
        self.width = 0

    def write(self, text):
        sys.stderr.write("\r" + text.ljust(self.width))
        sys.stderr.flush()
        self.width = len(text)

    def __call__(self, stage, seconds, share=None, iteration=0, total=0, **more):
        now = perf_counter()
        if now - self.last < 0.1:
            return True
        self.last = now
        if share is None:
            share = iteration / total if total else None
        text = f"{stage:>10} "
        if share is not None:
            done = round(20 * min(share, 1.0))
            text += f"[{'#' * done}{' ' * (20 - done)}] {100 * share:3.0f} %"
        if more.get("misses"):
            text += f", {more['misses']} missed"
        self.write(f"{text}, {seconds:.0f} s")
        return True

    def close(self):
        if self.width:
            sys.stderr.write("\n")


def _with_progress(progress, note, work):
    """Calls ``work`` with the callback, or with a progress bar."""
    if progress is None:
        progress = sys.stderr.isatty()
    if not isinstance(progress, bool):
        if not callable(progress):
            raise TypeError(f"progress: found a {type(progress).__name__}, expected a function, "
                            "True, False or None")
        return work(lambda **now: progress(SimpleNamespace(**now)))
    if not progress:
        return work(None)
    bar = _Bar()
    text = note()
    if text:
        sys.stderr.write(text + "\n")
    try:
        return work(bar)
    finally:
        bar.close()


def _starts(starts):
    """Rows of states, and whether they are the corners of a box."""
    if isinstance(starts, tuple) and len(starts) == 2:
        rows = [state_from(corner, "starts") for corner in starts]
        if len(rows[0]) != len(rows[1]):
            raise ValueError(f"starts: found corners of {len(rows[0])} and {len(rows[1])} "
                             "components, expected as many in both")
        return rows, True
    array = np.asarray(starts, dtype=float)
    if array.ndim != 2 or array.size == 0:
        raise ValueError(f"starts: found shape {array.shape}, expected the corners (lower, upper) "
                         "of a box, or one state a row")
    if not np.isfinite(array).all():
        raise ValueError("starts: found a number that is not finite")
    return array.tolist(), False


def _set_up(system, starts, mode, method, methods):
    source, modes = source_of(system)
    rows, box = _starts(starts)
    given = {} if mode is None else {"mode": mode}
    set_mode(given, system, modes)
    if method not in methods:
        raise ValueError(f"method: found {method!r}, expected one of {methods}")
    number = given.get("mode")
    return source, rows, box, source.start_mode if number is None else number


_TOLERANCES = ("rtol", "atol", "event_tolerance", "event_window", "h_max")


def _split(options):
    tolerances = {name: options.pop(name) for name in _TOLERANCES if name in options}
    return tolerances, options


def _pilot(system, rows, box, mode, how, length, events, labels=0):
    """A sentence on the cost of sampling and ``labels`` further steps, from one short run."""
    start = np.mean(rows, axis=0) if box else rows[0]
    given = dict(how, max_steps=1000, record_events=False, stall_steps=0)
    if getattr(system, "modes", None) is not None:
        given["mode"] = mode
    try:
        started = perf_counter()
        run = integrate(system, start, length, **given)
        took = perf_counter() - started
    except (ValueError, ArithmeticError):
        return ""
    found = max(run.statistics.events, 1)
    runs = events / found
    about = "at least " if not run.statistics.events or run.outcome == "step_limit" else "about "
    each = took / max(run.statistics.steps, 1)
    return (f"sampling takes {about}{runs * run.statistics.guard_calls:.0e} calls of the guard, "
            f"{runs * took + labels * each:.0f} s")


def train_classifier(system, starts, *, step, mode=None, method="rk4", progress=None, **options):
    """Trains a network that predicts whether a step meets the guard of a system.

    Runs of the system give points of the event surface; from there states are taken backward in
    time, and labelled by a step forward. Then the network is trained, assessed on states of
    other runs, and compared with the exact detector on runs of the same starts.

    Parameters
    ----------
    system : System or a ready one
        With one guard; flow and guard depend on the state alone.
    starts : tuple (lower, upper), or array_like, shape (n, components)
        The corners of a box, or states of which each run uses one.
    step : float
        Of the fixed steps that the network is for.
    mode
        At the start of a run.
    method : str
        ``"rk4"`` or ``"dopri5"``.
    progress : callable, bool or None
        Called with ``stage, iteration, total, loss, misses, seconds``; if it returns False, the
        training stops and returns what was learned so far. True: a bar on stderr, and an estimate
        before it. None: a bar if stderr is a terminal.
    seed : int
        1. The same seed gives the same network, to the bit on one machine.
    run_length, surface_points, states, fresh_states, trial_events, most_steps, margin, widened,
    hidden, iterations, batch, rate, final_rate, evaluate_every, logit_margin, checkpoint,
    checkpoint_every, resume
        As in C++ (``learn/train.hpp``, ``learn/classifier.hpp``).

    Returns
    -------
    Trained
        Its ``network`` is for ``integrate(system, ..., method=method, fixed=True, step=step,
        detector="network", gate=network)``.

    KeyboardInterrupt and exceptions of ``progress`` have the `Trained` so far as attribute
    ``ricochet_trained``.
    """
    module = _learn()
    source, rows, box, number = _set_up(system, starts, mode, method, ("rk4", "dopri5"))
    tolerances, options = _split(options)
    options["step"] = float(step)

    def note():
        length = options.get("run_length", 10.0)
        return _pilot(system, rows, box, number, dict(method=method, fixed=True, step=step),
                      length, 2 * options.get("surface_points", 2000)
                      + 2 * options.get("trial_events", 1000),
                      # Each state is up to 50 steps back, taken part by part.
                      20 * (options.get("states", 100_000) + options.get("fresh_states", 40_000)))

    return _with_progress(progress, note, lambda callback: module.train_classifier(
        source, rows, box, number, method, tolerances, options, callback, _trained))


def train_gate(system, starts, levels=None, *, step=None, mode=None, method=None, progress=None,
               **options):
    """Trains a gate: a network that predicts for how long no event occurs.

    Parameters
    ----------
    system : System or a ready one
    starts : tuple (lower, upper), or array_like, shape (n, components)
        The corners of a box, or states of which each run takes one.
    levels : sequence of float
        Horizons in time, rising; by default 2, 4, 8, 16 and 32 steps. With ``kind="level"`` values
        of the guard, of a system with bounds.
    step : float or tuple (least, largest)
        Of fixed steps. None: error control, which needs ``levels``.
    method : str
        ``"rk4"`` (default) or ``"dopri5"`` for fixed steps; ``"dopri5"`` with error control.
    mode, progress, seed
        As for `train_classifier`.
    kind : str
        ``"horizon"`` (default) or ``"level"``.
    recipe : str
        What the network sees: ``"state"`` (default), ``"state-rate"``, ``"state-phase(w)"``,
        ``"angles"``, ``"chain"``, with ``" mode(n)"`` behind it for a system of n modes.
    run_length, events, states, validation_events, fresh_events, most_steps, hidden, iterations,
    rounds, hard_events, neighbours, batch, rate, final_rate, evaluate_every, patience,
    fatal_weight, quantile, logit_margin, checkpoint, resume
        As in C++ (``learn/classifier.hpp``).

    Returns
    -------
    Trained
        Its ``network`` is for ``integrate(system, ..., gate=network, detector="calibrated")``, or
        ``"foreseen"``.

    KeyboardInterrupt and exceptions of ``progress`` have the `Trained` so far as attribute
    ``ricochet_trained``.
    """
    module = _learn()
    if method is None:
        method = "dopri5" if step is None else "rk4"
    source, rows, box, number = _set_up(system, starts, mode, method,
                                        ("dopri5",) if step is None else ("rk4", "dopri5"))
    tolerances, options = _split(options)
    if step is not None:
        least, largest = step if isinstance(step, (tuple, list)) else (step, step)
        options.update(step_min=float(least), step_max=float(largest))
    if levels is None:
        if step is None or options.get("kind", "horizon") != "horizon":
            raise ValueError("levels: found None, expected horizons in time, or values of the guard "
                             "for kind='level'")
        levels = [k * options["step_max"] for k in (2, 4, 8, 16, 32)]
    options["levels"] = [float(level) for level in levels]

    def note():
        how = {} if step is None else dict(method=method, fixed=True, step=options["step_max"])
        rounds = options.get("rounds", 2)
        events = (rounds * options.get("events", 3000) + options.get("validation_events", 1000)
                  + 2 * options.get("fresh_events", 30_000))
        return _pilot(system, rows, box, number, dict(how, **tolerances),
                      options.get("run_length", 10.0), events)

    return _with_progress(progress, note, lambda callback: module.train_gate(
        source, rows, box, number, method, tolerances, options, callback, _trained))


def certify(network, system, slack, *, least=None, progress=None, **options):
    """Proves that where a network clears a state, the guard of a system is above a margin.

    Parameters
    ----------
    network : Network or path
        Of the recipe ``"state"``, with ReLU.
    system : System or a ready one
        Its first guard does not depend on time.
    slack : sequence of float, or function (h) -> float
        How much the guard may change between states that differ by at most ``h[i]`` in every
        component, its own rounding included: a Lipschitz constant for each component, or a function
        of ``h``.
    least : function (lower, upper) -> float
        A lower bound of the guard over a box.
    progress : callable, bool or None
        Called with ``stage, level, levels, margin, threshold, boxes, share, seconds,
        seconds_left``; else as for `train_classifier`.
    margin, levels, ratio, margins, search, closest, smallest, max_unproved, limit, time_limit,
    threads, seed, checkpoint, resume
        As in C++ (``learn/certify.hpp``).

    Returns
    -------
    Certified
        Its ``network`` is for ``integrate(system, ..., gate=network, detector="certified")``.

    KeyboardInterrupt and exceptions of ``progress`` have the `Certified` so far as attribute
    ``ricochet_trained``. If a slack or bound is found violated, a ValueError gives the states.
    """
    module = _learn()
    if not isinstance(network, _ricochet.Network):
        network = Network(network)
    source, _ = source_of(system)
    if not callable(slack):
        slack = state_from(slack, "slack")
    return _with_progress(progress, lambda: "", lambda callback: module.certify(
        network.to_bytes(), source, slack, least, options, callback, _certified))
