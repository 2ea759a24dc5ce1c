"""Results of `solve_ivp`: SciPy's types where SciPy is loaded, and the solution as a function."""

import sys
from functools import lru_cache

import numpy as np


class OdeResult(dict):
    """A result of `solve_ivp`: a dictionary whose values are also attributes.

    t, y : ndarray, shapes (times,) and (n, times)
        The times, in the unit of ``t_span``, and the states there; complex for a complex ``y0``.
    sol : OdeSolution or Solution
        ``sol(t)``, shape (n,) or (n, times), with ``dense_output``; else None.
    t_events, y_events, y_events_after : list of ndarray, shapes (events,), (events, n)
        For each event function the times, and the states before and after resets. None without
        events.
    kinds, modes : list
        For each event function what its events were, and the modes before and after, shape
        (events, 2).
    nfev, njev, nlu : int
        Calls of ``fun``; the others are zero.
    status, message, success : int, str, bool
        0: the end was reached, 1: an event ended the run, -1: it failed.
    outcome, guard, statistics, run : str, int, namespace, Run
        How the run ended, the event that ended it, counts of calls and steps, and the run itself.
    phases, reactions : list, and ndarray of shape (m, times)
        With ``set_valued``: the changes of phase, and the reactions.

    Where a program has loaded ``scipy.integrate``, results are instances of SciPy's class, too.
    """

    def __getattr__(self, name):
        try:
            return self[name]
        except KeyError:
            raise AttributeError(name) from None

    __setattr__ = dict.__setitem__
    __delattr__ = dict.__delitem__

    def __dir__(self):
        return list(self)

    def __repr__(self):
        width = max(map(len, self), default=0)
        return "\n".join(f"{name:>{width}}: {value!r}" for name, value in self.items())

    def __reduce__(self):
        return new_result, (dict(self),)


class _Segment:
    """A step of a solution, in the place of SciPy's interpolants."""

    def __init__(self, solution, t_old, t):
        self.t_old, self.t = t_old, t
        self.t_min, self.t_max = min(t_old, t), max(t_old, t)
        self._solution = solution

    def __call__(self, t):
        """The states at times of the step, at its end that before a reset."""
        times = np.atleast_1d(np.asarray(t, float))
        out = np.where(times == self.t, self._solution.before(times), self._solution(times))
        return out[:, 0] if np.ndim(t) == 0 else out


class OdeSolution:
    """The solution over the run: ``sol(t)``, shape (n,) or for times (n, times).

    ``before(t)`` is the state before the resets at ``t``; beyond the run it is that at its end.
    ``ts`` are the ends of steps, and ``interpolants`` the solution on each of them.
    """

    def __init__(self, inner, code):
        self._inner, self._code = inner, code
        self.ts, self.t_min, self.t_max = np.array(inner.ts), inner.t_min, inner.t_max
        self.n_segments = max(self.ts.size - 1, 0)
        self.ascending = self.ts.size < 2 or bool(self.ts[-1] >= self.ts[0])
        self.ts_sorted = self.ts if self.ascending else self.ts[::-1]

    @property
    def interpolants(self):
        return [_Segment(self, a, b) for a, b in zip(self.ts[:-1], self.ts[1:])]

    def _shown(self, x):
        return x if self._code is None else self._code.shown(x.T).T

    def __call__(self, t):
        return self._shown(self._inner(t))

    def before(self, t):
        return self._shown(self._inner.before(t))

    def mode(self, t):
        return self._inner.mode(t)

    def __reduce__(self):
        return new_solution, (self._inner, self._code)


@lru_cache(maxsize=None)
def _also(ours, theirs):
    return type(ours.__name__, (ours, theirs), {"__module__": __name__, "__doc__": ours.__doc__})


def new_result(values):
    """An `OdeResult`."""
    if "scipy.optimize" not in sys.modules or "scipy.integrate" not in sys.modules:
        return OdeResult(values)
    from scipy.integrate._ivp import ivp

    return _also(OdeResult, ivp.OdeResult)(values)


def new_solution(inner, code):
    """An `OdeSolution`; ``inner`` itself where that is all."""
    if "scipy.integrate" not in sys.modules:
        return inner if code is None else OdeSolution(inner, code)
    from scipy.integrate import OdeSolution as theirs

    return _also(OdeSolution, theirs)(inner, code)
