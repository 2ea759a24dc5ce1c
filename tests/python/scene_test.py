"""Scenes of many bodies: built here or read from JSON."""

import importlib.util
import json
import os
from pathlib import Path

import numpy as np
import pytest

import ricochet
from ricochet import Scene, SceneKind

if importlib.util.find_spec("ricochet._scenes") is None:
    pytest.skip("the package was built without scenes", allow_module_level=True)

SOURCE = Path(os.environ.get("RICOCHET_SOURCE", Path(__file__).parents[2]))
GRAVITY = 9.81  # [m/s^2]


def drop(restitution=0.8, **disc):
    """A disc of radius 0.1 m, 2 m above a floor."""
    scene = Scene(gravity=(0, -GRAVITY))
    scene.material("steel", restitution=restitution)
    scene.wall((0, 0), (0, 1), material="steel", name="floor")
    scene.disc((0, 2.1), radius=0.1, material="steel", name="ball", **disc)
    return scene


def test_impacts_of_a_disc_are_those_of_the_closed_form():
    run = drop().simulate(4.0)
    first = np.sqrt(2 * 2.0 / GRAVITY)
    flights = [first * (1 + 2 * sum(0.8**k for k in range(1, n + 1))) for n in range(4)]
    times = run.events["t"][:4]
    # Flight is a parabola, whose root is right to rounding.
    np.testing.assert_allclose(times, flights, rtol=1e-14)
    assert run.success and run.outcome == "reached_end" and run.message == "" and run.t == 4.0
    assert run.body_names == ["ball"] and run.surface_names == ["floor"]
    event = run.events[0]
    assert event["kind"] == SceneKind.IMPACT and event["surface"] and event["body"] == event["other"] == 0
    np.testing.assert_allclose(event["before"][0], [0, -GRAVITY * first], rtol=1e-14)
    np.testing.assert_allclose(event["after"][0], [0, 0.8 * GRAVITY * first], rtol=1e-14)
    np.testing.assert_allclose(event["impulse"], [0, 1.8 * GRAVITY * first], rtol=1e-14)
    assert run.statistics.impacts == len(run.events)


def test_trajectories_and_energy_at_samples():
    times = np.linspace(0, 0.6, 7)
    run = drop(velocity=(1.0, 0.0)).simulate(0.6, sample_times=times)
    assert np.array_equal(run.times, times)
    assert run.trajectory.shape == run.trajectory_velocities.shape == (7, 1, 2)
    np.testing.assert_allclose(run.trajectory[:, 0, 0], times, atol=1e-15)
    np.testing.assert_allclose(run.trajectory[:, 0, 1], 2.1 - GRAVITY * times**2 / 2, atol=1e-14)
    np.testing.assert_allclose(run.energy, GRAVITY * 2.1 + 0.5, rtol=1e-14)
    np.testing.assert_allclose(run.energy_at_end, run.energy[-1], rtol=1e-15)
    assert np.array_equal(run.positions, run.trajectory[-1]) and not run.asleep.any()


def test_momentum_and_energy_of_an_elastic_break():
    table = Scene()
    cue = table.disc((0, 0), velocity=(7, 0.1), radius=0.5, mass=2.0)
    for k in range(4):
        table.disc((5 + 1.1 * k, 0.2 * k), radius=0.5)
    run = table.simulate(5.0)
    assert run.statistics.impacts >= 4 and cue == 0
    masses = np.array([2.0, 1, 1, 1, 1])
    np.testing.assert_allclose(masses @ run.velocities, [14.0, 0.2], rtol=1e-13)
    np.testing.assert_allclose(run.energy_at_end, 7**2 + 0.1**2, rtol=1e-13)


def test_a_spring_swings_by_its_period():
    scene = Scene()
    scene.disc((-1.5, 0), radius=0.1, name="a")
    scene.disc((1.5, 0), radius=0.1, name="b")
    scene.spring("a", "b", rest=2.0, stiffness=8.0)
    period = 2 * np.pi / 4  # of the reduced mass of 0.5 kg
    run = scene.simulate(period, rtol=1e-10, atol=1e-12)
    # Some 50 steps with errors of 1e-10 each at most.
    np.testing.assert_allclose(run.positions, [[-1.5, 0], [1.5, 0]], atol=5e-9)
    assert run.statistics.steps > 0


