"""The stubs: complete, true to the package, and enough for strictly checked programs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import ricochet

EXAMPLES = Path(__file__).with_name("typed_examples.py")
#: What the compiled module does not show: signatures of classes that only the library makes, and
#: the metaclass of pybind11.
ALLOWED = r"""
ricochet\.(Monitor|Network|Run|Simulation|Snapshot|Solution|Times)
ricochet\.(Run|Snapshot|Solution)\.__init__
"""


@pytest.fixture
def mypy(tmp_path):
    """Runs a module of mypy on the stubs alone, as a program that uses the package sees them."""
    pytest.importorskip("mypy")
    package = Path(ricochet.__file__).parent
    stubs = tmp_path / "stubs" / "ricochet"
    stubs.mkdir(parents=True)
    for name in ("__init__.pyi", "_ready.pyi", "py.typed"):
        (stubs / name).write_text((package / name).read_text())

    def run(*arguments):
        environment = dict(os.environ, MYPYPATH=str(stubs.parent), PYTHONPATH=str(package.parent),
                           MYPY_CACHE_DIR=str(tmp_path / "cache"))
        out = subprocess.run([sys.executable, "-m", *arguments], cwd=tmp_path, env=environment,
                             capture_output=True, text=True)
        assert out.returncode == 0, out.stdout + out.stderr
    return run


def test_examples_run():
    subprocess.run([sys.executable, str(EXAMPLES)], check=True)


def test_examples_have_types(mypy):
    mypy("mypy", "--strict", str(EXAMPLES))


def test_stubs_are_those_of_the_package(mypy, tmp_path):
    (tmp_path / "allowed").write_text(ALLOWED)
    mypy("mypy.stubtest", "ricochet", "--concise", "--ignore-missing-stub", "--allowlist",
         str(tmp_path / "allowed"), "--ignore-unused-allowlist")


def test_the_stubs_of_ready_systems_are_what_their_script_prints():
    source = os.environ.get("RICOCHET_SOURCE")
    if not source or not (Path(source) / "scripts" / "ready_stubs").exists():
        pytest.skip("RICOCHET_SOURCE has no scripts/ready_stubs")
    package = Path(ricochet.__file__).parent
    environment = dict(os.environ, PYTHONPATH=str(package.parent))
    out = subprocess.run([sys.executable, str(Path(source) / "scripts" / "ready_stubs")],
                         env=environment, capture_output=True, text=True, check=True)
    assert out.stdout == (package / "_ready.pyi").read_text()
