"""A bouncing ball: code written for SciPy, and one line more.

usage: bouncing_ball.py [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

from ricochet import plot, solve_ivp


def fall(t, y):
    return [y[1], -9.81]


def floor(t, y):
    return y[0]


floor.direction = -1
floor.unilateral = True
floor.reset = lambda t, y: [0.0, -0.8 * y[1]]
floor.rest = lambda t, y: [0.0, 0.0]

ball = solve_ivp(fall, (0, 5), [1.0, 0.0], events=floor, rtol=1e-9, max_step=0.02)
print(f"{len(ball.t_events[0]) - 1} impacts, then rest at t = {ball.t_events[0][-1]:.12f}")

figure, ax = pyplot.subplots(figsize=(7, 3))
plot(ball, labels=["height [m]", "velocity [m/s]"], ax=ax)
ax.set_xlabel("time [s]")
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "bouncing-ball.svg")
