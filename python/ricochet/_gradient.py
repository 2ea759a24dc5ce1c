"""Gradients through events: runs that can be taken back, sensitivities, periodic orbits."""

import weakref
from types import SimpleNamespace

import numpy as np

from . import _ready
from ._formula import Symbol, Symbols, _Tape
from ._kept import fingerprint
from ._system import System


def _module():
    """The compiled part, which is imported when it is needed."""
    try:
        from . import _gradients
    except ImportError as error:
        raise ImportError("gradients: this package was built without them; expected a build with "
                          "RICOCHET_SENSITIVITY") from error
    return _gradients


class Perceptron:
    """A network that functions of a system may call, with derivatives by its weights.

    Parameters
    ----------
    layers : sequence of (weight, bias)
        The weights of each layer, outputs x inputs, and its biases.
    activation : "tanh" or "relu"
        After each layer but the last.

    Called with numbers or symbols, ``network(x[0], x[1])``, it returns its output, or an array of
    them if there are several.
    """

    def __init__(self, layers, activation="tanh"):
        if activation not in ("tanh", "relu"):
            raise ValueError(f"activation: found {activation!r}, expected 'tanh' or 'relu'")
        self.activation = activation
        self.layers = [(np.array(w, dtype=float), np.array(b, dtype=float).ravel()) for w, b in layers]
        if not self.layers:
            raise ValueError("layers: found none, expected a weight and a bias for each")
        width = self.layers[0][0].shape[-1]
        for k, (weight, bias) in enumerate(self.layers):
            if weight.ndim != 2 or weight.shape[1] != width or bias.shape != weight.shape[:1]:
                raise ValueError(f"layers: layer {k}: found weights of shape {weight.shape} and "
                                 f"{bias.size} biases, expected {width} columns and as many rows "
                                 "as biases")
            width = weight.shape[0]

    @property
    def inputs(self):
        """Number of numbers that it takes."""
        return self.layers[0][0].shape[1]

    @property
    def outputs(self):
        """Number of numbers that it gives."""
        return self.layers[-1][1].size

    @property
    def parameters(self):
        """All weights and biases in a row, layer by layer."""
        return np.concatenate([part.ravel() for layer in self.layers for part in layer])

    def shaped(self, flat):
        """Numbers in a row as a list of (weight, bias)."""
        out, at = [], 0
        for weight, bias in self.layers:
            w = flat[at:at + weight.size].reshape(weight.shape)
            b = flat[at + weight.size:at + weight.size + bias.size]
            at += weight.size + bias.size
            out.append((w, b))
        return out

    def __call__(self, *inputs):
        if len(inputs) == 1 and np.ndim(inputs[0]) == 1:
            inputs = tuple(inputs[0])
        if len(inputs) != self.inputs:
            raise ValueError(f"network: found {len(inputs)} inputs, expected {self.inputs}")
        symbol = next((x for x in inputs if isinstance(x, Symbol)), None)
        out = self._record(symbol._tape, inputs) if symbol is not None else self._compute(inputs)
        return out[0] if self.outputs == 1 else out

    def _compute(self, inputs):
        x = np.array(inputs, dtype=float)
        for weight, bias in self.layers[:-1]:
            x = weight @ x + bias
            x = np.tanh(x) if self.activation == "tanh" else np.maximum(x, 0)
        return self.layers[-1][0] @ x + self.layers[-1][1]

    def _record(self, tape, inputs):
        if not isinstance(tape, _GradientTape):
            raise TypeError("network: found a network in a formula that is run without gradients; "
                            "expected ricochet.adjoint or ricochet.gradient")
        operands = [tape.operand(x) for x in inputs]
        at = tape.add("network", tape.number_of(self), len(tape.operands))._index
        tape.operands += operands
        out = np.empty(self.outputs, dtype=object).view(Symbols)
        for k in range(self.outputs):
            out[k] = tape.add("output", at, k)
        return out


class _GradientTape(_Tape):
    """A record of operations that may contain networks."""

    def __init__(self, networks):
        super().__init__()
        self.operands = []
        self._networks = networks

    def number_of(self, network):
        for k, known in enumerate(self._networks):
            if known is network:
                return k
        self._networks.append(network)
        return len(self._networks) - 1


