from enum import IntEnum
from os import PathLike
from types import SimpleNamespace
from typing import (Any, Callable, Iterable, Iterator, Mapping, MutableMapping, NamedTuple, Optional, Sequence,
                    Tuple, Union, overload)

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._ready import *

__version__: str

C_FLOW: str
C_GUARD: str
C_JACOBIAN: str
C_RATE: str
C_RESET: str

_Floats = NDArray[np.float64]
_Function = Union[Callable[..., Any], Compiled]

class Compiled:
    def __init__(self, function: Any, user: Any = None) -> None: ...

class Kind(IntEnum):
    CROSSING = 0
    TOUCH = 1
    TIME = 2
    ACCUMULATION = 3
    MODE = 4
    STICK = 5
    SLIP = 6
    JUMP = 7

class Solution:
    def __call__(self, t: ArrayLike) -> _Floats: ...
    def before(self, t: ArrayLike) -> _Floats: ...
    def mode(self, t: float) -> Any: ...
    @property
    def ts(self) -> _Floats: ...
    @property
    def t_min(self) -> float: ...
    @property
    def t_max(self) -> float: ...

class Run:
    @property
    def outcome(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def reason(self) -> str: ...
    @property
    def success(self) -> bool: ...
    @property
    def t(self) -> float: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def mode(self) -> Any: ...
    @property
    def guard(self) -> Optional[int]: ...
    @property
    def other_guard(self) -> Optional[int]: ...
    @property
    def modes(self) -> Optional[list[Any]]: ...
    @property
    def guard_names(self) -> list[str]: ...
    @property
    def statistics(self) -> SimpleNamespace: ...
    @property
    def events(self) -> NDArray[np.void]: ...
    @property
    def event_modes(self) -> list[Tuple[Any, Any]]: ...
    @property
    def times(self) -> _Floats: ...
    @property
    def states(self) -> _Floats: ...
    @property
    def solution(self) -> Optional[Solution]: ...
    @property
    def phases(self) -> list[Tuple[float, bool, str]]: ...
    @property
    def reaction(self) -> _Floats: ...
    @property
    def reactions(self) -> _Floats: ...
    @property
    def contact(self) -> Optional[SimpleNamespace]: ...

class Snapshot:
    @property
    def text(self) -> str: ...
    @staticmethod
    def from_text(text: str) -> Snapshot: ...

class Guard:
    name: Optional[str]
    def __init__(
        self, value: Optional[_Function] = None, *,
        name: Optional[str] = None, direction: float = -1,
        reset: Optional[_Function] = None,
        rest: Optional[_Function] = None,
        rate: Optional[_Function] = None,
        enabled: Optional[Callable[..., Any]] = None, in_modes: Optional[Sequence[Any]] = None,
        unilateral: bool = False, boolean: bool = False, degree: int = 0, touch: float = 0.0,
        stop_after: int = 0, at_start: bool = False, at_entry: bool = False,
        speed_bound: Optional[_Function] = None,
        acceleration_bound: Optional[_Function] = None,
        lower_bound: Optional[_Function] = None,
        upper_bound: Optional[_Function] = None,
        lipschitz: float = 1.0, resets: bool = True, directed: bool = False) -> None: ...
    def rate(self, function: Callable[..., Any]) -> Guard: ...
    def reset(self, function: Callable[..., Any]) -> Guard: ...
    def rest(self, function: Callable[..., Any]) -> Guard: ...
    def enabled(self, function: Callable[..., Any]) -> Guard: ...
    def speed_bound(self, function: Callable[..., Any]) -> Guard: ...
    def acceleration_bound(self, function: Callable[..., Any]) -> Guard: ...
    def lower_bound(self, function: Callable[..., Any]) -> Guard: ...
    def upper_bound(self, function: Callable[..., Any]) -> Guard: ...

@overload
def guard(value: Callable[..., Any], **options: Any) -> Guard: ...
@overload
def guard(value: None = None, **options: Any) -> Callable[[Callable[..., Any]], Guard]: ...

class Inclusion:
    def __init__(
        self, smooth: Callable[..., Any], bounds: Callable[..., Any], *,
        observe: Optional[ArrayLike] = None, act: Optional[ArrayLike] = None,
        mass: Optional[ArrayLike] = None, offset: Optional[Callable[..., Any]] = None,
        offset_rate: Optional[Callable[..., Any]] = None, reactions: Optional[int] = None,
        stands_for: Optional[Sequence[Optional[int]]] = None, in_modes: Optional[Sequence[Any]] = None,
        change: Optional[Callable[..., Any]] = None,
        start_mode: Optional[Callable[..., Any]] = None,
        static_bounds: Optional[Callable[..., Any]] = None) -> None: ...

class Stop(Exception):
    reason: str
    after: Any
    def __init__(self, reason: str, after: Any = None) -> None: ...

class Times:
    def __init__(self, times: Sequence[float]) -> None: ...
    def next(self, t: float) -> float: ...
    def previous(self, t: float) -> float: ...
    def count(self, t: float) -> int: ...

def every(period: float, phase: float = 0.0, name: str = "every") -> Times: ...

class System:
    flow: Any
    guards: Sequence[Any]
    modes: Any
    name: Optional[str]
    time_events: Union[None, Times, Iterable[float]]
    set_valued: Union[None, Inclusion, Callable[[], Inclusion]]
    changes_dimension: bool
    parameters: Optional[Mapping[str, float]]
    formula: Optional[int]
    jacobian: Any
    vector: str
    def __init__(self, flow: Optional[_Function] = None,
                 guards: Optional[Sequence[Any]] = None, **members: Any) -> None: ...
    def __init_subclass__(cls, unchecked_names: bool = False, **options: Any) -> None: ...

class Filippov(System):
    surfaces: Any
    fields: Sequence[Any]
    restoring_rate: float
    def __init__(self, surfaces: Any = None, fields: Optional[Sequence[_Function]] = None,
                 guards: Optional[Sequence[Any]] = None, *, restoring_rate: Optional[float] = None,
                 **members: Any) -> None: ...
    def start_mode(self, t: float, x: ArrayLike, tolerance: float = 0.0) -> str: ...
    def shares(self, mode: str, t: float, x: ArrayLike) -> _Floats: ...

class Mechanism(System):
    contacts: int
    tangents: int
    mass: Any
    force: Any
    gaps: Any
    directions: Any
    surface_rates: Any
    restitution: ArrayLike
    friction: ArrayLike
    dry_friction: Optional[ArrayLike]
    def __init__(self, guards: Optional[Sequence[Any]] = None, **members: Any) -> None: ...

def contact_motion(mechanism: Mechanism, q: ArrayLike, v: ArrayLike, t_end: float, *,
                   step: float = 0.0, events_only: bool = False, rtol: float = 1e-10,
                   atol: ArrayLike = 1e-12, t_start: float = 0.0, mode: Any = ...,
                   method: str = "dopri5", fixed: bool = False, h_min: float = 0.0,
                   h_max: float = ..., event_tolerance: float = 0.0, event_rtol: float = 0.0,
                   event_window: float = 0.0, check_inside: bool = True,
                   stop_at_event: bool = False, record_events: bool = True,
                   event_states: bool = True, record_steps: bool = False,
                   sample_times: Optional[ArrayLike] = None, detector: str = "extremum",
                   locator: str = "newton", max_steps: int = ..., stall_steps: int = ...,
                   progress: Union[None, bool, Callable[[float, float], Any]] = None) -> Run: ...

class Ensemble:
    rows: NDArray[Any]
    failures: dict[int, str]
    complete: bool
    inputs: dict[str, NDArray[Any]]
    event_table: Optional[NDArray[np.void]]
    guard_names: list[str]
    modes: Optional[list[Any]]
    times: Optional[_Floats]
    states: Optional[_Floats]
    def __init__(self, rows: NDArray[Any], failures: dict[int, str], complete: bool, *,
                 inputs: Optional[dict[str, NDArray[Any]]] = None,
                 event_table: Optional[NDArray[np.void]] = None, guard_names: Sequence[str] = (),
                 modes: Optional[list[Any]] = None, times: Optional[_Floats] = None,
                 states: Optional[_Floats] = None) -> None: ...
    def to_pandas(self, events: bool = False) -> Any: ...
    def to_xarray(self) -> Any: ...
    def __len__(self) -> int: ...
    def __getattr__(self, name: str) -> NDArray[Any]: ...

def ensemble(system: Union[System, Ready, Callable[..., Union[System, Ready]]], table: Any,
             t_end: float, *, parameters: Any = None,
             columns: Optional[Sequence[str]] = None, x0: Optional[ArrayLike] = None,
             threads: Optional[int] = None, executor: Any = None,
             progress: Union[None, bool, Callable[[int, int], Any]] = None, mode: Any = None,
             **options: Any) -> Ensemble: ...

def row_seed(seed: int, index: int) -> int: ...

def integrate(system: Union[System, Ready], x0: ArrayLike, t_end: float, *,
              t_start: float = 0.0, continues: bool = False, mode: Any = ..., method: str = "dopri5", fixed: bool = False,
              step: float = 0.0, rtol: float = 1e-8, atol: ArrayLike = 1e-10, h_min: float = 0.0,
              h_max: float = ..., event_tolerance: float = 0.0, event_rtol: float = 0.0,
              event_window: float = 0.0, check_inside: bool = True, stop_at_event: bool = False,
              record_events: bool = True, event_states: bool = True, record_steps: bool = False,
              sample_times: Optional[ArrayLike] = None, detector: str = "extremum",
              locator: str = "newton", gate: Union[None, str, PathLike[str], Network] = None,
              max_steps: int = ..., stall_steps: int = ...,
              progress: Union[None, bool, Callable[[float, float], Any]] = None) -> Run: ...

class Simulation:
    def __init__(self, system: Union[System, Ready], x0: ArrayLike, t_end: float,
                 **options: Any) -> None: ...
    def __iter__(self) -> Iterator[Tuple[float, _Floats]]: ...
    def step(self) -> bool: ...
    def advance(self) -> bool: ...
    def run_to_end(self) -> Run: ...
    def finish(self) -> Run: ...
    def save(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...
    def restart(self, t: float, x: ArrayLike, mode: int | str | None = None) -> None: ...
    def extend(self, t_end: float) -> None: ...
    @property
    def reaction(self) -> _Floats: ...
    @property
    def t(self) -> float: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def mode(self) -> Any: ...
    @property
    def ended(self) -> bool: ...
    @property
    def run(self) -> Run: ...

class SceneKind(IntEnum):
    IMPACT = 0
    HELD = 1
    STOPPED = 2
    JOINED = 3
    RELEASED = 4
    SLEPT = 5

class SceneRun:
    outcome: str
    message: str
    success: bool
    involved: list[int]
    t: float
    positions: _Floats
    velocities: _Floats
    asleep: NDArray[np.bool_]
    times: _Floats
    trajectory: _Floats
    trajectory_velocities: _Floats
    trajectory_asleep: NDArray[np.bool_]
    winding: NDArray[np.int32]
    angles: _Floats
    spins: _Floats
    trajectory_angles: _Floats
    trajectory_spins: _Floats
    trajectory_winding: NDArray[np.int32]
    energy: _Floats
    energy_at_end: float
    events: NDArray[np.void]
    body_names: list[str]
    surface_names: list[str]
    statistics: SimpleNamespace
    def __init__(self, scene: Any, found: dict[str, Any]) -> None: ...
    def animate(self, speed: float = 1.0) -> Animation: ...

class Animation:
    svg: str
    duration: float
    def __init__(self, svg: str, duration: float) -> None: ...
    def save(self, path: Union[str, PathLike[str]]) -> None: ...

class Scene:
    def __init__(self, gravity: ArrayLike = (0.0, 0.0), *, period: ArrayLike = (0.0, 0.0),
                 memory_limit: float = 4e9) -> None: ...
    @classmethod
    def from_json(cls, text: str, name: str = "scene") -> Scene: ...
    @classmethod
    def load(cls, path: Union[str, PathLike[str]]) -> Scene: ...
    def material(self, name: str, *, restitution: float = 1.0, friction: float = 0.0,
                 by_speed: Optional[Mapping[str, Any]] = None) -> None: ...
    def pair(self, first: Optional[str], second: Optional[str], *, restitution: float = 1.0,
             friction: float = 0.0, by_speed: Optional[Mapping[str, Any]] = None) -> None: ...
    def disc(self, at: ArrayLike, *, radius: float = 1.0, mass: float = 1.0,
             velocity: ArrayLike = (0.0, 0.0), drag: float = 0.0, material: Optional[str] = None,
             inertia: float = 0.0, angle: float = 0.0, spin: float = 0.0,
             name: Optional[str] = None) -> int: ...
    def point(self, at: ArrayLike, *, mass: float = 1.0, velocity: ArrayLike = (0.0, 0.0),
              drag: float = 0.0, material: Optional[str] = None,
              name: Optional[str] = None) -> int: ...
    def plate(self, start: ArrayLike, end: ArrayLike, *, along: Optional[ArrayLike] = None,
              speed: float = 0.0, mass: float = 1.0, material: Optional[str] = None,
              name: Optional[str] = None) -> int: ...
    def wall(self, point: ArrayLike, normal: ArrayLike, *, material: Optional[str] = None,
             motion: Optional[Mapping[str, Any]] = None, temperature: float = 0.0,
             name: Optional[str] = None) -> int: ...
    def terrain(self, points: ArrayLike, *, closed: bool = False, material: Optional[str] = None,
                motion: Optional[Mapping[str, Any]] = None, temperature: float = 0.0,
                name: Optional[str] = None) -> int: ...
    def arc(self, centre: ArrayLike, *, radius: Optional[float] = None,
            start: Optional[ArrayLike] = None, end: Optional[ArrayLike] = None,
            material: Optional[str] = None, temperature: float = 0.0,
            name: Optional[str] = None) -> int: ...
    def spring(self, first: Union[int, str], second: Union[int, str], *, stiffness: float,
               rest: float = 0.0, damping: float = 0.0) -> None: ...
    @property
    def body_names(self) -> list[str]: ...
    @property
    def surface_names(self) -> list[str]: ...
    @property
    def radii(self) -> _Floats: ...
    def simulate(self, t_end: Optional[float] = None, **options: Any) -> SceneRun: ...
    def measure(self, t_start: float, t_end: float, *, blocks: int = 10,
                area: Optional[float] = None,
                lengths: Optional[Mapping[Union[int, str], float]] = None,
                **options: Any) -> SimpleNamespace: ...
    def explain(self, t_end: Optional[float] = None, **options: Any) -> str: ...
    def energy(self, positions: ArrayLike, velocities: ArrayLike) -> _Floats: ...

class GuardNetwork(Compiled):
    direction: float
    terminal: Union[bool, int]
    unilateral: bool
    name: str
    reset: Callable[..., Any]
    rest: Callable[..., Any]
    rate: Compiled
    def __init__(self, path: Union[str, PathLike[str]], components: Sequence[int] = ()) -> None: ...
    @classmethod
    def from_bytes(cls, content: bytes, components: Sequence[int] = (),
                   name: str = "bytes") -> GuardNetwork: ...
    @classmethod
    def from_layers(cls, layers: Sequence[Tuple[ArrayLike, ArrayLike]], activation: str = "tanh", *,
                    offset: Sequence[float] = (), scale: Sequence[float] = (),
                    residual: Sequence[int] = (),
                    components: Sequence[int] = ()) -> GuardNetwork: ...
    @property
    def inputs(self) -> int: ...
    @property
    def components(self) -> Tuple[int, ...]: ...
    def __call__(self, *at: Any) -> float: ...
    def value(self, x: ArrayLike) -> Any: ...
    def gradient(self, x: ArrayLike) -> _Floats: ...
    def normal(self, x: ArrayLike) -> _Floats: ...
    def to_bytes(self) -> bytes: ...
    def save(self, path: Union[str, PathLike[str]]) -> None: ...

class Network:
    def __init__(self, path: Union[str, PathLike[str]]) -> None: ...
    @classmethod
    def from_bytes(cls, content: bytes, name: str = "bytes") -> Network: ...
    def to_bytes(self) -> bytes: ...
    def save(self, path: Union[str, PathLike[str]]) -> None: ...
    def __call__(self, features: ArrayLike) -> _Floats: ...
    def alarm(self, features: ArrayLike) -> Any: ...
    def in_domain(self, features: ArrayLike) -> Any: ...
    def cleared(self, features: ArrayLike) -> Any: ...
    @property
    def kind(self) -> str: ...
    @property
    def system(self) -> str: ...
    @property
    def parameters(self) -> dict[str, float]: ...
    @property
    def recipe(self) -> str: ...
    @property
    def threshold(self) -> float: ...
    @property
    def seed(self) -> int: ...
    @property
    def activation(self) -> str: ...
    @property
    def precision(self) -> str: ...
    @property
    def step_range(self) -> Tuple[float, float]: ...
    @property
    def domain(self) -> _Floats: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def layers(self) -> list[Tuple[_Floats, _Floats]]: ...
    @property
    def offset(self) -> _Floats: ...
    @property
    def scale(self) -> _Floats: ...
    @property
    def levels(self) -> list[Tuple[float, float]]: ...
    @property
    def calibration(self) -> Optional[dict[str, Any]]: ...
    @property
    def certified(self) -> bool: ...

class Trained:
    network: Optional[Network]
    outcome: str
    message: str
    misses_none: bool
    trial: SimpleNamespace
    verdict: str
    report: Optional[dict[str, Any]]
    def __init__(self, network: Optional[Network], outcome: str, message: str, misses_none: bool,
                 trial: SimpleNamespace, verdict: str,
                 report: Optional[dict[str, Any]]) -> None: ...

class Certified:
    network: Network
    proved: bool
    outcome: str
    message: str
    levels: list[SimpleNamespace]
    estimates: list[SimpleNamespace]
    counterexample: Optional[_Floats]
    seconds: float
    def __init__(self, network: Network, proved: bool, outcome: str, message: str,
                 levels: list[SimpleNamespace], estimates: list[SimpleNamespace],
                 counterexample: Optional[_Floats], seconds: float) -> None: ...

def train_classifier(
    system: Union[System, Ready], starts: Any, *, step: float, mode: Any = None,
    method: str = "rk4", progress: Union[None, bool, Callable[[SimpleNamespace], Any]] = None,
    seed: int = 1, run_length: float = 10.0, surface_points: int = 2000, states: int = 100_000,
    fresh_states: int = 40_000, trial_events: int = 1000, hidden: Sequence[int] = (16, 16),
    iterations: int = 20_000, **options: Any) -> Trained: ...

def train_gate(
    system: Union[System, Ready], starts: Any, levels: Optional[Sequence[float]] = None, *,
    step: Union[None, float, Tuple[float, float]] = None, mode: Any = None,
    method: Optional[str] = None,
    progress: Union[None, bool, Callable[[SimpleNamespace], Any]] = None, seed: int = 1,
    kind: str = "horizon", recipe: str = "state", run_length: float = 10.0, events: int = 3000,
    states: int = 200_000, fresh_events: int = 30_000, hidden: Sequence[int] = (16, 16),
    iterations: int = 4000, **options: Any) -> Trained: ...

def certify(
    network: Union[str, PathLike[str], Network], system: Union[System, Ready],
    slack: Union[Sequence[float], Callable[[_Floats], float]], *,
    least: Optional[Callable[[_Floats, _Floats], float]] = None,
    progress: Union[None, bool, Callable[[SimpleNamespace], Any]] = None, margin: float = 0.0,
    levels: int = 1, ratio: float = 2.0, seed: int = 1, threads: int = 2, limit: float = 300.0,
    **options: Any) -> Certified: ...

class Verdict(IntEnum):
    STANDS = 0
    CUT = 1
    RESTS = 2
    ENDED = 3

class Cut(NamedTuple):
    t: float
    s: float
    before: _Floats
    after: _Floats
    mode_before: Any
    mode_after: Any
    fired: list[int]
    fired_names: list[str]
    on_time: bool
    accumulation: bool
    state_changed: bool

class Monitor:
    def __init__(self, system: Union[System, Ready], like: ArrayLike, *, backward: bool = False,
                 cut_at_all: bool = False, event_tolerance: float = 0.0, event_rtol: float = 0.0,
                 event_window: float = 0.0, check_inside: bool = True, record_events: bool = True,
                 event_states: bool = True, detector: str = "extremum",
                 locator: str = "newton",
                 gate: Union[None, str, PathLike[str], Network] = None) -> None: ...
    def start(self, t: float, x: ArrayLike, scale: float, rate: Optional[ArrayLike] = None,
              mode: Any = None) -> Verdict: ...
    def examine(self, t0: float, h: float, x0: ArrayLike, x1: ArrayLike, rate0: ArrayLike,
                rate1: ArrayLike,
                interpolate: Optional[Callable[[float], ArrayLike]] = None) -> Verdict: ...
    def resume(self, scale: float, rate: Optional[ArrayLike] = None, *,
               after: Optional[ArrayLike] = None, mode: Any = None) -> Verdict: ...
    def hold(self, t: float) -> Verdict: ...
    def skip_to(self, t: float, x: ArrayLike, rate: ArrayLike) -> None: ...
    @property
    def cut(self) -> Cut: ...
    @property
    def t(self) -> float: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def mode(self) -> Any: ...
    @property
    def held(self) -> list[int]: ...
    @property
    def must_stop_at(self) -> float: ...
    @property
    def quiet_until(self) -> float: ...
    @property
    def events(self) -> NDArray[np.void]: ...
    @property
    def run(self) -> Run: ...
    def clear_events(self) -> None: ...
    def save(self) -> Snapshot: ...
    def restore(self, snapshot: Snapshot) -> None: ...

class OdeResult(dict[str, Any]):
    t: _Floats
    y: NDArray[Any]
    sol: Any
    t_events: Optional[list[_Floats]]
    y_events: Optional[list[NDArray[Any]]]
    y_events_after: Optional[list[NDArray[Any]]]
    kinds: Optional[list[list[str]]]
    modes: Optional[list[NDArray[Any]]]
    nfev: int
    njev: int
    nlu: int
    status: int
    message: str
    success: bool
    outcome: str
    statistics: Optional[SimpleNamespace]
    guard: Optional[int]
    phases: list[Tuple[float, bool, str]]
    reactions: _Floats
    run: Optional[Run]
    def __getattr__(self, name: str) -> Any: ...

def solve_ivp(fun: Union[Callable[..., Any], Compiled, System, Ready],
              t_span: Tuple[float, float], y0: ArrayLike, method: Any = "RK45",
              t_eval: Optional[ArrayLike] = None, dense_output: bool = False,
              events: Any = None, vectorized: bool = False, args: Optional[Sequence[Any]] = None, *,
              set_valued: Optional[Inclusion] = None, vector: str = "array",
              progress: Union[None, bool, Callable[[float, float], Any]] = None,
              rtol: ArrayLike = 1e-3, atol: ArrayLike = 1e-6, max_step: float = ...,
              first_step: Optional[float] = None, **options: Any) -> OdeResult: ...

def animate(run: Any, draw: Optional[Callable[[float, _Floats], ArrayLike]] = None, *,
            speed: float = 1.0, frames: int = 300) -> Animation: ...

def plot(run: Any, components: Optional[Sequence[int]] = None, *,
         labels: Optional[Sequence[str]] = None, phase: Optional[Tuple[int, int]] = None,
         events: bool = True, modes: bool = True, unit: Optional[str] = None,
         ax: Any = None) -> Any: ...

class FmuRun:
    def __init__(self, told: Mapping[str, Any], watched: Sequence[str] = ()) -> None: ...
    outcome: str
    message: str
    success: bool
    t: _Floats
    sides: NDArray[np.int8]
    events: list[SimpleNamespace]
    t_end: float
    x: _Floats
    method: str
    statistics: SimpleNamespace
    warnings: list[str]
    def __getitem__(self, name: str) -> _Floats: ...
    def keys(self) -> Iterable[str]: ...

class Fmu:
    file: str
    name: str
    version: str
    states: list[str]
    variables: dict[str, SimpleNamespace]
    parameters: MutableMapping[str, float]
    def __init__(self, file: Union[str, PathLike[str]]) -> None: ...
    def simulate(self, t_end: Optional[float] = None, t_start: Optional[float] = None, *,
                 rtol: float = 1e-8, method: str = "automatic", h_max: float = ...,
                 start: Optional[Mapping[str, float]] = None,
                 inputs: Optional[Mapping[str, Any]] = None,
                 output: Optional[Iterable[str]] = None,
                 sample_times: Optional[ArrayLike] = None, samples: int = 501,
                 step: Optional[float] = None,
                 co_simulation: Optional[bool] = None,
                 watch: Optional[Mapping[str, Any]] = None) -> FmuRun: ...
    def ensemble(self, table: Mapping[str, ArrayLike], t_end: Optional[float] = None,
                 t_start: Optional[float] = None, *, threads: Optional[int] = None,
                 **options: Any) -> list[FmuRun]: ...

def load_fmu(file: Union[str, PathLike[str]]) -> Fmu: ...

class Perceptron:
    activation: str
    layers: list[Tuple[_Floats, _Floats]]
    def __init__(self, layers: Iterable[Tuple[ArrayLike, ArrayLike]],
                 activation: str = "tanh") -> None: ...
    @property
    def inputs(self) -> int: ...
    @property
    def outputs(self) -> int: ...
    @property
    def parameters(self) -> _Floats: ...
    def shaped(self, flat: _Floats) -> list[Tuple[_Floats, _Floats]]: ...
    def __call__(self, *inputs: Any) -> Any: ...

class Gradient:
    value: Optional[float]
    x0: _Floats
    args: _Floats
    networks: list[_Floats]
    t_start: float
    def __init__(self, x0: _Floats, args: _Floats, networks: list[_Floats], t_start: float,
                 value: Optional[float] = None) -> None: ...

class Adjoint:
    def __init__(self, recording: Any, run: Any) -> None: ...
    @property
    def t(self) -> float: ...
    @property
    def x(self) -> _Floats: ...
    @property
    def mode(self) -> Any: ...
    @property
    def outcome(self) -> str: ...
    @property
    def message(self) -> str: ...
    @property
    def steps(self) -> int: ...
    @property
    def sample_times(self) -> _Floats: ...
    @property
    def samples(self) -> _Floats: ...
    @property
    def event_times(self) -> _Floats: ...
    @property
    def event_guards(self) -> list[Optional[str]]: ...
    @property
    def event_kinds(self) -> list[str]: ...
    @property
    def before(self) -> _Floats: ...
    @property
    def after(self) -> _Floats: ...
    @property
    def networks(self) -> Tuple[Perceptron, ...]: ...
    @property
    def undefined_at(self) -> Optional[Tuple[int, str, str]]: ...
    def gradient(self, *, end: Optional[ArrayLike] = None, samples: Optional[ArrayLike] = None,
                 event_times: Optional[ArrayLike] = None, before: Optional[ArrayLike] = None,
                 after: Optional[ArrayLike] = None) -> Gradient: ...

def adjoint(system: Union[System, Ready], x0: ArrayLike, t_end: float, *, args: ArrayLike = (),
            networks: Optional[Sequence[ArrayLike]] = None, mode: Any = None,
            t_start: float = 0.0, sample_times: ArrayLike = (), method: str = "dopri5",
            step: float = 0.0, rtol: float = 1e-8, atol: float = 1e-10,
            stop_at_event: bool = False, max_steps: int = ...) -> Adjoint: ...

def gradient(loss: Callable[[Any], Any], system: Union[System, Ready], x0: ArrayLike,
             t_end: float, **options: Any) -> Gradient: ...

def sensitivities(system: Union[System, Ready], x0: ArrayLike, t_end: float,
                  **options: Any) -> SimpleNamespace: ...

def monodromy(system: Union[System, Ready], x0: ArrayLike, period: float, *,
              t_start: float = 0.0, rtol: float = 1e-10, atol: float = 1e-10,
              **options: Any) -> _Floats: ...

def find_periodic_orbit(system: Union[System, Ready], guess: ArrayLike, period: float, *,
                        autonomous: bool = False, tolerance: float = 1e-10,
                        max_iterations: int = 30, args: ArrayLike = (),
                        networks: Optional[Sequence[ArrayLike]] = None, mode: Any = None,
                        t_start: float = 0.0, method: str = "dopri5", step: float = 0.0,
                        rtol: float = 1e-12, atol: float = 1e-12,
                        max_steps: int = ...) -> SimpleNamespace: ...
