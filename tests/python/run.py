"""Runs the tests of the Python package; 77 where pytest is missing, which CTest shows as skipped."""

import importlib.util
import sys


def main(arguments):
    if importlib.util.find_spec("pytest") is None:
        print("pytest was not found: the tests of the Python package are not run")
        return 77
    import pytest

    return pytest.main(["-q", "-p", "no:cacheprovider", "-rs", *arguments])


if __name__ == "__main__":  # processes that tests start import this file
    sys.exit(main(sys.argv[1:]))
