"""The notebooks of examples/python/notebooks/: every cell runs, also in a kernel where there is one."""

import json
import os
from importlib.util import find_spec
from pathlib import Path

import pytest

SOURCE = Path(os.environ.get("RICOCHET_SOURCE", Path(__file__).parents[2]))
NOTEBOOKS = sorted((SOURCE / "examples" / "python" / "notebooks").glob("*.ipynb"))


def ids(path):
    return path.stem


def test_there_are_notebooks():
    assert len(NOTEBOOKS) == 3


@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_every_cell_runs(path):
    book = json.loads(path.read_text(encoding="utf-8"))
    code = ["".join(cell["source"]) for cell in book["cells"] if cell["cell_type"] == "code"]
    if any("ricochet.Scene" in cell for cell in code) and not find_spec("ricochet._scenes"):
        pytest.skip("the package was built without scenes")
    assert any("assert " in cell for cell in code)
    names = {}
    for number, cell in enumerate(code):
        exec(compile(cell, f"{path.name}, code {number}", "exec"), names)
    assert all(not cell.get("outputs") for cell in book["cells"])  # none are kept


@pytest.mark.parametrize("path", NOTEBOOKS, ids=ids)
def test_it_runs_in_a_kernel(path):
    nbformat = pytest.importorskip("nbformat", reason="nbformat was not found")
    nbclient = pytest.importorskip("nbclient", reason="nbclient was not found")
    pytest.importorskip("ipykernel", reason="ipykernel was not found")
    book = nbformat.read(path, as_version=4)
    nbformat.validate(book)
    nbclient.NotebookClient(book, timeout=120, kernel_name="python3").execute()
    shown = [output for cell in book.cells for output in cell.get("outputs", ())]
    assert any("text/html" in output.get("data", {}) for output in shown) or "ensembles" in path.stem
