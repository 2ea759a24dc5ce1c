"""What an import of the package loads, and that the rest is found when it is asked for."""

import pickle
import subprocess
import sys

import pytest

import ricochet

RARE = ["concurrent.futures", "difflib", "html", "ricochet._ensemble", "ricochet._fmu", "ricochet._monitor", "ricochet._plot",
        "ricochet._scene", "ricochet._scenes", "ricochet._training"]


def test_an_import_loads_only_what_most_programs_use():
    program = f"import numpy, sys; before = set(sys.modules); import ricochet; print(*set({RARE}) & (set(sys.modules) - before))"
    out = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert out.split() == []


@pytest.mark.parametrize("name", ricochet.__all__)
def test_every_public_name_is_found(name):
    assert getattr(ricochet, name) is getattr(ricochet, name)
    assert name in dir(ricochet)


def test_another_name_is_missed_by_name():
    with pytest.raises(AttributeError, match="module 'ricochet' has no attribute 'solve_ipv'"):
        ricochet.solve_ipv
    assert not hasattr(ricochet, "_nothing")


def test_names_come_by_a_star_and_from_a_process_that_has_not_used_them():
    names = {}
    exec("from ricochet import *", names)
    assert set(ricochet.__all__) <= set(names)
    kind = pickle.loads(pickle.dumps(ricochet.SceneKind.HELD))
    assert kind is ricochet.SceneKind.HELD
