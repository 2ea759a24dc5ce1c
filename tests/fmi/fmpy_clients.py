#!/usr/bin/env python3
"""Another client: FMPy validates and runs the FMUs that the build has exported.

usage: fmpy_clients.py FOLDER_OF_FMUS FOLDER_OF_ENVIRONMENTS [PROGRAM FOLDER_OF_SCENES]

With the program `ricochet-fmi`, if scenes are built, it exports some of them, too.

FMPy is installed by pip into an environment of its own the first time. Exit status 77: it cannot be.
"""

import json
import math
import subprocess
import sys
import tempfile
import venv
from pathlib import Path

PACKAGES = ["fmpy==0.3.32"]


def python_with_fmpy(folder):
    """The interpreter of an environment with FMPy; none where pip cannot get it."""
    python = folder / "environment" / "bin" / "python"
    if not python.exists():
        venv.create(folder / "environment", with_pip=True)
    known = subprocess.run([python, "-c", "from fmpy import simulate_fmu"], capture_output=True)
    if known.returncode == 0:
        return python
    try:
        got = subprocess.run([python, "-m", "pip", "install", "-q", *PACKAGES], capture_output=True, text=True, timeout=300)
    except subprocess.TimeoutExpired:
        return None
    return python if got.returncode == 0 else None


def ball(t, e=0.9, g=9.81, h=10.0):
    """Height of the ball at time t, by its flights."""
    begin, speed = math.sqrt(2 * h / g), math.sqrt(2 * g * h)
    if t < begin:
        return h - g / 2 * t * t
    while True:
        speed *= e
        flight = 2 * speed / g
        if t < begin + flight:
            return speed * (t - begin) - g / 2 * (t - begin) ** 2
        begin += flight


def examine(fmus):
    """Runs in the environment with FMPy."""
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    for file in sorted(fmus.glob("*.fmu")):
        problems = validate_fmu(str(file))
        assert not problems, f"{file.name}: {problems}"
    print(f"{len(list(fmus.glob('*.fmu')))} FMUs are valid")
    for name in ("fmu_ball.fmu", "fmu_ball-2.fmu"):
        file = str(fmus / name)
        worst = 0
        for events in (False, True):
            if events and name.endswith("-2.fmu"):
                continue
            run = simulate_fmu(file, fmi_type="CoSimulation", stop_time=12, output_interval=0.01, output=["height", "events"],
                               early_return_allowed=events, use_event_mode=events)
            for t, height, count in run:
                worst = max(worst, abs(height - ball(float(t))))
            assert run["events"][-1] == 6, run["events"][-1]
        # A double of a height of 10 m is 1.8e-15 m apart; where the speed is 14 m/s so is a time of 12 s, 2.5e-14 m.
        print(f"{name}: co-simulation, 1200 steps, worst error {worst:.2e} m")
        assert worst <= 3e-14
        run = simulate_fmu(file, fmi_type="ModelExchange", stop_time=12, output_interval=0.01, output=["height", "events"],
                           relative_tolerance=1e-8)
        worst = max(abs(height - ball(float(t))) for t, height, _ in run)
        print(f"{name}: model exchange by CVODE at 1e-8, {int(run['events'][-1])} impacts, worst error {worst:.2e} m")
        assert run["events"][-1] == 6 and worst < 1e-2
    run = simulate_fmu(str(fmus / "fmu_sampled-2.fmu"), fmi_type="ModelExchange", stop_time=3, output=["x"])
    again = simulate_fmu(str(fmus / "fmu_sampled.fmu"), fmi_type="CoSimulation", stop_time=3, output_interval=0.25, output=["x"])
    print(f"fmu_sampled: x = {run['x'][-1]:.6f} by model exchange, {again['x'][-1]:.6f} by co-simulation")
    assert abs(run["x"][-1] - again["x"][-1]) < 1e-3


BALL_AS_SCENE = {
    "gravity": [0, -9.81],
    "materials": {"steel": {"restitution": 0.9}},
    "walls": [{"point": [0, 0], "normal": [0, 1], "material": "steel"}],
    "bodies": [{"name": "ball", "disc": {"radius": 1}, "at": [0, 11], "material": "steel"}],
}


def examine_scenes(program, scenes):
    """Scenes that `ricochet fmu export` has packed: the ball, and many discs by steps of two lengths."""
    from fmpy import simulate_fmu
    from fmpy.validation import validate_fmu

    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "ball.json"
        scene.write_text(json.dumps(BALL_AS_SCENE))
        for version in ("2", "3"):
            file = str(Path(folder) / f"ball{version}.fmu")
            subprocess.run([program, "fmu", "export", scene, "--fmi", version, "-o", file], check=True)
            problems = validate_fmu(file)
            assert not problems, problems
            for events in (False, True) if version == "3" else (False,):
                run = simulate_fmu(file, stop_time=12, output_interval=0.01, output=["ball.y", "events"],
                                   early_return_allowed=events, use_event_mode=events)
                worst = max(abs(y - 1 - ball(float(t))) for t, y, _ in run)
                print(f"scene of a ball, FMI {version}, event mode {events}: {len(run)} rows, worst error {worst:.2e} m")
                # As above, with heights of the centre; those of the closed form are no better than the sum of its flights.
                assert worst <= 1e-13, worst
                assert run["events"][-1] == 6, run["events"][-1]
            for name in ("bin", "gas", "cradle"):
                file = str(Path(folder) / f"{name}{version}.fmu")
                subprocess.run([program, "fmu", "export", Path(scenes) / f"{name}.json", "--fmi", version, "-o", file],
                               check=True)
                problems = validate_fmu(file)
                assert not problems, f"{name}: {problems}"
                ends = [simulate_fmu(file, stop_time=0.25, output_interval=step)[-1] for step in (0.25, 1 / 128)]
                assert all(a == b for a, b in zip(*(tuple(end) for end in ends))), name
                print(f"{name}, FMI {version}: {len(ends[0]) - 1} outputs, the same bits by steps of 1/4 and 1/128 s")


def main(fmus, folder, *scenes):
    python = python_with_fmpy(Path(folder))
    if python is None:
        print("FMPy is not installed and cannot be by pip: its clients are not run")
        return 77
    return subprocess.run([python, __file__, "--examine", fmus, *scenes]).returncode


if __name__ == "__main__":
    if sys.argv[1] == "--examine":
        examine(Path(sys.argv[2]))
        if len(sys.argv) > 3:
            examine_scenes(*sys.argv[3:])
    else:
        sys.exit(main(*sys.argv[1:]))