def test_bodies_come_to_rest_on_each_other():
    scene = Scene(gravity=(0, -GRAVITY))
    scene.material("clay", restitution=0.2, friction=0.5)
    scene.wall((0, 0), (0, 1), material="clay")
    scene.disc((0, 0.6), radius=0.5, material="clay")
    scene.disc((0, 1.8), radius=0.5, material="clay")
    run = scene.simulate(5.0)
    assert run.success, run.message
    assert run.asleep.all()
    # Contacts are solved to 1e-10 of the velocities; gaps close to the contact step's order.
    np.testing.assert_allclose(run.positions, [[0, 0.5], [0, 1.5]], atol=1e-4)
    assert {SceneKind.JOINED, SceneKind.SLEPT} <= set(run.events["kind"].tolist())


def test_json_gives_the_bits_of_the_scene_built_here():
    text = json.dumps({
        "gravity": [0, -GRAVITY], "materials": {"steel": {"restitution": 0.8}},
        "walls": [{"name": "floor", "point": [0, 0], "normal": [0, 1], "material": "steel"}],
        "bodies": [{"name": "ball", "disc": {"radius": 0.1}, "at": [0, 2.1], "material": "steel"}],
        "run": {"t_end": 2.0, "sample_times": [1.0]}})
    scene = Scene.from_json(text)
    run = scene.simulate()
    built = drop().simulate(2.0, sample_times=[1.0])
    assert np.array_equal(run.events, built.events) and np.array_equal(run.trajectory, built.trajectory)
    scene.disc((3, 1), material="steel")  # a material of the file
    assert len(scene.body_names) == 2
    assert scene.simulate(0.5, sample_times=[]).t == 0.5


def test_scenes_of_files_run(tmp_path):
    path = tmp_path / "ball.json"
    path.write_text('{"bodies": [{"point": {}, "at": [0, 0], "velocity": [1, 0]}], "run": {"t_end": 2}}')
    assert Scene.load(path).simulate().positions.tolist() == [[2.0, 0.0]]
    examples = sorted((SOURCE / "examples" / "scenes").glob("*.json"))
    assert examples
    scene = Scene.load(examples[0])
    assert "bod" in scene.explain(1.0) and len(scene.radii) == len(scene.body_names)


@pytest.mark.parametrize("motion", [
    {"amplitude": (0, 0.05), "frequency": 3.0, "phase": 0.0},
    {"displacement": lambda t: (0.0, 0.05 * np.sin(6 * np.pi * t)),
     "velocity": lambda t: (0.0, 0.3 * np.pi * np.cos(6 * np.pi * t)),
     "acceleration_bound": 0.05 * (6 * np.pi) ** 2, "reach": 0.05}])
def test_a_table_that_shakes(motion):
    scene = Scene(gravity=(0, -GRAVITY))
    scene.material("steel", restitution=0.5)
    scene.wall((0, 0), (0, 1), motion=motion, material="steel")
    scene.point((0, 0.5), material="steel")
    run = scene.simulate(1.0)
    first = run.events[0]
    fallen = 0.5 - GRAVITY * first["t"] ** 2 / 2
    # Both sides of the contact are of the size of a metre.
    assert abs(fallen - 0.05 * np.sin(6 * np.pi * first["t"])) < 1e-13
    assert first["before"][1][1] == pytest.approx(0.3 * np.pi * np.cos(6 * np.pi * first["t"]), rel=1e-12)


def test_exceptions_of_motions_pass():
    def displacement(t):
        raise KeyError("lost")

    scene = Scene(gravity=(0, -GRAVITY))
    scene.point((0, 0.5))
    scene.wall((0, 0), (0, 1), motion={"displacement": displacement, "velocity": lambda t: (0, 0),
                                       "acceleration_bound": 1.0})
    with pytest.raises(KeyError, match="lost"):
        scene.simulate(1.0)
    scene = Scene(gravity=(0, -GRAVITY))
    scene.point((0, 0.5))
    scene.wall((0, 0), (0, 1), motion={"displacement": lambda t: 3, "velocity": lambda t: (0, 0),
                                       "acceleration_bound": 1.0})
    with pytest.raises(TypeError, match="displacement returned 3, expected two numbers"):
        scene.simulate(1.0)


