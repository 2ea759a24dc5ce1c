"""Siconos on the problems of the report that it is made for, behind the protocol of ricochet_report.

    siconos_peer.py list | serve <cell> | run <cell>

The inclusions as its manual says: a relay on a linear or a nonlinear first-order system, the
implicit Euler-Moreau scheme with theta = 1/2 (its default is 1, of first order too), constant steps.
The ball: Moreau-Jean's time stepping of a Lagrangian system with Newton's impact law; an impact is
the step after which the velocity has turned. Sliding bodies: the same with Coulomb's law, by
Siconos' solver of contact problems with friction.
"""
import math
import subprocess
import sys

from peer import answer, main

try:
    import numpy as np
    import siconos.kernel as sk
except ImportError as error:
    sys.exit(f"found no Siconos ({error}); on Debian: apt-get install python3-siconos")


def relay(start, t_end, a, source, b, c, width, step):
    """x' = a x + source(t) + b r, r in -width Sgn(c x), at 101 times."""
    steps = round(t_end / step)
    every = steps // 100
    system = sk.FirstOrderLinearDS(np.array(start, dtype=float), np.array(a, dtype=float))
    if source is not None:
        system.setbPtr(np.array([source(0.0)]))
    relation = sk.FirstOrderLinearTIR(np.array(c, dtype=float), np.array(b, dtype=float))
    interaction = sk.Interaction(sk.RelayNSL(1, -width, width), relation)
    model = sk.NonSmoothDynamicalSystem(0, t_end)
    model.insertDynamicalSystem(system)
    model.link(interaction, system)
    simulation = sk.TimeStepping(model, sk.TimeDiscretisation(0, t_end / steps),
                                 sk.EulerMoreauOSI(0.5), sk.Relay())
    samples = [list(start)]
    for k in range(1, steps + 1):
        if source is not None:  # the mean of the step
            system.setbPtr(np.array([source((k - 0.5) * t_end / steps)]))
        simulation.computeOneStep()
        simulation.nextStep()
        if k % every == 0:
            samples.append([float(v) for v in system.x()])
    return answer(finished=True, samples=samples, steps=steps)


def sliding_mode(step):
    return relay([0.15], 0.5, [[0.0]], lambda t: 1.75 * math.sin(50 * t), [[1.0]], [[1.0]], 2.0,
                 step)


def diode_circuit(step):
    c1, c2, g, ell = 1 / 9, 1.0, 0.7, 1 / 7
    a = [[-g / c1, g / c1, 0], [g / c2, -g / c2, 1 / c2], [0, -1 / ell, 0]]
    return relay([9.998048, 1.980972, -10.908448], 20.0, a, None, [[1 / c1], [0], [0]],
                 [[1.0, 0, 0]], 0.8, step)


def ball(step):
    body = sk.LagrangianLinearTIDS([10.0], [0.0], np.eye(1))
    body.setFExtPtr(np.array([-9.81]))
    interaction = sk.Interaction(sk.NewtonImpactNSL(0.9), sk.LagrangianLinearTIR(np.eye(1)))
    model = sk.NonSmoothDynamicalSystem(0, 20.5)
    model.insertDynamicalSystem(body)
    model.link(interaction, body)
    simulation = sk.TimeStepping(model, sk.TimeDiscretisation(0, step), sk.MoreauJeanOSI(0.5),
                                 sk.LCP())
    out = answer(finished=True, steps=0)
    before = 0.0
    while simulation.hasNextEvent():
        simulation.computeOneStep()
        simulation.nextStep()
        out["steps"] += 1
        velocity = float(body.velocity()[0])
        if before < 0 < velocity:
            out["times"].append(float(simulation.startingTime()))
            out["guards"].append(0)
        before = velocity
    return out


def slide(inertia, radius, step):
    """A body of 1 kg on a floor, coordinates x, height and angle: when it ceases to slide."""
    start, friction, t_end = 4.0, 0.3, 2.0
    body = sk.LagrangianLinearTIDS([0.0, 0.0, 0.0], [start, 0.0, 0.0],
                                   np.diag([1.0, 1.0, inertia]))
    body.setFExtPtr(np.array([0.0, -9.81, 0.0]))
    relation = sk.LagrangianLinearTIR(np.array([[0.0, 1.0, 0.0], [1.0, 0.0, -radius]]))
    interaction = sk.Interaction(sk.NewtonImpactFrictionNSL(0.0, 0.0, friction, 2), relation)
    model = sk.NonSmoothDynamicalSystem(0, t_end)
    model.insertDynamicalSystem(body)
    model.link(interaction, body)
    simulation = sk.TimeStepping(model, sk.TimeDiscretisation(0, step), sk.MoreauJeanOSI(0.5),
                                 sk.FrictionContact(2))
    out = answer(finished=True, steps=0)
    slides = True
    while simulation.hasNextEvent():
        simulation.computeOneStep()
        simulation.nextStep()
        out["steps"] += 1
        velocity = body.velocity()
        now = abs(float(velocity[0]) - radius * float(velocity[2])) > 1e-6 * start
        if slides and not now:
            out["times"].append(float(simulation.startingTime()))
            out["guards"].append(0)
        slides = now
    return out


def block(step):
    return slide(1.0, 0.0, step)


def rolling(step):
    return slide(0.4 * 0.125 ** 2, 0.125, step)


WAYS = (("sliding-mode", sliding_mode, (5e-3, 1e-3, 1e-4)),
        ("diode-circuit", diode_circuit, (0.2, 0.05, 0.0125)))
CELLS = [(name, "Siconos", "Euler-Moreau, theta 1/2", step, lambda run=run, step=step: run(step))
         for name, run, steps in WAYS for step in steps]
CELLS += [(name, "Siconos", "Moreau-Jean", step, lambda run=run, step=step: run(step))
          for name, run in (("ball", ball), ("block", block), ("rolling", rolling))
          for step in (1e-2, 1e-3)]


def version():
    """Of Debian's package, since the module tells none."""
    asked = subprocess.run(["dpkg-query", "-W", "-f", "${Version}", "python3-siconos"],
                           capture_output=True, text=True)
    return asked.stdout or "version not told"


if __name__ == "__main__":
    sys.exit(main({"Siconos": version()}, CELLS))
