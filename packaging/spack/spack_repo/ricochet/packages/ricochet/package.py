# A recipe for Spack 1.0 and later beside its sources: it builds the last commit of the tree that it is in.
from pathlib import Path

from spack_repo.builtin.build_systems.cmake import CMakePackage

from spack.package import *


class Ricochet(CMakePackage):
    """Hybrid systems: smooth motion, events, resets."""

    git = f"file://{Path(__file__).resolve().parents[6]}"

    license("MIT")

    version("main", branch="main")

    variant("nonsmooth", default=False, description="Set-valued motion: inclusions, contacts")
    variant("sensitivity", default=False, description="Derivatives through events, periodic orbits")
    variant("scene", default=False, description="Scenes of many bodies")
    variant("faults", default=False, description="Rate-and-state friction, slider, strike-slip fault")
    variant("learn", default=False, description="Classifiers, gates, certificates")
    variant("learn_steps", default=False, description="Policies that choose steps, reinforcement learning, laws of friction")
    variant("c", default=False, description="The interface for C, a shared library")

    conflicts("~nonsmooth", when="+faults")
    conflicts("~faults", when="+learn_steps")
    conflicts("~learn", when="+learn_steps")
    requires("%gcc@12:", "%clang@14:", policy="one_of")

    depends_on("c", type="build", when="+c")
    depends_on("cxx", type="build")
    depends_on("cmake@3.25:", type="build")
    depends_on("nlohmann-json@3.11:3", type="build")
    depends_on("eigen@3.4:3")
    depends_on("boost@1.74:")
    depends_on("fmt@9:11")

    def cmake_args(self):
        parts = ("nonsmooth", "sensitivity", "scene", "faults", "learn", "learn_steps", "c")
        without = ("PYTHON", "BUILD_APP", "BUILD_EXAMPLES", "BUILD_TESTS")
        return [
            *(self.define_from_variant(f"RICOCHET_{part.upper()}", part) for part in parts),
            *(self.define(f"RICOCHET_{part}", False) for part in without),
        ]
