"""Motions as pictures that move in a notebook or a browser."""

import numpy as np

from ._numbers import number_from

_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#e69f00", "#cc79a7", "#56b4e9")
_DARK = "#404040"
_LONGEST = 600  # [px] of the longer side
_HALF_PIXEL = 0.5  # motion that is left out between two key times
_MOST_SHOWN = 20_000  # positions of bodies in the picture of a notebook


class Animation:
    """A motion as an SVG that moves, and repeats, by itself; a notebook shows it.

    svg : str
        The picture as text.
    duration : float
        [s] of one repetition on the screen.
    """

    def __init__(self, svg, duration):
        self.svg, self.duration = svg, duration

    def _repr_html_(self):
        return self.svg

    def save(self, path):
        """Writes the picture to a file, which should end in ``.svg``."""
        with open(path, "w", encoding="utf-8") as file:
            file.write(self.svg)

    def __repr__(self):
        return f"<Animation of {self.duration:.4g} s, {len(self.svg)} characters>"


class _Frame:
    """The part of the plane that is shown, and its pixels."""

    def __init__(self, low, high):
        low, high = np.asarray(low, float), np.asarray(high, float)
        margin = 0.04 * max(*(high - low), 1e-9)
        self.low, self.high = low - margin, high + margin
        self.scale = _LONGEST / (self.high - self.low).max()

    @classmethod
    def around(cls, points):
        """The frame of all these points, shape (n, 2)."""
        points = points[np.isfinite(points).all(axis=1)]
        if not len(points):
            return cls((-1.0, -1.0), (1.0, 1.0))
        return cls(points.min(axis=0), points.max(axis=0))

    @property
    def size(self):
        return self.scale * (self.high - self.low)

    def pixels(self, points):
        """Points of the plane, shape (..., 2), as pixels, y downwards."""
        points = np.asarray(points, float)
        return self.scale * np.stack((points[..., 0] - self.low[0], self.high[1] - points[..., 1]), axis=-1)


def _kept(times, values):
    """The places of the values, shape (n, m), from which the others follow by straight lines.

    Within half a pixel; a pair at one time, where something jumps, is kept.
    """
    kept = {0, len(times) - 1}
    kept.update(k + side for k in np.flatnonzero(np.diff(times) == 0) for side in (0, 1))
    open_parts = [tuple(part) for part in zip(sorted(kept)[:-1], sorted(kept)[1:])]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        part = (times[first + 1:last] - times[first]) / (times[last] - times[first])
        line = values[first] + part[:, None] * (values[last] - values[first])
        apart = np.abs(values[first + 1:last] - line).max(axis=1)
        worst = int(apart.argmax())
        if apart[worst] > _HALF_PIXEL:
            worst += first + 1
            kept.add(worst)
            open_parts += [(first, worst), (worst, last)]
    return sorted(kept)


class _Clock:
    """The times of a motion on the screen."""

    def __init__(self, times, speed):
        self.times = times
        self.duration = float(times[-1] - times[0]) / speed

    def _keys(self, times):
        parts = (times - self.times[0]) / (self.times[-1] - self.times[0])
        return f'dur="{self.duration:.4g}s" repeatCount="indefinite" keyTimes="{_joined(parts, "%.5g")}"'

    def animate(self, attribute, values, times=None, form="%.1f"):
        """The element that animates an attribute by these values, shape (times, numbers); or nothing."""
        times = self.times if times is None else times
        values = np.asarray(values, float).reshape(len(times), -1)
        if np.abs(values - values[0]).max() < 0.05:
            return ""
        kept = _kept(times, values)
        rows = ";".join(" ".join(form % number for number in values[k]) for k in kept)
        element = f'animate attributeName="{attribute}"'
        if attribute in ("translate", "rotate"):
            element = f'animateTransform attributeName="transform" type="{attribute}"'
        return f'<{element} {self._keys(times[kept])} values="{rows}"/>'


def _joined(numbers, form):
    return ";".join(form % number for number in numbers)


def _points(pixels):
    return " ".join("%.1f,%.1f" % tuple(point) for point in pixels)


def _picture(frame, content, label):
    from html import escape

    width, height = frame.size
    return (f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(label)}" '
            f'viewBox="0 0 {width:.0f} {height:.0f}" width="{width:.0f}" height="{height:.0f}">'
            f'<rect width="100%" height="100%" fill="white"/>{content}</svg>')


# --- scenes ---


def _chain(points, centre, radius):
    """The points of terrain; of an arc some at every third degree."""
    points = np.asarray(points, float)
    if not radius > 0:
        return points
    first, last = (np.arctan2(*(point - centre)[::-1]) for point in (points[0], points[-1]))
    sweep = last - first if last > first else last - first + 2 * np.pi
    angles = first + np.linspace(0, sweep, int(np.ceil(60 * sweep / np.pi)) + 1)
    return centre + radius * np.column_stack((np.cos(angles), np.sin(angles)))


