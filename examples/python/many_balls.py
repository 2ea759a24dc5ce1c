"""When bouncing balls come to rest: a system of one's own, in a pool of processes.

usage: many_balls.py [PICTURE]
"""

import sys
from concurrent.futures import ProcessPoolExecutor

import numpy as np

import ricochet


class Ball(ricochet.System):
    """A ball on a floor, which it leaves with a fraction of its speed."""

    def __init__(self, restitution):
        super().__init__()
        self.restitution = restitution

    def flow(self, t, x):
        return [x[1], -9.81]

    @ricochet.guard(unilateral=True)
    def floor(self, t, x):
        return x[0]

    @floor.reset
    def bounce(self, t, x):
        return [0.0, -self.restitution * x[1]]

    @floor.rest
    def lie(self, t, x):
        return [0.0, 0.0]


def main(picture):
    from matplotlib.figure import Figure

    restitution = np.linspace(0.1, 0.8, 60)
    with ProcessPoolExecutor(2) as executor:
        balls = ricochet.ensemble(Ball, [1.0, 0.0], 6.0, parameters={"restitution": restitution},
                                  executor=executor)
    events = balls.event_table
    rests = events[events["kind"] == ricochet.Kind.ACCUMULATION]
    exact = np.sqrt(2 / 9.81) * (1 + restitution) / (1 - restitution)
    error = np.abs(rests["t"] - exact[rests["row"]]).max()
    print(f"{len(rests)} of {len(balls)} balls lie still; largest error of the time {error:.1e} s")

    figure = Figure(figsize=(7, 3))
    ax = figure.subplots()
    ax.plot(restitution[events["row"]], events["t"], ".", markersize=1, label="impacts")
    ax.plot(restitution[rests["row"]], rests["t"], label="rest")
    ax.set_xlabel("restitution")
    ax.set_ylabel("time [s]")
    ax.legend()
    figure.tight_layout()
    figure.savefig(picture)


if __name__ == "__main__":  # the processes of the pool import this file
    main(sys.argv[1] if len(sys.argv) > 1 else "many-balls.svg")
