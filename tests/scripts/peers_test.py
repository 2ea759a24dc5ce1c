#!/usr/bin/env python3
"""What `scripts/bench --peers pypi` does with answers, dashes and interrupts; no peer is needed."""
import argparse
import contextlib
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path
from unittest import mock

from common import ROOT

sys.path[:0] = [str(ROOT / "bench/peers_pypi"), str(ROOT / "bench/report")]

import environment  # noqa: E402
import peers  # noqa: E402
import peers_page  # noqa: E402
import problems  # noqa: E402
import scoring  # noqa: E402

KNOWN = problems.problems()


def row(problem, peer, seconds, error=0.0, **more):
    return {"name": f"{problem}/{peer}/h", "problem": problem, "peer": peer, "how": "h", "value": 1e-9,
            "error": error, "missed": 0, "invented": 0, "finished": True, "note": "", "first": 2.0,
            "samples": [seconds, 2 * seconds], "passes": 2} | more


def found(*rows, absent=None):
    return {"rows": list(rows), "absent": absent or {}, "versions": {"heyoka": "7"}, "load": [1.0, 3.0],
            "yardstick": [1e-8, 1e-8], "passes": 2, "rounds": 12,
            "machine": {"commit": "abc", "date": "today", "processor": "P", "cores": 2}}


class References(unittest.TestCase):
    def test_a_ball_falls_by_the_closed_form(self):
        times = KNOWN["ball"]["times"]
        self.assertEqual(len(times), 13)
        first = math.sqrt(20 / 9.81)
        self.assertAlmostEqual(times[1] - times[0], 1.8 * first, delta=1e-15)

    def test_impacts_at_the_end_count(self):
        first = math.sqrt(20 / 9.81)
        self.assertEqual(problems.impact_times(10.0, 0.9, first), [first])

    def test_the_kept_references_have_the_events_that_their_titles_say(self):
        self.assertEqual(len(KNOWN["henon-heiles"]["times"]), 153)
        self.assertEqual(len(KNOWN["stick-slip"]["times"]), 21)
        self.assertEqual(sum(KNOWN["orbits"]["counts"]), 6422)
        self.assertEqual(len(KNOWN["orbits"]["last"]), problems.ORBITS)

    def test_a_disc_that_does_not_slip_keeps_its_spin(self):
        # Rolling to the right is spin -v / r: an impact then has no tangential impulse, 2 m/s stay.
        rolls = problems.SPINNING | {"spin": -20.0}
        with mock.patch.object(problems, "SPINNING", rolls):
            x, _, spin = problems.spinning_disc()
        self.assertAlmostEqual(x, 2.0, delta=1e-14)
        self.assertEqual(spin, -20.0)

    def test_discs_do_not_overlap_at_the_start(self):
        at, velocities, radius = problems.disc_table()
        self.assertGreater(at[1][0] - at[0][0], 2 * radius)
        self.assertTrue(all(abs(math.hypot(*v) - problems.DISCS_SPEED) < 1e-12 for v in velocities))

    def test_the_gradient_agrees_with_differences(self):
        def last(height, restitution):
            return problems.impact_times(height, restitution, 25.0)[problems.IMPACTS - 1]
        by_height, _, by_restitution = KNOWN["gradient"]["samples"][0]
        h = 1e-5
        self.assertAlmostEqual((last(10 + h, 0.9) - last(10 - h, 0.9)) / (2 * h), by_height, delta=1e-8)
        self.assertAlmostEqual((last(10, 0.9 + h) - last(10, 0.9 - h)) / (2 * h), by_restitution, delta=1e-5)


