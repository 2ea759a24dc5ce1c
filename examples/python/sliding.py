"""Dry friction: a block on a spring swings back and forth, and sticks.

usage: sliding.py [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

import ricochet

# Friction is 0.3 N against the motion, so that two smooth fields meet at velocity 0. Where both lead to the surface,
# the motion slides along it, which here is sticking. Mass 1 kg, spring 1 N/m.
block = ricochet.Filippov(
    ricochet.Guard(lambda t, x: x[1], name="rest", rate=lambda t, x, dxdt: dxdt[1]),
    [lambda t, x: [x[1], -x[0] + 0.3], lambda t, x: [x[1], -x[0] - 0.3]])
run = ricochet.integrate(block, [2.0, 0.0], 12.0, record_steps=True)

for event, (before, after) in zip(run.events, run.event_modes):
    print(f"{event['t']:.9f} s at {event['after'][0]:+.6f} m: {before} -> {after}")
# The friction force while sticking is the mean of the two bounds with these weights.
share = block.shares(run.mode, run.t, run.x)[0]
print(f"at {run.t:.0f} s {run.x[0]:+.6f} m, friction {0.3 - 0.6 * share:+.6f} N")

figure, axes = pyplot.subplots(figsize=(6, 3))
ricochet.plot(run, labels=["position [m]", "velocity [m/s]"], unit="s", ax=axes)
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "sliding.svg")
