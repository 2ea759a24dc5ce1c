#!/usr/bin/env python3
"""What scripts/release makes, and what it refuses."""
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from common import ROOT, output, script, version


def environment():
    """That of this process, with a name for commits."""
    return os.environ | {f"GIT_{who}_{what}": "test" for who in ("AUTHOR", "COMMITTER") for what in ("NAME", "EMAIL")}


@unittest.skipUnless((ROOT / ".git").exists(), "no checkout")
class Release(unittest.TestCase):
    """In a clone of the checkout, with what was changed there as its last commit."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.clone = Path(folder.name) / "clone"
        output("git", "clone", "-q", "--shared", "--no-tags", str(ROOT), str(cls.clone))
        patch = subprocess.run(["git", "diff", "--binary", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
        if patch:
            subprocess.run(["git", "apply", "-"], cwd=cls.clone, input=patch, check=True)
        for name in output("git", "ls-files", "--others", "--exclude-standard").splitlines():
            to = cls.clone / name
            to.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, to)
        changelog = cls.clone / "CHANGELOG.md"
        if not script("release").notes(changelog.read_text(), "## Unreleased\n"):
            changelog.write_text(changelog.read_text().replace("## Unreleased\n", "## Unreleased\n\n- A change.\n"))
        cls.git("add", "-A")
        cls.git("commit", "-q", "--allow-empty", "-m", "as it is")
        cls.base = cls.git("rev-parse", "HEAD")
        major, minor, _ = map(int, version().split("."))
        cls.next = f"{major}.{minor + 1}.0"

    def setUp(self):
        self.git("checkout", "-q", "-f", "-B", "main", self.base)
        self.git("clean", "-q", "-fdx")
        for tag in self.git("tag").split():
            self.git("tag", "-d", tag)

    @classmethod
    def git(cls, *arguments):
        done = subprocess.run(["git", *arguments], cwd=cls.clone, check=True, capture_output=True, text=True, env=environment())
        return done.stdout.strip()

    def release(self, *arguments):
        return subprocess.run(["scripts/release", *arguments], cwd=self.clone, capture_output=True, text=True, env=environment())

    def assert_refused(self, done, why):
        self.assertEqual((done.returncode, done.stdout), (1, ""), done.stderr)
        self.assertIn(why, done.stderr)

    def test_a_dry_run_shows_the_commit_and_changes_nothing(self):
        before = self.git("rev-parse", "HEAD")
        done = self.release(self.next, "--dry-run")
        self.assertEqual(done.returncode, 0, done.stderr)
        for line in (f"+    VERSION {self.next}", f"+version: {self.next}", f'+  "version": "{self.next}",', f"+## {self.next} - "):
            self.assertIn(line, done.stdout)
        self.assertIn("would run: scripts/check, git commit", done.stdout)
        self.assertEqual((self.git("status", "--porcelain"), self.git("rev-parse", "HEAD"), self.git("tag")), ("", before, ""))

    def test_a_tree_with_changes_is_refused(self):
        with (self.clone / "README.md").open("a") as file:
            file.write("more\n")
        self.assert_refused(self.release(self.next, "--dry-run"), "the tree has changes")

    def test_another_branch_is_refused(self):
        self.git("checkout", "-q", "-b", "other")
        self.assert_refused(self.release(self.next, "--dry-run"), "expected the branch main, found other")

    def test_a_bad_version_is_refused(self):
        for bad in ("1.2", "v1.2.3", "1.2.3-rc1", "01.2.3", "one"):
            self.assert_refused(self.release(bad, "--dry-run"), f"expected a version X.Y.Z, found {bad}")
        self.assert_refused(self.release("0.0.1", "--dry-run"), "expected a version after")
        self.git("tag", "v9.0.0")
        self.assert_refused(self.release("9.0.0", "--dry-run"), "9.0.0 has been released")
        self.assert_refused(self.release(self.next, "--dry-run"), "expected a version after 9.0.0")

    def test_a_changelog_without_entries_is_refused(self):
        (self.clone / "CHANGELOG.md").write_text("# Changelog\n\n## Unreleased\n\n## 0.1.0 - 2026-01-01\n\n- Something.\n")
        self.git("commit", "-q", "-a", "-m", "nothing")
        self.assert_refused(self.release(self.next, "--dry-run"), "expected entries under Unreleased, found none")

    def test_a_release_is_one_commit_with_its_archive_and_its_tag(self):
        before = self.git("rev-parse", "HEAD")
        done = self.release(self.next, "--skip-checks", "--no-debs", "--tag")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual((self.git("rev-parse", "HEAD~1"), self.git("log", "-1", "--format=%s")), (before, f"Release {self.next}"))
        self.assertEqual((self.git("status", "--porcelain"), self.git("tag", "--points-at", "HEAD")), ("", f"v{self.next}"))
        out = self.clone / f"build/release-{self.next}"
        archive = f"ricochet-{self.next}"
        text = output("tar", "-xOf", f"{archive}.tar.gz", f"{archive}/CMakeLists.txt", folder=out)
        self.assertIn(f"VERSION {self.next}\n", text)
        output("sha256sum", "--check", "--quiet", "SHA256SUMS", folder=out)
        self.assertIn(f"{archive}.tar.gz", (out / "SHA256SUMS").read_text())
        self.assertTrue((out / "notes.md").read_text().startswith(f"# ricochet {self.next}\n\n"))
        self.assert_refused(self.release(self.next, "--dry-run"), f"{self.next} has been released")

    def test_a_release_that_cannot_be_built_leaves_no_commit(self):
        (self.clone / "setup.py").write_text("raise SystemExit(1)\n")
        self.git("commit", "-q", "-a", "-m", "broken")
        before = self.git("rev-parse", "HEAD")
        done = self.release(self.next, "--skip-checks", "--no-debs", "--tag")
        self.assertEqual(done.returncode, 1)
        self.assertEqual((self.git("rev-parse", "HEAD"), self.git("status", "--porcelain"), self.git("tag")), (before, "", ""))


if __name__ == "__main__":
    unittest.main()
