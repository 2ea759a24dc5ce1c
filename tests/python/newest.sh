#!/usr/bin/env bash
# Tests the Python package with the newest NumPy, SciPy and pybind11 that pip can fetch, in a
# virtual environment in the build tree; only the module is compiled again.
# usage: newest.sh PYTHON CMAKE BUILD_TREE SOURCE_TREE; 77: pip cannot fetch them
set -euo pipefail
python=$1 cmake=$2 build=$3 source=$4
room=$build/newest_python
venv=$room/venv/bin/python

if ! [ -x "$venv" ]; then
    "$python" -m venv "$room/venv" || { echo "skipped: $python makes no virtual environment"; exit 77; }
fi
"$venv" -m pip install --quiet --disable-pip-version-check --retries 1 --timeout 20 --upgrade \
    numpy scipy pybind11 pytest cffi mypy pandas xarray tqdm distributed matplotlib nbclient nbformat ipykernel ||
    { echo "skipped: pip could not fetch NumPy, SciPy, pybind11 and pytest"; exit 77; }
"$venv" -m pip list --disable-pip-version-check

for component in core taylor nonsmooth scene scene_contact; do
    "$cmake" --install "$build" --component "$component" --prefix "$room/core" >/dev/null
done
# Not optimised: what the module does is tested, not how fast it is.
"$cmake" -S "$source/tests/python/newest" -B "$room/build" -G Ninja -DCMAKE_CXX_FLAGS=-O0 \
    -DCMAKE_PREFIX_PATH="$room/core" -DPython_EXECUTABLE="$venv"
"$cmake" --build "$room/build"
cd "$source/tests/python"
PYTHONPATH=$room/build/python RICOCHET_SOURCE=$source MPLBACKEND=Agg PYTHONDONTWRITEBYTECODE=1 \
    "$venv" run.py compiled_test.py ensemble_test.py own_ensemble_test.py event_systems_test.py filippov_test.py \
    formula_test.py held_test.py hybrid_test.py import_test.py implicit_test.py instants_test.py meaning_test.py monitor_test.py network_test.py notebooks_test.py refusals_test.py \
    rest_test.py scene_test.py scipy_test.py scipy_own_test.py show_test.py set_valued_test.py times_test.py types_test.py veto_test.py docs_test.py
