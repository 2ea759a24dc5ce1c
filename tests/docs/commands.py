"""Runs the commands of `ricochet` that README.md and docs/*.md show in blocks of sh, in a directory of their own.

usage: commands.py PROGRAM [--long]

Those of LONG are only run with --long; without it their options are still checked, by --help of the same command.
Blocks that show other programs are not run: their commands must match one of OTHERS, so that nothing is shown that
somebody has not looked at.
"""

import os
import re
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LONG = [r"simulate fault .*elements=(25|50)", r"compare (step-control|fault|rate-and-state)", r"\btrain\b", r"rate_and_state=1",
        r"^ricochet-studies", r"kick="]
OTHERS = [r"scripts/\w+", r"bench/report/compare\.py ", r"cmake ", r"ctest ", r"pip install", r"git ", r"cc mine\.c", r"g\+\+ ", r"build/release/bin/ricochet_\w+", r"doxygen", r"mpirun "]


def commands():
    pages = sorted(ROOT.glob("docs/*.md")) + [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for block in re.findall(r"^```sh\n(.*?)^```", text, re.M | re.S):
            for line in block.replace("\\\n", " ").splitlines():
                line = re.sub(r"(^|\s)#.*", "", line).strip()
                if line:
                    yield page.name, line
        for line in re.findall(r"`(ricochet simulate [^`]*--plot [^`]*)`", text):
            yield page.name, line


def main(program, long):
    failures, run = [], 0
    with tempfile.TemporaryDirectory() as work:
        for name in ("models", "examples"):
            os.symlink(ROOT / name, Path(work) / name)
        ball = Path(program).resolve().parents[1] / "tests/fmi/fmus/fmu_ball.fmu"
        if ball.exists():
            os.symlink(ball, Path(work) / "ball.fmu")
        for page, command in commands():
            command = re.sub(r"^build/release/bin/(?=ricochet\b)", "", command)
            if command.startswith("printf "):  # makes a file for the next command
                subprocess.run(command, shell=True, cwd=work, check=True)
                continue
            if not re.match(r"ricochet(-studies)?\b(?!_)", command):
                if not any(re.match(other, command) for other in OTHERS):
                    failures.append(f"{page}: `{command}` is neither a command of ricochet nor in the list of others")
                continue
            words = shlex.split(command)
            tool = Path(program).resolve().with_name(words[0])
            if ".fmu" in command and not ball.exists():
                continue
            if any(re.search(pattern, command) for pattern in LONG) and not long:
                words = [words[0], *words[1:2], "--help"] if words[0] == "ricochet" else None
            if words is None or not tool.exists():
                continue
            result = subprocess.run([str(tool), *words[1:]], cwd=work, capture_output=True, text=True, timeout=900)
            if "is built by the target" in result.stderr:
                continue  # a build without that program
            run += 1
            if result.returncode != 0:
                failures.append(f"{page}: `{command}` ended with {result.returncode}: {result.stderr.strip()[:200]}")
    print("\n".join(failures) or f"{run} commands run")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], "--long" in sys.argv[2:]))
