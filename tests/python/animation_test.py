"""Motions as pictures that move: what they show, and at which times."""

import pickle
import xml.etree.ElementTree as Xml

import numpy as np
import pytest

import ricochet

SVG = "{http://www.w3.org/2000/svg}"


def pictured(animation):
    return Xml.fromstring(animation.svg)


def keys(element):
    """The key times of an animated element, and its values, a row each."""
    times = np.array([float(key) for key in element.get("keyTimes").split(";")])
    values = np.array([[float(x) for x in row.split()] for row in element.get("values").split(";")])
    assert times[0] == 0 and times[-1] == 1 and (np.diff(times) >= 0).all() and len(times) == len(values)
    return times, values


def along(element, part):
    """The values at a part of the duration, as the picture interpolates them."""
    times, values = keys(element)
    return np.array([np.interp(part, times, column) for column in values.T])


def box(**options):
    """A disc that falls between two walls onto terrain, beside a platform that rises."""
    scene = ricochet.Scene(gravity=(0, -9.81))
    scene.disc((0.5, 1.0), radius=0.1, velocity=(0.4, 0.0), name="<ball>", **options)
    scene.wall((0, 0), (1, 0))
    scene.wall((1, 0), (-1, 0))
    scene.terrain([(0.0, 0.0), (1.0, 0.0)])
    scene.terrain([(1.2, 0.0), (1.4, 0.0)], motion={"velocity": (0.0, 0.25)})
    return scene.simulate(2.0, sample_times=np.linspace(0, 2, 201))


def test_bodies_are_where_the_run_has_them_within_a_pixel():
    run = box()
    picture = pictured(run.animate())
    body = picture.findall(f"{SVG}g")[1].find(f"{SVG}g")
    moves = body.find(f"{SVG}animateTransform")
    assert moves.get("type") == "translate" and moves.get("dur") == "2s"
    assert body.find(f"{SVG}circle/{SVG}title").text == "<ball>"
    radius = float(body.find(f"{SVG}circle").get("r"))
    scale = radius / 0.1
    drawn = np.array([along(moves, part) for part in np.linspace(0, 1, 201)])
    real = scale * run.trajectory[:, 0] * (1, -1)
    apart = (drawn - drawn[0]) - (real - real[0])
    assert np.abs(apart).max() < 1.2  # half a pixel, and rounding to tenths and of the scale
    assert len(keys(moves)[0]) < 150  # straight stretches are left out


def test_surfaces_are_drawn_and_move():
    surfaces = pictured(box().animate()).findall(f"{SVG}g")[0].findall(f"{SVG}polyline")
    assert len(surfaces) == 4
    points = [np.array([[float(x) for x in point.split(",")] for point in each.get("points").split()])
              for each in surfaces]
    assert points[0][0, 0] == points[0][1, 0] < points[1][0, 0]  # walls from side to side of the picture
    assert points[2][0, 1] == points[2][1, 1]
    for still in surfaces[:3]:
        assert still.find(f"{SVG}animateTransform") is None
    times, shift = keys(surfaces[3].find(f"{SVG}animateTransform"))
    width = points[3][1, 0] - points[3][0, 0]
    np.testing.assert_allclose(shift, [[0, 0], [0, -0.5 / 0.2 * width]], atol=0.2)


def test_arcs_are_round_and_points_are_seen():
    scene = ricochet.Scene()
    scene.arc((0, 0), radius=1.0)
    scene.arc((0, 0), start=(0.5, 0.0), end=(0.0, 0.5))
    scene.point((0.1, 0.2), velocity=(1.0, 0.3))
    run = scene.simulate(3.0, sample_times=np.linspace(0, 3, 100))
    groups = pictured(run.animate()).findall(f"{SVG}g")
    whole, quarter = (np.array([[float(x) for x in point.split(",")] for point in each.get("points").split()])
                      for each in groups[0].findall(f"{SVG}polyline"))
    centre = 0.5 * (whole.min(axis=0) + whole.max(axis=0))
    radius = np.hypot(*(whole - centre).T)
    assert radius.max() - radius.min() < 0.2 and len(whole) == 121
    np.testing.assert_allclose(np.hypot(*(quarter - centre).T), 0.5 * radius.mean(), atol=0.2)
    assert (quarter[:, 0] >= centre[0] - 0.1).all() and (quarter[:, 1] <= centre[1] + 0.1).all()
    assert float(groups[1].find(f"{SVG}g/{SVG}circle").get("r")) == 2


def test_discs_that_turn_show_it():
    body = pictured(box(inertia=0.005, spin=-3.0).animate()).findall(f"{SVG}g")[1].find(f"{SVG}g")
    spoke = body.find(f"{SVG}path/{SVG}animateTransform")
    run = box(inertia=0.005, spin=-3.0)
    assert spoke.get("type") == "rotate"
    np.testing.assert_allclose(along(spoke, 0.5), -np.degrees(run.trajectory_angles[100]), atol=1)


