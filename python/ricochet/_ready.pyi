# Written by scripts/ready_stubs.
from typing import Optional, Tuple

__all__ = ["Ready", "BouncingBall", "Pendulum", "Thermostat", "ImpactOscillator",
           "CoulombOscillator", "StickSlip", "BuckConverter"]

class Ready:
    modes: Optional[Tuple[str, ...]]
    state: Tuple[str, ...]
    @property
    def parameters(self) -> dict[str, float]: ...
    def __getattr__(self, name: str) -> float: ...

class BouncingBall(Ready):
    start: Tuple[float, float]
    def __init__(self, *, gravity: float = 9.81, restitution: float = 0.9) -> None: ...
    def impact_time(self, n: int, height: float, velocity: float = 0.0) -> float: ...
    def zeno_time(self, height: float, velocity: float = 0.0) -> float: ...

class Pendulum(Ready):
    start: Tuple[float, float]
    def __init__(self, *, gravity: float = 9.8, length: float = 1.0) -> None: ...
    def half_period(self, amplitude: float = -0.05) -> float: ...

class Thermostat(Ready):
    start: Tuple[float]
    def __init__(self, *, rate: float = 0.1, ambient: float = 0.0, heated: float = 30.0,
                 low: float = 18.0, high: float = 22.0) -> None: ...
    def switch_time(self, n: int, temperature: float = 20.0) -> float: ...

class ImpactOscillator(Ready):
    start: Tuple[float, float]
    def __init__(self, *, frequency: float = 0.7, wall: float = 1.0, restitution: float = 0.8,
                 damping: float = 0.1) -> None: ...
    def impacts(self, t_end: float) -> list[float]: ...

class CoulombOscillator(Ready):
    start: Tuple[float, float]
    def __init__(self, *, mass: float = 1.0, stiffness: float = 1.0, friction: float = 0.3,
                 static_friction: float = 0.3) -> None: ...
    def turning_time(self, n: int) -> float: ...
    def turning_point(self, n: int, start: float = 2.0) -> float: ...

class StickSlip(Ready):
    start: Tuple[float, float]
    period: float
    def __init__(self, *, mass: float = 1.0, stiffness: float = 1.0, belt_speed: float = 0.2,
                 friction: float = 1.0, weakening: float = 3.0) -> None: ...

class BuckConverter(Ready):
    start: Tuple[float, float]
    def __init__(self, *, input: float = 12.0, inductance: float = 0.001,
                 capacitance: float = 0.0001, resistance: float = 10.0, low: float = 0.4,
                 high: float = 0.6) -> None: ...
