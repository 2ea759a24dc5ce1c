"""Runs the tests of the Python package; 77 where pytest is missing, which CTest shows as skipped."""

import importlib.util
import sys

if importlib.util.find_spec("pytest") is None:
    print("pytest was not found: the tests of the Python package are not run")
    sys.exit(77)

import pytest

sys.exit(pytest.main(["-q", "-p", "no:cacheprovider", "-rs", *sys.argv[1:]]))
