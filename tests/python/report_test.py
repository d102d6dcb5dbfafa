"""report: figures that it computes, names that are only text, and the program with real files."""

import importlib.util
import json
import os
import random
import re
import shutil
import tempfile
import unittest
import unittest.mock
from html import escape
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.textpath import TextPath
from sprag import report
from sprag.report import page
from sprag.report.analysis import FEWEST_RESIDUALS, check_predictions, consistency
from sprag.report.analysis import innovations, normalized
from sprag.report.content import quantity, rounded, rounded_to
from sprag.report.inputs import Inputs
from sprag.report.pictures import MotionPictures, correlation_picture
from sprag.report.run import certainty_blocks, impacts_blocks, measurement_blocks
from sprag.tables import read_table
from support import SOURCE, FolderTest, ended

LAB_RIG = str(SOURCE / "scenes" / "lab_rig.toml")
HAS_CORE = importlib.util.find_spec("sprag._core") is not None
needs_core = unittest.skipUnless(HAS_CORE, "the compiled part is not built")
WHOLE = (-np.inf, np.inf)  # s
STATES = "k,t,q1,q2,u1,u2,B\n0,0,1,2,0,0,1\n1,8,1,2,0,0,1\n"


def residuals(values) -> pd.DataFrame:
    return pd.DataFrame({"t": range(len(values)), "value": values, "sigma": 1.0, "contact": 1})


def inputs_of(*tables) -> Inputs:
    return Inputs("s.toml", "s", None, tables=[*tables])


class FolderCase(FolderTest):
    def table(self, text: str):
        return read_table(self.file("table.csv", text))

    def report(self, *arguments: str, code: int = 0) -> str:
        """Calls the program in this process, and returns its messages."""
        return self.run_main(report.main, "--output", "r.html", *arguments, code=code).stderr

    def page(self) -> str:
        return (self.folder / "r.html").read_text()


class NumbersTest(unittest.TestCase):
    def test_two_digits_of_sigma_are_shown(self):
        for value, sigma, text in [
            (0.650071234, 6e-5, "0.650071"),
            (1.1457, 0.26, "1.15"),
            (-1.1457, 0.1, "-1.15"),
            (1.000200012345, 1e-9, "1.000200012"),
            (3e-6, 7.2e-6, "3e-06"),
            (-0.0, 1.0, "0"),
            (0.123456789, 0.0, "0.123457"),
            (float("nan"), 1.0, "not determined"),
        ]:
            self.assertEqual(rounded_to(value, sigma), text)

    def test_small_numbers_have_prefixes(self):
        self.assertEqual(quantity(-0.05, "m"), "-50 mm")
        self.assertEqual(quantity(0.0, "s"), "0 s")
        self.assertEqual(quantity(None, "s"), "not determined")
        self.assertEqual(quantity(1.6e-4, "rad"), "0.16 mrad", "as in pictures")

    def test_consistency_refutes_a_wrong_sigma(self):
        draw, runs = np.random.default_rng(29), 2000 if "SPRAG_THOROUGH" in os.environ else 1000
        for n in (FEWEST_RESIDUALS, 400):
            values = draw.standard_normal((runs, n))
            right = sum(consistency(residuals(row)).holds for row in values)
            wrong = sum(consistency(residuals(2.0 * row)).holds for row in values)
            self.assertAlmostEqual(right / runs, 0.95, delta=0.022)
            self.assertLess(wrong / runs, 0.4 if n == FEWEST_RESIDUALS else 0.01)
        self.assertIsNone(consistency(residuals(np.ones(FEWEST_RESIDUALS - 1))))


