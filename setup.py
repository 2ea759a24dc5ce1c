"""Builds the Python package from the source tree: CMake compiles the library and its modules.

    pip install .                         needs a C++20 compiler; pip fetches the rest
    pip install --no-build-isolation .    needs CMake, Eigen, Boost, fmt, nlohmann-json, NumPy and pybind11 (2.10,
                                          or 2.12 with NumPy 2) as well, and no network

The metadata is in pyproject.toml, except for what setuptools of Debian 12 would refuse there. CMAKE_ARGS has further
options of CMake: -DRICOCHET_LEARN=ON adds training, -DRICOCHET_SENSITIVITY=ON gradients.
"""

import importlib.util
import os
import re
import subprocess
import sys
from pathlib import Path
from shutil import which

import setuptools
from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = Path(__file__).resolve().parent
VERSION = re.search(r"^ +VERSION ([0-9.]+)$", (SOURCE / "CMakeLists.txt").read_text(), re.M)[1]
LEFT_OUT = ("LEARN", "SENSITIVITY", "FAULTS", "C", "BUILD_APP", "BUILD_TESTS", "BUILD_EXAMPLES", "INSTALL")


def headers_of_pip():
    """Options that tell CMake where the build requirements of pyproject.toml have their headers."""
    prefixes = [str(path) for path in (Path(entry, "cmeel.prefix") for entry in sys.path) if path.is_dir()]
    includes = [f"{prefix}/include" for prefix in prefixes]
    options = []
    for package in ("nlohmann_json", "libboost_headers"):
        found = importlib.util.find_spec(package)
        if found:
            includes.append(str(Path(found.origin).parent / "include"))
            if package == "libboost_headers":  # before a Boost of the system, which may have CMake's files
                options.append("-DBoost_NO_BOOST_CMAKE=ON")
    if includes:
        options.append(f"-DCMAKE_INCLUDE_PATH={';'.join(includes)}")
    if prefixes:
        options.append(f"-DCMAKE_PREFIX_PATH={';'.join(prefixes)}")
    return options


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        build = Path(self.build_temp).resolve()
        build.mkdir(parents=True, exist_ok=True)
        # --fresh, since pip has removed the programs and headers that an earlier build was configured with.
        configure = [
            "cmake", "--fresh", *(["-GNinja"] if which("ninja") else []), "-S", str(SOURCE), "-B", str(build),
            "-DCMAKE_BUILD_TYPE=Release", "-DRICOCHET_WHEEL=ON",
            f"-DPython_EXECUTABLE={sys.executable}", "-DRICOCHET_PYTHON=ON", "-DRICOCHET_PYTHON_REQUIRED=ON",
            *(f"-DRICOCHET_{part}=OFF" for part in LEFT_OUT), *headers_of_pip(),
            *os.environ.get("CMAKE_ARGS", "").split(),
        ]
        subprocess.run(configure, check=True)
        jobs = os.environ.get("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
        subprocess.run(["cmake", "--build", str(build), "--target", "ricochet_python",
                        "--parallel", jobs], check=True)
        module, = (build / "python" / "ricochet").glob("_ricochet.*")
        target = Path(self.get_ext_fullpath(extension.name)).resolve()
        target.parent.mkdir(parents=True, exist_ok=True)
        self.copy_file(str(module), str(target))
        # Where a further part is in the module; FMUs are where what they need is there.
        for part in ("_scenes", "_learn", "_gradients", "_faults", "_fmi"):
            for further in (build / "python" / "ricochet").glob(f"{part}.*"):
                self.copy_file(str(further), str(target.parent / further.name))


# The name of the keyword has changed with the metadata, in setuptools 77.
licence = "license_expression" if int(setuptools.__version__.split(".")[0]) >= 77 else "license"
setup(
    version=VERSION,
    **{licence: "MIT"},
    packages=["ricochet"],
    package_dir={"": "python"},
    package_data={"ricochet": ["*.pyi", "py.typed"]},
    ext_modules=[Extension("ricochet._ricochet", sources=[])],
    cmdclass={"build_ext": CMakeBuild},
)
