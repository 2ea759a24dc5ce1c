#!/usr/bin/env python3
"""What scripts/coverage makes of the counters of gcov."""
import shutil
import tempfile
import unittest
from pathlib import Path

from common import output, script

SOURCE = """\
template <class T>
T half(T x)
{
    if (x < 0) {
        return -x / 2;
    }
    return x / 2;
}

int never(int x)
{

    return x + 1;
}

int main(int n, char**)
{
    return n > 1 ? never(half(n)) : half(-0.5) > 1;
}
"""


@unittest.skipUnless(shutil.which("g++") and shutil.which("gcov"), "g++ and gcov are not both installed")
class Coverage(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        root = Path(folder.name).resolve()
        for top in ("src/core", "tests", "build"):
            (root / top).mkdir(parents=True)
        (root / "src/core/a.cpp").write_text(SOURCE)
        (root / "tests/a_test.cpp").write_text('#include "../src/core/a.cpp"\n')
        output("g++", "--coverage", "-O0", str(root / "tests/a_test.cpp"), "-o", "a", folder=root / "build")
        output("./a", folder=root / "build")
        cls.coverage = script("coverage")
        cls.files = cls.coverage.read(root / "build", root)

    def test_only_files_of_the_library_are_counted(self):
        self.assertEqual(list(self.files), ["src/core/a.cpp"])

    def test_a_line_of_a_template_is_reached_in_one_of_its_instances(self):
        # Of half<int>, which is not called, and half<double>, which is called with a negative number.
        file = self.files["src/core/a.cpp"]
        self.assertTrue(file.lines[5])
        self.assertEqual(file.unreached(), "7-13")
        lines, reached, branches, taken = file.counts()
        # 2, 4, 5, 7; 10, 13; 16, 18.
        self.assertEqual((lines, reached), (8, 5))
        # Each of the two conditions goes one of its two ways.
        self.assertEqual((branches, taken), (4, 2))

    def test_the_report_has_a_row_for_the_room_and_the_lines_without_a_test(self):
        text = self.coverage.report(self.files)
        self.assertIn("| core | 8 | 62.5 % | 4 | 50.0 % |\n| all | 8 |", text)
        self.assertIn("- `src/core/a.cpp`: 3 of 8: 7-13\n", text)


if __name__ == "__main__":
    unittest.main()
