#!/usr/bin/env python3
"""The version of the project is in one place, and the same where it has to be repeated."""
import json
import re
import unittest

from common import ROOT, version

try:
    import yaml
except ImportError:
    yaml = None


class Versions(unittest.TestCase):
    def test_every_file_that_is_read_without_a_build_has_the_version_of_the_project(self):
        citation = (ROOT / "CITATION.cff").read_text()
        self.assertEqual(re.search(r"^version: (.*)$", citation, re.M)[1], version())
        manifest = json.loads((ROOT / "packaging/vcpkg/ricochet/vcpkg.json").read_text())
        self.assertEqual(manifest["version"], version())

    @unittest.skipUnless(yaml, "PyYAML is not installed")
    def test_the_citation_has_what_its_format_asks_for(self):
        citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
        self.assertLessEqual({"cff-version", "message", "title", "authors", "version"}, set(citation))


if __name__ == "__main__":
    unittest.main()