class Scores(unittest.TestCase):
    problem = problems.rows("p", [3, 2], [1.0, 2.0])

    def score(self, counts, last):
        return scoring.scored({"finished": True, "note": "", "counts": counts, "last": last}, self.problem)

    def test_a_right_ensemble_has_the_largest_error_of_a_last_time(self):
        scored = self.score([3, 2], [1.0, 2.0 + 1e-9])
        self.assertEqual((scored["missed"], scored["invented"]), (0, 0))
        self.assertAlmostEqual(scored["error"], 1e-9, delta=1e-15)
        self.assertFalse(scoring.is_wrong(scored, "rows"))

    def test_events_of_one_run_do_not_stand_for_those_of_another(self):
        scored = self.score([2, 3], [1.0, 2.0])
        self.assertEqual((scored["missed"], scored["invented"]), (1, 1))
        self.assertTrue(scoring.is_wrong(scored, "rows"))

    def test_a_time_that_is_no_number_and_a_missing_run_are_wrong(self):
        self.assertTrue(scoring.is_wrong(self.score([3, 2], [1.0, math.nan]), "rows"))
        self.assertTrue(scoring.is_wrong(self.score([3], [1.0]), "rows"))

    def test_an_engine_that_loses_contacts_is_timed_all_the_same(self):
        answer = {"finished": True, "note": "", "contacts": KNOWN["discs"]["contacts"] - 7, "penetration": 0.4,
                  "energy_change": -0.1}
        scored = scoring.scored(answer, KNOWN["discs"])
        self.assertEqual((scored["missed"], scored["invented"], scored["penetration"]), (7, 0, 0.4))
        self.assertFalse(scoring.is_wrong(scored, "bodies"))


class Tables(unittest.TestCase):
    def text(self, given, *names):
        return peers_page.page(given, {name: KNOWN[name] for name in names})

    def test_every_peer_of_a_program_has_a_place(self):
        self.assertEqual(set(peers_page.PEERS_OF), set(peers.PROGRAMS))
        named = {peer for all_of in peers_page.PEERS_OF.values() for peer in all_of}
        self.assertEqual(named, set(peers_page.PEERS))
        self.assertEqual(named - {"ricochet"}, set(environment.PACKAGES))

    def test_reasons_are_given_of_known_problems_and_peers(self):
        self.assertLessEqual(set(peers_page.CANNOT), set(KNOWN))
        for reasons in peers_page.CANNOT.values():
            self.assertLessEqual(set(reasons), set(peers_page.PEERS))

    def test_a_dash_has_its_reason(self):
        text = self.text(found(row("ball", "ricochet", 1e-6), absent={"casadi": "not installed: no wheel"}), "ball")
        self.assertIn("| casadi | - | - | - | - | - | - | not installed: no wheel |", text)
        self.assertIn("| pymunk | - | - | - | - | - | - | an engine of bodies", text)

    def test_a_peer_that_has_rows_has_no_dash(self):
        text = self.text(found(row("ball", "MuJoCo", 1e-6)), "ball")
        self.assertEqual(text.count("| MuJoCo |"), 1)

    def test_a_failure_is_quoted_and_not_timed(self):
        failed = row("ball", "heyoka", 1.0) | {"failed": "ended with signal 6", "samples": []}
        text = self.text(found(row("ball", "ricochet", 1e-6), failed), "ball")
        self.assertIn("| heyoka | h | 1e-09 | - | - | - | - | ended with signal 6 |", text)

    def test_losses_are_said_as_wins_are(self):
        lines = self.text(found(row("ball", "ricochet", 4e-6, 1e-10), row("ball", "heyoka", 1e-6, 1e-10),
                                row("ball", "SciPy", 8e-6, 1e-13)), "ball").splitlines()
        title = KNOWN["ball"]["title"]
        self.assertIn(f"| {title} | 1e-09 | 4 us: h, 1e-09 | 1 us: heyoka, h, 1e-09 | **0.25** |", lines)
        self.assertIn(f"| {title} | 1e-12 | - | 8 us: SciPy, h, 1e-09 | - |", lines)

    def test_wrong_rows_do_not_win(self):
        wrong = row("ball", "heyoka", 1e-9, missed=1)
        text = self.text(found(row("ball", "ricochet", 1e-6), wrong), "ball")
        self.assertIn("| heyoka | h | 1e-09 | 0 | 1, 0 |", text)
        self.assertNotIn("heyoka, h", text)

    def test_compiling_has_a_column_of_its_own(self):
        text = self.text(found(row("ball", "diffrax", 0.5)), "ball")
        self.assertIn("| diffrax | h | 1e-09 | 0 | 0, 0 | 500 ms | 1.5 s |  |", text)

    def test_a_busy_machine_is_said(self):
        self.assertIn("Other work shared the cores", self.text(found(row("ball", "ricochet", 1.0)), "ball"))
        quiet = found(row("ball", "ricochet", 1.0)) | {"load": [0.5, 1.1]}
        self.assertNotIn("Other work", self.text(quiet, "ball"))

    def test_the_last_line_of_pip_that_says_error_is_the_reason(self):
        self.assertEqual(environment.last_line("ERROR: no matching distribution\nnotice: old pip\n"),
                         "no matching distribution")
        self.assertEqual(environment.last_line(""), "no message")