class _Recording:
    """The functions of a system, recorded for any values of its arguments."""

    def __init__(self, system, components, count):
        self.components, self.count = components, count
        self.modes = system._mode_list()
        self.networks = []
        self._calls_python = False
        self._strict = system.formula is not None
        self._refuse(system)
        guards = system._guard_list()
        self.guard_names = [guard["name"] for guard in guards]
        flow, _ = self._each_mode(system.flow, "flow", components)
        time_reset, next_of_time_reset = self._each_mode(system.time_reset, "time_reset", components,
                                                         reset=True)
        times = system.time_events
        self.specification = dict(
            components=components, own=count, flow=flow, time_reset=time_reset,
            next_of_time_reset=next_of_time_reset, guards=[self._guard(guard) for guard in guards],
            times=[] if times is None else self._times_of(times),
            networks=[(network.activation, network.layers) for network in self.networks],
            calls_python=self._calls_python)
        self.compiled = _module().Recorded(self.specification)

    @staticmethod
    def _times_of(times):
        try:
            return [float(t) for t in times]
        except TypeError:
            raise TypeError("time_events: found ticks without end, expected a sequence of times, "
                            "for a gradient") from None

    @staticmethod
    def _refuse(system):
        for name in ("guard_values", "reset_set", "next_time_event", "set_valued",
                     "changes_dimension", "contacts", "fields"):
            if getattr(system, name, None):
                raise ValueError(f"{name}: found it in a system whose gradient is asked for, "
                                 "expected one without; see docs/derivatives.md")

    def _guard(self, guard):
        if guard["enabled"] is not None or guard["directed"]:
            what = "directed" if guard["directed"] else "enabled"
            raise ValueError(f"guard {guard['name']}: found {what!r}, expected a guard without it "
                             "for a gradient")
        title = f"guard {guard['name']}"
        value, _ = self._each_mode(guard["value"], title, 1, within=guard["in_modes"])
        reset, following = self._each_mode(guard["reset"], f"reset of {title}", self.components,
                                           within=guard["in_modes"], reset=True)
        rest, next_of_rest = self._each_mode(guard["rest"], f"rest of {title}", self.components,
                                             within=guard["in_modes"], reset=True)
        return dict(name=guard["name"], direction=int(guard["direction"]),
                    unilateral=bool(guard["unilateral"]), boolean=bool(guard["boolean"]),
                    touch=float(guard["touch"]), stop_after=int(guard["stop_after"]), value=value,
                    reset=reset, rest=rest, next=following, next_of_rest=next_of_rest)

    def _each_mode(self, function, title, results, within=None, reset=False):
        """The function in each mode, and the modes to which a reset leads."""
        if function is None:
            return [], []
        out, following = [], []
        for k, mode in enumerate([None] if self.modes is None else self.modes):
            if within is not None and mode not in within:
                out.append(None)
                following.append(k)
                continue
            recorded, to = self._function(function, k, mode, title, results, reset)
            out.append(recorded)
            following.append(to)
        return out, following

    def _function(self, function, k, mode, title, results, reset):
        before = len(self.networks)
        tape = _GradientTape(self.networks)
        x = np.empty(self.components, dtype=object).view(Symbols)
        for i in range(self.components):
            x[i] = tape.add("component", i)
        t = tape.add("time")
        args = [tape.add("parameter", j) for j in range(self.count)]
        leading = () if self.modes is None else (mode,)
        try:
            returned = function(*leading, t, x, *args)
            to, returned = self._after(k, returned, x, reset)
            numbers = np.asarray(returned, dtype=object).ravel()
            if len(numbers) != results:
                raise ValueError(f"{title} returned {len(numbers)} numbers, expected {results}")
            indices = [tape.operand(value) for value in numbers]
            if None in indices:
                raise TypeError(f"{title} returned {numbers[indices.index(None)]!r}, expected "
                                "formulas and numbers")
        except TypeError:
            # It is no formula: its derivatives are differences.
            if self._strict or len(self.networks) > before:
                raise
            del self.networks[before:]
            return self._callback(function, k, leading, results, reset)
        return _module().Program(tape.ops, tape.operands, indices), to

    def _after(self, k, returned, x, reset):
        """The next mode and the state that a reset returned."""
        if not reset or self.modes is None:
            return k, returned
        if isinstance(returned, tuple) and len(returned) == 2 and returned[0] in self.modes:
            return self.modes.index(returned[0]), returned[1]
        return self.modes.index(returned), x

    def _callback(self, function, k, leading, results, reset):
        self._calls_python = True
        to = k
        if reset and self.modes is not None:
            raise TypeError("reset: found one that is no formula in a system with modes, expected "
                            "arithmetic and functions of NumPy")

        def call(t, x, p):
            return np.asarray(function(*leading, t, x, *p), dtype=float).ravel()
        return _module().Callback(call, self.components, self.count, results), to


