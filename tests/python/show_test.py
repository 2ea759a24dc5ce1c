"""How runs are shown: in a line, in a notebook, and while they last."""

import re
import sys

import numpy as np
import pytest

import ricochet


def bouncing(**options):
    return ricochet.integrate(ricochet.BouncingBall(), [10.0, 0.0], 20.5, **options)


class Heater(ricochet.System):
    modes = ("<off>", "on")

    def flow(self, mode, t, x):
        return [30.0 * (mode == "on") - x[0]]

    @ricochet.guard(in_modes=["<off>"])
    def cold(self, mode, t, x):
        return x[0] - 18

    @cold.reset
    def cold(self, mode, t, x):
        return "on"


def test_a_run_is_a_line():
    assert re.fullmatch(r"<Run: reached_end at t = 20\.5, x = \[\S+, \S+\], 13 events>",
                        repr(bouncing()))
    run = ricochet.integrate(Heater(), [20.0], 1.0)
    assert re.fullmatch(r"<Run: reached_end at t = 1\.0, x = \[\S+\], mode 'on', 1 event>", repr(run))
    many = ricochet.integrate(ricochet.System(lambda t, x: 0 * x), np.arange(9.0), 1.0)
    assert "x = [0, 1, 2, ..., 7, 8], 0 events" in repr(many)


def test_a_notebook_shows_the_outcome_and_the_events():
    page = bouncing()._repr_html_()
    assert "<img" not in page and page.count("<tr>") == 1 + 5 + 1 + 5
    assert "3 more" in page and "floor" in page and "crossing" in page
    assert "reached_end" in page
    short = ricochet.integrate(Heater(), [20.0], 1.0)._repr_html_()
    assert "&lt;off&gt; → on" in short and "<off>" not in short
    failed = ricochet.integrate(ricochet.System(lambda t, x: x * np.inf), [1.0], 1.0)
    assert "non_finite" in failed._repr_html_() and failed.message in failed._repr_html_().replace("&#x27;", "'")


def test_a_notebook_shows_a_picture_where_there_are_states(monkeypatch):
    pytest.importorskip("matplotlib")
    from matplotlib import pyplot

    run, figures = bouncing(record_steps=True), pyplot.get_fignums()
    assert '<img width="500"' in run._repr_html_()
    assert len(run._repr_html_()) < 100_000
    assert pyplot.get_fignums() == figures  # no figure is left behind
    assert '<img' in bouncing(sample_times=np.linspace(0, 20, 50))._repr_html_()
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert "<img" not in run._repr_html_()


def test_modes_are_shaded_and_many_marks_are_small():
    matplotlib = pytest.importorskip("matplotlib")
    from matplotlib.figure import Figure

    run = ricochet.integrate(Heater(), [20.0], 1.0, record_steps=True)
    switch = run.events["t"][0]
    ax = ricochet.plot(run, unit="h", ax=Figure().subplots())
    assert ax.get_xlabel() == "t [h]" and ax.get_ylabel() == "x[0]"
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["x[0]", "<off>", "on"]
    spans = [path.get_extents() for each in ax.collections for path in each.get_paths()]
    assert [(span.x0, span.x1) for span in spans] == [(0.0, switch), (switch, 1.0)]
    plain = ricochet.plot(run, modes=False, ax=Figure().subplots())
    assert not plain.collections and plain.get_legend() is None
    one = ricochet.integrate(Heater(), [25.0], 0.1, record_steps=True)
    assert len(ricochet.plot(one, ax=Figure().subplots()).collections) == 1
    unknown = ricochet.integrate(Heater(), [20.0], 1.0, record_steps=True, record_events=False)
    assert not ricochet.plot(unknown, ax=Figure().subplots()).collections
    few, many = (ricochet.plot(bouncing(record_steps=True, **more), ax=Figure().subplots()).lines[1]
                 for more in ({}, {"h_max": 1e-2}))
    assert few.get_markersize() == many.get_markersize() > 5
    crowded = ricochet.integrate(ricochet.Pendulum(), [-0.05, 0.0], 300.0, record_steps=True)
    assert len(crowded.events) > 250
    assert ricochet.plot(crowded, ax=Figure().subplots()).lines[1].get_markersize() < 2
    assert matplotlib


def test_a_function_sees_the_progress():
    def fall(t, x):
        return [x[1], -9.81]

    own = ricochet.System(fall)
    formula = ricochet.System(fall, formula=2)
    for system in (own, formula, ricochet.BouncingBall()):
        seen = []
        run = ricochet.integrate(system, [10.0, 0.0], 2.0,
                                 progress=lambda t, end: seen.append((t, end)))
        assert seen[-1] == (2.0, 2.0) and run.success
        plain = ricochet.integrate(system, [10.0, 0.0], 2.0)
        assert run.x.tobytes() == plain.x.tobytes()
        assert run.statistics.steps == plain.statistics.steps
    seen = []
    result = ricochet.solve_ivp(fall, (0, 2), [10.0, 0.0], progress=lambda t, end: seen.append(t))
    assert seen[-1] == 2.0 and np.array_equal(result.y, ricochet.solve_ivp(fall, (0, 2), [10.0, 0.0]).y)
    seen = []
    moded = ricochet.integrate(Heater(), [20.0], 1.0, record_steps=True,
                               progress=lambda t, end: seen.append(t))
    assert seen[-1] == 1.0 and moded.times.size > 2


def test_its_exceptions_end_the_run():
    def enough(t, end):
        raise StopIteration("enough")

    with pytest.raises(StopIteration, match="enough"):
        ricochet.integrate(ricochet.System(lambda t, x: -x), [1.0], 1.0, progress=enough)
    with pytest.raises(TypeError, match="progress: found a int"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0, 0.0], 1.0, progress=3)
    with pytest.raises(TypeError, match="sample_times"):
        ricochet.integrate(ricochet.BouncingBall(), [1.0, 0.0], 1.0, progress=True,
                           record_steps=True)


@pytest.mark.parametrize("installed", [True, False])
def test_a_bar_is_drawn(installed, capsys, monkeypatch):
    if installed:
        pytest.importorskip("tqdm")
    else:
        monkeypatch.setitem(sys.modules, "tqdm.auto", None)
        monkeypatch.setitem(sys.modules, "tqdm", None)
    ricochet.integrate(ricochet.System(lambda t, x: -x), [1.0], 8.0, progress=True)
    assert re.search(r"100 ?%", capsys.readouterr().err)
    ricochet.ensemble(ricochet.BouncingBall, {"height": np.linspace(1, 2, 300)}, 1.0, progress=True)
    assert "300" in capsys.readouterr().err
