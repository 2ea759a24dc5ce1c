"""Rate-and-state friction, the slider and the fault. Numbers in hexadecimal are what C++ gives for the same calls."""

import math
import os
import signal
import threading

import numpy as np
import pytest

import ricochet

faults = pytest.importorskip("ricochet.faults", reason="a build without faults")


def hexadecimal(numbers):
    return [float(number).hex() for number in numbers]


def half_as_stiff(**members):
    """The slider of examples/rate_and_state.cpp."""
    rock = faults.Friction()
    stiffness = 0.5 * rock.critical_stiffness(1, 9.81, 1.5e-4)
    return faults.SpringSlider(rock, **{"stiffness": stiffness, "load_velocity": 1.5e-4, **members})


def test_laws_are_those_of_cpp():
    rock = faults.Friction(effect="log")
    friction, rate = rock.evaluate(2e-4, 0.3)
    assert abs(friction - (0.5109 + 0.011 * math.log(2) + 0.016 * 0.3)) < 1e-15
    assert abs(rate - (1e-4 * math.exp(-0.3) - 2e-4) / 1e-6) < 1e-12
    assert hexadecimal(faults.Friction().evaluate(2e-4, 0.3)) == ["0x1.0bf1345779745p-1", "-0x1.f7ac36d5f471dp+6"]
    friction, rate = rock.evaluate([[1e-4], [2e-4]], [0.0, 0.3, 0.6])
    assert friction.shape == rate.shape == (2, 3) and friction[1, 1] == rock.evaluate(2e-4, 0.3)[0]
    # The rate vanishes in the steady state of each law, xi = -log(V / V*); PRZ has its own: theta = 2 D / V.
    for evolution, steady in ("ageing", 0.0), ("slip", 0.0), ("prz", math.log(2)):
        law = faults.Friction(evolution=evolution)
        assert abs(law.evaluate(3e-4, steady - math.log(3))[1]) < 1e-9


def test_the_slider_has_the_bits_of_cpp():
    slider = half_as_stiff()
    assert hexadecimal([slider.largest_convex_step]) == ["0x1.6f551ae603011p-9"]
    run = slider.run(1.0, threshold=1e-3, samples=11)
    assert run.success and run.steps == 20355 and run.unsolved == 0
    assert list(run.events["kind"]) == ["onset", "arrest"] * 4
    assert hexadecimal(run.events["t"]) == [
        "0x1.1a7610596620bp-2", "0x1.25cf2f4cb108dp-2", "0x1.cf0160a812318p-2", "0x1.dc68e4653d1fap-2",
        "0x1.4d1d4323fd758p-1", "0x1.5416967cef9a8p-1", "0x1.b7033dbef1fe2p-1", "0x1.be117bd2aafe8p-1"]
    assert hexadecimal(run.state.item()) == [
        "0x1.0000000000000p+0", "0x1.35d4150ab07dbp-13", "0x1.789358de8c42ep-18", "0x1.33fe5d1f991e4p+1"]
    np.testing.assert_allclose(run.samples["t"], np.linspace(0, 1, 11), atol=1e-15)
    assert run.samples["x"][-1] == run.state["x"]
    coarse = slider.run(1000.0, order=2, step=1.0)
    assert coarse.steps == 1000 and coarse.unsolved == 0
    assert hexadecimal([coarse.state["x"]]) == ["0x1.33338d433572dp-3"]


def test_the_slider_is_pulled_by_pieces():
    # Far below the speed V* of the start nothing slips once the load stands still.
    run = half_as_stiff(load_velocity=[(0, 1e-4), (0.5, 0.0)]).run(2.0, threshold=1e-3)
    assert run.success and run.state["v"] < 1e-5 and run.state["t"] == 2.0


def test_the_rupture_has_the_bits_of_cpp():
    fault = faults.Fault(20)
    run = fault.rupture(30.0, snapshot_times=[6.5, 8.15, 9.5])
    assert run.outcome == "at_rest" and run.success
    assert (run.statistics["arrests"], run.statistics["steps"]) == (400, 226)
    assert hexadecimal([run.mean_slip, run.peak_time, run.peak_velocity, run.rest_time]) == [
        "0x1.fdc4f625b5f82p-3", "0x1.0488bbdf50fc5p+3", "0x1.4ec908b10dccfp-4", "0x1.695771518c12cp+3"]
    assert run.slip.shape == (20, 20) and run.snapshots["velocity"].shape == (3, 20, 20)
    assert hexadecimal([run.snapshots["velocity"][1, 9, 10]]) == ["0x1.07fc7227eb6b2p-3"]
    assert abs(run.slip.mean() - run.mean_slip) < 1e-12 and len(run.times) == len(run.mean_slips)
    np.testing.assert_allclose(fault.depths, 3000 / 20 * (np.arange(20) + 0.5), rtol=1e-12)


def test_implicit_steps_are_chosen_by_rules():
    fault = faults.Fault(4)
    constant = fault.rupture(30.0, step=0.125, integrator="bathe")
    assert hexadecimal([constant.mean_slip]) == ["0x1.fafac26e014d6p-3"] and constant.statistics["steps"] == 89
    by_error = fault.rupture(30.0, step=0.125, integrator="bathe", controller="error", rtol=1e-4)
    assert abs(by_error.mean_slip - constant.mean_slip) < 1e-3
    policy = os.path.join(os.environ.get("RICOCHET_SOURCE", "."), "models", "fault-step.safetensors")
    learned = fault.rupture(30.0, step=0.125, integrator="bathe", controller="learned", policy=policy)
    assert learned.success and learned.statistics["asked"] > 0
    assert abs(learned.mean_slip - constant.mean_slip) < 1e-2


