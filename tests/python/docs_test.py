"""Every block in Python of the pages, every script of examples/python/, and the stubs."""

import ast
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import ricochet
from ricochet import _ricochet

SOURCE = Path(os.environ.get("RICOCHET_SOURCE", Path(__file__).parents[2]))


@pytest.mark.parametrize("page, least", [("README.md", 1), ("docs/clocks.md", 1), ("docs/phases.md", 1), ("docs/contact.md", 1), ("docs/fault.md", 1), ("docs/rate-and-state.md", 1), ("docs/python.md", 4), ("docs/python-systems.md", 5),
                                         ("docs/python-ensembles.md", 5), ("docs/python-more.md", 4),
                                         ("docs/fmi.md", 1), ("docs/derivatives.md", 5), ("docs/learned-guards.md", 1), ("python/README.md", 1)])
def test_blocks_of_the_page_run(page, least, tmp_path, monkeypatch):
    # One after the other, in one module, as a reader would; a comment `# -> text` after an expression or a
    # print says what it gives.
    text = (SOURCE / page).read_text()
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.M | re.S)
    assert len(blocks) >= least
    ball = Path(os.environ.get("RICOCHET_FMUS", ""), "fmu_ball.fmu")
    if page == "docs/fmi.md":
        if not ball.exists():
            pytest.skip("a build without FMI")
        (tmp_path / "ball.fmu").symlink_to(ball)
        monkeypatch.chdir(tmp_path)
    if page == "docs/derivatives.md" and not find_spec("ricochet._gradients"):
        pytest.skip("a build without gradients")
    if page in ("docs/fault.md", "docs/rate-and-state.md") and not find_spec("ricochet._faults"):
        pytest.skip("a build without faults")
    names = {}
    for block in blocks:
        for missing in ("numba", "cffi", "matplotlib", "scipy", "torch"):
            if re.search(rf"import {missing}|from {missing}", block):
                pytest.importorskip(missing)
        if "train_classifier(" in block and not find_spec("ricochet._learn"):
            continue  # a package without training
        exec(compile(block, page, "exec"), names)


@pytest.mark.parametrize("script", sorted((SOURCE / "examples" / "python").glob("*.py")),
                         ids=lambda path: path.stem)
def test_examples_draw_their_picture(script, tmp_path):
    pytest.importorskip("matplotlib")
    if "ricochet.sensitivities" in script.read_text() and not find_spec("ricochet._gradients"):
        pytest.skip("a build without gradients")
    if "ricochet import faults" in script.read_text() and not find_spec("ricochet._faults"):
        pytest.skip("a build without faults")
    picture = tmp_path / "picture.svg"
    subprocess.run([sys.executable, str(script), str(picture)], check=True, timeout=60)
    assert picture.stat().st_size > 5000


def declared(body):
    return {node.name for node in body if isinstance(node, (ast.FunctionDef, ast.ClassDef))} | {
        node.target.id for node in body if isinstance(node, ast.AnnAssign)}


def test_stubs_declare_what_there_is():
    package = Path(ricochet.__file__).parent
    public = ast.parse((package / "__init__.pyi").read_text() +
                       (package / "_ready.pyi").read_text())
    assert set(ricochet.__all__) <= declared(public.body)
    classes = {node.name: declared(node.body) for node in public.body
               if isinstance(node, ast.ClassDef)}
    for name in ("Run", "Solution", "Snapshot", "Simulation", "Monitor", "Network"):
        found = {member for member in vars(getattr(_ricochet, name)) if not member.startswith("_")}
        assert found <= classes[name], name


def test_everything_public_has_a_docstring():
    for name in ricochet.__all__:
        thing = getattr(ricochet, name)
        if callable(thing):
            assert thing.__doc__, name
        for member, value in vars(thing).items() if isinstance(thing, type) else ():
            if not member.startswith("_") and (callable(value) or isinstance(value, property)):
                assert value.__doc__, f"{name}.{member}"


def test_importing_needs_numpy_alone():
    code = ("import sys, numpy; before = set(sys.modules); import ricochet; "
            "print(*{m.split('.')[0] for m in set(sys.modules) - before})")
    out = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert not {"scipy", "matplotlib", "numba", "cffi", "ctypes"} & set(out.stdout.split())
