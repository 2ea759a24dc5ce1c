#!/usr/bin/env python3
"""scripts/generate writes what the programs print, and leaves a file as it is where one of them fails."""
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from common import ROOT



class Generate(unittest.TestCase):
    def setUp(self):
        # Other tests read the pages of the repository, so the script runs in a tree of its own.
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.tree = Path(folder.name)
        for name in ("scripts", "docs", "build/bin"):
            (self.tree / name).mkdir(parents=True)
        shutil.copy(ROOT / "scripts/generate", self.tree / "scripts")
        subprocess.run(["git", "init", "--quiet", self.tree], check=True)
        self.page = self.tree / "docs/systems.md"
        self.page.write_text("the page of yesterday\n")

    def generate(self, program):
        """Writes the page of systems by a `ricochet` that is a script of the shell."""
        file = self.tree / "build/bin/ricochet"
        file.write_text(f"#!/bin/sh\n{program}\n")
        file.chmod(0o755)
        return subprocess.run([self.tree / "scripts/generate", "systems", "--build", self.tree / "build", "--keep-build"],
                              capture_output=True, text=True)

    def test_a_file_becomes_what_its_program_prints(self):
        result = self.generate("echo a page of $1")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(self.page.read_text(), "a page of systems\n")
        self.assertIn("docs/systems.md", result.stdout)

    def test_a_file_stays_where_its_program_fails(self):
        result = self.generate("echo half a page; exit 1")
        self.assertEqual(result.returncode, 1)
        self.assertIn("systems --markdown` failed", result.stderr)
        self.assertEqual(self.page.read_text(), "the page of yesterday\n")

    def test_an_unknown_name_is_refused_with_those_that_are_known(self):
        result = subprocess.run([ROOT / "scripts/generate", "goldn"], capture_output=True, text=True)
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("golden", result.stderr)


if __name__ == "__main__":
    unittest.main()