def test_a_body_that_leaves_a_cell_comes_back_on_the_other_side_at_once():
    scene = ricochet.Scene(period=(1.0, 0.0))
    scene.disc((0.5, 0.0), radius=0.1, velocity=(1.0, 0.0))
    run = scene.simulate(2.0, sample_times=np.linspace(0, 2, 41))
    moves = pictured(run.animate()).findall(f"{SVG}g")[1].find(f"{SVG}g/{SVG}animateTransform")
    times, at = keys(moves)
    jumps = np.flatnonzero(np.diff(times) == 0)
    assert len(jumps) == 2  # at half a second and at one and a half
    np.testing.assert_allclose(times[jumps], [0.25, 0.75], atol=0.02)
    slopes = np.diff(at[:, 0])[np.diff(times) > 0] / np.diff(times)[np.diff(times) > 0]
    np.testing.assert_allclose(slopes, slopes.mean(), rtol=0.02)  # never backwards


def test_a_run_is_drawn_by_a_function():
    pendulum = ricochet.Pendulum()
    run = ricochet.integrate(pendulum, pendulum.start, 4.0, record_steps=True)

    def rod(t, x):
        return [(0.0, 0.0), (np.sin(x[0]), -np.cos(x[0]))]

    animation = ricochet.animate(run, rod, speed=2, frames=101)
    assert animation.duration == 2 and repr(animation).startswith("<Animation of 2 s, ")
    line = pictured(animation).find(f"{SVG}polyline")
    shapes = [along(line.find(f"{SVG}animate"), part).reshape(2, 2) for part in np.linspace(0, 1, 101)]
    angles = [np.arctan2(*(last - first)) for first, last in shapes]
    np.testing.assert_allclose(angles, run.solution(np.linspace(0, 4, 101))[0], atol=2e-3)
    for shape in shapes:
        np.testing.assert_allclose(np.hypot(*(shape[1] - shape[0])), np.hypot(*(shapes[0][1] - shapes[0][0])),
                                   rtol=3e-3)
    marked = pictured(animation).find(f"{SVG}circle")
    assert [each.get("attributeName") for each in marked] == ["cx", "cy"]


@pytest.mark.parametrize("options", [{"record_steps": True}, {"sample_times": np.linspace(0, 4, 500)}])
def test_components_are_drawn_over_time(options):
    run = ricochet.integrate(ricochet.BouncingBall(restitution=0.8), [2.0, 0.0], 4.0, **options)
    picture = pictured(ricochet.animate(run))
    curves, dots = picture.findall(f"{SVG}polyline"), picture.findall(f"{SVG}circle")
    assert [curve.find(f"{SVG}title").text for curve in curves] == ["x[0]", "x[1]"]
    heights = [float(point.split(",")[1]) for point in curves[0].get("points").split()]
    dot = dots[0].find(f"{SVG}animate[@attributeName='cy']")
    for part in (0.0, 0.3, 0.7, 1.0):
        assert abs(along(dot, part)[0] - heights[round(part * 299)]) < 2.5  # a frame moves it by 2 at most
    result = ricochet.solve_ivp(lambda t, y: [y[1], -y[0]], (0, 3), [1.0, 0.0], dense_output=True)
    assert "<animate " in ricochet.animate(result).svg


def test_notebooks_show_runs_of_scenes(tmp_path):
    run = box()
    page = run._repr_html_()
    assert "&lt;SceneRun: reached_end" in page and run.animate().svg in page
    assert run.animate()._repr_html_() == run.animate().svg
    run.animate().save(tmp_path / "box.svg")
    assert (tmp_path / "box.svg").read_text() == run.animate().svg
    again = pickle.loads(pickle.dumps(run))
    assert again.animate().svg == run.animate().svg
    scene = ricochet.Scene()
    scene.disc((0, 0))
    assert "<svg" not in scene.simulate(1.0)._repr_html_()
    many = ricochet.Scene()
    for i in range(250):
        many.disc((3 * i, 0))
    assert "<svg" not in many.simulate(1.0, sample_times=np.linspace(0, 1, 100))._repr_html_()


def test_what_cannot_be_drawn_is_refused():
    run = ricochet.integrate(ricochet.BouncingBall(), [2.0, 0.0], 1.0, record_steps=True)
    plain = ricochet.integrate(ricochet.BouncingBall(), [2.0, 0.0], 1.0)
    scene = ricochet.Scene()
    scene.disc((0, 0))

    def refused(error, said, *arguments, **options):
        with pytest.raises(error, match=said):
            ricochet.animate(*arguments, **options)

    refused(ValueError, "less than two times", plain)
    refused(ValueError, "less than two times", scene.simulate(1.0))
    refused(ValueError, "speed: found 0.0", run, speed=0)
    refused(ValueError, "speed", run, speed=np.inf)
    refused(ValueError, "frames: found 1", run, frames=1)
    refused(TypeError, "draw: found a int", run, 3)
    refused(TypeError, "run: found a dict", {})
    refused(ValueError, r"draw returned the shapes \[\(2,\)\]", run, lambda t, x: x)
    refused(ValueError, "not finite", run, lambda t, x: [(0.0, np.nan)])
    refused(TypeError, "draws itself", box(), lambda t, x: [(0, 0)])
