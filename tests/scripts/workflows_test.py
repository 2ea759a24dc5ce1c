#!/usr/bin/env python3
"""The files of .github: what they run exists, and what they ask for is there. Exit status 77: PyYAML is missing."""
import itertools
import os
import re
import subprocess
import sys
import unittest

from common import ROOT, output

try:
    import yaml
except ImportError:
    print("PyYAML is missing")
    sys.exit(77)

GITHUB = ROOT / ".github"


def load(path):
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def workflows():
    return {path.name: load(path) for path in sorted(GITHUB.glob("workflows/*.yml"))}


def jobs():
    """Triples of where a job is, the job, and each combination of its matrix."""
    for name, workflow in workflows().items():
        for key, job in workflow["jobs"].items():
            matrix = job.get("strategy", {}).get("matrix", {})
            for values in itertools.product(*matrix.values()):
                yield f"{name}, {key}", job, dict(zip(matrix, values))


def filled(text, values):
    """A text of a workflow with the values of a matrix."""
    return re.sub(r"\$\{\{ matrix\.(\w+) \}\}", lambda found: str(values[found[1]]), text)


def commands():
    """Pairs of where a command is, and the words that it runs."""
    for where, job, values in jobs():
        for step in job["steps"]:
            if "run" in step:
                yield where, filled(step["run"], values).split()


class Workflows(unittest.TestCase):
    def test_there_are_some(self):
        self.assertEqual(sorted(workflows()), ["checks.yml", "weekly.yml", "wheels.yml"])

    def test_each_step_runs_a_script_of_the_repository(self):
        for where, words in commands():
            self.assertRegex(words[0], r"^scripts/\w+$", where)
            self.assertTrue(os.access(ROOT / words[0], os.X_OK), f"{where}: {words[0]}")

    def test_every_part_of_check_is_run_and_no_other(self):
        refusal = subprocess.run(["scripts/check", "nothing"], cwd=ROOT, capture_output=True, text=True).stderr
        parts = set(re.search(r"there are (.*)", refusal)[1].split(", "))
        run = {part for _, words in commands() if words[0] == "scripts/check" for part in words[1:]}
        # The rooms have a job each.
        self.assertEqual(run, parts - {"rooms"})

    def test_every_room_has_a_job(self):
        rooms = sorted(words[1] for _, words in commands() if words[0] == "scripts/rooms")
        self.assertEqual(rooms, sorted(output("scripts/rooms", "--list").split()))

    def test_each_option_is_one_of_its_script(self):
        for where, words in commands():
            for option in words[1:]:
                if option.startswith("--"):
                    self.assertIn(option, (ROOT / words[0]).read_text(), where)

    def test_workflows_may_only_read_and_have_an_end(self):
        for name, workflow in workflows().items():
            self.assertEqual(workflow["permissions"], {"contents": "read"}, name)
        for where, job, _ in jobs():
            self.assertIn("timeout-minutes", job, where)

    def test_actions_have_a_version(self):
        for where, job, _ in jobs():
            for step in job["steps"]:
                self.assertRegex(step.get("uses", "a@v1"), r"@v\d+$", where)


class Forms(unittest.TestCase):
    def forms(self):
        return {path.stem: load(path) for path in sorted(GITHUB.glob("ISSUE_TEMPLATE/w*.yml"))}

    def test_every_question_has_a_name_of_its_own_and_a_text(self):
        self.assertEqual(sorted(self.forms()), ["wish", "wrong-build", "wrong-event"])
        for name, form in self.forms().items():
            questions = [part for part in form["body"] if part["type"] != "markdown"]
            names = [question["id"] for question in questions]
            self.assertEqual(len(names), len(set(names)), name)
            self.assertTrue(form["name"] and form["description"] and all(q["attributes"]["label"] for q in questions), name)

    def test_a_wrong_event_comes_with_its_system_its_options_and_what_the_run_says(self):
        asked = {part["id"]: part for part in self.forms()["wrong-event"]["body"] if "id" in part}
        for needed in ("system", "options", "describe", "version"):
            self.assertTrue(asked[needed]["validations"]["required"], needed)
        self.assertIn("describe(run)", asked["describe"]["attributes"]["description"])

    def test_the_other_files_can_be_read(self):
        for path in GITHUB.rglob("*.yml"):
            self.assertIsInstance(load(path), dict, path.name)

    def test_each_folder_that_has_an_owner_is_there(self):
        for line in (GITHUB / "CODEOWNERS").read_text().splitlines():
            if line and not line.startswith("#"):
                folder, *owners = line.split()
                self.assertTrue((ROOT / folder.strip("/")).exists() and owners, line)


if __name__ == "__main__":
    unittest.main()
