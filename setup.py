"""Builds the Python package from the source tree: CMake compiles the library and its module.

    pip install --no-build-isolation .

needs CMake, a C++20 compiler, Eigen, Boost, fmt, nlohmann-json, NumPy and pybind11 (2.10, or 2.12
with NumPy 2), and no network. Without --no-build-isolation pip fetches the newest of the last two.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

SOURCE = Path(__file__).resolve().parent
VERSION = re.search(r"^ +VERSION ([0-9.]+)$", (SOURCE / "CMakeLists.txt").read_text(), re.M)[1]


class CMakeBuild(build_ext):
    def build_extension(self, extension):
        build = Path(self.build_temp).resolve()
        build.mkdir(parents=True, exist_ok=True)
        configure = [
            "cmake", "-S", str(SOURCE), "-B", str(build), "-DCMAKE_BUILD_TYPE=Release",
            f"-DPython_EXECUTABLE={sys.executable}", "-DRICOCHET_PYTHON=ON",
            "-DRICOCHET_PYTHON_REQUIRED=ON",
            *(f"-DRICOCHET_{part}=OFF" for part in (
                "FAULTS", "LEARN", "BUILD_APP", "BUILD_TESTS", "BUILD_EXAMPLES", "INSTALL")),
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
        # Scenes; training where CMAKE_ARGS asks for it; FMUs where what they need is there.
        for part in ("_scenes", "_learn", "_fmi"):
            for further in (build / "python" / "ricochet").glob(f"{part}.*"):
                self.copy_file(str(further), str(target.parent / further.name))


setup(
    version=VERSION,
    packages=["ricochet"],
    package_dir={"": "python"},
    package_data={"ricochet": ["*.pyi", "py.typed"]},
    ext_modules=[Extension("ricochet._ricochet", sources=[])],
    cmdclass={"build_ext": CMakeBuild},
)