FAKE = """import json, sys
open({log!r}, "a").write("started\\n")
for line in sys.stdin:
    if line.startswith("solve"):
        said = {{"finished": True, "note": "", "times": {times}, "guards": [0] * 13, "first": 1.0}}
    else:
        said = {{"seconds": 0.01 * int(line.split()[1])}}
    print(json.dumps(said), flush=True)
"""


class Resuming(unittest.TestCase):
    def run_once(self, folder, done):
        program = FAKE.format(log=str(folder / "log"), times=KNOWN["ball"]["times"])
        cell = {"name": "ball/p/h", "problem": "ball", "peer": "p", "how": "h", "value": 0,
                "command": [sys.executable, "-c", program]}
        options = argparse.Namespace(core=None, together=4, rounds=4, sample=0.01, seconds=0.04)
        with mock.patch.object(peers, "FOLDER", folder), contextlib.redirect_stdout(io.StringIO()):
            return peers.run_problem("ball", KNOWN["ball"], [cell], done, peers.report.Clock(options), options)

    def test_what_has_been_measured_is_not_run_again(self):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            (folder / "cells").mkdir()
            first, = self.run_once(folder, 0)
            again, = self.run_once(folder, 0)
            self.assertEqual(again, first)
            self.assertEqual((folder / "log").read_text().count("started"), 1)
            second, = self.run_once(folder, 1)
            self.assertEqual(second["passes"], 2)
            self.assertGreater(len(second["samples"]), len(first["samples"]))
            self.assertEqual(json.loads((folder / "cells/ball_p_h.json").read_text()), second)


class Failures(unittest.TestCase):
    def ask(self, program, patience):
        with mock.patch.object(peers, "PATIENCE", patience):
            worker = peers.Worker([sys.executable, "-c", program], None)
            try:
                return worker.ask("solve")
            finally:
                worker.close()

    def test_what_works_too_long_is_ended(self):
        with self.assertRaisesRegex(peers.report.PeerFailed, "no answer within 0.2 s of processor time"):
            self.ask("input()\nwhile True: pass", 0.2)

    def test_what_is_kept_waiting_is_not(self):
        program = "import time; input(); time.sleep(2.5); print('{}', flush=True); input()"
        self.assertEqual(self.ask(program, 2.0), {})


class CommandLine(unittest.TestCase):
    def test_other_peers_are_refused(self):
        said = subprocess.run([ROOT / "scripts/bench", "--peers", "npm"], capture_output=True, text=True)
        self.assertEqual((said.returncode, said.stderr), (2, "scripts/bench: --peers npm: expected pypi\n"))

    def test_a_core_that_is_not_there_is_refused(self):
        said = subprocess.run([sys.executable, ROOT / "bench/peers_pypi/peers.py", "--core", "100000"],
                              capture_output=True, text=True, env=os.environ)
        self.assertIn("--core is 100000; expected one of", said.stderr)


if __name__ == "__main__":
    unittest.main()
