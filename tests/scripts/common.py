"""What the tests of scripts share."""
import importlib.machinery
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True


def script(name):
    """A script as a module."""
    loader = importlib.machinery.SourceFileLoader(name, str(ROOT / "scripts" / name))
    module = importlib.util.module_from_spec(importlib.util.spec_from_loader(name, loader))
    loader.exec_module(module)
    return module


def output(*command, folder=ROOT):
    """What a command prints; it must not fail."""
    return subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout


def version():
    """The version of the project."""
    return re.search(r"^    VERSION ([\d.]+)$", (ROOT / "CMakeLists.txt").read_text(), re.M)[1]
