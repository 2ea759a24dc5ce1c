#!/usr/bin/env bash
# Installs the package by pip into a directory of its own, without network, and tests it there.
# usage: install.sh PYTHON SOURCE_TREE; 77: pip or setuptools is missing
set -euo pipefail
python=$1 source=$2
"$python" -c "import pip, setuptools" 2>/dev/null || { echo "pip or setuptools was not found"; exit 77; }

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
# A copy, so that nothing is left in the source tree.
mkdir "$work/source"
cd "$source"
cp -r CMakeLists.txt LICENSE LICENSE-THIRD-PARTY MANIFEST.in cmake docs include models pyproject.toml python setup.py src "$work/source"
"$python" -m pip install --no-build-isolation --no-index --no-deps --target "$work/site" "$work/source"
cd "$work"
PYTHONPATH="$work/site" MPLBACKEND=Agg "$python" "$source/tests/python/run.py" \
    "$source/tests/python/hybrid_test.py" "$source/tests/python/refusals_test.py"
"$python" -c "
import sys
sys.path.insert(0, '$work/site')
import importlib.metadata
import ricochet
version = importlib.metadata.version('ricochet')
assert version == ricochet.__version__, (version, ricochet.__version__)
assert f'VERSION {version}\\n' in open('$source/CMakeLists.txt').read(), version
licences = {f.name for f in importlib.metadata.files('ricochet')}
assert {'LICENSE', 'LICENSE-THIRD-PARTY'} <= licences, licences"
