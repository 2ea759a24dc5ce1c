#!/usr/bin/env python3
"""What scripts/bench does with answers and with peers that misbehave; no peer is needed."""
import argparse
import contextlib
import io
import json
import sys
import tempfile
import unittest
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "bench/report"))
sys.dont_write_bytecode = True

import compare  # noqa: E402
import guard_map  # noqa: E402
import page  # noqa: E402
import run  # noqa: E402
from score import score, scored_as_wrong  # noqa: E402

EVENTS = {"times": [1.0, 2.0, 3.0], "guards": [0, 0, 1], "samples": []}


def answer(times, guards, finished=True):
    return {"finished": finished, "times": times, "guards": guards, "samples": []}


class Scores(unittest.TestCase):
    def test_a_right_answer_has_the_largest_error_of_its_times(self):
        row = score(answer([1.0, 2.0 + 1e-9, 3.0], [0, 0, 1]), EVENTS)
        self.assertEqual((row["missed"], row["invented"]), (0, 0))
        self.assertAlmostEqual(row["error"], 1e-9, delta=1e-15)
        self.assertFalse(scored_as_wrong(row))

    def test_events_that_are_missed_or_invented_are_counted(self):
        row = score(answer([1.0, 2.9, 3.0], [0, 0, 1]), EVENTS)
        self.assertEqual((row["missed"], row["invented"]), (1, 1))
        row = score(answer([1.0, 2.0], [0, 0]), EVENTS)
        self.assertEqual((row["missed"], row["invented"]), (1, 0))
        self.assertTrue(scored_as_wrong(row))

    def test_an_event_of_another_guard_is_no_event_of_this_one(self):
        row = score(answer([1.0, 2.0, 3.0], [0, 0, 0]), EVENTS)
        self.assertEqual((row["missed"], row["invented"]), (1, 1))

    def test_events_after_the_end_of_scoring_are_not_compared(self):
        problem = EVENTS | {"scored_until": 2.5, "times": [1.0, 2.0], "guards": [0, 0]}
        row = score(answer([1.0, 2.0, 2.4, 2.6], [0, 0, 1, 1]), problem)
        self.assertEqual((row["missed"], row["invented"]), (0, 1))
        row = score(answer([1.0, 2.6, float("nan")], [0, 0, 0]), problem)
        self.assertEqual((row["missed"], row["invented"]), (1, 1))

    def test_times_that_are_no_numbers_are_wrong(self):
        row = score(answer([1.0, float("nan"), 3.0], [0, 0, 1]), EVENTS)
        self.assertTrue(scored_as_wrong(row))

    def test_states_are_compared_by_their_relative_norm(self):
        problem = {"samples": [[1.0], [1.0], [1.0]], "times": [], "guards": []}
        given = {"finished": True, "samples": [[1.0], [1.1], [1.0]]}
        self.assertAlmostEqual(score(given, problem)["error"], 0.1 / 2 ** 0.5)
        given["samples"].pop()
        self.assertTrue(scored_as_wrong(score(given, problem)))


class Peers(unittest.TestCase):
    """Each stands for a peer that does not do what it should."""

    def ask(self, program, patience=10):
        worker = run.Worker([sys.executable, "-c", program], None)
        try:
            return worker.ask("solve", patience)
        finally:
            worker.close()

    def test_an_answer_comes_through(self):
        self.assertEqual(self.ask("input(); print('{\"seconds\": 1}', flush=True); input()"),
                         {"seconds": 1})

    def test_a_crash_is_named(self):
        with self.assertRaisesRegex(run.PeerFailed, "signal 6"):
            self.ask("import os; os.abort()")

    def test_an_exception_is_quoted(self):
        with self.assertRaisesRegex(run.PeerFailed, "status 1: .*no such solver"):
            self.ask("input(); raise SystemExit('no such solver')")

    def test_nonsense_is_quoted(self):
        with self.assertRaisesRegex(run.PeerFailed, "nonsense"):
            self.ask("input(); print('42 is the answer', flush=True); input()")

    def test_silence_ends(self):
        with self.assertRaisesRegex(run.PeerFailed, "no answer within"):
            self.ask("import time; time.sleep(60)", 0.5)

    def test_what_a_peer_failed_with_is_its_row(self):
        cell = {"name": "p/x/y", "problem": "p", "peer": "x", "how": "y", "value": 0,
                "command": [sys.executable, "-c", "import os; os.abort()"]}
        row, worker = run.solve(cell, EVENTS, None)
        self.assertIsNone(worker)
        self.assertIn("signal 6", row["failed"])
        self.assertEqual(page.why(row), row["failed"])


FAKE = """#!{python}
import json, sys
with open({log!r}, "a") as log:
    print("started", file=log)
for line in sys.stdin:
    if line.startswith("solve"):
        print(json.dumps({{"finished": True, "times": [1.0, 2.0, 3.0], "guards": [0, 0, 1],
                          "samples": [], "steps": 3, "flow_calls": 4, "guard_calls": 5,
                          "energy_change": None, "note": ""}}), flush=True)
    else:
        print(json.dumps({{"seconds": {seconds} * int(line.split()[1])}}), flush=True)
"""


