"""How the package is used, for types_test.py, which runs this file and checks it by mypy --strict."""

from concurrent.futures import ThreadPoolExecutor
from typing import Any, List, Optional, Tuple, cast

import numpy as np
from numpy.typing import NDArray

import ricochet

Floats = NDArray[np.float64]


def fall(t: float, y: Floats) -> List[float]:
    return [float(y[1]), -9.81]


def height(t: float, y: Floats) -> float:
    return float(y[0])


class Thermostat(ricochet.System):
    modes = ("off", "on")

    def flow(self, mode: str, t: float, x: Floats) -> List[float]:
        return [-0.1 * (x[0] - (30.0 if mode == "on" else 0.0))]

    @ricochet.guard(in_modes=["off"])
    def too_cold(self, mode: str, t: float, x: Floats) -> float:
        return float(x[0]) - 18

    @too_cold.reset
    def switch_on(self, mode: str, t: float, x: Floats) -> str:
        return "on"


class Ball(ricochet.System):
    def __init__(self, restitution: float) -> None:
        super().__init__()
        self.restitution = restitution

    def flow(self, t: float, x: Floats) -> List[float]:
        return fall(t, x)

    @ricochet.guard(unilateral=True)
    def floor(self, t: float, x: Floats) -> float:
        return float(x[0])

    @floor.reset
    def bounce(self, t: float, x: Floats) -> Any:
        return ricochet.Stop("broken") if x[1] < -100 else [0.0, -self.restitution * x[1]]


def solved() -> Tuple[float, Optional[Floats]]:
    result = ricochet.solve_ivp(fall, (0, 1), [10.0, 0.0], events=height, rtol=1e-9,
                                t_eval=np.linspace(0, 1, 5), dense_output=True)
    found: ricochet.OdeResult = result
    status: int = found.status
    message: str = found.message
    first: Optional[Floats] = None if found.t_events is None else found.t_events[0]
    assert status == 0 and message and found["success"]
    return float(found.y[0, -1]), first


def integrated() -> ricochet.Run:
    run = ricochet.integrate(Thermostat(), [20.0], 48.0, mode="off", record_steps=True)
    names: List[str] = run.guard_names
    end: Floats = run.x
    assert names == ["too_cold"] and end.shape == (1,)
    solution = run.solution
    assert solution is not None
    at: Floats = solution(np.array([1.0, 2.0]))
    assert at.shape == (1, 2) and run.events["kind"][0] == ricochet.Kind.CROSSING
    system = ricochet.System(fall, [ricochet.Guard(height, unilateral=True,
                                                   reset=lambda t, x: [0.0, -0.9 * x[1]])],
                             time_events=ricochet.every(0.5))
    return ricochet.integrate(system, (10.0, 0.0), 2.0, progress=lambda t, end: None)


def driven() -> float:
    simulation = ricochet.Simulation(ricochet.BouncingBall(restitution=0.8), [10.0, 0.0], 5.0)
    stepped: bool = simulation.step()
    saved: ricochet.Snapshot = simulation.save()
    simulation.restore(ricochet.Snapshot.from_text(saved.text))
    for t, x in simulation:
        assert isinstance(t, float) and x.shape == (2,)
    assert stepped and simulation.ended
    return simulation.run.t


def many() -> ricochet.Ensemble:
    balls = ricochet.ensemble(ricochet.BouncingBall, {"height": [1.0, 2.0]}, 1.0, threads=1)
    outcome: NDArray[Any] = balls.outcome
    assert list(outcome) == ["reached_end"] * 2
    with ThreadPoolExecutor(1) as executor:
        own = ricochet.ensemble(Ball, [1.0, 0.0], 1.0, parameters={"restitution": [0.5, 0.6]},
                                executor=executor, sample_times=[0.0, 1.0])
    table, failures = own.event_table, own.failures
    assert table is not None and not failures and own.states is not None
    return own


def watched() -> List[int]:
    monitor = ricochet.Monitor(ricochet.BouncingBall(), [1.0, 0.0])
    verdict: ricochet.Verdict = monitor.start(0.0, [1.0, 0.0], 0.1)
    assert verdict == ricochet.Verdict.STANDS
    return monitor.held


def stiff() -> int:
    def jacobian(t: float, x: List[float]) -> List[List[float]]:
        return [[-1e4]]

    system = ricochet.System(lambda t, x: [-1e4 * x[0]], jacobian=jacobian, vector="list")
    run = ricochet.integrate(system, [1.0], 1.0, method="rosenbrock4")
    result = ricochet.solve_ivp(lambda t, y: [-1e4 * y[0]], (0, 1), [1.0], "BDF", vector="list",
                                jac=jacobian)
    return result.njev + int(run.success)


def sliding() -> str:
    block = ricochet.Filippov(lambda t, x: x[0], [lambda t, x: [1.0], lambda t, x: [-1.0]],
                              restoring_rate=1.0)
    share: Floats = block.shares("sliding", 0.0, [0.0])
    assert share.shape == (1,)
    return block.start_mode(0.0, [1.0], tolerance=0.1)


def scene() -> None:
    try:
        made = ricochet.Scene(gravity=(0, -9.81))
    except ImportError:  # a package without scenes
        return
    made.material("steel", restitution=0.5)
    floor: int = made.wall((0, 0), (0, 1), material="steel", motion={"velocity": (0, 0.1)})
    disc: int = made.disc((0, 2), radius=0.1, name="disc")
    run: ricochet.SceneRun = made.simulate(1.0, sample_times=[0.5])
    assert floor == disc == 0 and run.trajectory.shape == (1, 1, 2)
    assert run.events["kind"][0] == ricochet.SceneKind.IMPACT and run.energy_at_end > 0


def differentiated() -> None:
    """The gradient of a time of impact."""
    try:
        found: ricochet.Gradient = ricochet.gradient(lambda run: run.event_times[0],
                                                     ricochet.BouncingBall(), [10.0, 0.0], 2.0)
    except ImportError:  # a package without gradients
        return
    run: ricochet.Adjoint = ricochet.adjoint(ricochet.BouncingBall(), [10.0, 0.0], 2.0)
    assert abs(found.x0[0] - run.event_times[0] / 20) < 1e-9 and run.undefined_at is None


def refused() -> None:
    """Mistakes that the types show: strict checking complains where an error is missing."""
    try:
        ricochet.integrate(fall, [1.0, 0.0], 1.0)  # type: ignore[arg-type]
    except TypeError:
        pass
    try:
        ricochet.BouncingBall(bounciness=1.0)  # type: ignore[call-arg]
    except TypeError:
        pass
    try:
        cast(Any, ricochet).solve(fall)
    except AttributeError:
        pass


if __name__ == "__main__":
    for example in (solved, integrated, driven, many, watched, stiff, sliding, scene, differentiated, refused):
        example()
