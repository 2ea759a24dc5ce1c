"""Hybrid systems: smooth motion, events, resets.

``solve_ivp`` takes SciPy's arguments and returns SciPy's result; events may also reset the
state. ``System`` is for modes and many guards, ``integrate`` and ``Simulation`` run it,
``Monitor`` finds its events in the steps of another integrator, and ``BouncingBall``,
``Pendulum`` and others are ready-made systems. Events are located to neighbouring
floating-point numbers.
"""

from . import _show  # noqa: F401
from ._compiled import C_FLOW, C_GUARD, C_JACOBIAN, C_RATE, C_RESET, Compiled
from ._ensemble import Ensemble, ensemble, row_seed
from ._filippov import Filippov
from ._fmu import Fmu, FmuRun, load_fmu
from ._gradient import (Adjoint, Gradient, Perceptron, adjoint, find_periodic_orbit, gradient,
                        monodromy, sensitivities)
from ._inclusion import Inclusion
from ._ivp import solve_ivp
from ._monitor import Cut, Monitor, Verdict
from ._network import Network
from ._plot import plot
from ._ready import SYSTEMS as _READY
from ._ricochet import Run, Snapshot, Solution, Times, __version__
from ._run import Kind, Simulation, integrate
from ._scene import Scene, SceneKind, SceneRun
from ._solution import OdeResult
from ._system import Guard, Stop, System, every, guard
from ._training import Certified, Trained, certify, train_classifier, train_gate

globals().update(_READY)  # BouncingBall and the other ready systems

__all__ = [
    "Adjoint", "C_FLOW", "C_GUARD", "C_JACOBIAN", "C_RATE", "C_RESET", "Certified", "Compiled", "Cut",
    "Ensemble", "Filippov", "Fmu", "FmuRun", "Gradient", "Guard", "Inclusion", "Kind", "Monitor",
    "Network", "OdeResult", "Perceptron", "Run", "Scene", "SceneKind", "SceneRun", "Simulation",
    "Snapshot", "Solution", "Stop", "System", "Times", "Trained", "Verdict", "adjoint", "certify",
    "ensemble", "every", "find_periodic_orbit", "gradient", "guard", "integrate", "load_fmu",
    "monodromy", "plot", "row_seed", "sensitivities", "solve_ivp", "train_classifier", "train_gate",
    *_READY,
]