class AnalysisTest(FolderCase):
    def test_a_contact_that_stays_closed_is_closed_up_to_the_end(self):
        events = read_table(self.file("e.csv", "t,contact,closed\n1,1,1\n2,1,0\n4,1,1\n"))
        states = self.table("k,t,q1,u1\n0,0,0,0\n1,9,0,0\n")
        _, grid = measurement_blocks(inputs_of(states, events))
        self.assertEqual(grid.rows, [["1", "0", "2", "6", "1", "4"]])

    def test_inserted_and_spurious_events_are_not_measured(self):
        table = self.table(
            "t,contact,closed,note\n1,1,1,\n1,1,0,\n2,1,1,spurious\n2,1,0,spurious\n"
            "3,1,1,lost\n3,1,0,lost\n4,1,1,\n4,1,0,\n"
        )
        text, grid = measurement_blocks(inputs_of(table))
        self.assertIn("has 2 events from t = 1 s to 4 s", text)
        self.assertIn("2 rows marked as spurious are not counted", text)
        self.assertIn("2 rows that identify inserted for lost events", text)
        self.assertEqual(grid.rows, [["1", "2", "0", "0", "1", "4"]])

    def test_labels_of_correlations_are_within_the_picture(self):
        label = "beam.bending_stiffness"
        svg = correlation_picture([label, *"abcdef"], np.eye(7)).svg
        (x,) = re.findall(rf'x="([\d.]+)"[^>]*>{label}', svg)
        width = TextPath((0, 0), label + "  1", size=8).get_extents().width
        self.assertGreater(float(x), width)

    def test_innovations_are_those_of_each_reported_closing(self):
        found = innovations(
            self.table(
                "k,t,q1,u1,closing_t,closing_contact,filter_gap,sigma_filter_gap\n"
                "0,0,0,0,-1,0,0,0\n1,1,0,0,0.5,2,0.25,0.5\n2,2,0,0,0.5,2,0.25,0.5\n"
                "3,3,0,0,2.5,1,1,0\n"
            )
        )
        self.assertEqual(found["t"].tolist(), [0.5, 2.5])
        self.assertEqual(found["contact"].tolist(), [2, 1])
        # Without a sigma there is no normalized one.
        self.assertEqual(normalized(found)["value"].tolist(), [0.5])
        self.assertEqual(len(innovations(self.table("k,t,q1,u1\n0,0,0,0\n"))), 0)

    def test_predictions_are_compared_with_the_next_event(self):
        predictions = self.table(
            "made_at,certain_until,t,contact,kind,sigma_t\n"
            "0.5,1,,,,\n"
            "1.5,3,2.1,1,impact,0.3\n"
            "1.5,3,2.9,2,impact,0.4\n"
            "2.5,4,3.2,1,impact,0.1\n"
            "3.5,5,4.5,1,opens,0.1\n"
            "5.5,6,5.9,1,impact,0.1\n"
        )
        events = pd.DataFrame({"t": [1.0, 2.0, 3.0, 4.0], "contact": [1, 1, 2, 1]})
        events["kind"] = ["impact", "closes", "impact", "opens"]
        check = check_predictions(predictions, events, 0.4)
        self.assertEqual((check.made, check.none, check.claimed), (5, 1, 3))
        np.testing.assert_allclose(check.errors["value"], [-0.1, -0.5])
        np.testing.assert_allclose(check.errors["sigma"].iloc[0], 0.5)  # with the jitter
        self.assertEqual(check.errors["t"].tolist(), [2.0, 4.0])

    def test_velocities_are_by_contact_and_kind_with_right_medians(self):
        rows = [(1, "impact", v) for v in (-0.1, -0.2, -0.4, -0.5)]
        rows += [(1, "closes", -0.01), (2, "impact", -1.5), (2, "opens", 0.0)]
        text = "t,contact,kind,velocity_before,sigma_velocity_before,velocity_after"
        text += ",sigma_velocity_after,impulse\n"
        for t, (contact, kind, v) in enumerate(rows):
            text += f"{t},{contact},{kind},{v},0.01,{-0.5 * v},0.01,{-v}\n"
        picture, grid = impacts_blocks(inputs_of(self.table(text)), WHOLE)
        self.assertNotIn("infinite", picture.caption)
        text += "9,2,impact,-1,inf,0,inf,0\n"
        picture, _ = impacts_blocks(inputs_of(self.table(text)), WHOLE)
        self.assertIn("An infinite sigma has no bar.", picture.caption)
        self.assertEqual(grid.head[3:5], ["median speed", "largest speed"])
        shown = [row[:6] for row in grid.rows]
        self.assertEqual(shown[0], ["1", "closes", "1", "10 mm/s", "10 mm/s", "4"])
        self.assertEqual(shown[1], ["1", "impact", "4", "0.3 m/s", "0.5 m/s", "3"])
        self.assertEqual(shown[2], ["2", "impact", "1", "1.5 m/s", "1.5 m/s", "5"])
        self.assertEqual(len(shown), 3)

    def test_a_motion_that_is_a_block_on_a_phone_is_shown_in_part(self):
        t = np.linspace(0.0, 100.0, 800)
        rows = enumerate(zip(t, np.sin(0.8 * np.pi * t)))
        table = self.table("k,t,q1\n" + "".join(f"{k},{x},{y}\n" for k, (x, y) in rows))
        (picture,) = MotionPictures(inputs_of(table), WHOLE).of_motion()
        self.assertIn("Only t = 0 to 50 s is shown", picture.caption)

    def test_an_infinite_bound_has_no_row(self):
        none = self.table("k,t,q1,u1,B\n0,0,1,2,inf\n1,1,1,2,inf\n")
        self.assertEqual(certainty_blocks(inputs_of(none), WHOLE), [])
        late = self.table("k,t,q1,u1,B\n0,0,1,2,inf\n1,1,1,2,0.25\n")
        *_, grid = certainty_blocks(inputs_of(late), WHOLE)
        self.assertEqual(grid.rows, [["B", "table", "none", "0", "0.25 J", "1"]])


