"""The virtual environment of the peers, build/peers-pypi/environment, filled by pip from PyPI.

What cannot be had is left out, with the reason; the next call does not try it again (--renew does).
"""
import json
import subprocess
import sys
from pathlib import Path

# Packages of each peer.
PACKAGES = {
    "SciPy": ["scipy"], "heyoka": ["heyoka"], "diffrax": ["diffrax", "jax[cpu]"],
    "numbalsoda": ["numbalsoda"], "scikit-sundae": ["scikit-sundae"], "casadi": ["casadi"],
    "pymunk": ["pymunk"], "Box2D": ["box2d"], "MuJoCo": ["mujoco"], "Drake": ["drake"], "FMPy": ["FMPy"],
    "torchdiffeq": ["torchdiffeq", "torch"],
}
BY_WISH = {"torchdiffeq": "not installed: the wheel of torch on PyPI has 539 MB, and is not imported without the "
                          "libraries of CUDA, which have more; `--with torchdiffeq` installs all of it"}


def last_line(text):
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")]
    return (errors or lines or ["no message"])[-1].removeprefix("ERROR: ")[:200]


def python_of(folder):
    return folder / "environment/bin/python"


def make(folder, wished=(), renew=False):
    """Installs what is not there; returns the peers that are absent, with the reason."""
    known_file = folder / "installed.json"
    known = json.loads(known_file.read_text()) if known_file.exists() and not renew else {}
    folder.mkdir(parents=True, exist_ok=True)
    if not python_of(folder).exists():
        subprocess.run([sys.executable, "-m", "venv", folder / "environment"], check=True)
    for peer, packages in PACKAGES.items():
        if peer in BY_WISH and peer not in wished:
            known.setdefault(peer, BY_WISH[peer])
        if known.get(peer) == "" or (peer in known and peer not in wished):
            continue
        print(f"pip install {' '.join(packages)}", flush=True)
        run = subprocess.run([python_of(folder), "-m", "pip", "install", "--quiet",
                              "--disable-pip-version-check", *packages], capture_output=True, text=True)
        known[peer] = "" if run.returncode == 0 else f"not installed: {last_line(run.stderr)}"
        known_file.write_text(json.dumps(known, indent=1))
    return {peer: reason for peer, reason in known.items() if reason}
