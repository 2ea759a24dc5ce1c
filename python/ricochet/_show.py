"""How runs are shown: a line at the prompt, a table and a picture in a notebook."""

import numpy as np

from . import _ricochet

_ROWS = 5  # number of events shown at either end of a long table


def _numbers(x):
    """A state in a few digits, its middle left out where it is long."""
    x = np.asarray(x)
    shown = [f"{number:.6g}" for number in (x if x.size <= 6 else [*x[:3], *x[-2:]])]
    if x.size > 6:
        shown.insert(3, "...")
    return "[" + ", ".join(shown) + "]"


def _line(run):
    """A run in one line: how and where it ended, and how many events it had."""
    mode = "" if run.modes is None else f", mode {getattr(run.mode, 'name', run.mode)!r}"
    count = len(run.events)
    return (f"<Run: {run.outcome} at t = {run.t!r}, x = {_numbers(run.x)}{mode}, "
            f"{count} event{'' if count == 1 else 's'}>")


def _guard_of(run, number):
    return run.guard_names[number] if 0 <= number < len(run.guard_names) else "time"


def _table(run):
    """The events as a table, the first and the last of many."""
    from html import escape

    from ._run import Kind

    events, modes = run.events, run.event_modes
    head = ["t", "guard", "kind", *(["mode"] if run.modes is not None else []), "before", "after"]
    shown = range(len(events))
    if len(shown) > 2 * _ROWS + 1:
        shown = [*shown[:_ROWS], None, *shown[-_ROWS:]]
    rows = []
    for i in shown:
        if i is None:
            left_out = f"{len(events) - 2 * _ROWS} more"
            rows.append(f'<tr><td colspan="{len(head)}" style="text-align:center">{left_out}</td></tr>')
            continue
        event = events[i]
        cells = [f"{event['t']:.10g}", _guard_of(run, int(event["guard"])),
                 Kind(int(event["kind"])).name.lower()]
        if run.modes is not None:
            before, after = (str(getattr(mode, "name", mode)) for mode in modes[i])
            cells.append(before if before == after else f"{before} \u2192 {after}")
        cells += [_numbers(event["before"]), _numbers(event["after"])]
        rows.append("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>")
    titles = "".join(f"<th>{title}</th>" for title in head)
    return f"<table><thead><tr>{titles}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _picture(run):
    """The states over time as a picture in the page; nothing without states or matplotlib."""
    if run.times.size < 2:
        return ""
    try:
        from matplotlib.figure import Figure
    except ImportError:
        return ""
    import base64
    import io

    from ._plot import plot

    # A figure of its own: pyplot and its current axes are left alone.
    figure = Figure(figsize=(5.0, 2.2), layout="constrained")
    plot(run, ax=figure.subplots())
    content = io.BytesIO()
    figure.savefig(content, format="png", dpi=144)
    text = base64.b64encode(content.getvalue()).decode("ascii")
    return f'<img width="500" alt="states over time" src="data:image/png;base64,{text}">'


def _page(run):
    """A run as HTML: its outcome, its events, and its states over time where it has them."""
    from html import escape

    parts = [f"<p><code>{escape(_line(run))}</code></p>"]
    if not run.success:
        parts.append(f"<p>{escape(run.message)}</p>")
    parts.append(_picture(run))
    if len(run.events):
        parts.append(_table(run))
    return "".join(parts)


_ricochet.Run.__doc__ = """What a run has computed; its arrays are read-only views of it.

outcome, message, success, reason : str, str, bool, str
    How the run ended, a sentence about it, whether that is an end as wanted, and the text of a
    `Stop` or which function was not finite.
t, x, mode : float, ndarray of shape (n,), and a mode
    Where it ended.
guard, other_guard : int or None
    The guard that ended it, and the second of two whose resets contradict each other.
events : ndarray, shape (events,)
    A structured array with the fields ``t``, ``guard`` (an index into `guard_names`, -1 for a time
    event), ``kind`` (a `Kind`), ``mode_before``, ``mode_after``, ``before`` and ``after`` (states,
    shape (n,)), ``bracket`` (times on both sides, shape (2,)), ``slope`` (of the guard along the
    motion), ``error`` (of the time), ``late`` and ``reaction``.
event_modes : list of tuples
    The modes before and after each event, by name where the system names them.
times, states : ndarray, shapes (times,) and (times, n)
    At ``sample_times``, or with ``record_steps`` at the ends of steps. Shorter states end in NaN.
solution : Solution or None
    With ``record_steps``: ``solution(t)``, shape (n,) or for times (n, times).
phases, reaction, reactions : list, and ndarrays of shapes (m,) and (times, m)
    With ``set_valued``: the changes of phase, and the reactions at the end and at `times`.
statistics : namespace
    Counts of steps, calls and events.

Times have the unit of the caller's flow.
"""
_ricochet.Run.__repr__ = _line
_ricochet.Run._repr_html_ = _page
