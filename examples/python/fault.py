"""An earthquake on a strike-slip fault of 20 x 20 elements: the mean motion, and where it slipped.

usage: fault.py [PICTURE]
"""

import sys

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

from ricochet import faults

fault = faults.Fault(20)  # 3 km x 3 km
rupture = fault.rupture(30.0, snapshot_times=[6.5, 8.15, 9.5])

print(f"mean slip {rupture.mean_slip:.4f} m, fastest at {rupture.peak_time:.3f} s with {rupture.peak_velocity:.4f} m/s, "
      f"at rest after {rupture.rest_time:.3f} s")
print(f"{rupture.statistics['arrests']} elements stopped, in {rupture.statistics['steps']} steps")

# The rupture starts deep, where friction drops most, and runs towards the surface.
figure, axes = pyplot.subplots(1, 4, figsize=(11, 3))
axes[0].plot(rupture.times, rupture.mean_velocities)
axes[0].set(xlabel="time [s]", ylabel="mean velocity [m/s]")
for each, snapshot in zip(axes[1:], rupture.snapshots):
    each.imshow(100 * snapshot["velocity"], extent=(0, 3, 3, 0), vmin=0, vmax=13)
    each.set(title=f"{snapshot['t']:.2f} s", xlabel="along the strike [km]", ylabel="depth [km]")
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "fault.svg")
