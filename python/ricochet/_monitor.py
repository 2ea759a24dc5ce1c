"""Events of a motion that another integrator computes."""

from typing import NamedTuple

from . import _ricochet
from ._network import set_gate
from ._numbers import meant_by
from ._run import Named, set_mode, source_of, state_from


class Verdict(Named):
    """The next action of a host.

    STANDS : the step stands: continue from its end
    CUT : the step ends at a set of events: continue from ``cut.after``, and ``resume``
    RESTS : the motion has come to rest: keep the state until ``must_stop_at``, then ``hold``
    ENDED : the run is over; ``run.outcome`` says why
    """

    STANDS = 0
    CUT = 1
    RESTS = 2
    ENDED = 3


_VERDICTS = tuple(Verdict)


class Cut(NamedTuple):
    """A set of events, all at the same time, that ends a step.

    t, s : float
        Its time, and the offset of this from the start of the last step.
    before, after : ndarray, shape (n,)
        The states before and after the resets.
    mode_before, mode_after
        The modes, by name where the system names them.
    fired, fired_names : list
        Numbers of the guards that fired, ascending, and their names.
    on_time : bool
        Whether a time event is among them.
    accumulation : bool
        Whether ``after`` is the state of ``rest`` after infinitely many events.
    state_changed : bool
        If False, the host need not restart.
    """

    t: float
    s: float
    before: object
    after: object
    mode_before: object
    mode_after: object
    fired: list
    fired_names: list
    on_time: bool
    accumulation: bool
    state_changed: bool


_OPTIONS = ("event_tolerance", "event_rtol", "event_window", "check_inside", "record_events",
            "event_states", "detector", "locator", "gate")
_FORMER = ("look_inside",)  # names of options before version 0.2


class Monitor(_ricochet.Monitor):
    """The events of a system in the steps of a host, such as SciPy's ``RK45``.

    A host shows every step that it has accepted, in order, each beginning where the last one
    ended; steps that it rejects are never shown. The monitor changes nothing of the host::

        verdict = monitor.start(t, x, scale=h)
        while verdict in (Verdict.STANDS, Verdict.CUT) and t < t_end:
            if verdict == Verdict.CUT:
                # the host goes to monitor.cut.t and monitor.cut.after
                verdict = monitor.resume(scale=h)
            else:
                # the host takes a step, to monitor.must_stop_at at most
                verdict = monitor.examine(t0, h, x0, x1, rate0, rate1)

    Parameters
    ----------
    system : System or a ready one
        Its flow is used if the host gives no rate.
    like : array_like
        A state of the dimension of the motion.
    backward : bool
        The host's time runs backward.
    cut_at_all : bool
        Every crossing ends its step, even if the guard has no reset: for hosts that change the
        state themselves.
    event_tolerance, event_rtol, event_window, check_inside, record_events, event_states,
    detector, locator, gate
        As for `integrate`.

    Rates are dx/dt. A step out of turn (with a gap, beyond a time event, or before ``resume``)
    raises a RuntimeError and changes nothing; arrays of another shape and lengths that are not
    positive raise a ValueError. Only one thread at a time may use a monitor; a second one gets a
    RuntimeError. Exceptions from functions of the system or from ``interpolate`` are passed on
    unchanged, with the `Run` so far as ``ricochet_run``; the monitor then accepts only ``start``
    or ``restore``.
    """

    def __init__(self, system, like, *, backward=False, cut_at_all=False, **options):
        """Arguments are those of the class."""
        for name in options:
            if name not in _OPTIONS + _FORMER:
                raise TypeError(f"Monitor: found an option {name!r}, expected some of "
                                + meant_by(name, ("backward", "cut_at_all") + _OPTIONS))
        set_gate(options)
        source, modes = source_of(system)
        self._system, self._mode_list = system, modes
        super().__init__(source, state_from(like, "like"), options, bool(backward),
                         bool(cut_at_all), modes)

    def _number(self, mode):
        if mode is None:
            return None
        given = {"mode": mode}
        set_mode(given, self._system, self._mode_list)
        number = given["mode"]
        if not isinstance(number, int) or number < 0:
            raise ValueError(f"mode: found {mode!r}, expected a number, as the system has no names")
        return number

    def start(self, t, x, scale, rate=None, mode=None):
        """Arms all guards at a state that no event has led to: at the start, or after a gap.

        ``scale`` is the approximate length of the next step; ``rate`` is dx/dt at ``x``, by default
        the system's flow; ``mode`` is by default the initial mode of the system. May return
        ``Verdict.CUT``, if a guard is about to be crossed.
        """
        return _VERDICTS[self._start(t, x, scale, rate, self._number(mode))]

    def examine(self, t0, h, x0, x1, rate0, rate1, interpolate=None):
        """Looks for events in the next step, from ``t0`` over the length ``h``, above zero.

        ``x0`` and ``x1`` are the states at its ends, ``rate0`` and ``rate1`` the values of dx/dt
        there. ``interpolate(t)`` returns the state at a time from ``t0`` to ``t0 + h``, like SciPy's
        dense output; the default is the cubic through these four.
        """
        return _VERDICTS[self._examine(t0, h, x0, x1, rate0, rate1, interpolate)]

    def resume(self, scale, rate=None, *, after=None, mode=None):
        """After a cut, once the host has gone to ``cut.after``: arms all guards there.

        May return ``Verdict.CUT`` again. ``after`` and ``mode`` are for hosts that continue from
        another state than ``cut.after``.
        """
        return _VERDICTS[self._resume(scale, rate, after, self._number(mode))]

    def hold(self, t):
        """Tells the monitor that the state was kept until ``t``, at most ``must_stop_at``."""
        return _VERDICTS[self._hold(t)]

    def skip_to(self, t, x, rate):
        """Tells the monitor that the host went to ``t`` <= ``quiet_until`` in steps not shown."""
        self._skip_to(t, x, rate)

    @property
    def cut(self):
        """The last set of events that has ended a step, as a `Cut`; before one, a RuntimeError."""
        return Cut(*self._cut())
