"""Events of a motion that somebody else integrates."""

from enum import IntEnum
from typing import NamedTuple

from . import _ricochet
from ._network import set_gate
from ._run import set_mode, source_of, state_from


class Verdict(IntEnum):
    """What a host is to do next."""

    STANDS = 0  #: the step stands: continue from its end
    CUT = 1     #: the step ends at a set of events: continue from ``cut.after``, and ``resume``
    RESTS = 2   #: the motion has come to rest: keep the state until ``must_stop_at``, then ``hold``
    ENDED = 3   #: the run is over; ``run.outcome`` says why


_VERDICTS = tuple(Verdict)


class Cut(NamedTuple):
    """A set of events that ends a step, at the same time for all its members."""

    t: float             #: its time
    s: float             #: from the start of the step shown last
    before: object       #: the state before the resets
    after: object        #: the state after them
    mode_before: object
    mode_after: object
    fired: list          #: the numbers of the guards that fired, rising
    fired_names: list
    on_time: bool        #: with a time event
    accumulation: bool   #: ``after`` is what ``rest`` makes of the limit of infinitely many events
    state_changed: bool  #: False: the host need not start again


_OPTIONS = ("event_tolerance", "event_rtol", "event_window", "look_inside", "record_events",
            "event_states", "detector", "locator", "gate")


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
        Its flow is asked for where no rate is given.
    like : array_like
        A state of the dimension of the motion.
    backward : bool
        The host's time runs backward.
    cut_at_all : bool
        Every crossing ends its step, also of guards without a reset: for hosts that change the
        state themselves.
    event_tolerance, event_rtol, event_window, look_inside, record_events, event_states,
    detector, locator, gate
        As for `integrate`.

    Rates are dx/dt. Steps out of turn, with a gap, beyond a time event or before ``resume`` are a
    RuntimeError, and nothing has changed then; arrays of another shape and lengths that are not
    positive are a ValueError. One thread at a time: a second one gets a RuntimeError. An exception of
    a function of the system or of ``interpolate`` arrives unchanged, its ``ricochet_run`` the `Run`
    so far; then the monitor waits for ``start`` or ``restore``.
    """

    def __init__(self, system, like, *, backward=False, cut_at_all=False, **options):
        for name in options:
            if name not in _OPTIONS:
                raise TypeError(f"Monitor: found an option {name!r}, expected some of backward, "
                                "cut_at_all, " + ", ".join(_OPTIONS))
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

        ``scale`` is the length of the next step, roughly; ``rate`` dx/dt at ``x``, by default the
        system's flow there; ``mode`` by default that of the system. May return ``Verdict.CUT``:
        a guard that is about to be crossed.
        """
        return _VERDICTS[self._start(t, x, scale, rate, self._number(mode))]

    def examine(self, t0, h, x0, x1, rate0, rate1, interpolate=None):
        """Looks for events in the next step, from ``t0`` over the length ``h``, above zero.

        ``x0``, ``x1`` are the states at its ends, ``rate0``, ``rate1`` dx/dt there.
        ``interpolate(t)`` returns the state at a time within, as the dense output of SciPy; by default
        the cubic through the four.
        """
        return _VERDICTS[self._examine(t0, h, x0, x1, rate0, rate1, interpolate)]

    def resume(self, scale, rate=None, *, after=None, mode=None):
        """After a cut, once the host has gone to ``cut.after``: arms all guards there.

        May return ``Verdict.CUT`` again. ``after`` and ``mode`` are for hosts that go to a state of
        their own making instead.
        """
        return _VERDICTS[self._resume(scale, rate, after, self._number(mode))]

    def hold(self, t):
        """The state of a motion at rest has been kept until ``t``, at most ``must_stop_at``."""
        return _VERDICTS[self._hold(t)]

    def skip_to(self, t, x, rate):
        """The host has continued to ``t``, at most ``quiet_until``, in steps that it has not shown."""
        self._skip_to(t, x, rate)

    @property
    def cut(self):
        """The last set of events that has ended a step, as a `Cut`."""
        return Cut(*self._cut())
