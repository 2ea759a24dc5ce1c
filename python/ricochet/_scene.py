"""Scenes of many bodies in a plane, from impact to impact."""

import os
from enum import IntEnum
from types import SimpleNamespace

import numpy as np

from ._numbers import meant_by, number_from, numbers_from


def _scenes():
    from importlib import import_module
    try:
        return import_module("._scenes", __package__)
    except ModuleNotFoundError as error:
        raise ImportError(
            "ricochet: found a package without scenes, expected the module ricochet._scenes: build "
            "it with the CMake option RICOCHET_SCENE") from error


class SceneKind(IntEnum):
    """Kind of an event of a scene: the field ``kind`` of ``run.events``.

    IMPACT : two bodies, or a body and a surface, have struck each other
    HELD : impacts on a surface have accumulated, and the body slides or rests on it
    STOPPED : friction has stopped a sliding body
    JOINED : lasting contact: the body is advanced in a group
    RELEASED : the body has left its group
    SLEPT : the group of the body has come to rest
    """

    IMPACT = 0
    HELD = 1
    STOPPED = 2
    JOINED = 3
    RELEASED = 4
    SLEPT = 5

    def __str__(self):
        return self.name


_EVENT = np.dtype([("t", "f8"), ("number", "u8"), ("kind", "u1"), ("body", "i8"), ("other", "i8"),
                   ("surface", "?"), ("impulse", "f8", 2), ("before", "f8", (2, 2)),
                   ("after", "f8", (2, 2))])


def _pair(given, what):
    pair = numbers_from(given, what)
    if pair.shape != (2,):
        raise ValueError(f"{what}: found shape {pair.shape}, expected two numbers")
    return pair.tolist()


def _text(given):
    if given is None:
        return ""
    if not isinstance(given, str):
        raise TypeError(f"name: found {given!r}, expected a text")
    return given


class SceneRun:
    """Result of a run of a scene, in m, s, kg, N s and J.

    outcome, message, success : str, str, bool
        How the run ended; a sentence on what ended it, empty at the end; whether it reached its end.
    involved : list of int
        The bodies that the message is about.
    t : float
        Time that all bodies have reached.
    positions, velocities, asleep : ndarray, shapes (bodies, 2), (bodies, 2) and (bodies,)
        There; ``asleep``: at rest until struck.
    times, trajectory, trajectory_velocities, trajectory_asleep : ndarray
        ``sample_times`` that were reached, and the states there, shapes (times, bodies, 2) and
        (times, bodies).
    winding, trajectory_winding : ndarray of int, shapes (bodies, 2) and (times, bodies, 2)
        Periods that each body has gone along x and y, in a scene with a ``period``; else 0.
    angles, spins, trajectory_angles, trajectory_spins : ndarray, (bodies,) and (times, bodies)
        [rad] and [rad/s] of discs with an ``inertia``; else 0.
    energy : ndarray, shape (times,)
        At ``times``, kinetic and of gravity and springs; ``energy_at_end`` at ``t``.
    events : ndarray, shape (events,)
        A structured array: ``t``; ``number``, equal for the contacts of one cluster; ``kind``, a
        `SceneKind`; ``body``; ``other``, a body or, where ``surface`` is set, a surface; ``impulse``
        on ``body``; ``before`` and ``after``, the velocities of both.
    body_names, surface_names : list of str
    statistics : namespace
        Counts, such as ``impacts`` and ``steps``.
    """

    def __init__(self, scene, found):
        self.outcome, self.message = found["outcome"], found["message"]
        self.success = self.outcome == "reached_end"
        self.involved = found["involved"].tolist()
        self.t = found["t"]
        last = found["last"]
        self.positions, self.velocities, self.asleep, self.winding = (rows[0] for rows in last)
        self.times = found["times"]
        (self.trajectory, self.trajectory_velocities, self.trajectory_asleep,
         self.trajectory_winding) = found["samples"]
        columns = found["events"]
        self.events = np.empty(len(columns["t"]), _EVENT)
        for name, column in columns.items():
            self.events[name] = column
        period = np.array(scene._scene.period)
        self.angles, self.spins = (rows[0] for rows in found["turns"])
        self.trajectory_angles, self.trajectory_spins = found["sample_turns"]
        inertias = scene._scene.inertias
        self.energy = scene.energy(self.trajectory + self.trajectory_winding * period,
                                   self.trajectory_velocities)
        self.energy += 0.5 * self.trajectory_spins**2 @ inertias
        self.energy_at_end = float(scene.energy(last[0] + last[3] * period, last[1])[0]
                                   + 0.5 * self.spins**2 @ inertias)
        self.body_names, self.surface_names = scene.body_names, scene.surface_names
        self._radii, self._period = scene.radii, period
        self._surfaces = scene._scene.surfaces(self.times.tolist())  # as an animation draws them
        self.statistics = SimpleNamespace(**found["statistics"])

    def animate(self, speed=1.0):
        """The motion between ``sample_times`` as an `Animation`, as by `ricochet.animate`."""
        from ._animation import animate
        return animate(self, speed=speed)

    def _repr_html_(self):
        from ._animation import page_of_scene
        return page_of_scene(self)

    def __repr__(self):
        return (f"<SceneRun: {self.outcome} at t = {self.t!r}, {len(self.body_names)} bodies, "
                f"{self.statistics.events} events>")


