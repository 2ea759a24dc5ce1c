"""Fields that meet at switching surfaces, between which the motion may slide."""

import numpy as np

from . import _ricochet
from ._compiled import C_FLOW, as_function, is_compiled
from ._numbers import number_from, state_from
from ._system import Guard, System, _times

_PLACES = ("below", "above", "sliding")  # in the order of the digits of a mode
#: Members of a `System` that have no meaning here.
_FOREIGN = ("modes", "guard_values", "reset_set", "next_time_event", "previous_time_event",
            "changes_dimension", "formula", "set_valued", "jacobian")


class Filippov(System):
    """Smooth fields that meet at one or two switching surfaces, along which the motion may slide.

    Where both fields lead to a surface h = 0 the motion slides along it, with the convex combination
    of the fields that keeps h still; on two surfaces it is bilinear in one weight for each.

    Parameters
    ----------
    surfaces : functions (t, x) -> float, one or two
        h; also a `Guard` with a name and a ``rate``. With rates of all surfaces the decisions are
        sharper, and no differences are taken.
    fields : functions (t, x) -> numbers, shape (n,), two or four
        dx/dt in each region: below and above the surface; of two surfaces in the order below both,
        above the first, above the second, above both. They must be smooth up to the surfaces and a
        little beyond.
    guards, time_events, time_reset
        As in a `System`, watched beside the surfaces and while sliding; resets return the state
        alone. Guards may not have ``rate``, ``rest``, ``directed`` or bounds.
    restoring_rate : float
        [1/time] Sliding follows h' = -restoring_rate h, against drift on curved surfaces. Default 0.

    Modes are ``"below"``, ``"above"`` and ``"sliding"``, of two surfaces pairs such as
    ``"sliding, above"``. Without ``mode`` a run starts in `start_mode`. Runs go forward in time only.
    Each surface has four guards, ``"h: from below"``, ``"h: from above"``, ``"h: exit below"`` and
    ``"h: exit above"`` with its name in place of h.
    """

    surfaces = ()
    fields = ()
    restoring_rate = 0.0
    _unchecked_names = True  # of `below` and the like

    def __init__(self, surfaces=None, fields=None, guards=None, *, restoring_rate=None, **members):
        super().__init__(None, guards, **members)
        if surfaces is not None:
            is_one = callable(surfaces) or isinstance(surfaces, Guard) or is_compiled(surfaces)
            self.surfaces = [surfaces] if is_one else list(surfaces)
        if fields is not None:
            self.fields = fields
        if restoring_rate is not None:
            self.restoring_rate = number_from(restoring_rate, "restoring_rate")

    def _surface_list(self):
        given = self.surfaces
        if callable(given) or isinstance(given, Guard) or is_compiled(given):
            given = [given]
        surfaces = [each if isinstance(each, Guard) else Guard(each) for each in given]
        if len(surfaces) not in (1, 2):
            raise ValueError(f"{type(self).__name__}: surfaces: found {len(surfaces)}, expected one or "
                             "two functions (t, x)")
        out = []
        for i, surface in enumerate(surfaces):
            for what, function in surface._functions.items():
                if what not in ("value", "rate") and function is not None:
                    raise TypeError(f"surfaces[{i}]: found {what!r}, expected only value, rate and "
                                    "name")
            specification = surface._specification(i)
            if specification["name"] == str(i):
                specification["name"] = f"surface {i}"
            out.append(dict(specification, direction=0, title=f"surfaces[{i}]"))
        return out

    def _own_guards(self):
        guards = self._guard_list()
        for guard in guards:
            for what in ("rate", "rest", "directed", "speed_bound", "acceleration_bound",
                         "lower_bound", "upper_bound", "in_modes"):
                if guard[what] is not None and guard[what] is not False:
                    raise TypeError(f"guard {guard['name']}: found {what!r} in a guard of a Filippov, "
                                    "expected none")
        return guards

    def _mode_list(self):
        count = len(self._surface_list())
        if count == 1:
            return list(_PLACES)
        return [f"{first}, {second}" for second in _PLACES for first in _PLACES]

    def _refuse_foreign(self):
        for name in _FOREIGN:
            if getattr(self, name) is not getattr(System, name):
                raise TypeError(f"{type(self).__name__}: found {name!r} in a Filippov, expected none")
        if self.flow is not None:
            raise TypeError(f"{type(self).__name__}: found 'flow' in a Filippov, expected fields")

    def _source(self, args=None, watch=None):
        self._refuse_foreign()
        surfaces, own = self._surface_list(), self._own_guards()
        fields = [as_function(field, C_FLOW, f"fields[{i}]") for i, field in enumerate(self.fields)]
        if len(fields) != 2 ** len(surfaces):
            raise ValueError(f"{type(self).__name__}: fields: found {len(fields)}, expected "
                             f"{2 ** len(surfaces)} for {len(surfaces)} of surfaces")
        times = None if self.time_events is None else _times(self._read_again("time_events"))
        if self.time_reset is not None and times is None:
            raise ValueError("time_reset: found one without time events, expected time_events beside "
                             "it")
        sources = []
        for i, field in enumerate(fields):
            if watch is not None and not is_compiled(field):
                field = watch(field, False)
            first = i == 0
            sources.append(_ricochet.callback_system(dict(
                name=self.name or type(self).__name__, flow=field, flow_title=f"fields[{i}]",
                args=args, guards=surfaces + own if first else [], time_events=times if first else None,
                time_reset=self.time_reset if first else None, as_list=self.vector == "list")))
        is_rated = all(surface["rate"] is not None for surface in surfaces)
        return _ricochet.FilippovSource(sources, len(surfaces), is_rated, times,
                                        number_from(self.restoring_rate, "restoring_rate"))

    def start_mode(self, t, x, tolerance=0.0):
        """The mode in which a run from ``x`` at ``t`` starts.

        A surface counts as met where ``|h| <= tolerance``; then both fields decide.
        """
        number = self._source().start_mode_at(number_from(t, "t"), state_from(x, "x"),
                                              number_from(tolerance, "tolerance"))
        return self._mode_list()[number]

    def shares(self, mode, t, x):
        """The weight in [0, 1] of the fields above each surface, shape (surfaces,).

        While sliding it is the mean of the switching, such as the force of sticking friction as a
        part of its bounds; elsewhere 0 below and 1 above.
        """
        modes = self._mode_list()
        if mode not in modes:
            raise ValueError(f"mode: found {mode!r}, expected one of {modes}")
        return np.array(self._source().shares(modes.index(mode), number_from(t, "t"),
                                              state_from(x, "x")))