def _in_frame(point, normal, frame):
    """The part of a wall in the frame, shape (2, 2); None where it passes by."""
    along = np.array([-normal[1], normal[0]])
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack(((frame.low - point) / along, (frame.high - point) / along))
    outside = (along == 0) & ((point < frame.low) | (point > frame.high))
    first = np.where(along == 0, -np.inf, ends.min(axis=0)).max()
    last = np.where(along == 0, np.inf, ends.max(axis=0)).min()
    if outside.any() or not first < last:
        return None
    return point + np.outer((first, last), along)


def _frame_of_scene(run, surfaces):
    """Around all bodies and terrain, and the walls along its sides that are near."""
    radii = run._radii[:, None]
    seen = [(run.trajectory + side * radii).reshape(-1, 2) for side in (-1, 1)]
    for is_wall, chain, _, moved in surfaces:
        if not is_wall:
            seen += [chain + shift for shift in moved]
    inner = _Frame.around(np.concatenate(seen))
    low, high = inner.low.copy(), inner.high.copy()
    reach = 0.25 * (high - low).max()
    for is_wall, chain, normal, moved in surfaces:
        for c in (0, 1):
            if is_wall and normal[1 - c] == 0:
                at = chain[0, c] + moved[:, c]
                at = at[(at >= inner.low[c] - reach) & (at <= inner.high[c] + reach)]
                low[c], high[c] = min([low[c], *at]), max([high[c], *at])
    return _Frame(low, high)


def _without_jumps(times, at, winding, period):
    """Times and positions of a body; where it comes back on the other side, both at one time."""
    gone = np.diff(winding, axis=0) * period
    if not gone.any():
        return times, at
    after = np.flatnonzero(gone.any(axis=1)) + 1
    half = 0.5 * (at[after] + gone[after - 1] - at[after - 1])
    middle = 0.5 * (times[after - 1] + times[after])
    places = np.repeat(after, 2)
    pairs = np.stack((at[after - 1] + half, at[after] - half), axis=1).reshape(-1, 2)
    return np.insert(times, places, np.repeat(middle, 2)), np.insert(at, places, pairs, axis=0)


def _body(run, i, frame, clock):
    from html import escape

    times, at = _without_jumps(run.times, run.trajectory[:, i], run.trajectory_winding[:, i], run._period)
    pixels = frame.pixels(at)
    radius = frame.scale * run._radii[i]
    shape = (f'<circle r="{max(2.0, radius):.1f}" fill="{_COLOURS[i % len(_COLOURS)]}" fill-opacity="0.7">'
             f"<title>{escape(run.body_names[i])}</title></circle>")
    degrees = -np.degrees(run.trajectory_angles[:, i])
    if degrees.any():
        turn = clock.animate("rotate", degrees)
        shape += f'<path d="M0 0H{radius:.1f}" transform="rotate({degrees[0]:.1f})">{turn}</path>'
    moves = clock.animate("translate", pixels, times)
    return f'<g transform="translate({pixels[0, 0]:.1f} {pixels[0, 1]:.1f})">{shape}{moves}</g>'


def _surface(surface, frame, clock):
    is_wall, chain, normal, moved = surface
    shown = _in_frame(chain[0] + moved[0], normal, frame) if is_wall else chain + moved[0]
    if shown is None:
        return ""
    shift = frame.scale * (moved - moved[0]) * (1, -1)
    moves = clock.animate("translate", shift) if len(moved) > 1 else ""
    return f'<polyline points="{_points(frame.pixels(shown))}">{moves}</polyline>'


def _of_scene(run, speed):
    surfaces = [(is_wall, _chain(points, np.asarray(centre), radius), np.asarray(normal),
                 np.asarray(moved, float).reshape(-1, 2) if len(moved) else np.zeros((1, 2)))
                for is_wall, points, normal, centre, radius, moved in run._surfaces]
    frame, clock = _frame_of_scene(run, surfaces), _Clock(run.times, speed)
    content = f'<g fill="none" stroke="{_DARK}" stroke-width="2">'
    content += "".join(_surface(surface, frame, clock) for surface in surfaces)
    content += f'</g><g stroke="{_DARK}">'
    content += "".join(_body(run, i, frame, clock) for i in range(len(run._radii)))
    return Animation(_picture(frame, content + "</g>", repr(run)), clock.duration)


def page_of_scene(run):
    """A run of a scene as HTML: its outcome, and its motion where it was sampled."""
    from html import escape

    parts = [f"<p><code>{escape(repr(run))}</code></p>"]
    if not run.success:
        parts.append(f"<p>{escape(run.message)}</p>")
    if len(run.times) > 1 and run.trajectory.shape[0] * run.trajectory.shape[1] <= _MOST_SHOWN:
        parts.append(_of_scene(run, 1.0).svg)
    return "".join(parts)


# --- runs ---


