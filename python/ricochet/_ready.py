"""Ready systems: the library's own, which run at the speed of C++."""

import inspect

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

    def __repr__(self):
        given = ", ".join(f"{name}={value!r}" for name, value in self._parameters.items())
        return f"{type(self).__name__}({given})"

    def __reduce__(self):
        return _again, (type(self), self._parameters)


def _again(cls, parameters):
    return cls(**parameters)


def _signature(parameters, kind):
    """A signature of `self` and of pairs of a name and a default, None where there is none."""
    own = [inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)]
    empty = inspect.Parameter.empty
    return inspect.Signature(own + [
        inspect.Parameter(name, kind, default=empty if default is None else default)
        for name, default in parameters])


def _known_function(system, known):
    """The method for a function of the known motion."""
    name = known["name"]
    whole = [argument[0] for argument in known["arguments"] if argument[2]]
    signature = _signature([argument[:2] for argument in known["arguments"]],
                           inspect.Parameter.POSITIONAL_OR_KEYWORD)

    def function(self, *given, **named):
        bound = signature.bind(self, *given, **named)
        bound.apply_defaults()
        arguments = [number_from(value, key) for key, value in bound.arguments.items()
                     if key != "self"]
        values = _ricochet.closed_form(system, name, list(self._parameters.values()), arguments)
        return values if known["many"] else values[0]

    function.__name__ = name
    function.__qualname__ = f"Ready.{name}"
    function.__signature__ = signature
    function.__doc__ = known["meaning"].replace("`", "``") + "\n\nIn closed form." + (
        f" {whole[0]} is a whole number." if whole else "")
    return function


def _doc(of):
    """The docstring of a ready system."""
    lines = [of["description"], ""]
    lines += [*of["equations"], ""] if of["equations"] else []
    lines += ["State: " + ", ".join(f"{title} [{unit}]" for title, _, unit, _ in of["state"]) + ".",
              "", "Parameters", "----------"]
    for name, initial, unit, values, meaning in of["parameters"]:
        lines += [f"{name.replace('-', '_')} : float, default {initial:g}",
                  f"    [{unit}] in {values}: {meaning}."]
    if of["source"]:
        lines += ["", f"({of['source']}.)"]
    return "\n".join(lines)


def _ready_class(of):
    """The class of a ready system, by its description."""
    signature = _signature([(name.replace("-", "_"), initial)
                            for name, initial, *_ in of["parameters"]],
                           inspect.Parameter.KEYWORD_ONLY)

    def __init__(self, **parameters):
        bound = signature.bind(self, **parameters)
        bound.apply_defaults()
        Ready.__init__(self, **{name: value for name, value in bound.arguments.items()
                                if name != "self"})

    __init__.__signature__ = signature
    members = {"__init__": __init__, "__doc__": _doc(of), "__module__": "ricochet",
               "_name": of["name"], "state": tuple(title for title, *_ in of["state"]),
               "start": tuple(start for _, start, *_ in of["state"]),
               "modes": tuple(of["modes"]) or None, **dict(of["constants"])}
    for known in of["known"]:
        members[known["name"]] = _known_function(of["name"], known)
    return type(of["type"], (Ready,), members)


#: The classes of the ready systems by their names.
SYSTEMS = {of["type"]: _ready_class(of) for of in _ricochet.ready_descriptions()}
globals().update(SYSTEMS)
