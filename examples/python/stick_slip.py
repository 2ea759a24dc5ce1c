"""A block on a moving belt: a hybrid automaton of one's own, with modes.

usage: stick_slip.py [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

import ricochet

BELT = 0.2  # [m/s]


class Block(ricochet.System):
    """A mass of 1 kg on a spring of 1 N/m, carried by a belt that it rubs on."""

    modes = ("stick", "slip")

    def flow(self, mode, t, x):
        position, velocity = x
        if mode == "stick":
            return [BELT, 0.0]
        return [velocity, -position + 1 / (1 + 3 * (BELT - velocity))]

    @ricochet.guard(in_modes=["stick"])
    def pulled_off(self, mode, t, x):
        return 1 - x[0]  # what friction bears

    @pulled_off.reset
    def pulled_off(self, mode, t, x):
        return "slip", [1.0, BELT]

    @ricochet.guard(in_modes=["slip"])
    def caught(self, mode, t, x):
        return BELT - x[1]

    @caught.reset
    def caught(self, mode, t, x):
        return "stick", [x[0], BELT]


run = ricochet.integrate(Block(), [0.0, BELT], 40.0, mode="stick", record_steps=True, h_max=0.05)
for event in run.events:
    print(f"{event['t']:9.6f}  {run.guard_names[event['guard']]}")

figure, (over_time, phase) = pyplot.subplots(1, 2, figsize=(9, 3))
ricochet.plot(run, labels=["position [m]", "velocity [m/s]"], ax=over_time)
over_time.set_xlabel("time [s]")
ricochet.plot(run, phase=(0, 1), ax=phase)
phase.set_xlabel("position [m]")
phase.set_ylabel("velocity [m/s]")
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "stick-slip.svg")
