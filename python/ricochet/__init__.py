"""Hybrid systems: smooth motion, events, resets.

``solve_ivp`` takes SciPy's arguments and returns SciPy's result; events may also reset the
state. ``System`` is for modes and many guards, ``integrate`` and ``Simulation`` run it,
``Monitor`` finds its events in the steps of another integrator, and ``BouncingBall``,
``Pendulum`` and others are ready-made systems. Events are located to neighbouring
floating-point numbers.
"""

from importlib import import_module

from . import _show  # noqa: F401
from ._ivp import solve_ivp
from ._ready import SYSTEMS as _READY
from ._ricochet import Run, Snapshot, Solution, Times, __version__
from ._run import Kind, Simulation, integrate
from ._system import Guard, Stop, System, every, guard

# What many programs do not use is imported when it is first asked for.
_LATER = {
    "_animation": ("Animation", "animate"),
    "_compiled": ("C_FLOW", "C_GUARD", "C_JACOBIAN", "C_RATE", "C_RESET", "Compiled"),
    "_ensemble": ("Ensemble", "ensemble", "row_seed"),
    "_filippov": ("Filippov",),
    "_fmu": ("Fmu", "FmuRun", "load_fmu"),
    "_gradient": ("Adjoint", "Gradient", "Perceptron", "adjoint", "find_periodic_orbit", "gradient",
                  "monodromy", "sensitivities"),
    "_guard_network": ("GuardNetwork",),
    "_inclusion": ("Inclusion",),
    "_mechanism": ("Mechanism", "contact_motion"),
    "_monitor": ("Cut", "Monitor", "Verdict"),
    "_network": ("Network",),
    "_plot": ("plot",),
    "_scene": ("Scene", "SceneKind", "SceneRun"),
    "_solution": ("OdeResult",),
    "_training": ("Certified", "Trained", "certify", "train_classifier", "train_gate"),
}
_HOME = {name: module for module, names in _LATER.items() for name in names}

globals().update(_READY)  # BouncingBall and the other ready systems

__all__ = [
    "Adjoint", "Animation", "C_FLOW", "C_GUARD", "C_JACOBIAN", "C_RATE", "C_RESET", "Certified",
    "Compiled", "Cut", "Ensemble", "Filippov", "Fmu", "FmuRun", "Gradient", "Guard", "GuardNetwork",
    "Inclusion", "Kind", "Mechanism", "Monitor", "Network", "OdeResult", "Perceptron", "Run",
    "Scene", "SceneKind", "SceneRun", "Simulation", "Snapshot", "Solution", "Stop", "System",
    "Times", "Trained", "Verdict", "adjoint", "animate", "certify", "contact_motion", "ensemble",
    "every", "find_periodic_orbit", "gradient", "guard", "integrate", "load_fmu", "monodromy", "plot", "row_seed", "sensitivities", "solve_ivp", "train_classifier", "train_gate",
    *_READY,
]


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__():
    return sorted({*globals(), *__all__})