# Ready systems in formulas, whose arguments are their parameters in order.

def _ball():
    def reset(t, x, gravity, restitution):
        return [0.0, -restitution * x[1]]
    return dict(flow=lambda t, x, gravity, restitution: [x[1], -gravity],
                guard=lambda t, x, gravity, restitution: x[0], reset=reset,
                rest=lambda t, x, gravity, restitution: [0.0, 0.0], unilateral=True)


def _pendulum():
    return dict(flow=lambda t, x, gravity, length: [x[1], -(gravity / length) * np.sin(x[0])],
                guard=lambda t, x, gravity, length: x[1], direction=0)


def _oscillator():
    def flow(t, x, frequency, wall, restitution, damping):
        return [x[1], np.cos(frequency * t) - x[0] - damping * x[1]]

    def reset(t, x, frequency, wall, restitution, damping):
        return [wall, -restitution * x[1]]
    return dict(flow=flow, guard=lambda t, x, frequency, wall, restitution, damping: wall - x[0],
                reset=reset, unilateral=True)


#: The functions of ready systems, and the parameters that they take.
_READY = {
    "BouncingBall": (_ball, ("gravity", "restitution")),
    "Pendulum": (_pendulum, ("gravity", "length")),
    "ImpactOscillator": (_oscillator, ("frequency", "wall", "restitution", "damping")),
}
_of_ready = {}
_kept = weakref.WeakKeyDictionary()


def _recorded_ready(system):
    """The recording of a ready system, and the values of its parameters."""
    for name, (make, parameters) in _READY.items():
        if isinstance(system, _ready.SYSTEMS[name]):
            if name not in _of_ready:
                _of_ready[name] = _Recording(System(formula=2, **make()), 2, len(parameters))
            known = system.parameters
            return _of_ready[name], np.array([known[each] for each in parameters], dtype=float)
    raise TypeError(f"gradient: found the ready system {type(system).__name__}, expected "
                    + ", ".join(_READY) + " or a System of formulas")


def _recording_of(system, components, args):
    """The recording of a system, kept while its functions stay the same, and its arguments."""
    if isinstance(system, _ready.Ready):
        if len(args):
            raise ValueError("args: found some for a ready system, whose parameters they are; "
                             "expected none")
        return _recorded_ready(system)
    if not isinstance(system, System):
        raise TypeError(f"gradient: found a {type(system).__name__}, expected a System or a ready "
                        "system")
    numbers = np.atleast_1d(np.asarray(args, dtype=float)).ravel()
    functions = [system.flow, getattr(system, "guard", None), getattr(system, "reset", None),
                 getattr(system, "rest", None), system.time_reset]
    for guard in system._read_again("guards"):
        functions += list(getattr(guard, "_functions", {}).values())
    of = fingerprint([each for each in functions if each is not None], system, ())
    key = None if of is None else (of, components, len(numbers))
    known = _kept.get(system)
    if key is not None and known is not None and known[0] == key:
        return known[1], numbers
    recording = _Recording(system, components, len(numbers))
    if key is not None:
        _kept[system] = key, recording
    return recording, numbers


class Gradient:
    """The derivatives of a loss: ``value``, ``x0``, ``args``, ``networks``, ``t_start``.

    ``args`` are those by the arguments of the system's functions, or by the parameters of a ready
    system in their order; ``networks`` has an array for each network, its weights in a row. They
    are NaN where they do not exist.
    """

    def __init__(self, x0, args, networks, t_start, value=None):
        self.value = value
        self.x0, self.args, self.networks, self.t_start = x0, args, networks, t_start

    def __repr__(self):
        return f"Gradient(value={self.value!r}, x0={self.x0!r}, args={self.args!r})"