class RunTest(FolderCase):
    """A rig of two masses, with jittered events."""

    @classmethod
    def setUpClass(cls):
        cls.recorded = Path(tempfile.mkdtemp(prefix="sprag_report_test_"))
        cls.addClassCleanup(shutil.rmtree, cls.recorded)
        jitter = 2e-5
        scene = cls.of_run("scene.toml")
        Path(scene).write_text(Path(LAB_RIG).read_text() + f"\n[events]\njitter = {jitter}\n")
        rig = "scene.toml --duration 30 --tick 0.01"
        files = "--events exact.csv --states machine.csv"
        ended(cls.recorded, "MASTER_SIM", f"{rig} --speed max --no-lcm {files}")
        draw = random.Random(11)
        rows = ["t,contact,closed"]
        error = 0.0
        for row in Path(cls.of_run("exact.csv")).read_text().splitlines()[1:]:
            t, contact, closed = row.split(",")
            if closed == "1":
                error = draw.gauss(0.0, jitter)  # a pulse, which takes two rows, has one error
            rows.append(f"{float(t) + error:.12f},{contact},{closed}")
        Path(cls.of_run("events.csv")).write_text("\n".join(rows) + "\n")
        files = "--states states.csv --impacts impacts.csv --predictions predictions.csv"
        report = "--report observer.json"
        ended(cls.recorded, "OBSERVER", f"{rig} --replay events.csv --predict 0.5 {files} {report}")
        files = "--truth machine.csv --estimate states.csv --csv V.csv"
        ended(cls.recorded, "SYNC_LOGGER", f"scene.toml {files}")
        names = "events states impacts predictions machine V".split()
        cls.files = [scene, *(cls.of_run(f"{n}.csv") for n in names), cls.of_run("observer.json")]

    @classmethod
    def of_run(cls, name: str) -> str:
        return str(cls.recorded / name)

    def check_self_contained(self, html: str) -> None:
        """No script, nothing that is loaded, one element of each identifier, closed elements."""
        for part in (
            "<script <link <img <image <iframe <object data: @import javascript: onload <?xml "
            "<!ENTITY"
        ).split():
            self.assertNotIn(part, html)
        places = re.sub(r'xmlns(:\w+)?="[^"]*"', "", html)
        self.assertNotRegex(places, "https?://")
        self.assertIn("default-src 'none'; style-src 'unsafe-inline'", html)
        for tag in ("svg", "table", "section", "figure"):
            self.assertEqual(html.count(f"<{tag}"), html.count(f"</{tag}>"))
        self.assertTrue(html.endswith("</html>\n"))
        identifiers = re.findall(r'\sid="([^"]*)"', html)
        self.assertEqual(len(identifiers), len(set(identifiers)))
        for reference in re.findall(r'href="#([^"]*)"|url\(#([^)]*)\)', html):
            self.assertIn("".join(reference), identifiers)

    @needs_core
    def test_run_has_every_section_with_the_figures_of_the_files(self):
        self.assertEqual(self.report(*self.files, "--report", "own.json"), "")
        html = self.page()
        self.check_self_contained(html)
        titles = (
            "Machine and scene; What was measured; Motion; Predicted and measured events; "
            "Impact velocities; Error energy V and bound B; Inconsistencies; "
            "Files, versions and command lines"
        ).split("; ")
        self.assertEqual(re.findall("<h2>(.*?)</h2>", html), titles)
        self.assertEqual(json.loads(Path(self.path("own.json")).read_text())["sections"], titles)
        self.assertIn("general system M, C, K", html)
        self.assertIn("4.5 Hz", html)
        self.assertRegex(html, "<td[^>]*>jitter of event times</td><td>20 µs</td>")
        figures = json.loads(Path(self.of_run("observer.json")).read_text())
        events = pd.read_csv(self.of_run("events.csv"))
        closings = int((events["closed"] == 1).sum())
        self.assertEqual(figures["confidence"]["inconsistencies"], 0)
        self.assertIn(
            f"None of the {closings} closings contradicts the filter&#39;s estimate.", html
        )
        self.assertRegex(html, f"<td>events taken</td><td[^>]*>{figures['events']}</td>")
        V = pd.read_csv(self.of_run("V.csv"))["V"]
        self.assertIn(f"<td>{rounded(V.iloc[-1])} J</td>", html)
        impacts = pd.read_csv(self.of_run("impacts.csv"))
        fastest = impacts["velocity_before"].abs().max()
        self.assertIn(rounded(fastest), html)
        self.assertIn("sprag observer scene.toml --duration 30 --tick 0.01 --replay ", html)
        self.assertIn("innovations are within 2 sigma", html)
        self.assertIn("Sigma passes this test.", html)

    @needs_core
    def test_a_wrong_sigma_is_reported(self):
        states = pd.read_csv(self.of_run("states.csv"), float_precision="round_trip")
        states["sigma_filter_gap"] *= 0.3
        states.to_csv(self.path("wrong.csv"), index=False)
        html = page([self.files[0], self.files[1], self.path("wrong.csv")])
        self.assertIn("less certain than it claims", html)

    @needs_core
    def test_sigma_of_exact_times_is_not_tested(self):
        html = page([LAB_RIG, *self.files[1:3]])
        self.assertIn("Whether sigma is right is not tested.", html)
        self.assertNotIn("this test", html)
        self.assertEqual(page([LAB_RIG, *self.files[1:3]]), html, "equal files, equal pages")

    @needs_core
    def test_identification_has_parameters_and_residuals(self):
        nominal = Path(self.files[0]).read_text()
        scene = self.path("wrong.toml")
        Path(scene).write_text(nominal.replace("restitution = 0.6", "restitution = 0.55"))
        options = f"events.csv {scene} --free impact.restitution,system.K,system.C"
        with_report, as_json = self.path("identify.json"), self.path("json.json")
        ended(self.recorded, "IDENTIFY", f"{options} --report {with_report}")
        Path(as_json).write_text(ended(self.recorded, "IDENTIFY", f"{options} --json"))
        for file in (with_report, as_json):
            html = page([scene, self.of_run("events.csv"), file])
            self.check_self_contained(html)
            self.assertIn("<strong>The events fit, with 3 parameters as found.</strong>", html)
            self.assertIn("predicts the impacts of the last fifth within", html)
            self.assertEqual(html.count("<svg"), 3)  # intervals, correlations, residuals
            self.assertIn("Fitted values with 95 % intervals", html)
            self.assertIn(">1.00<", html)  # on the diagonal of the correlations
            self.assertIn("residuals are within 2 sigma", html)
            self.assertNotIn("<h2>Motion</h2>", html)
            for parameter in json.loads(Path(file).read_text())["parameters"]:
                shown = rounded_to(parameter["value"], parameter["sigma"])
                self.assertRegex(html, f'>{parameter["parameter"]}</td>.*>{shown}</td>')
            # --json has no command line.
            self.assertEqual("sprag identify " in html, file == with_report)

    def test_without_the_compiled_part_the_rest_is_shown(self):
        with unittest.mock.patch.dict("sys.modules", {"sprag._core": None}):
            said = self.report(*self.files[:3], self.files[-1])
        self.assertIn("the compiled part of the Python package is not installed", said)
        html = self.page()
        self.check_self_contained(html)
        self.assertIn("this page leaves out the rows about the machine, its contacts", html)
        self.assertIn("Gap at each contact", html)
        self.assertIn("None of the ", html)
        self.assertIn("<h2>Motion</h2>", html)