class Passes(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.directory = Path(self.place.name)
        self.log = self.directory / "log"
        self.program = run.PROGRAM
        self.options = argparse.Namespace(sample=0.01, seconds=0.2, rounds=15, core=None)
        self.problem = EVENTS | {"problem": "p", "t_end": 4, "scored_until": None,
                                 "sample_times": []}

    def tearDown(self):
        run.PROGRAM = self.program
        self.place.cleanup()

    def cell(self, seconds):
        script = self.directory / "peer"
        script.write_text(FAKE.format(python=sys.executable, log=str(self.log), seconds=seconds))
        script.chmod(0o755)
        run.PROGRAM = str(script)
        return {"name": "p/x/y", "problem": "p", "peer": "x", "how": "y", "value": 0,
                "command": [str(script), "serve", "p/x/y"]}

    def passes(self, cell, numbers):
        clock = run.Clock(self.options)
        with contextlib.redirect_stdout(io.StringIO()):
            for done in numbers:
                rows = run.run_problem(self.problem, [cell], done, self.options, clock,
                                       self.directory)
        return rows[0]

    def test_each_pass_takes_its_part_of_the_samples_in_a_process_of_its_own(self):
        cell = self.cell(0.01)
        self.assertEqual(len(self.passes(cell, [0])["samples"]), 8)
        row = self.passes(cell, [0, 1])  # goes on from the file of the first pass
        self.assertEqual([len(row["samples"]), row["passes"]], [15, 2])
        self.assertEqual(self.log.read_text().count("started"), 4)  # with the yardstick's
        self.passes(cell, [0, 1])
        self.assertEqual(self.log.read_text().count("started"), 4)

    def test_a_single_sample_is_taken_once(self):
        row = self.passes(self.cell(6), [0, 1])
        self.assertEqual([row["samples"], row["passes"]], [[6.0], 1])


def report(times, yardstick):
    rows = [{"name": name, "problem": "p", "peer": peer, "how": "h", "value": 1e-8, "missed": 0,
             "invented": 0, "error": 1e-9, "finished": True, "note": "", "command": "again",
             "steps": None, "flow_calls": 1, "guard_calls": 2, "samples": [time, 1.1 * time]}
            for name, peer, time in times]
    return {"rows": rows, "yardstick": yardstick, "absent": {"SciPy": "absent"}, "pays": [],
            "problems": {"p": {"title": "P", "events": 3, "t_end": 1}},
            "machine": {"commit": "c", "date": "d", "processor": "m", "cores": 1, "compiler": "g"},
            "versions": {"ricochet": "1", "GSL": "2"}}


class Reports(unittest.TestCase):
    def test_noise_and_absence_are_said(self):
        said = " ".join(page.remarks(report([], [1e-9] * 5 + [2e-9] * 5), None))
        self.assertIn("too noisy", said)
        self.assertIn("SciPy is not in this report", said)
        self.assertNotIn("too noisy", " ".join(page.remarks(report([], [1e-9] * 10), None)))

    def test_a_machine_of_another_speed_does_not_change_ratios(self):
        one = report([("a", "ricochet", 1.0), ("b", "GSL", 4.0)], [1e-9])
        slower = report([("a", "ricochet", 2.0), ("b", "GSL", 8.0)], [2e-9])
        self.assertLess(compare.agreement(one, slower)[0][0], 1e-12)
        other = report([("a", "ricochet", 1.0), ("b", "GSL", 8.0)], [1e-9])
        self.assertGreater(compare.agreement(one, other)[0][0], compare.AGREEMENT)

    def test_two_reports_agree_or_disagree_or_the_machine_was_too_noisy(self):
        quiet, noisy = [1e-9] * 10, [1e-9] * 5 + [2e-9] * 5
        one = report([("a", "ricochet", 1.0), ("b", "GSL", 4.0)], quiet)
        # Times 1 : 4 and 1 : 4.8 depart by sqrt(1.2) = 1.10 from their geometric means, 1 : 4 and
        # 1 : 5.6 by sqrt(1.4) = 1.18.
        near = report([("a", "ricochet", 1.0), ("b", "GSL", 4.8)], quiet)
        far = report([("a", "ricochet", 1.0), ("b", "GSL", 5.6)], quiet)
        loud = report([("a", "ricochet", 1.0), ("b", "GSL", 5.6)], noisy)
        self.assertEqual([compare.verdict(one, other)[0] for other in (near, far, loud)], [0, 1, 3])
        self.assertEqual(compare.verdict(loud, one)[0], 3)
        self.assertIn("All 2 ratios", " ".join(page.remarks(one, near)))
        self.assertIn("They disagree", " ".join(page.remarks(one, far)))
        self.assertIn("too noisy to tell", " ".join(page.remarks(one, loud)))

    def test_cells_whose_own_samples_spread_are_too_noisy_to_tell(self):
        one = report([("a", "ricochet", 1.0), ("b", "GSL", 4.0)], [1e-9] * 10)
        far = report([("a", "ricochet", 1.0), ("b", "GSL", 5.6)], [1e-9] * 10)
        for row in far["rows"]:
            row["samples"] = [row["samples"][0] * factor for factor in (1, 1.5, 1.5)]
        status, said = compare.verdict(one, far)
        self.assertEqual(status, 3)
        self.assertIn("2 of the other 2 are too noisy to tell", " ".join(said))

    def test_reports_of_other_commits_or_rows_are_said_to_be(self):
        one = report([("a", "ricochet", 1.0), ("b", "GSL", 4.0)], [1e-9])
        other = report([("c", "ricochet", 1.0), ("d", "GSL", 4.0)], [1e-9])
        other["machine"]["commit"] = "e"
        status, said = compare.verdict(one, other)
        self.assertEqual(status, 1)
        self.assertIn("of commit e, not of c", said[0])
        self.assertIn("no times of the same rows", said[1])

    def test_curves_of_one_panel_have_colours_of_their_own(self):
        names = ["ricochet: dopri5", "ricochet: scene", "Bullet: contacts", "ODE: contacts"]
        shown = page.panel("", "", "", [page.curve(name, [(1.0, 1.0)]) for name in names])
        self.assertEqual(len({curve["colour"] for curve in shown["curves"]}), len(names))

    def test_the_change_of_energy_is_a_remark(self):
        row = report([("a", "ricochet", 1.0)], [1e-9])["rows"][0] | {"energy_change": -2e-15}
        self.assertEqual(page.why(row), "energy changes by -2e-15")

    def test_the_pages_have_every_row_and_its_command(self):
        with tempfile.TemporaryDirectory() as directory:
            out = Path(directory)
            given = report([("a", "ricochet", 1.0), ("b", "GSL", 4.0)], [1e-9])
            page.write(given, None, out, out)  # no program draws: the report says so
            markdown = (out / "report.md").read_text()
            html = (out / "index.html").read_text()
            self.assertEqual(json.loads((out / "report.json").read_text())["rows"], given["rows"])
        for text in (markdown, html):
            self.assertIn("again", text)
            self.assertIn("No figures", text)
        self.assertIn("| P | 1e-08 | 1 s | h | 4 |", markdown)
        self.assertIn("width=device-width", html)


def guard_ways(rate, *ways):
    return {"rate": rate, "ways": [{"name": name, "time": time, "calls": calls, "events": 5,
                                    "same": same} for name, time, calls, same in ways]}


class GuardMap(unittest.TestCase):
    # A look at every step costs 1 us and a call of 1; planned 2 us and 0.01, every 50 loses events.
    row = guard_ways(2.0, ("every step", 1e-6, 1.0, True), ("every 50", 1e-6, 0.02, False),
                     ("planned", 2e-6, 0.01, True))
    found = {"panels": [{"known": "bounds", "rows": [row]}], "seconds": 3, "proof_seconds": 1,
             "training_seconds": 1, "command": "ricochet_map"}

    def test_who_wins_depends_on_the_price_of_a_call(self):
        way, gain, other = guard_map.winner(self.row, 0)
        self.assertEqual((way["name"], gain, other), ("every step", 1.0, None))
        # 1001 us against 12 us, and against 1 + 20 us.
        way, gain, other = guard_map.winner(self.row, 1e-3)
        self.assertEqual(way["name"], "planned")
        self.assertAlmostEqual(gain, 1001 / 12)
        self.assertIsNone(other)

    def test_what_is_faster_but_changes_events_is_in_brackets(self):
        # 11 us against 2.1 us, and against 1.2 us.
        self.assertEqual(guard_map.text(self.row, 1e-5), "planned 5.24x (every 50 9.17x)")

    def test_the_next_one_is_named(self):
        # 11 us against 2.1 us and 2.6 us.
        row = guard_ways(2.0, *[(way["name"], way["time"], way["calls"], way["same"])
                                for way in self.row["ways"]], ("certified", 2.5e-6, 0.01, True))
        self.assertIn("planned 5.24x, then certified 4.23x", guard_map.text(row, 1e-5))

    def test_a_panel_has_a_tile_for_every_price_and_rate(self):
        tiles = guard_map.panels(self.found)[0]["tiles"]
        self.assertEqual(len(tiles["value"]), len(tiles["x"]) * len(tiles["y"]))
        marks = guard_map.panels(self.found)[0]["curves"]
        self.assertEqual(sum(len(curve["x"]) for curve in marks), len(tiles["value"]))

    def test_the_pages_have_the_map(self):
        with tempfile.TemporaryDirectory() as directory:
            out = Path(directory)
            given = report([("a", "ricochet", 1.0)], [1e-9]) | {"map": self.found}
            page.write(given, None, out, out)
            for file in ("report.md", "index.html"):
                self.assertIn("planned 5.24x (every 50 9.17x)", (out / file).read_text())


if __name__ == "__main__":
    unittest.main()
