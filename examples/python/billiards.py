"""A break on a billiard table: fifteen balls in a rack, and their motion after one stroke.

usage: billiards.py [PICTURE]
"""

import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

import ricochet

RADIUS, LENGTH, WIDTH = 0.028575, 2.54, 1.27  # [m]
table = ricochet.Scene()
table.material("ivory", restitution=0.95)
table.material("rubber", restitution=0.8)
table.wall((0, 0), (0, 1), material="rubber", name="near")
table.wall((0, 0), (1, 0), material="rubber", name="left")
table.wall((LENGTH, WIDTH), (0, -1), material="rubber", name="far")
table.wall((LENGTH, WIDTH), (-1, 0), material="rubber", name="right")
ball = dict(radius=RADIUS, mass=0.17, material="ivory")
cue = table.disc((0.6, WIDTH / 2), velocity=(7, 0.1), name="cue", **ball)
for row in range(5):
    for k in range(row + 1):
        table.disc((1.9 + row * RADIUS * np.sqrt(3.0), WIDTH / 2 + (2 * k - row) * RADIUS), **ball)

run = table.simulate(3.0, sample_times=np.linspace(0, 3, 601))
print(f"the cue ball meets the rack after {run.events['t'][0]:.12f} s")
print(f"{len(run.events)} contacts in {run.t:.0f} s; the cue ball ends at "
      f"({run.positions[cue, 0]:.3f}, {run.positions[cue, 1]:.3f})")

figure, axes = pyplot.subplots(figsize=(7, 3.6))
for body in range(len(run.body_names)):
    axes.plot(*run.trajectory[:, body].T, linewidth=0.7)
    axes.add_patch(pyplot.Circle(run.positions[body], RADIUS, color=f"C{body % 10}"))
axes.set(xlim=(0, LENGTH), ylim=(0, WIDTH), aspect="equal", xlabel="x [m]", ylabel="y [m]")
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "billiards.svg")
