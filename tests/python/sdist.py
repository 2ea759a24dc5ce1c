"""Builds the source distribution, a wheel from it, and runs the Python tests on the installed wheel.

usage: sdist.py PYTHON SOURCE_TREE [DIRECTORY], where both are kept; 77: pip cannot fetch the build requirements

All of it in environments of its own, with build isolation: CMake is told to look for nothing in the system, so that a
compiler and Python have to be enough. Prints the processor time of the build, and what the wheel weighs.
"""

import os
import resource
import shutil
import subprocess
import sys
import tarfile
import tempfile
import zipfile
from email import message_from_string
from pathlib import Path

#: What the sources of a distribution are made of; a copy, so that nothing is left in the source tree.
TREE = ("CMakeLists.txt", "LICENSE", "LICENSE-THIRD-PARTY", "MANIFEST.in", "README.md", "cmake", "docs", "examples", "include",
        "models", "pyproject.toml", "python", "setup.py", "src", "tests")
MOST_BYTES = 2_650_000  # what it weighs with all that scenes have, and a hundredth more; the aim is 2 MB
MOST_SYMBOLS = 100


def run(*command, **options):
    subprocess.run([str(word) for word in command], check=True, **options)


def environment(python, folder, *packages):
    """The interpreter of a fresh virtual environment with packages in it."""
    run(python, "-m", "venv", folder)
    inside = folder / "bin" / "python"
    installed = subprocess.run(
        [inside, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "1", "--timeout", "20",
         *packages])
    if installed.returncode:
        print(f"skipped: pip could not fetch {', '.join(map(str, packages))}")
        sys.exit(77)
    return inside


def build_sdist(tools, source, work):
    tree = work / "tree"
    tree.mkdir()
    for name in TREE:
        path = source / name
        shutil.copytree(path, tree / name) if path.is_dir() else shutil.copy(path, tree / name)
    run(tools, "-m", "build", "--sdist", "--outdir", work, tree)
    sdist, = work.glob("ricochet-*.tar.gz")
    with tarfile.open(sdist) as files:
        print(f"{sdist.name}: {sdist.stat().st_size} bytes, {len(files.getnames())} files")
    return sdist


def build_wheel(python, sdist, work):
    """The wheel that pip makes of the source distribution, and the processor time that this takes [s]."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run(python, "-m", "pip", "wheel", "--disable-pip-version-check", "--no-deps", "--wheel-dir", work, sdist,
        env=dict(os.environ, CMAKE_ARGS="-DCMAKE_FIND_USE_CMAKE_SYSTEM_PATH=OFF"))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    wheel, = work.glob("ricochet-*.whl")
    return wheel, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def exported(module):
    """Names that a compiled module exports."""
    out = subprocess.run(["nm", "-D", "--defined-only", module], capture_output=True, text=True, check=True).stdout
    return [line.split()[-1] for line in out.splitlines()]


def check_wheel(wheel, work):
    size = wheel.stat().st_size
    with zipfile.ZipFile(wheel) as files:
        files.extractall(work / "unpacked")
        names = set(files.namelist())
        modules = [name for name in names if name.endswith(".so")]
        metadata, = (files.read(name).decode() for name in names if name.endswith("dist-info/METADATA"))
    symbols = [name for module in modules for name in exported(work / "unpacked" / module)]
    print(f"{wheel.name}: {size} bytes, {', '.join(sorted(modules))}, exports {len(symbols)} symbols")
    assert size <= MOST_BYTES, f"expected at most {MOST_BYTES} bytes"
    assert len(symbols) <= MOST_SYMBOLS, symbols
    assert {"PyInit__ricochet", "PyInit__scenes"} <= set(symbols), symbols
    assert {"ricochet/py.typed", "ricochet/__init__.pyi", "ricochet/_scenes.py"} <= names, names
    check_metadata(metadata)


def check_metadata(text):
    metadata = message_from_string(text)
    assert metadata["License-Expression"] == "MIT", metadata.items()
    assert set(metadata.get_all("License-File")) == {"LICENSE", "LICENSE-THIRD-PARTY"}, metadata.items()
    assert metadata["Author"] == "The ricochet authors", metadata.items()
    assert "predictive monitoring" in metadata["Keywords"], metadata["Keywords"]
    # An index shows this text by itself: a relative link would lead nowhere.
    description = metadata.get_payload()
    assert "solve_ivp" in description
    for link in description.split("](")[1:]:
        assert link.startswith(("https://", "#")), link[:60]


def main(python, source, kept=None):
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        tools = environment(python, work / "tools", "build")
        sdist = build_sdist(tools, source, work)
        wheel, seconds = build_wheel(environment(python, work / "plain", "pip"), sdist, work)
        print(f"pip made the wheel in {seconds:.0f} s of processor time")
        check_wheel(wheel, work)
        inside = environment(python, work / "inside", f"{wheel}[test]")
        # The tests of the distribution, not those of the tree: it has to be complete.
        with tarfile.open(sdist) as files:
            files.extractall(work, filter="data") if hasattr(tarfile, "data_filter") else files.extractall(work)
        unpacked = work / sdist.name.removesuffix(".tar.gz")
        clean = {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "RICOCHET_SOURCE")}
        run(inside, unpacked / "tests" / "python" / "installed.py", cwd=work, env=clean)
        if kept:
            Path(kept).mkdir(parents=True, exist_ok=True)
            for file in (sdist, wheel):
                shutil.copy(file, kept)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]).resolve(), *sys.argv[3:])
