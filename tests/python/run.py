"""Runs the tests of the Python package; 77, which CTest shows as skipped, where pytest is missing or a file skips itself."""

import importlib.util
import sys


def main(arguments):
    if importlib.util.find_spec("pytest") is None:
        print("pytest was not found: the tests of the Python package are not run")
        return 77
    import pytest

    status = pytest.main(["-q", "-p", "no:cacheprovider", "-rs", *arguments])
    return 77 if status == pytest.ExitCode.NO_TESTS_COLLECTED else status


if __name__ == "__main__":  # processes that tests start import this file
    sys.exit(main(sys.argv[1:]))