class Scene:
    """Discs, points and plates in a plane, with walls, terrain and springs; each body has its own clock.

    The plane is vertical with gravity, horizontal without. Discs turn if they have an inertia; at
    others friction acts at the centre. Lengths are in m, times in s, masses in kg.

    Parameters
    ----------
    gravity : (float, float)
        [m/s^2] Default (0, 0).
    period : (float, float)
        [m] Lengths of a cell that repeats along x and y; 0, the default: none.
    memory_limit : float
        [bytes] A scene that would need more in a run is refused. Default 4e9.
    """

    def __init__(self, gravity=(0.0, 0.0), *, period=(0.0, 0.0), memory_limit=4e9):
        self._scene = _scenes().Scene(_pair(gravity, "gravity"), _pair(period, "period"),
                                      number_from(memory_limit, "memory_limit"))
        self._materials = {None: 0}

    @classmethod
    def _of(cls, scene):
        out = cls.__new__(cls)
        named = {name: i for i, name in enumerate(scene.material_names) if name}
        out._scene, out._materials = scene, {None: 0, **named}
        return out

    @classmethod
    def from_json(cls, text, name="scene"):
        """Reads the scene that ``text`` describes, with the options of its ``"run"``.

        ValueError, with ``name`` and the line, where it is not one.
        """
        if not isinstance(text, str):
            raise TypeError(f"text: found a {type(text).__name__}, expected a text; Scene.load reads "
                            "files")
        return cls._of(_scenes().read_scene(text, name))

    @classmethod
    def load(cls, path):
        """Reads a scene from a JSON file; ValueError also where the file cannot be read."""
        return cls._of(_scenes().load_scene(os.fspath(path)))

    def material(self, name, *, restitution=1.0, friction=0.0, by_speed=None):
        """Adds a material, by whose name bodies and surfaces refer to it.

        At a contact the smaller restitution, in [0, 1], and the smaller coefficient of friction apply.
        Without a material a body is elastic and smooth. ``by_speed``, in place of a constant:
        ``{"speed": v, "exponent": p}`` for 1 - (1 - restitution) (approach / v)^p below v, or
        ``{"speeds": [...], "restitutions": [...]}``, linear between them.
        """
        if not isinstance(name, str) or not name:
            raise TypeError(f"name: found {name!r}, expected a text")
        self._materials[name] = self._scene.material(
            name, number_from(restitution, "restitution"), number_from(friction, "friction"), by_speed)

    def pair(self, first, second, *, restitution=1.0, friction=0.0, by_speed=None):
        """Says what applies where two materials touch, in place of the smaller coefficients of both."""
        self._scene.pair(self._material(first), self._material(second),
                         number_from(restitution, "restitution"), number_from(friction, "friction"),
                         by_speed)

    def _material(self, name):
        if name not in self._materials:
            known = [each for each in self._materials if each is not None]
            raise ValueError(f"material: found {name!r}, expected some of {meant_by(name, known)}")
        return self._materials[name]

    def disc(self, at, *, radius=1.0, mass=1.0, velocity=(0.0, 0.0), drag=0.0, material=None,
             inertia=0.0, angle=0.0, spin=0.0, name=None):
        """Adds a disc with its centre ``at`` (x, y), and returns its number among the bodies.

        ``drag`` [kg/s] is the d of a force -d velocity. With an ``inertia`` [kg m^2], mass radius^2 / 2
        for a solid disc, it turns, from this ``angle`` [rad] with this ``spin`` [rad/s].
        """
        return self._scene.disc(_text(name), _pair(at, "at"), _pair(velocity, "velocity"),
                                number_from(radius, "radius"), number_from(mass, "mass"),
                                number_from(drag, "drag"), self._material(material),
                                number_from(inertia, "inertia"), number_from(angle, "angle"),
                                number_from(spin, "spin"))

    def point(self, at, *, mass=1.0, velocity=(0.0, 0.0), drag=0.0, material=None, name=None):
        """Adds a body without extension, and returns its number; two points never meet."""
        return self._scene.point(_text(name), _pair(at, "at"), _pair(velocity, "velocity"),
                                 number_from(mass, "mass"), number_from(drag, "drag"),
                                 self._material(material))

    def plate(self, start, end, *, along=None, speed=0.0, mass=1.0, material=None, name=None):
        """Adds a straight plate from ``start`` to ``end``, such as a piston, and returns its number.

        It moves along a line without turning: in the direction ``along`` (x, y) of any length, by
        default at a right angle to itself, with this ``speed`` [m/s]. Discs, points and parallel plates
        meet it from both sides, and walls stop it.
        """
        direction = [0.0, 0.0] if along is None else _pair(along, "along")
        if along is not None and not any(direction):
            raise ValueError(f"along: found {along!r}, expected a direction")
        return self._scene.plate(_text(name), [_pair(start, "start"), _pair(end, "end")], direction,
                                 number_from(speed, "speed"), number_from(mass, "mass"),
                                 self._material(material))

    def wall(self, point, normal, *, material=None, motion=None, temperature=0.0, name=None):
        """Adds a wall through ``point``, whose ``normal`` points towards the bodies.

        Returns its number among the surfaces. ``motion`` is a dictionary:
        ``{"amplitude": (x, y), "frequency": hertz, "phase": rad}``, ``{"velocity": (x, y), "since":
        t}``, ``{"times": [...], "displacements": [(x, y), ...]}``, or functions of t that return
        pairs, ``{"displacement": f, "velocity": df, "acceleration_bound": a}``, also with
        ``speed_bound`` and ``reach``. ``temperature`` [J], kT of a thermal wall: bodies leave it with a
        velocity at random, by the ``seed`` of the run.
        """
        return self._scene.wall(_text(name), _pair(point, "point"), _pair(normal, "normal"),
                                self._material(material), motion,
                                number_from(temperature, "temperature"))

    def terrain(self, points, *, closed=False, material=None, motion=None, temperature=0.0,
                name=None):
        """Adds a chain of segments between ``points``, shape (n, 2), which is met from both sides.

        ``closed``: the last point is joined to the first. Returns its number among the surfaces.
        """
        ends = numbers_from(points, "points")
        if ends.ndim != 2 or ends.shape[1] != 2:
            raise ValueError(f"points: found shape {ends.shape}, expected (n, 2)")
        return self._scene.terrain(_text(name), ends.tolist(), bool(closed),
                                   self._material(material), motion,
                                   number_from(temperature, "temperature"))

    def arc(self, centre, *, radius=None, start=None, end=None, material=None, temperature=0.0,
            name=None):
        """Adds a circle of this ``radius``, or the part of one that leads counterclockwise from
        ``start`` to ``end``; both are met from both sides. Returns its number among the surfaces.
        """
        if (radius is None) == (start is None and end is None) or (start is None) != (end is None):
            raise ValueError(f"arc: found radius={radius!r}, start={start!r} and end={end!r}, expected "
                             "a radius, or a start and an end")
        ends = [[0.0, 0.0]] * 2 if start is None else [_pair(start, "start"), _pair(end, "end")]
        size = 0.0 if radius is None else number_from(radius, "radius")
        if radius is not None and not size > 0:
            raise ValueError(f"arc: found radius={radius!r}, expected a positive number")
        return self._scene.arc(_text(name), _pair(centre, "centre"), size, ends,
                               self._material(material), number_from(temperature, "temperature"))

    def _number(self, body):
        if isinstance(body, str):
            return self._scene.body(body)
        count = len(self._scene.body_names)
        if isinstance(body, bool) or not isinstance(body, (int, np.integer)) or not 0 <= body < count:
            raise ValueError(f"spring: found {body!r}, expected the name of a body, or a number below "
                             f"{count}")
        return int(body)

    def spring(self, first, second, *, stiffness, rest=0.0, damping=0.0):
        """Adds a spring between two bodies, by number or name.

        Its tension is stiffness (length - rest) + damping d(length)/dt.
        """
        self._scene.spring(self._number(first), self._number(second), number_from(rest, "rest"),
                           number_from(stiffness, "stiffness"), number_from(damping, "damping"))

    @property
    def body_names(self):
        """Names of the bodies, by number."""
        return self._scene.body_names

    @property
    def surface_names(self):
        """Names of walls and terrain, by number."""
        return self._scene.surface_names

    @property
    def radii(self):
        """Radii of the bodies [m], shape (bodies,); 0 for points."""
        return self._scene.radii

    @staticmethod
    def _options(t_end, options):
        if t_end is not None:
            options["t_end"] = number_from(t_end, "t_end")
        if options.get("sample_times") is not None:
            options["sample_times"] = numbers_from(options["sample_times"], "sample_times").tolist()
        return {name: value for name, value in options.items() if value is not None}

    def simulate(self, t_end=None, **options):
        """Runs the scene to ``t_end``, by default that of its file, and returns a `SceneRun`.

        Options: ``t_start``, ``sample_times``, ``rtol`` and ``atol`` (of bodies with springs or
        drag), ``impacts`` ("waves", or "together": Newton's law for all contacts of a cluster at once),
        ``elastic_within`` [s], ``contact_step`` [s] (of groups in lasting contact), ``crowded_from``
        (bodies from which a group may be a crowd, 0: never), ``record_events``,
        ``max_events``, ``seed`` (of thermal walls). ValueError for a scene that cannot start, naming the bodies that overlap.
        """
        return SceneRun(self, self._scene.simulate(self._options(t_end, options)))

    def measure(self, t_start, t_end, *, blocks=10, area=None, lengths=None, **options):
        """Runs a gas without gravity, and measures it from ``t_start`` to ``t_end`` [s].

        Returns a namespace of pairs, the mean and its standard error over ``blocks`` equal parts of
        that time: ``collision_rate`` and ``wall_rate`` [1/s], ``temperature`` (kT) [J],
        ``virial_pressure`` [N/m], ``mean_free_path`` [m], and ``surface_pressure`` [N/m], one for each
        surface, NaN unless ``lengths`` has its name or number with the length [m] that is struck.
        ``area`` [m^2] of the gas is by default that of the ``period``. Options as of `simulate`; no
        event is kept.
        """
        names = self.surface_names
        known = [float("nan")] * len(names)
        for surface, length in (lengths or {}).items():
            number = names.index(surface) if surface in names else surface
            if isinstance(number, bool) or not isinstance(number, int) or not 0 <= number < len(names):
                raise ValueError(f"lengths: found {surface!r}, expected the name or number of a surface, "
                                 f"some of {names}")
            known[number] = number_from(length, "lengths")
        if isinstance(blocks, bool) or not isinstance(blocks, int) or blocks < 2:
            raise ValueError(f"blocks: found {blocks!r}, expected a whole number from 2 on")
        found = self._scene.measure(number_from(t_start, "t_start"), number_from(t_end, "t_end"), blocks,
                                    0.0 if area is None else number_from(area, "area"), known,
                                    self._options(None, options))
        return SimpleNamespace(**found)

    def explain(self, t_end=None, **options):
        """Says how the scene would be run, as a text; nothing is simulated."""
        return self._scene.explain(self._options(t_end, options))

    def energy(self, positions, velocities):
        """Energy [J] of states of all bodies, shape (times,) of two arrays (times, bodies, 2)."""
        return self._scene.energy(numbers_from(positions, "positions"),
                                  numbers_from(velocities, "velocities"))

    def __repr__(self):
        return f"<Scene: {len(self.body_names)} bodies, {len(self.surface_names)} surfaces>"