def test_an_interrupt_ends_a_run():
    import signal
    import threading

    scene = Scene(gravity=(0, -GRAVITY))
    scene.wall((0, 0), (0, 1))
    for k in range(50):
        scene.point((k, 1.0 + 0.01 * k))
    threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    with pytest.raises(KeyboardInterrupt):
        scene.simulate(1e7, record_events=False)


def refused(call, error, said):
    with pytest.raises(error, match=said):
        call()


def test_what_is_no_scene_is_refused():
    scene = drop()
    refused(lambda: scene.disc((0, 5), radius=-1), ValueError, "radius")
    refused(lambda: scene.disc((0, 5), name="ball"), ValueError, "ball")
    refused(lambda: scene.disc((0, 5, 1)), ValueError, r"at: found shape \(3,\), expected two numbers")
    refused(lambda: scene.disc((0, 5), material="stel"), ValueError, "material: found 'stel', expected some of .*did you mean 'steel'")
    refused(lambda: scene.disc((0, 5), name=3), TypeError, "name: found 3, expected a text")
    refused(lambda: scene.material("wood", restitution=1.2), ValueError, "restitution")
    refused(lambda: scene.material(""), TypeError, "name: found ''")
    refused(lambda: scene.terrain([0, 1]), ValueError, r"points: found shape \(2,\), expected \(n, 2\)")
    refused(lambda: scene.spring("ball", "bell", stiffness=1), ValueError, "bell")
    refused(lambda: scene.spring(0, 7, stiffness=1), ValueError, "spring: found 7, expected the name of a body, or a number below 1")
    refused(lambda: scene.wall((0, -9), (0, 1), motion=[1, 2]), TypeError, "motion: found .*, expected a dictionary")
    refused(lambda: scene.wall((0, -9), (0, 1), motion={"amplitude": (0, 1), "freqency": 3}), ValueError,
            "motion: found 'freqency', expected some of amplitude, frequency, phase")
    refused(lambda: scene.wall((0, -9), (0, 1), motion={"phase": 1}), ValueError, "expected a key 'amplitude'")
    refused(lambda: scene.wall((0, -9), (0, 1), motion={"amplitude": 3}), TypeError, "motion: amplitude: found 3, expected pairs")
    refused(lambda: scene.wall((0, -9), (0, 1), motion={"displacement": 3}), TypeError, "found no function 'displacement'")
    refused(lambda: scene.simulate(), ValueError, "t_end")
    refused(lambda: scene.simulate("soon"), TypeError, "t_end: found 'soon', expected a number")
    refused(lambda: scene.simulate(1.0, sample_tims=[1]), TypeError, "found an option 'sample_tims', expected some of")
    refused(lambda: scene.simulate(1.0, impacts="wave"), ValueError, "impacts: found 'wave', expected 'waves' or 'together'")
    refused(lambda: scene.simulate(1.0, max_events="many"), TypeError, "max_events: found 'many'")
    refused(lambda: scene.energy([[1.0]], [[1.0]]), ValueError, r"expected \(times, 1, 2\)")
    refused(lambda: Scene(gravity=9.81), ValueError, "gravity: found shape")
    refused(lambda: Scene.from_json("{"), ValueError, "scene:1")
    refused(lambda: Scene.from_json({}), TypeError, "text: found a dict, expected a text")
    refused(lambda: Scene.load("nowhere.json"), ValueError, "nowhere.json")


def test_bodies_that_overlap_are_named():
    scene = Scene()
    scene.disc((0, 0), name="one")
    scene.disc((1, 0), name="two")
    refused(lambda: scene.simulate(1.0), ValueError, "one.*two|two.*one")


def test_circles_repeat_across_the_border_of_a_period():
    # A point along y = 0.125 strikes the pin at the corner of the next cell.
    scene = Scene(period=(1, 1))
    scene.arc((0, 0), radius=0.25, name="pin")
    scene.point((0.5, 0.125), velocity=(1, 0))
    run = scene.simulate(0.4)
    assert run.events["t"] == pytest.approx([0.5 - np.sqrt(0.25**2 - 0.125**2)], rel=1e-14)
    assert run.winding.tolist() == [[0, 0]]
    free = Scene(period=(1, 2))
    free.disc((0.25, 0.5), velocity=(1.5, -0.75), radius=0.1)
    run = free.simulate(10, sample_times=[1])
    assert run.winding.tolist() == [[15, -4]] and run.trajectory_winding.tolist() == [[[1, -1]]]
    with pytest.raises(ValueError, match="expected a radius, or a start and an end"):
        scene.arc((0, 0), radius=1, start=(1, 0), end=(0, 1))


