"""Pictures of runs, where matplotlib is installed."""

import numpy as np


def _curve(run):
    """Times and states to be joined by lines, with NaN where a reset has moved the state."""
    solution = run.solution
    t, x = run.times, run.states
    if solution is not None and solution.ts.size > 1:
        ends = solution.ts
        span = abs(ends[-1] - ends[0])
        fewest = 9 if ends.size < 500 else 2
        times, states = [], []
        for left, right in zip(ends[:-1], ends[1:]):
            inside = np.linspace(left, right, fewest + int(500 * abs(right - left) / span))
            times.append(inside)
            end = solution.before if right != left else solution
            states.append(np.hstack([solution(inside[:-1]), end(inside[-1:])]))
        t, x = np.concatenate(times), np.concatenate(states, axis=1).T
    moved = np.any(np.diff(x, axis=0) != 0, axis=1)
    jumps = np.flatnonzero((np.diff(t) == 0) & moved) + 1
    return np.insert(t, jumps, np.nan), np.insert(x, jumps, np.nan, axis=0)


def _spans(run):
    """For each mode that the run was in: its name, and its intervals as rows (start, length)."""
    changes = run.events[run.events["mode_before"] != run.events["mode_after"]]
    bounds = np.concatenate([run.times[:1], changes["t"], [run.t]])
    if len(changes):
        numbers = np.concatenate([changes["mode_before"][:1], changes["mode_after"]])
    else:
        numbers = [list(run.modes).index(run.mode)]
    rows = np.column_stack((bounds[:-1], np.diff(bounds)))
    return {number: (str(getattr(run.modes[number], "name", run.modes[number])),
                     rows[np.asarray(numbers) == number])
            for number in sorted(set(map(int, numbers)))}


def _shade(run, ax):
    for number, (name, rows) in _spans(run).items():
        ax.broken_barh(rows, (0, 1), transform=ax.get_xaxis_transform(), zorder=0,
                       facecolor=f"C{number % 10}", alpha=0.12, linewidth=0, label=name)


def _mark(ax, x, y, color):
    """Events as dots, small ones where they are many."""
    ax.plot(x, y, ".", color=color, markersize=min(6.0, max(1.5, 120 / max(len(x), 1))))


def plot(run, components=None, *, labels=None, phase=None, events=True, modes=True, unit=None,
         ax=None):
    """Draws the states of a run over time, with its events as dots, on its modes as colours.

    Parameters
    ----------
    run : Run or the result of `solve_ivp`
        With states, so made with ``sample_times``, which are joined by straight lines, or with
        ``record_steps``, whose solution is drawn as a curve.
    components : sequence of int
        Components to draw; by default all.
    labels : sequence of str
        Their labels: in a legend, or at the axis where one component is drawn.
    phase : (int, int)
        Draws the second component over the first instead, with their labels at the axes.
    events : bool
        Whether events are marked, before and after their resets; many of them by smaller dots.
    modes : bool
        Whether the intervals of each mode are shaded, over time, with its name in the legend.
    unit : str
        The unit of the time, for its axis.
    ax : matplotlib.axes.Axes
        The axes to draw in; by default the current ones.

    Returns
    -------
    matplotlib.axes.Axes
    """
    if ax is None:
        try:
            from matplotlib import pyplot
        except ImportError:
            raise ImportError("ricochet.plot needs matplotlib, which was not found") from None
    run = getattr(run, "run", None) or run
    if getattr(run, "times", None) is None:
        raise ValueError("plot: found a result over no time, expected one over a span of time")
    if run.times.size == 0:
        raise ValueError("plot: found a run without states, expected one with sample_times or "
                         "record_steps=True")
    t, x = _curve(run)
    ax = pyplot.gca() if ax is None else ax
    marks = run.events if events else run.events[:0]
    components = range(x.shape[1]) if components is None else components
    components = list(components)
    labels = [f"x[{c}]" for c in components] if labels is None else list(labels)
    if len(labels) != len(components):
        raise ValueError(f"labels: found {len(labels)}, expected one for each of "
                         f"{len(components)} components")
    if phase is not None:
        first, second = phase
        label_of = dict(zip(components, labels))
        ax.set_xlabel(label_of.get(first, f"x[{first}]"))
        ax.set_ylabel(label_of.get(second, f"x[{second}]"))
        line, = ax.plot(x[:, first], x[:, second])
        for side in ("before", "after"):
            _mark(ax, marks[side][:, first], marks[side][:, second], line.get_color())
        return ax
    for c, label in zip(components, labels):
        line, = ax.plot(t, x[:, c], label=label)
        for side in ("before", "after"):
            _mark(ax, marks["t"], marks[side][:, c], line.get_color())
    shaded = modes and run.modes is not None and len(run.events) == run.statistics.events
    if shaded:
        _shade(run, ax)
    ax.set_xlabel("t" if unit is None else f"t [{unit}]")
    if len(labels) == 1:
        ax.set_ylabel(labels[0])
    if len(labels) > 1 or shaded:
        ax.legend()
    return ax
