"""Compares what the programs of the pages print with the comment at their ends.

usage: prints.py SOURCE_TREE DIRECTORY_OF_PROGRAMS
"""

import re
import subprocess
import sys
from pathlib import Path

BLOCK = re.compile(r"```cpp\n// ([a-z_]+)\.cpp\n(.*?)```", re.S)
SAID = re.compile(r"^}\n((?://[^\n]*\n)+)\Z", re.M)


def said_at_end(program):
    """The lines that the comment behind the last function says are printed; empty if there is none."""
    found = SAID.search(program)
    return [line[2:].strip() for line in found[1].splitlines()] if found else []


def main(source, programs):
    compared, failed = 0, 0
    for page in [source / "README.md", *sorted((source / "docs").glob("*.md"))]:
        for name, text in BLOCK.findall(page.read_text()):
            said, program = said_at_end(text), programs / f"docs_{name}"
            if not said or not program.exists():
                continue
            compared += 1
            printed = subprocess.run([program], capture_output=True, text=True, check=False).stdout
            printed = [line.strip() for line in printed.splitlines()]
            if printed != said:
                failed += 1
                print(f"{page.name}, {name}.cpp\n  says   {said}\n  prints {printed}")
    print(f"{compared} programs compared, {failed} differ")
    return 1 if failed or not compared else 0


sys.exit(main(Path(sys.argv[1]), Path(sys.argv[2])))
