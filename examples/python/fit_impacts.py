"""Restitution and drag of a bouncing ball from the times of its impacts, as a microphone hears them.

usage: fit_impacts.py [PICTURE]

Gauss-Newton steps, whose Jacobian is that of the times of impact through all impacts before them.
"""

import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot

import ricochet

GRAVITY, HEIGHT = 9.81, 2.0  # [m/s²], [m]


class Ball(ricochet.System):
    unilateral = True

    def flow(self, t, x, restitution, drag):
        return [x[1], -GRAVITY - drag * x[1]]

    def guard(self, t, x, restitution, drag):
        return x[0]

    def reset(self, t, x, restitution, drag):
        return [0, -restitution * x[1]]


def impacts(parameters):
    """The first twelve times of impact [s], and their derivatives by restitution and drag."""
    found = ricochet.sensitivities(Ball(), [HEIGHT, 0.0], 8.0, args=parameters)
    return found.run.event_times[:12], found.event_times[:12, 2:]


truth = np.array([0.85, 0.1])  # restitution, drag [1/s]
heard = impacts(truth)[0] + np.random.default_rng(2).normal(0, 1e-3, 12)  # [s]

guess = np.array([0.8, 0.0])
residuals = []
for step in range(6):
    times, jacobian = impacts(guess)
    residuals.append(np.sqrt(np.mean((times - heard) ** 2)))
    guess = guess + np.linalg.lstsq(jacobian, heard - times, rcond=None)[0]
# The covariance of the estimate, from the noise that is left.
spread = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian))) * residuals[-1]
print(f"restitution {guess[0]:.4f} +- {spread[0]:.4f} (it is {truth[0]})")
print(f"drag {guess[1]:.4f} +- {spread[1]:.4f} 1/s (it is {truth[1]})")
if not np.all(np.abs(guess - truth) < 5 * spread):
    sys.exit("the fit has missed the truth")

figure, (left, right) = pyplot.subplots(1, 2, figsize=(8, 3.2))
t = np.linspace(0, heard[-1], 600)
for parameters, label in ((np.array([0.8, 0.0]), "first guess"), (guess, "fit")):
    run = ricochet.adjoint(Ball(), [HEIGHT, 0.0], heard[-1] + 0.01, args=parameters, sample_times=t)
    left.plot(run.sample_times, run.samples[:, 0], label=label)
left.plot(heard, np.zeros(12), "k|", markersize=12, label="heard")
left.set(xlabel="t [s]", ylabel="height [m]")
left.legend()
right.semilogy(residuals, "o-")
right.set(xlabel="step of Gauss and Newton", ylabel="residual [s]")
figure.tight_layout()
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "fit_impacts.svg")
