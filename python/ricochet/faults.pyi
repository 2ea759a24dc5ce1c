from os import PathLike
from typing import Any, Optional, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import System

_Floats = NDArray[np.float64]

class Friction:
    def __init__(self, a: float = 0.011, b: float = 0.016, f_star: float = 0.5109,
                 v_star: float = 1e-4, d_rs: float = 1e-6, *, evolution: str = "ageing",
                 effect: str = "asinh") -> None: ...
    def evaluate(self, v: ArrayLike, xi: ArrayLike) -> Tuple[Any, Any]: ...
    def critical_stiffness(self, mass: float, normal_force: float, v: float) -> float: ...

class SliderRun:
    outcome: str
    state: np.void
    events: NDArray[np.void]
    samples: NDArray[np.void]
    steps: int
    rejected: int
    stages: int
    iterations: int
    unsolved: int
    not_convex: int
    residual: float
    def __init__(self, found: dict[str, Any]) -> None: ...
    @property
    def success(self) -> bool: ...

class SpringSlider:
    friction: Friction
    largest_convex_step: float
    def __init__(self, friction: Optional[Friction] = None, *, stiffness: float = 1e4,
                 mass: float = 1.0, normal_force: float = 9.81, load_velocity: ArrayLike = 1e-4,
                 load_start: Optional[float] = None) -> None: ...
    def run(self, t_end: float, *, t: float = 0.0, x: float = 0.0, v: Optional[float] = None,
            xi: float = 0.0, order: int = 4, step: float = 0.0, rtol: float = 1e-8,
            first_step: float = 1e-5, threshold: float = 0.0, samples: int = 0,
            max_steps: int = 10_000_000) -> SliderRun: ...

class FaultFriction:
    law: Friction
    def __init__(self, law: Optional[Friction] = None, *, plate_velocity: float = 1e-9,
                 normal_stress: float = 0.0, slip_rate: float = 1e-9,
                 theta: Optional[float] = None, overload: float = 1e-5) -> None: ...

class FaultRun:
    outcome: str
    t: float
    mean_slip: float
    peak_velocity: float
    peak_time: float
    arrest_time: float
    rest_time: float
    longest_step: float
    stable_step: float
    slip: _Floats
    velocity: _Floats
    peak_velocity_of: _Floats
    arrival: _Floats
    times: _Floats
    mean_slips: _Floats
    mean_velocities: _Floats
    snapshots: NDArray[np.void]
    statistics: dict[str, Any]
    earthquakes: NDArray[np.void]
    xi: _Floats
    step_times: _Floats
    fastest: _Floats
    residual: float
    unsolved: int
    inner: int
    handed_over: int
    elements_of_front: float
    def __init__(self, found: dict[str, Any]) -> None: ...
    @property
    def success(self) -> bool: ...

class Fault:
    elements: int
    def __init__(self, elements: int = 1, *, side: float = 3000.0, shear_modulus: float = 30e9,
                 poisson: float = 0.25, density: float = 2500.0, damping: float = ...,
                 stress_gradient: float = 15e3, residual_friction: float = 0.5,
                 friction_drop: float = 0.1, slip_distance: float = 0.1, overload: float = 1e-5,
                 medium: str = "full_space", mesh: str = "plain",
                 kernel: Union[None, str, PathLike[str]] = None,
                 memory_limit: float = ...) -> None: ...
    @property
    def factor(self) -> float: ...
    @property
    def time_unit(self) -> float: ...
    @property
    def depths(self) -> _Floats: ...
    def rupture(self, t_end: float, *, step: float = 0.0, rtol: Optional[float] = None,
                snapshot_times: ArrayLike = (), polynomial_bound: float = 0.0,
                max_steps: int = 1_000_000, integrator: str = "explicit",
                controller: str = "constant",
                policy: Union[None, str, PathLike[str]] = None) -> FaultRun: ...
    def earthquakes(self, t_end: float, friction: Optional[FaultFriction] = None, *,
                    step: float = 0.0, rtol: float = 1e-4, snapshot_times: ArrayLike = (),
                    polynomial_bound: float = 0.0, max_steps: int = 1_000_000, order: int = 4,
                    first_step: float = 0.0, threshold: float = 1e-3) -> FaultRun: ...
    def system(self, friction: Optional[FaultFriction] = None, *,
               polynomial_bound: float = 0.0) -> FaultSystem: ...

class FaultSystem(System):
    fault: Fault
    friction: FaultFriction
    def __init__(self, fault: Fault, friction: Optional[FaultFriction] = None, *,
                 polynomial_bound: float = 0.0) -> None: ...
    def start(self) -> _Floats: ...
    def slip(self, t: float, x: ArrayLike) -> _Floats: ...
    def velocity(self, x: ArrayLike) -> _Floats: ...
