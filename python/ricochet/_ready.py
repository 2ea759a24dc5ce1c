"""Ready systems: the library's own, which run at the speed of C++."""

from . import _ricochet
from ._numbers import number_from


#: Functions of a `System`, which a ready system has in C++.
_OF_SYSTEMS = ("flow", "guard", "reset", "rest", "guard_rate", "guards", "guard_values",
               "reset_set", "time_events", "next_time_event", "previous_time_event", "time_reset",
               "jacobian")


class Ready:
    """A ready system; its parameters are keyword arguments and attributes."""

    _name = ""
    modes = None
    state = ()  #: the names of its components

    def __init__(self, **parameters):
        self._parameters = {name: number_from(value, name) for name, value in parameters.items()}
        self._source = _ricochet.ready_system(self._name, list(self._parameters.values()))
        self._source.parameters = {name.replace("_", "-"): value
                                   for name, value in self._parameters.items()}

    @property
    def parameters(self):
        """The parameters by name."""
        return dict(self._parameters)

    def __init_subclass__(cls, **options):
        super().__init_subclass__(**options)
        for name in _OF_SYSTEMS:
            if name in vars(cls):
                raise TypeError(f"{cls.__name__}: found {name!r} in a subclass of a ready system, "
                                "which is computed without Python; expected a subclass of System")

    def __getattr__(self, name):
        try:
            return self.__dict__["_parameters"][name]
        except KeyError:
            raise AttributeError(f"{type(self).__name__} has no {name!r}") from None

    def __setattr__(self, name, value):
        if name in self.__dict__.get("_parameters", ()):
            raise AttributeError(f"{name}: found an assignment to a parameter of a ready system, "
                                 f"expected another system: {type(self).__name__}({name}=...)")
        super().__setattr__(name, value)

    def _known(self, what, *arguments):
        return _ricochet.closed_form(self._source, what, [number_from(a, what) for a in arguments])

    def __repr__(self):
        given = ", ".join(f"{name}={value!r}" for name, value in self._parameters.items())
        return f"{type(self).__name__}({given})"

    def __reduce__(self):
        return _again, (type(self), self._parameters)


def _again(cls, parameters):
    return cls(**parameters)


class BouncingBall(Ready):
    """A point mass falling onto a rigid floor at height 0.

    State (height [m], velocity [m/s]); the floor is a unilateral guard with the reset
    v+ = -restitution v-, and the ball rests after infinitely many impacts.
    """

    _name = "bouncing-ball"
    state = ("height", "velocity")
    start = (10.0, 0.0)

    def __init__(self, *, gravity=9.81, restitution=0.9):
        super().__init__(gravity=gravity, restitution=restitution)

    def impact_time(self, n, height, velocity=0.0):
        """Time [s] of impact n = 0, 1, 2, ..., in closed form."""
        return self._known("impact_time", n, height, velocity)[0]

    def zeno_time(self, height, velocity=0.0):
        """Limit [s] of the times of impact; infinite for restitution 1."""
        return self._known("zeno_time", height, velocity)[0]


class Pendulum(Ready):
    """A point mass on a massless rod, swinging without friction.

    State (angle [rad], rate [rad/s]); its turning points are recorded.
    """

    _name = "pendulum"
    state = ("angle", "rate")
    start = (-0.05, 0.0)

    def __init__(self, *, gravity=9.8, length=1.0):
        super().__init__(gravity=gravity, length=length)

    def half_period(self, amplitude=-0.05):
        """Time [s] between turning points at +-amplitude [rad], in closed form."""
        return self._known("half_period", amplitude)[0]


class ImpactOscillator(Ready):
    """A damped oscillator under a harmonic force, with a rigid wall on one side.

    State (position, velocity), dimensionless; the wall is a unilateral guard with the reset
    v+ = -restitution v-.
    """

    _name = "impact-oscillator"
    state = ("position", "velocity")
    start = (0.0, 0.0)

    def __init__(self, *, frequency=0.7, wall=1.0, restitution=0.8, damping=0.1):
        super().__init__(frequency=frequency, wall=wall, restitution=restitution,
                         damping=damping)

    def impacts(self, t_end):
        """Times of all impacts from `start` up to ``t_end``, in closed form."""
        return self._known("impacts", t_end)


class CoulombOscillator(Ready):
    """A mass on a spring under Coulomb's friction.

    State (position [m], velocity [m/s]); it stops, turns, and sticks at last.
    """

    _name = "coulomb-oscillator"
    state = ("position", "velocity")
    modes = ("slip-left", "slip-right", "stick")
    start = (2.0, 0.0)

    def __init__(self, *, mass=1.0, stiffness=1.0, friction=0.3, static_friction=0.3):
        super().__init__(mass=mass, stiffness=stiffness, friction=friction,
                         static_friction=static_friction)

    def turning_time(self, n):
        """Time [s] of the n-th stop after a start at rest, n = 1, 2, ..."""
        return self._known("turning_time", n)[0]

    def turning_point(self, n, start=2.0):
        """Where [m] the n-th stop is after a start at rest at ``start`` [m]."""
        return self._known("turning_point", n, start)[0]


class StickSlip(Ready):
    """A mass held by a spring on a moving belt, under friction that falls with the sliding speed.

    State (position [m], velocity [m/s]).
    """

    _name = "stick-slip"
    state = ("position", "velocity")
    modes = ("slip-left", "slip-right", "stick")
    start = (1.0, 0.2)
    period = 12.001031294830578647  #: [s] with the default parameters

    def __init__(self, *, mass=1.0, stiffness=1.0, belt_speed=0.2, friction=1.0, weakening=3.0):
        super().__init__(mass=mass, stiffness=stiffness, belt_speed=belt_speed,
                         friction=friction, weakening=weakening)


class Thermostat(Ready):
    """The temperature of a room with a heater that is switched on and off.

    State (temperature [degrees],).
    """

    _name = "thermostat"
    state = ("temperature",)
    modes = ("off", "on")
    start = (20.0,)

    def __init__(self, *, rate=0.1, ambient=0.0, heated=30.0, low=18.0, high=22.0):
        super().__init__(rate=rate, ambient=ambient, heated=heated, low=low, high=high)

    def switch_time(self, n, temperature=20.0):
        """Time [s] of switch n = 0, 1, 2, ...; the even ones switch the heater on."""
        return self._known("switch_time", n, temperature)[0]
