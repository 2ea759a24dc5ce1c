"""Runs all tests of the Python package on the package that is installed, of wheels for instance; 77 where pytest is missing.

usage: installed.py [further arguments of pytest]
"""

import os
import sys
from pathlib import Path

import run

HERE = Path(__file__).resolve().parent


def main():
    os.environ.setdefault("RICOCHET_SOURCE", str(HERE.parents[1]))
    os.environ.setdefault("MPLBACKEND", "Agg")
    import ricochet

    print(f"ricochet {ricochet.__version__} of {Path(ricochet.__file__).parent}", flush=True)
    return run.main([*sys.argv[1:], *map(str, sorted(HERE.glob("*_test.py")))])


if __name__ == "__main__":  # processes that tests start import this file
    sys.exit(main())
