"""Progress of runs: a bar by tqdm where it is installed, else a line on stderr."""

import sys
from time import perf_counter

_PAUSE = 0.1  # [s] between two reports


class _Line:
    """A line on stderr, in place of tqdm's bar."""

    def __init__(self, total):
        self.total = total

    def show(self, done):
        share = "" if self.total is None else f" of {self.total:g} ({done / self.total:.0%})"
        sys.stderr.write(f"\r{done:g}{share}    ")
        sys.stderr.flush()

    def close(self):
        sys.stderr.write("\n")


class _Tqdm:
    """A bar of tqdm, of numbers that need not be whole."""

    def __init__(self, bar, total, unit):
        self.bar = bar(total=total, unit=unit, bar_format=None if total is None else
                       "{l_bar}{bar}| {n:.4g}/{total:.4g} [{elapsed}<{remaining}]")

    def show(self, done):
        self.bar.n = done
        self.bar.refresh()

    def close(self):
        self.bar.close()


def _bar(total, unit):
    total = total if total is not None and 0 < total < float("inf") else None
    try:
        from tqdm.auto import tqdm
    except ImportError:
        return _Line(total)
    return _Tqdm(tqdm, total, unit)


def check(progress):
    """Refuses what is neither a bool nor a function; None where nothing is to be shown."""
    if progress is None or progress is False:
        return None
    if progress is not True and not callable(progress):
        raise TypeError(f"progress: found a {type(progress).__name__}, expected a function, True, "
                        "False or None")
    return progress


class OfTime:
    """Shows how far a run is from ``t_start`` to ``t_end``, every tenth of a second.

    ``progress`` is True, for a bar, or a function that is called with the time and ``t_end``.
    """

    def __init__(self, progress, t_start, t_end):
        self.progress, self.t_start, self.t_end = progress, t_start, t_end
        self.bar = _bar(abs(t_end - t_start), " of t") if progress is True else None
        self.last = -_PAUSE
        self.farthest = 0.0

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.bar is not None:
            self.bar.close()

    def at(self, t):
        """Reports the time ``t``, unless the last report is recent."""
        now = perf_counter()
        if now - self.last < _PAUSE:
            return
        self.last = now
        self.show(t)

    def show(self, t):
        """Reports the time ``t``; a bar does not go back where a step is repeated."""
        if self.bar is None:
            self.progress(t, self.t_end)
        else:
            self.farthest = max(self.farthest, abs(t - self.t_start))
            self.bar.show(self.farthest)

    def watching(self, flow, is_moded):
        """The flow with a report of every time at which it is called."""
        index = 1 if is_moded else 0

        def watched(*given):
            self.at(given[index])
            return flow(*given)
        return watched


class OfRows:
    """A function for the ``progress`` of an ensemble that shows a bar of rows."""

    def __init__(self, rows):
        self.bar = _bar(rows, " rows")

    def __call__(self, done, rows):
        self.bar.show(done)

    def close(self):
        """Leaves the bar as it is."""
        self.bar.close()