def test_cycles_have_the_bits_of_cpp():
    run = faults.Fault(3).earthquakes(1e9, faults.FaultFriction(overload=1e-3), rtol=1e-3)
    assert run.success and run.statistics["steps"] == 6274 and len(run.earthquakes) == 14
    assert hexadecimal(run.earthquakes["start"][:2]) == ["0x1.69a26508d6ad2p+27", "0x1.69ab5e4f8c8dcp+27"]
    assert hexadecimal(run.earthquakes["mean_slip"][-1:]) == ["0x1.16997339e69c0p-4"]
    assert run.xi.shape == (3, 3) and len(run.fastest) == len(run.step_times) == 6275


def test_the_fault_is_a_system_for_any_method():
    friction = faults.FaultFriction(plate_velocity=1e-3, slip_rate=2e-3, overload=1e-3)
    system = faults.Fault(3).system(friction)
    run = ricochet.integrate(system, system.start(), 30.0, rtol=1e-6, atol=1e-6, method="rosenbrock4")
    assert hexadecimal([system.slip(run.t, run.x)[1, 1]]) == ["0x1.9505324e49ba2p-6"]
    assert run.success and run.statistics.steps == 50 and run.statistics.jacobians > 0
    run = ricochet.integrate(system, system.start(), 3.0, rtol=1e-8, atol=1e-8)
    assert hexadecimal([system.slip(run.t, run.x)[1, 1]]) == ["0x1.8679422bb776fp-8"]
    assert system.velocity(run.x).shape == (3, 3) and (system.velocity(run.x) > 0).all()
    # It outlives what it was made of, and runs without the interpreter.
    again = ricochet.integrate(faults.Fault(3).system(friction), system.start(), 3.0, rtol=1e-8, atol=1e-8)
    assert hexadecimal(again.x) == hexadecimal(run.x)


@pytest.mark.parametrize("call, error, words", [
    (lambda: faults.Friction(a=-1), ValueError, "a must be positive"),
    (lambda: faults.Friction(evolution="aging"), ValueError, "evolution: found 'aging', expected one of .*'ageing'"),
    (lambda: faults.Friction(effect="log").evaluate(0.0, 0.0), ValueError, "asinh"),
    (lambda: faults.Friction().evaluate("fast", 0), TypeError, "v: found 'fast', expected numbers"),
    (lambda: faults.SpringSlider(friction=0.6), TypeError, "friction: found a float, expected a Friction"),
    (lambda: faults.SpringSlider(mass=0), ValueError, "mass must be positive"),
    (lambda: faults.SpringSlider(load_velocity=[1, 2]), ValueError, r"load_velocity: found shape \(2,\)"),
    (lambda: faults.SpringSlider(load_velocity=[(1, 1), (0, 1)]).run(1), ValueError, "rise|ascend|before"),
    (lambda: half_as_stiff().run(1, order=3), ValueError, "order"),
    (lambda: half_as_stiff().run(1, samples=1.5), ValueError, "samples: found 1.5, expected a whole number"),
    (lambda: half_as_stiff().run(math.nan), ValueError, "t_end"),
    (lambda: faults.Fault(0), ValueError, "elements"),
    (lambda: faults.Fault(2.5), ValueError, "elements: found 2.5, expected a whole number"),
    (lambda: faults.Fault(2, poisson=0.6), ValueError, "poisson"),
    (lambda: faults.Fault(2, medium="air"), ValueError, "medium: found 'air'"),
    (lambda: faults.Fault(2, kernel="absent.npy"), ValueError, "absent.npy"),
    (lambda: faults.Fault(2).rupture(-1), ValueError, "t_end"),
    (lambda: faults.Fault(2).rupture(30, controller="pi"), ValueError, "controller: found 'pi' of explicit steps"),
    (lambda: faults.Fault(2).rupture(30, step=0.1, integrator="bathe", controller="learned"), ValueError, "policy"),
    (lambda: faults.Fault(2).rupture(30, step=0.1, integrator="bathe-published", controller="error"), ValueError,
     "averaged"),
    (lambda: faults.Fault(2).earthquakes(1, order=3), ValueError, "order"),
    (lambda: faults.Fault(2).earthquakes(1, friction=faults.Friction()), TypeError, "expected a FaultFriction"),
    (lambda: faults.Fault(2).earthquakes(1, faults.FaultFriction(slip_rate=0)), ValueError, "slip_rate"),
    (lambda: faults.FaultSystem(3), TypeError, "fault: found a int, expected a Fault"),
    (lambda: faults.Fault(2).system(faults.FaultFriction(slip_rate=-1e-9)), ValueError, "slip_rate"),
    (lambda: ricochet.integrate(faults.Fault(2).system(), [0.0] * 5, 1.0), ValueError, "3 components for each of 4 elements"),
])
def test_what_does_not_fit_is_named(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_an_interrupt_ends_a_long_run():
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        faults.Fault(20).earthquakes(1e12, faults.FaultFriction(overload=1e-3), rtol=1e-6, max_steps=10**9)
    timer.join()


def test_everything_public_has_a_docstring():
    for name in faults.__all__:
        thing = getattr(faults, name)
        assert thing.__doc__
        for member, value in vars(thing).items():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"