def test_a_plate_is_a_body_that_moves_along_a_line():
    # A point of 1 kg at 3 m/s catches up with a plate of 2 kg at 1 m/s: they leave at 1/3 and 7/3 m/s.
    scene = Scene()
    scene.point((0, 0), velocity=(3, 0))
    assert scene.plate((1, -1), (1, 1), along=(4, 0), speed=1, mass=2, name="piston") == 1
    run = scene.simulate(1, sample_times=[0])
    assert scene.body_names[1] == "piston" and scene.radii.tolist() == [0, 0]
    assert run.events["t"] == pytest.approx([0.5], rel=1e-15)
    assert run.events["other"].tolist() == [1] and not run.events["surface"][0]
    assert run.velocities == pytest.approx(np.array([[1 / 3, 0], [7 / 3, 0]]), rel=1e-14)
    assert run.energy[0] == pytest.approx(run.energy_at_end, rel=1e-14)
    with pytest.raises(ValueError, match="along: found .*expected a direction"):
        scene.plate((3, 0), (3, 1), along=(0, 0))
    with pytest.raises(ValueError, match="Scene: plate 2 has no length"):
        scene.plate((3, 0), (3, 0))


def test_discs_turn_where_they_have_an_inertia():
    # Laid on a floor at 3 m/s, a solid disc rolls at 2 m/s after 0.5 s of slipping.
    scene = Scene(gravity=(0, -10))
    scene.material("felt", restitution=0, friction=0.2)
    scene.wall((0, 0), (0, 1), material="felt")
    scene.disc((0, 0.5), velocity=(3, 0), radius=0.5, mass=2, inertia=0.25, material="felt")
    run = scene.simulate(1, sample_times=[0, 0.5])
    assert run.velocities[0, 0] == pytest.approx(2) and run.spins[0] == pytest.approx(-4)
    assert run.trajectory_spins[:, 0] == pytest.approx([0, -4])
    assert run.energy == pytest.approx([9 + 10, 4 + 2 + 10])


def test_pairs_speeds_and_temperatures_of_materials():
    scene = Scene()
    scene.material("a", restitution=0.5, by_speed={"speed": 2, "exponent": 0.5})
    scene.material("b", restitution=0.9)
    scene.pair("a", "b", restitution=0.25)
    scene.wall((0, 0), (1, 0), material="b")
    scene.wall((4, 0), (-1, 0), temperature=2.0)
    scene.disc((2, 0), velocity=(-1, 0), radius=0.5, material="a")
    run = scene.simulate(40, seed=5)
    assert run.events["after"][0, 0, 0] == pytest.approx(0.25)
    assert run.events["after"][1, 0, 1] != 0
    again = scene.simulate(40, seed=5)
    assert (run.events["after"] == again.events["after"]).all()
    with pytest.raises(ValueError, match="by_speed: found 'sped'"):
        scene.material("c", by_speed={"sped": 1})


def test_a_gas_is_measured():
    # Two points between walls 2 m apart and 3 m long, at 4 m/s: m v^2 / (2 * 3) each, on each wall, with
    # the one impact more or less that a block may have.
    scene = Scene()
    scene.wall((0, 0), (1, 0), name="left")
    scene.wall((2, 0), (-1, 0))
    scene.point((1, 0), velocity=(4, 0), mass=0.5)
    scene.point((1, 9), velocity=(-4, 0), mass=0.5)
    found = scene.measure(0, 100, blocks=4, area=6, lengths={"left": 3})
    assert found.outcome == "reached_end"
    assert found.surface_pressure[0][0] == pytest.approx(2 * 0.5 * 16 / 6, abs=0.06)
    assert np.isnan(found.surface_pressure[1][0])
    assert found.temperature[0] == pytest.approx(8)
    with pytest.raises(ValueError, match="lengths: found 'right'"):
        scene.measure(0, 1, area=6, lengths={"right": 3})
