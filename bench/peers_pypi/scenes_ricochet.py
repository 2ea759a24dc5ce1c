"""ricochet's scenes of discs, and its import of FMUs, from Python."""
import os
import sys

import numpy as np

import bodies
import problems
import ricochet
from cell import events, main, values


def box():
    scene = ricochet.Scene()
    size = problems.DISCS_BOX
    for point, normal in (((0, 0), (0, 1)), ((0, 0), (1, 0)), ((size, size), (0, -1)), ((size, size), (-1, 0))):
        scene.wall(point, normal)
    for at, velocity in zip(bodies.TABLE[0], bodies.TABLE[1]):
        scene.disc(at, radius=bodies.TABLE[2], velocity=velocity)
    return scene


def discs():
    scene = box()

    def read(run):
        seen = scene.simulate(problems.DISCS_END, sample_times=np.linspace(0, problems.DISCS_END, 241))
        deepest = max(bodies.overlap(np.asarray(at)) for at in seen.trajectory)
        return bodies.answer(run.statistics.impacts, deepest, run.velocities)
    return lambda: scene.simulate(problems.DISCS_END), read


def spinning():
    thrown = problems.SPINNING
    scene = ricochet.Scene(gravity=(0, -problems.GRAVITY))
    scene.material("rubber", restitution=thrown["restitution"], friction=thrown["friction"])
    scene.wall((0, 0), (0, 1), material="rubber")
    scene.disc((0, thrown["y"]), velocity=(thrown["vx"], 0), radius=thrown["radius"], mass=1.0,
               inertia=thrown["radius"] ** 2 / 2, spin=thrown["spin"], material="rubber")
    return (lambda: scene.simulate(thrown["t_end"]),
            lambda run: values([*run.positions[0], run.spins[0]]))


def fmu_ball(version, tolerance):
    def make():
        fmu = ricochet.load_fmu(os.path.join(os.environ["RICOCHET_FMUS"], f"ball{version}.fmu"))
        return (lambda: fmu.simulate(t_end=problems.FMU_END, rtol=tolerance, samples=2),
                lambda run: events([event.t for event in run.events]))
    return make


def cells():
    out = [("discs", "ricochet", "scene, from contact to contact", 0, discs),
           ("spinning-disc", "ricochet", "scene, from contact to contact", 0, spinning)]
    out += [("fmu-ball", "ricochet", f"load_fmu, FMI {version}", tolerance, fmu_ball(version, tolerance))
            for version in (2, 3) for tolerance in (1e-4, 1e-8, 1e-12)]
    return out


if __name__ == "__main__":
    sys.exit(main({}, cells()))
