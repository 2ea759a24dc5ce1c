"""Mechanisms whose parts hit, stick, slide and rest on each other."""

import inspect
from numbers import Integral

import numpy as np

from . import _ricochet
from ._compiled import is_compiled
from ._numbers import numbers_from, state_from
from ._run import integrate
from ._system import System

#: Members of a `System` that have no meaning here.
_FOREIGN = ("flow", "changes_dimension", "formula", "set_valued", "jacobian", "previous_time_event",
            "vector")
#: What a guard may not have: contact takes over where impacts accumulate.
_FOREIGN_OF_GUARDS = ("rest", "directed", "speed_bound", "acceleration_bound", "lower_bound",
                      "upper_bound")


def _takes_time(function, what):
    """Whether a function takes (t, q), and not only q."""
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):  # not written in Python
        return False
    for is_timed in False, True:
        try:
            signature.bind(*[None] * (1 + is_timed))
            return is_timed
        except TypeError:
            pass
    raise TypeError(f"{what}: found {what}{signature}, expected {what}(q) or {what}(t, q)")


def _refuse_arguments(function, arguments):
    """Rejects a function that cannot be called with these arguments, by their names."""
    what = arguments.partition("(")[0]
    try:
        signature = inspect.signature(function)
    except (TypeError, ValueError):
        return
    try:
        signature.bind(*[None] * (arguments.count(",") + 1))
    except TypeError:
        raise TypeError(f"{what}: found {what}{signature}, expected {arguments}") from None


def _no_flow(*_):
    raise AssertionError("the flow of a mechanism is that of its forces")


class Mechanism(System):
    """A mechanical system with contacts: impacts, friction, parts that rest on each other.

    With coordinates q, velocities v = dq/dt and impulses p of the contacts::

        M(q) dv = F(t, q, v) dt + H(q)' dp

    A subclass with the members below, run by `contact_motion`, `integrate` or `Simulation`. It may
    have up to 6 coordinates, and the guards, resets, time events and modes of a `System` for the
    state x = (q, v), which act in flight and in contact alike.

    mass(q) -> numbers, shape (n, n)
        M, symmetric and positive definite; also a matrix that does not change.
    force(t, q, v) -> numbers, shape (n,)
        The smooth forces [N], gravity and springs among them; where M depends on q, also the
        inertial forces. With ``modes``: force(mode, t, q, v).
    contacts : int
        Number of contacts. The following members are needed where there are some.
    tangents : 1 or 2
        Directions of slip at a contact, in the plane (default) or in space.
    gaps(q) -> numbers, shape (contacts,)
        The gap of each contact [m], positive where it is open.
    directions(q) -> numbers, shape (contacts * (1 + tangents), n)
        H: of each contact first the row of the rate of its gap, then those of its slip velocities;
        each rate is the product of its row and v.
    restitution, friction
        Newton's coefficient, 0 to 1, and Coulomb's, not negative: a number for all contacts, or
        one for each.
    gaps(t, q), directions(t, q), surface_rates(t, q) -> numbers, shape (contacts * (1 + tangents),)
        Surfaces that move: ``surface_rates`` is what they add to the relative velocities H v.
    dry_friction : number or sequence
        The largest force [N] of dry friction against the motion of each coordinate, not negative.

    Runs go forward in time only. ``run.guard_names`` has the contacts first.
    """

    contacts = 0
    tangents = 1
    mass = None
    force = None
    gaps = None
    directions = None
    surface_rates = None
    restitution = 0.0
    friction = 0.0
    dry_friction = None
    _further_names = ("contacts", "tangents", "mass", "force", "gaps", "directions", "surface_rates",
                      "restitution", "friction", "dry_friction")

    def __init__(self, guards=None, **members):
        super().__init__(members.pop("flow", None), guards, **members)

    def _refuse_foreign(self, guards):
        who = type(self).__name__
        for name in _FOREIGN:
            if getattr(self, name) is not getattr(System, name):
                instead = "force" if name == "flow" else "none"
                raise TypeError(f"{who}: found {name!r} in a Mechanism, expected {instead}")
        for guard in guards:
            for what in _FOREIGN_OF_GUARDS:
                if guard[what] is not None and guard[what] is not False:
                    raise TypeError(f"guard {guard['name']}: found {what!r} in a guard of a "
                                    "Mechanism, expected none")

    def _count(self, name, least, most):
        count = getattr(self, name)
        if not isinstance(count, Integral) or isinstance(count, bool) or not least <= count <= most:
            raise ValueError(f"{name}: found {count!r}, expected a whole number from {least} to "
                             f"{most}")
        return int(count)

    def _function(self, name, arguments, needed=True):
        function = getattr(self, name)
        if function is None and not needed:
            return None
        if is_compiled(function):
            raise TypeError(f"{name}: found a compiled function, expected one of Python")
        if not callable(function):
            found = "none" if function is None else repr(function)
            raise TypeError(f"{name}: found {found}, expected a function {arguments}")
        if name not in ("gaps", "directions"):
            _refuse_arguments(function, arguments)
        return function

    def _coefficients(self, name, contacts):
        given = getattr(self, name)
        if callable(given):
            raise TypeError(f"{name}: found a function, expected a number, or one for each contact")
        numbers = numbers_from(given, name)
        if numbers.shape not in ((), (contacts,)):
            raise ValueError(f"{name}: found shape {numbers.shape}, expected a number or "
                             f"({contacts},)")
        return np.broadcast_to(numbers, (contacts,)).tolist()

    def _masses(self):
        """The function of the mass matrix, or the numbers of one that does not change."""
        if self.mass is None or callable(self.mass):
            return self._function("mass", "mass(q)"), []
        matrix = numbers_from(self.mass, "mass")
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or matrix.size == 0:
            raise ValueError(f"mass: found shape {matrix.shape}, expected a square")
        return None, matrix.ravel().tolist()

    def _frictions(self):
        if self.dry_friction is None:
            return []
        forces = numbers_from(self.dry_friction, "dry_friction")
        if forces.ndim != 1 or forces.size == 0:
            raise ValueError(f"dry_friction: found shape {forces.shape}, expected a number for each "
                             "coordinate")
        return forces.tolist()

    def _surfaces(self, contacts):
        """The functions of the contacts."""
        if contacts == 0:
            for name in ("gaps", "directions", "surface_rates"):
                if getattr(self, name) is not None:
                    raise ValueError(f"{name}: found one of a Mechanism without contacts, expected "
                                     "their number: contacts")
            return dict(gaps=None, directions=None, surface_rates=None, timed_gaps=False,
                        timed_directions=False)
        gaps = self._function("gaps", "gaps(q)")
        directions = self._function("directions", "directions(q)")
        rates = self._function("surface_rates", "surface_rates(t, q)", needed=False)
        timed_gaps = _takes_time(gaps, "gaps")
        if timed_gaps and rates is None:
            raise TypeError("gaps: found gaps(t, q) without surface_rates, expected surface_rates(t, "
                            "q), the rates of the gaps and slip velocities where v = 0")
        return dict(gaps=gaps, directions=directions, surface_rates=rates, timed_gaps=timed_gaps,
                    timed_directions=_takes_time(directions, "directions"))

    def _source(self, args=None, watch=None):
        if args:
            raise TypeError("args: found some for a Mechanism, expected none")
        events = self._event_members(None)
        self._refuse_foreign(events["guards"])
        modes = events["modes"]
        contacts = self._count("contacts", 0, 10000)
        mode = "" if modes is None else "mode, "
        mass, constant_mass = self._masses()
        description = dict(
            self._surfaces(contacts), contacts=contacts, tangents=self._count("tangents", 1, 2),
            mass=mass, constant_mass=constant_mass,
            force=self._function("force", f"force({mode}t, q, v)"), modes=modes,
            restitution=self._coefficients("restitution", contacts),
            friction=self._coefficients("friction", contacts), dry_friction=self._frictions())
        beside = _ricochet.callback_system(dict(events, flow=_no_flow, time_reset=self.time_reset))
        return _ricochet.mechanism_system(beside, description)