class Adjoint:
    """A run that can be taken back; made by `adjoint`.

    ``t``, ``x``, ``mode``, ``outcome`` and ``message`` are those of its end; ``samples`` has a row
    for each of ``sample_times``; ``event_times``, ``event_guards``, ``event_kinds``, ``before`` and
    ``after`` have an entry for each event. ``undefined_at`` is None, or the number of the first
    event through which there is no derivative, the reason, and a sentence.
    """

    def __init__(self, recording, run):
        self._recording, self._run = recording, run

    t = property(lambda self: self._run.t,
                 doc="Time [s] at its end.")
    x = property(lambda self: self._run.x,
                 doc="The state at its end, shape (n,).")
    outcome = property(lambda self: self._run.outcome,
                       doc="How it ended, such as ``reached_end``.")
    message = property(lambda self: self._run.message,
                       doc="A sentence on how it ended.")
    steps = property(lambda self: self._run.steps,
                     doc="Number of its steps.")
    sample_times = property(lambda self: self._run.sample_t,
                            doc="Times [s] of the samples, shape (samples,).")
    samples = property(lambda self: self._run.samples,
                       doc="States at the sample times, shape (samples, n).")
    event_times = property(lambda self: self._run.event_t,
                           doc="Times [s] of the events, shape (events,).")
    event_kinds = property(lambda self: self._run.event_kind,
                           doc="Kinds of the events, shape (events,).")
    before = property(lambda self: self._run.before,
                      doc="States before the events, shape (events, n).")
    after = property(lambda self: self._run.after,
                     doc="States after the events, shape (events, n).")
    undefined_at = property(lambda self: self._run.undefined,
                            doc="None, or the number of the first event without a derivative, the reason, and a sentence.")
    networks = property(lambda self: tuple(self._recording.networks),
                        doc="The networks of the system, in the order of their gradients.")

    @property
    def mode(self):
        """The mode at its end."""
        modes = self._recording.modes
        return self._run.mode if modes is None else modes[self._run.mode]

    @property
    def event_guards(self):
        """Names of the guards of the events; None for a time event."""
        names = self._recording.guard_names
        return [None if guard is None else names[guard] for guard in self._run.event_guard]

    def gradient(self, *, end=None, samples=None, event_times=None, before=None, after=None):
        """The derivatives of a loss whose derivatives by these numbers are given.

        Parameters
        ----------
        end : array (n,)
            By the state at the end, at its fixed time.
        samples : array (samples, n)
            By the states at the sample times.
        event_times : array (events,)
            By the times of the events.
        before, after : arrays (events, n)
            By the states before and after the events, which move with them.
        """
        return Gradient(*self._run.gradient(end, samples, event_times, before, after))


def adjoint(system, x0, t_end, *, args=(), networks=None, mode=None, t_start=0.0, sample_times=(),
            method="dopri5", step=0.0, rtol=1e-8, atol=1e-10, stop_at_event=False,
            max_steps=2**63 - 1):
    """Runs a system so that gradients can be taken back through the run and its events.

    Parameters
    ----------
    system : System, or a ready BouncingBall, Pendulum or ImpactOscillator
        Its functions take ``args`` after the state, ``flow(t, x, *args)``. They are called once with
        symbols; those that are no formulas are differentiated by differences.
    x0 : array (n,)
    t_end : float
        The run goes from ``t_start`` to here; steps are those of ``method``, under error control,
        or of length ``step``.
    args : numbers
        Parameters, by which derivatives are taken as well.
    networks : list of arrays
        Values for the weights of the networks, in a row for each; by default those that the
        `Perceptron` objects have.
    """
    start = np.atleast_1d(np.asarray(x0, dtype=float))
    recording, numbers = _recording_of(system, start.size, args)
    if networks is None:
        networks = [network.parameters for network in recording.networks]
    number_of_mode = 0
    if mode is not None:
        if recording.modes is None or mode not in recording.modes:
            raise ValueError(f"mode: found {mode!r}, expected one of {recording.modes}")
        number_of_mode = recording.modes.index(mode)
    options = _options(t_start, t_end, number_of_mode, step, rtol, atol, stop_at_event, max_steps,
                       sample_times)
    run = _module().Adjoint(recording.compiled, start, numbers, networks, options, method)
    return Adjoint(recording, run)


def _options(t_start, t_end, mode, step, rtol, atol, stop_at_event, max_steps, sample_times):
    return dict(t_start=float(t_start), t_end=float(t_end), mode=mode, step=float(step),
                rtol=float(rtol), atol=float(atol), stop_at_event=bool(stop_at_event),
                max_steps=int(max_steps),
                sample_times=[float(t) for t in np.atleast_1d(sample_times)] if len(
                    np.atleast_1d(sample_times)) else [])


