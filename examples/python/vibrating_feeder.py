"""A part on a track that shakes obliquely hops forward, until it reaches the end of the track.

usage: vibrating_feeder.py [PICTURE]
"""

import math
import sys

import matplotlib

matplotlib.use("Agg")
import numpy as np
from matplotlib import pyplot

import ricochet

AMPLITUDE, ANGLE, FREQUENCY = 5e-4, 0.5, 314.0  # [m], [rad], [rad/s]


class Part(ricochet.Mechanism):
    """q = (way along the track, height) [m]."""

    contacts, restitution, friction = 1, 0.1, 0.4
    mass = np.eye(2)

    def force(self, t, q, v):
        return [0.0, -9.81]

    def gaps(self, t, q):
        return [q[1] - AMPLITUDE * math.sin(ANGLE) * math.sin(FREQUENCY * t)]

    def directions(self, q):
        return [[0.0, 1.0], [1.0, 0.0]]  # of the rate of the gap, and of the slip

    def surface_rates(self, t, q):
        speed = AMPLITUDE * FREQUENCY * math.cos(FREQUENCY * t)
        return [-speed * math.sin(ANGLE), -speed * math.cos(ANGLE)]

    @ricochet.guard(stop_after=1)
    def end(self, t, x):
        return 0.05 - x[0]


# With the tolerances and the steps of examples/vibrating_feeder.cpp, for the same digits.
run = ricochet.contact_motion(Part(), [0, 0], [0, AMPLITUDE * FREQUENCY * math.sin(ANGLE)], 10.0, step=1e-5,
                              rtol=1e-8, atol=1e-10, record_steps=True)
print(f"{run.outcome} after {run.t:.4f} s: {50 / run.t:.1f} mm/s, {len(run.events) - 1} impacts, "
      f"{len(run.phases)} phases, pressed by up to {run.reactions[:, 0].max():.1f} N")

shown = run.times < 0.1
figure, axes = pyplot.subplots(figsize=(6, 3))
axes.plot(run.times[shown], 1e3 * run.states[shown, 1], label="part")
axes.plot(run.times[shown], 1e3 * AMPLITUDE * math.sin(ANGLE) * np.sin(FREQUENCY * run.times[shown]), label="track")
axes.set(xlabel="time [s]", ylabel="height [mm]")
axes.legend()
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "vibrating_feeder.svg")
