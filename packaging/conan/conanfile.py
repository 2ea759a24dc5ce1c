"""A recipe for Conan 2 beside its sources: `conan create packaging/conan` packages the tree that it is in."""
import re
from pathlib import Path

from conan import ConanFile
from conan.errors import ConanInvalidConfiguration
from conan.tools.build import check_min_cppstd
from conan.tools.cmake import CMake, CMakeDeps, CMakeToolchain, cmake_layout
from conan.tools.files import copy

COMPONENTS = ("nonsmooth", "sensitivity", "scene", "faults", "learn", "learn_steps", "c")
STANDS_ON = {"faults": ["nonsmooth"], "learn_steps": ["learn", "faults"]}
WITHOUT = ("PYTHON", "BUILD_APP", "BUILD_EXAMPLES", "BUILD_TESTS")


class Ricochet(ConanFile):
    name = "ricochet"
    license = "MIT"
    description = "Hybrid systems: smooth motion, events, resets"
    topics = ("hybrid systems", "events", "ordinary differential equations", "differential inclusions", "contact")
    package_type = "static-library"
    settings = "os", "arch", "compiler", "build_type"
    options = {component: [True, False] for component in COMPONENTS}
    default_options = {component: False for component in COMPONENTS}

    @property
    def tree(self):
        return Path(self.recipe_folder).parents[1]

    def set_version(self):
        self.version = re.search(r"^ +VERSION ([0-9.]+)$", (self.tree / "CMakeLists.txt").read_text(), re.M)[1]

    def export_sources(self):
        for pattern in ("CMakeLists.txt", "LICENSE*", "cmake/*", "include/*", "models/*", "src/*"):
            copy(self, pattern, self.tree, self.export_sources_folder)

    def layout(self):
        cmake_layout(self)

    def requirements(self):
        self.requires("eigen/[>=3.4 <4]", transitive_headers=True)
        self.requires("boost/[>=1.74 <2]", transitive_headers=True, options={"header_only": True})
        self.requires("fmt/[>=9 <12]")
        self.requires("nlohmann_json/[>=3.11 <4]", visible=False)

    def validate(self):
        check_min_cppstd(self, 20)
        if self.settings.os != "Linux":
            raise ConanInvalidConfiguration("ricochet is built on Linux, by g++ or clang")
        for component, needed in STANDS_ON.items():
            missing = [other for other in needed if not self.options.get_safe(other)]
            if self.options.get_safe(component) and missing:
                raise ConanInvalidConfiguration(f"ricochet: {component} needs {' and '.join(missing)}")

    def generate(self):
        toolchain = CMakeToolchain(self)
        for component in COMPONENTS:
            toolchain.cache_variables[f"RICOCHET_{component.upper()}"] = bool(self.options.get_safe(component))
        for part in WITHOUT:
            toolchain.cache_variables[f"RICOCHET_{part}"] = False
        toolchain.generate()
        CMakeDeps(self).generate()

    def build(self):
        cmake = CMake(self)
        cmake.configure()
        cmake.build()

    def package(self):
        CMake(self).install()
        copy(self, "LICENSE*", self.source_folder, Path(self.package_folder) / "licenses")

    def package_info(self):
        # The package's own files of CMake are found, with its components and targets.
        self.cpp_info.set_property("cmake_find_mode", "none")
        self.cpp_info.builddirs = ["lib/cmake/ricochet"]
        self.cpp_info.libs = ["ricochet"]