def gradient(loss, system, x0, t_end, **options):
    """The value and the derivatives of a loss of a run: a `Gradient`.

    ``loss(run)`` returns a formula of the numbers of the run: arithmetic and functions of NumPy of
    ``run.x``, ``run.samples``, ``run.event_times``, ``run.before`` and ``run.after``, arrays as those
    of `Adjoint`. The other arguments are those of `adjoint`.
    """
    run = adjoint(system, x0, t_end, **options)
    tape = _GradientTape([])
    groups = dict(x=run.x, samples=run.samples, event_times=run.event_times, before=run.before,
                  after=run.after)
    numbers = np.concatenate([array.ravel() for array in groups.values()])
    shown, at = {}, 0
    for name, array in groups.items():
        symbols = np.empty(array.size, dtype=object).view(Symbols)
        for k in range(array.size):
            symbols[k] = tape.add("component", at + k)
        at += array.size
        shown[name] = symbols.reshape(array.shape)
    result = loss(SimpleNamespace(run=run, t=run.t, sample_times=run.sample_times, **shown))
    index = tape.operand(np.asarray(result, dtype=object).item())
    if index is None:
        raise TypeError(f"loss: found {result!r}, expected a formula or a number")
    value, slopes = _module().Program(tape.ops, [], [index]).value_and_slopes(numbers)
    parts, at = {}, 0
    for name, array in groups.items():
        parts[name] = slopes[at:at + array.size].reshape(array.shape)
        at += array.size
    parts["end"] = parts.pop("x")
    out = run.gradient(**{name: part for name, part in parts.items() if np.any(part)})
    out.value = value
    return out


def sensitivities(system, x0, t_end, **options):
    """The derivatives of a run by its start and its arguments.

    The arguments are those of `adjoint`. Returned are ``run``, ``state`` (n, n + args), the
    derivatives of the state at the end, ``event_times`` (events, n + args), and ``samples``
    (samples, n, n + args), in a namespace; the columns are those of the start, then the arguments.
    """
    run = adjoint(system, x0, t_end, **options)
    columns = run.x.size if run._recording is None else run._recording.components
    columns += run._recording.count

    def row(**slopes):
        by = run.gradient(**slopes)
        return np.concatenate((by.x0, by.args))
    times = np.full((len(run.event_times), columns), np.nan)
    for k in range(len(times)):
        unit = np.zeros(len(times))
        unit[k] = 1
        times[k] = row(event_times=unit)
    samples = np.empty((*run.samples.shape, columns))
    for k, i in np.ndindex(run.samples.shape):
        unit = np.zeros(run.samples.shape)
        unit[k, i] = 1
        samples[k, i] = row(samples=unit)
    return SimpleNamespace(run=run, state=run._run.end_rows()[:, :columns], event_times=times,
                           samples=samples, undefined_at=run.undefined_at)


def monodromy(system, x0, period, *, t_start=0.0, rtol=1e-10, atol=1e-10, **options):
    """The derivative of the state after a period by the state at its start, through all events.

    Its eigenvalues are the Floquet multipliers of a periodic orbit. NaN where it does not exist, or
    where the run ends early.
    """
    run = adjoint(system, x0, t_start + period, t_start=t_start, rtol=rtol, atol=atol, **options)
    n = run._recording.components
    if run.outcome != "reached_end":
        return np.full((n, n), np.nan)
    return run._run.end_rows()[:, :n]


def find_periodic_orbit(system, guess, period, *, autonomous=False, tolerance=1e-10,
                        max_iterations=30, args=(), networks=None, mode=None, t_start=0.0,
                        method="dopri5", step=0.0, rtol=1e-12, atol=1e-12, max_steps=2**63 - 1):
    """Searches for a periodic orbit through events near ``guess``, by shooting.

    Returned are ``converged``, ``x``, ``period``, ``monodromy``, ``multipliers`` (Floquet's, the
    largest first), ``residual``, ``iterations``, ``end`` and ``message``, in a namespace. With
    ``autonomous`` the period is a guess, too. The start should lie away from the surfaces of guards.
    """
    start = np.atleast_1d(np.asarray(guess, dtype=float))
    recording, numbers = _recording_of(system, start.size, args)
    if networks is None:
        networks = [network.parameters for network in recording.networks]
    number_of_mode = 0 if mode is None else recording.modes.index(mode)
    options = _options(t_start, t_start + period, number_of_mode, step, rtol, atol, False,
                       max_steps, ())
    found = _module().find_orbit(recording.compiled, start, numbers, networks, options, method,
                                 float(period), bool(autonomous), float(tolerance),
                                 int(max_iterations))
    found["multipliers"] = np.array(found["multipliers"])
    return SimpleNamespace(**found)