def contact_motion(mechanism, q, v, t_end, *, step=0.0, events_only=False, rtol=1e-10, atol=1e-12,
                   **options):
    """Runs a `Mechanism`: impacts by events while contacts are open, Moreau's steps in contact.

    Parameters
    ----------
    mechanism : Mechanism
    q, v : array_like, shape (n,)
        Coordinates and velocities at the start, outside of all obstacles.
    t_end : float
        [s] The end of the run.
    step : float
        [s] Length of the steps in contact; 0: a thousandth of the run.
    events_only : bool
        The run ends as ``"not_handed_over"`` where contact would begin.
    rtol, atol : float
        Errors allowed in a step of a flight.
    **options
        As for `integrate`: ``t_start``, ``mode``, ``sample_times``, ``record_steps``, ``h_max``,
        ``stop_at_event``, ``max_steps`` and others. With ``fixed=True`` the steps of flights have
        the length ``step``, too.

    Returns
    -------
    Run
        Its states are (q, v); ``events`` has impacts in flight, whose ``guard`` is the contact, and
        events of guards and times; ``phases`` says where contact began and ended, and why;
        ``reactions`` has at ``times`` the forces [N] of all contacts, the normal one of each first,
        and those of dry friction of each coordinate, means over the step that holds the sample and
        zero in flight; ``contact`` has counts of the motion in contact and, where the run ended as
        ``"not_converged"``, the contact problem that was not solved.

    Raises ValueError for a start inside an obstacle, for coefficients outside their range, for a
    mass matrix that is not positive definite, and for a row of ``directions`` that is not the
    gradient of its gap.
    """
    if not isinstance(mechanism, Mechanism):
        raise TypeError(f"mechanism: found a {type(mechanism).__name__}, expected a "
                        "ricochet.Mechanism")
    q, v = state_from(q, "q"), state_from(v, "v")
    if len(q) != len(v):
        raise ValueError(f"v: found {len(v)} numbers, expected {len(q)} as in q")
    return integrate(mechanism, [*q, *v], t_end, step=step, events_only=events_only, rtol=rtol,
                     atol=atol, **options)