class ProgramTest(FolderCase):
    def test_refused_identification_has_its_reason(self):
        text = """{"program": "identify", "version": "9", "scene": "other", "fits": false,
            "verdict": "the events do not fit", "problem": "wrong_model", "reason": "They scatter.",
            "exit": 3, "parameters": [], "missing": [{"t": 3.25, "contact": 1}]}"""
        self.report(LAB_RIG, self.file("i.json", text))
        html = self.page()
        self.assertIn('class="verdict bad"', html)
        self.assertIn("<strong>The events do not fit.</strong> They scatter.", html)
        self.assertIn("The identification was of the scene other", html)
        self.assertIn(">lost: the machine has an impact there</td>", html)
        self.assertIn("3.25", html)

    def test_inconsistencies_are_listed_with_their_times(self):
        text = """{"program": "observer", "settled_tick": 10,
            "degraded": [{"from": 4.5, "to": 4.875}],
            "confidence": {"inconsistencies": 7, "first_inconsistencies": [{"t": 4.75, "contact": 1,
            "suspicion": "missing event", "known_loss": true, "square_over_variance": 123}]}}"""
        self.report(LAB_RIG, self.file("o.json", text))
        html = self.page()
        self.assertIn("gate failed 7 times, first at t = 4.75 s, contact 1", html)
        self.assertIn('<td class="number">4.75</td>', html)
        self.assertIn("<td>missing event</td>", html)
        self.assertIn("The first 1 of 7.", html)
        self.assertIn("4.875", html)

    @needs_core
    def test_a_shaken_stop_does_not_rest_and_a_record_is_drawn(self):
        states = "k,t,q1,q2,q3,q4,u1,u2,u3,u4,B\n0,0,1,2,0,0,1,2,0,0,1\n1,1,1,2,0,0,1,2,0,0,1\n"
        swept = str(SOURCE / "scenes" / "swept_beam.toml")
        html = page([swept, self.file("s.csv", states)])
        self.assertIn("moves with the shaken frame", html)
        self.assertNotIn("<td>rests</td>", html)
        self.assertIn("Recorded acceleration of the frame", html)
        self.assertIn('<th class="number">clearance [mm]</th>', html)
        self.assertRegex(html, ">force 1, times its direction</td><td[^>]*>a recorded input</td>")
        self.assertIn("<td>rests</td>", page([LAB_RIG, self.file("s.csv", STATES)]))

    def test_hostile_names_are_text(self):
        evil = "</title><script>alert(1)</script>&#x27;\"'`touch ran`\n\x1b[31m]]>$\\frac$"
        scene = self.file(
            "a.toml",
            f"name = {json.dumps(evil)}\n[system]\nM = [[1]]\nC = [[1]]\nK = [[1]]\n[[contact]]\n"
            "direction = [1]\n[impact]\nrestitution = 0.5\n",
        )
        states = self.file(
            "s.csv",
            "k,t,q1,u1,B,sigma_q1,<script>x$y$,sigma_<script>x$y$\n"
            "0,0,1,2,1,1,1,1\n1,8,3,4,1,1,2,1\n",
        )
        fitted = {"parameter": evil, "unit": evil, "determined": True, "value": 1.0, "nominal": 2.0}
        ends = {"low": 0.5, "high": 1.5, "sigma": 0.2, "range": [0, 3]}
        identified = {
            **{key: evil for key in ("version", "scene", "verdict", "problem", "reason", "held")},
            "program": "identify",
            "command": [evil, "--free", evil],
            "fits": False,
            "parameters": [{**fitted, **ends}, {**fitted, "parameter": "b"}],
            "correlations": [[1.0, 0.5], [0.5, 1.0]],
        }
        first = [{"t": 1.0, "contact": 1, "suspicion": evil}]
        observed = {
            **{"program": "observer", "version": evil, "skipped": {evil: 3}},
            "confidence": {"inconsistencies": 2, "first_inconsistencies": first},
        }
        i = self.file("i.json", json.dumps(identified))
        o = self.file("<img src=x onerror=alert(1)>.json", json.dumps(observed))
        self.report(scene, f"{evil}={states}", i, o, "--title", evil)
        html = self.page()
        for part in ("<script", "<img", "\x1b", "alert(1)</script>"):
            self.assertNotIn(part, html)
        self.assertIn("<h1>&lt;/title&gt;&lt;script&gt;alert(1)", html)
        self.assertIn(escape("$\\frac$"), html)
        self.assertFalse((self.folder / "ran").exists())

    def test_any_json_is_a_report_or_refused(self):
        o = self.file(
            "o.json",
            '{"program":"observer","events":"many","skipped":[1],"degraded":{"a":1},"command":7,'
            '"confidence":{"inconsistencies":"x","first_inconsistencies":[3,{"t":"x"}],'
            '"bound":[]}}',
        )
        i = self.file(
            "i.json",
            '{"program":"identify","verdict":3,"parameters":[1,{"parameter":4,"determined":true},'
            '{"value":"x"}],"correlations":[[1],[2,"x"],3],"residuals":{"t":[1,"x",3],'
            '"contact":[-1,2,99],"residual":[1,2,3],"sigma":[0,null,1]},"missing":7,'
            '"drift":{"value":1},"others":3, "scatter": 1e999, "jitter": ' + "9" * 400 + "}",
        )
        page([LAB_RIG, o, i])
        for text, expected in [
            (b"{", "is no complete JSON"),
            (b'{"a": 1}', "has no key program"),
            (b'{"program": 3}', "has no key program"),
            (b'{"program": "\xff"}', "is no complete JSON"),
            (b'{"a":' * 100000, "is no complete JSON"),
            (b"a,b\n1,2\n", "the header is none"),
            (b"", "the header is none"),
        ]:
            bad = self.folder / "bad.json"
            bad.write_bytes(text)
            said = self.report(LAB_RIG, str(bad), code=2)
            for part in (str(bad), expected, "expected a scene, a CSV of states"):
                self.assertIn(part, said)
            self.assertFalse((self.folder / "r.html").exists())

    def test_bad_usage_exits_with_two_and_keeps_an_old_report(self):
        states = self.file("s.csv", STATES)
        foreign = self.file("f.csv", "k,t,q1,u1,B\n0,0,1,2,1\n1,8,1,2,1\n")
        self.file("r.html", "old")
        for arguments, expected in [
            ([LAB_RIG, self.path("none.csv")], self.path("none.csv")),
            ([LAB_RIG, self.path("none.json")], "expected a scene, a CSV of states"),
            ([LAB_RIG], "no file of a run is given"),
            ([states], "no scene is given"),
            ([LAB_RIG, LAB_RIG, states], "is a second scene"),
            ([LAB_RIG, states, "--from", "9"], "nothing to show"),
            ([LAB_RIG, states, "--output", "r.doc"], "must end in .html or .pdf"),
            ([LAB_RIG, foreign], "has 1 coordinates; the scene has 2"),
        ]:
            self.assertIn(expected, self.report(*arguments, code=2))
            self.assertEqual(self.page(), "old")
        self.assertEqual(Path(states).read_text(), STATES)

    def test_a_damaged_file_is_shown_up_to_the_damage(self):
        states = self.file("s.csv", STATES + "2,9,1\n")
        self.assertIn(f"{states}:4: 3 fields", self.report(LAB_RIG, states, code=1))
        self.assertIn(f"{states}:4: 3 fields", self.page())
        self.assertIn("states of an estimate, 2 rows", self.page())

    def test_pdf_needs_a_program_that_works(self):
        arguments = [LAB_RIG, self.file("s.csv", STATES), "--output", "r.pdf"]
        with unittest.mock.patch.dict(os.environ, PATH=self.path("bin")):
            if importlib.util.find_spec("weasyprint") is None:
                self.assertIn("apt install chromium", self.report(*arguments, code=1))
            else:
                self.report(*arguments)
                self.assertEqual((self.folder / "r.pdf").read_bytes()[:5], b"%PDF-")
                (self.folder / "r.pdf").unlink()
            chromium = Path(self.file("bin/chromium", "#!/bin/sh\nexit 3\n"))
            chromium.chmod(0o700)
            said = self.report(*arguments, code=1)
        self.assertIn("chromium has failed to convert", said)
        self.assertFalse((self.folder / "r.pdf").exists())

    @unittest.skipUnless(
        shutil.which("chromium"), "no chromium: scripts/install_packages --browser"
    )
    def test_pdf_is_made_by_chromium(self):
        states = self.file("s.csv", STATES)
        self.report(LAB_RIG, states, "--format", "pdf", "--output", "a name")
        self.assertEqual((self.folder / "a name").read_bytes()[:5], b"%PDF-")