def _states(run, frames):
    """Times, and the states there, shape (times, components)."""
    ends = run.times[[0, -1]]
    times = np.linspace(*ends, frames)
    if run.solution is not None:
        return times, run.solution(times).T
    return times, np.stack([np.interp(times, run.times, column) for column in run.states.T], axis=1)


def _drawn(draw, times, states):
    shapes = [np.asarray(draw(t, x), float) for t, x in zip(times.tolist(), states)]
    shape = shapes[0].shape
    if len(shape) != 2 or shape[1] != 2 or shape[0] < 1 or any(each.shape != shape for each in shapes):
        found = sorted({each.shape for each in shapes})
        raise ValueError(f"draw returned the shapes {found[:3]}, expected (points, 2) for one number of "
                         "points")
    if not np.isfinite(shapes).all():
        raise ValueError("draw returned numbers that are not finite")
    return np.stack(shapes)


def _by_drawing(run, draw, speed, frames):
    times, states = _states(run, frames)
    shapes = _drawn(draw, times, states)
    frame, clock = _Frame.around(shapes.reshape(-1, 2)), _Clock(times, speed)
    pixels = frame.pixels(shapes)
    content = (f'<polyline fill="none" stroke="{_DARK}" stroke-width="2" points="{_points(pixels[0])}">'
               f'{clock.animate("points", pixels)}</polyline>')
    last = pixels[:, -1]
    content += (f'<circle r="7" fill="{_COLOURS[0]}" cx="{last[0, 0]:.1f}" cy="{last[0, 1]:.1f}">'
                f'{clock.animate("cx", last[:, 0])}{clock.animate("cy", last[:, 1])}</circle>')
    return Animation(_picture(frame, content, repr(run)), clock.duration)


def _over_time(run, speed, frames):
    """The components over time, each scaled to the height of the picture, and their present values."""
    times, states = _states(run, frames)
    low, high = np.nanmin(states), np.nanmax(states)
    part = (times - times[0]) / (times[-1] - times[0])
    height = (states - low) / (high - low if high > low else 1.0)
    frame, clock = _Frame((0.0, 0.0), (1.0, 0.5)), _Clock(times, speed)
    content = ""
    for i in range(states.shape[1]):
        pixels = frame.pixels(np.column_stack((part, 0.5 * height[:, i])))
        there = np.isfinite(pixels[:, 1])
        if not there.any():
            continue
        colour = _COLOURS[i % len(_COLOURS)]
        content += (f'<polyline fill="none" stroke="{colour}" points="{_points(pixels[there])}">'
                    f"<title>x[{i}]</title></polyline>")
        pixels[:, 1] = np.interp(times, times[there], pixels[there, 1])
        content += (f'<circle r="5" fill="{colour}" cx="{pixels[0, 0]:.1f}" cy="{pixels[0, 1]:.1f}">'
                    f'{clock.animate("cx", pixels[:, 0])}{clock.animate("cy", pixels[:, 1])}</circle>')
    return Animation(_picture(frame, content, repr(run)), clock.duration)


def animate(run, draw=None, *, speed=1.0, frames=300):
    """Makes a picture that moves of a run; a notebook shows it as it is.

    Parameters
    ----------
    run : SceneRun, Run or the result of `solve_ivp`
        With states: a `SceneRun` with ``sample_times``, whose bodies and surfaces are drawn; a run with
        ``record_steps``, or with ``sample_times``, between which its states are on straight lines.
    draw : function (t, x) -> array_like, shape (points, 2)
        Of a run: the points that are joined at the time ``t`` in the state ``x``, such as the joints of a
        mechanism; the last one is marked. By default the components are drawn over time, with their
        present values as dots.
    speed : float
        Seconds of the motion in a second on the screen.
    frames : int
        Of a run: the number of times at which it is drawn.

    Returns
    -------
    Animation

    ValueError for a run without states at two times.
    """
    from ._scene import SceneRun

    speed = number_from(speed, "speed")
    if not 0 < speed < np.inf:
        raise ValueError(f"speed: found {speed!r}, expected a positive number")
    if isinstance(frames, bool) or not isinstance(frames, int) or frames < 2:
        raise ValueError(f"frames: found {frames!r}, expected a whole number from 2 on")
    if draw is not None and not callable(draw):
        raise TypeError(f"draw: found a {type(draw).__name__}, expected a function")
    run = getattr(run, "run", None) or run
    times = getattr(run, "times", None)
    if times is None:
        raise TypeError(f"run: found a {type(run).__name__}, expected a Run or a SceneRun")
    if len(times) < 2 or times[0] == times[-1]:
        raise ValueError("run: found states at less than two times, expected sample_times or "
                         "record_steps=True")
    if isinstance(run, SceneRun):
        if draw is not None:
            raise TypeError("draw: found one beside a run of a scene, which draws itself")
        return _of_scene(run, speed)
    return _over_time(run, speed, frames) if draw is None else _by_drawing(run, draw, speed, frames)
