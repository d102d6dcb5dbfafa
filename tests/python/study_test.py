"""The program study and run_study(): executors, interruptions, files of rows, refusals."""

import contextlib
import importlib.util
import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import time
import unittest
import unittest.mock
import warnings
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import sprag
from sprag import study as studies
from support import BUILD, SOURCE, FolderTest

PROGRAM = BUILD / "tools/study"
MPIRUN = shutil.which("mpirun")


def has(module):
    return importlib.util.find_spec(module) is not None


class StudyTest(FolderTest):
    references: dict[int, str] = {}
    environment = {
        **os.environ,
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
    }

    def study(self, runs, name="study"):
        """A study of 12 * runs runs."""
        file = self.folder / f"{name}.toml"
        file.write_text(
            f"""
scene = "{SOURCE}/scenes/lab_rig.toml"
duration = 5.0
samples = 50
tick = 0.02
seed = 3
estimators = ["replica", "both"]
record = ["V_floor", "time_below", "nees", "trusted", "impacts"]
runs = {runs}
[start]
replica = 0.4
[vary]
events.jitter = {{ log = [1e-6, 1e-3], points = 4 }}
observer.impact.restitution = {{ relative = [-0.1, 0.1], points = 3 }}
disturbance.lost = {{ linear = [0.0, 0.1], random = true }}
"""
        )
        return file

    def command(self, file, folder, *more):
        """The program as a process, which the test interrupts."""
        return [PROGRAM, file, "--output", self.folder / folder, *more]

    def run_program(self, command, code=0):
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=self.folder, env=self.environment
        )
        self.assertEqual(done.returncode, code, done.stderr)

    def run_study(self, file, folder, *more, code=0):
        """The program within this process."""
        return self.run_main(studies.main, file, "--output", folder, *more, code=code)

    def rows(self, folder):
        return (self.folder / folder / "rows.csv").read_text()

    def reference(self, runs):
        """The rows of one thread of study(runs)."""
        if runs not in self.references:
            self.run_study(self.study(runs, "reference"), "reference", "--jobs", "1")
            self.references[runs] = self.rows("reference")
        return self.references[runs]

    def rows_so_far(self, folder):
        file = self.folder / folder / "rows.part.csv"
        return file.read_text().count("\n") if file.exists() else 0

    def break_off(self, command, folder, rows, end):
        """Starts the command and ends it as soon as there are more than `rows` rows."""
        process = subprocess.Popen(
            command, stderr=subprocess.PIPE, text=True, cwd=self.folder, env=self.environment
        )
        while self.rows_so_far(folder) <= rows:
            self.assertIsNone(process.poll(), "it ended before")
            time.sleep(0.01)
        end(process)
        _, error = process.communicate(timeout=60)
        self.assertNotEqual(process.returncode, 0)
        self.assertFalse((self.folder / folder / "rows.csv").exists())
        return error


class ExecutorsTest(StudyTest):
    def test_rows_do_not_depend_on_the_executor(self):
        file = self.study(5)
        expected = self.reference(5)
        self.assertEqual(expected.count("\n"), 61)
        self.run_study(file, "three", "--jobs", "3", "--chunk", "1")
        self.assertEqual(self.rows("three"), expected)
        with ProcessPoolExecutor(2) as executor:
            sprag.run_study(file, executor, jobs=2, output=self.folder / "processes")
        self.assertEqual(self.rows("processes"), expected)
        in_memory, of_file = sprag.run_study(file), sprag.read_study(self.folder / "three")
        self.assertEqual(in_memory.names, of_file.names)
        for name in of_file.names:
            self.assertEqual(in_memory[name].dtype, of_file[name].dtype)
            np.testing.assert_array_equal(in_memory[name], of_file[name])

    @unittest.skipUnless(MPIRUN and has("mpi4py"), "python3-mpi4py or openmpi-bin is missing")
    def test_ranks_of_mpi(self):
        file = self.study(5)
        expected = self.reference(5)
        report = self.folder / "report.json"
        mpirun = [MPIRUN, "--oversubscribe", "--bind-to", "none", "-n"]
        for ranks in (1, 3):
            folder = f"ranks_{ranks}"
            command = self.command(file, folder, "--mpi", "--chunk", "2", "--report", report)
            self.run_program([*mpirun, str(ranks), *command])
            self.assertEqual(self.rows(folder), expected)
            self.assertEqual(json.loads(report.read_text())["workers"], max(ranks - 1, 1))
        self.run_program([*mpirun, "2", *self.command(self.folder / "none", "other", "--mpi")], 2)

    @unittest.skipUnless(has("distributed"), "python3-distributed is missing")
    def test_workers_of_dask(self):
        from distributed import LocalCluster

        file = self.study(5)
        local = {"host": "127.0.0.1", "protocol": "tcp://", "dashboard_address": None}
        workers = {"n_workers": 2, "threads_per_worker": 1, "processes": False}
        with warnings.catch_warnings(), contextlib.ExitStack() as stack:
            warnings.simplefilter("ignore")  # those of Dask
            cluster = stack.enter_context(LocalCluster(**local, **workers))
            report = self.folder / "report.json"
            address = cluster.scheduler_address
            self.run_study(file, "dask", "--dask", address, "--chunk", "3", "--report", report)
        self.assertEqual(self.rows("dask"), self.reference(5))
        self.assertEqual(json.loads(report.read_text())["workers"], 2)

    def test_options_of_workers_exclude_each_other(self):
        file = self.study(1)
        for options in (["--mpi", "--dask", "x"], ["--mpi", "--jobs", "2"]):
            self.run_study(file, "folder", *options, code=2)
        with unittest.mock.patch.dict(os.environ, OMPI_COMM_WORLD_SIZE="2"):
            refused = self.run_study(file, "folder", code=2)
        self.assertIn("under mpirun give --mpi", refused.stderr)
        self.assertFalse((self.folder / "folder").exists())


class ProgressTest(unittest.TestCase):
    def test_it_estimates_the_time_left(self):
        progress = studies.Progress(total=1000, before=20, workers=2, begin=100.0)
        with unittest.mock.patch("time.perf_counter", return_value=160.0):
            self.assertEqual(str(progress), "20 of 1000 runs, 0 per second, 0 failed")
            progress.done, progress.failures = 30, 1
            left = "50 of 1000 runs, 0.5 per second, 31 min 40 s left, 1 failed"
            self.assertEqual(str(progress), left)
            progress.done = 980
            self.assertEqual(str(progress), "1000 of 1000 runs, 16.3 per second, 1 failed")


class InterruptionsTest(StudyTest):
    def test_a_killed_study_continues(self):
        file = self.study(20)
        kept = 0
        for sent in (signal.SIGTERM, signal.SIGKILL):
            self.break_off(
                self.command(file, "killed", "--chunk", "3", "--jobs", "1"),
                "killed",
                kept + 30,
                lambda process: process.send_signal(sent),
            )
            kept = self.rows_so_far("killed")
        with open(self.folder / "killed/rows.part.csv", "a") as rows:
            rows.write("239,11,19,0.0")  # a torn row
        report = self.folder / "report.json"
        self.run_study(file, "killed", "--report", report)
        found = json.loads(report.read_text())
        self.assertEqual(found["before"], kept - 1)
        self.assertEqual(found["done"], 240 - (kept - 1))
        self.assertEqual(self.rows("killed"), self.reference(20))

    def test_a_killed_worker_loses_its_own_runs_only(self):
        file = self.study(5)
        with ProcessPoolExecutor(2) as executor:
            executor.submit(os.getpid).result()
            os.kill(next(iter(executor._processes)), signal.SIGKILL)
            with self.assertRaisesRegex(sprag.Error, "a worker ended"):
                sprag.run_study(file, executor, jobs=2, output=self.folder / "killed")
        sprag.run_study(file, output=self.folder / "killed")
        self.assertEqual(self.rows("killed"), self.reference(5))

    def test_workers_end_with_their_parent(self):
        file = self.study(4000)
        code = f"""
from concurrent.futures import ProcessPoolExecutor
import sprag
executor = ProcessPoolExecutor(2)
sprag.run_study({str(file)!r}, executor, jobs=2, output="killed")
"""
        children = []

        def kill(process):
            listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
            children.extend(map(int, listed.split()))
            process.kill()

        self.break_off([sys.executable, "-c", code], "killed", 30, kill)
        self.assertEqual(len(children), 2)
        for child in children:
            while Path(f"/proc/{child}").exists():
                if "State:\tZ" in Path(f"/proc/{child}/status").read_text():
                    break
                time.sleep(0.05)

    def test_a_full_disk_keeps_written_rows(self):
        file = self.study(5)
        (self.folder / "full").mkdir()
        done = subprocess.run(
            self.command(file, "full", "--chunk", "7"),
            capture_output=True,
            text=True,
            # A limit of the size of a file simulates the full disk.
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (5000, 5000)),
        )
        self.assertEqual(done.returncode, 1, done.stderr)
        self.assertIn("rows.part.csv: File too large", done.stderr)
        self.assertIn("the same command goes on", done.stderr)
        kept = (self.folder / "full/rows.part.csv").read_text()
        self.assertGreater(len(kept), 3000)
        self.run_study(file, "full")
        self.assertEqual(self.rows("full"), self.reference(5))

    def test_shards_combine_to_the_study(self):
        file = self.study(5)
        for shard in ("3/4", "1/4", "4/4", "2/4"):
            self.run_study(file, "shards", "--shard", shard, "--jobs", "1")
        whole = self.folder / "shards/shard-2-of-4.csv"
        text = whole.read_text()
        whole.with_suffix(".part.csv").write_text(text[: len(text) // 2])
        whole.unlink()
        report = self.folder / "report.json"
        self.run_study(file, "shards", "--report", report)
        self.assertEqual(self.rows("shards"), self.reference(5))
        self.assertTrue(0 < json.loads(report.read_text())["done"] < 15)
        (self.folder / "shards/shard-1-of-2.json").write_text(
            (self.folder / "shards/shard-1-of-4.json").read_text()
        )
        (self.folder / "shards/rows.csv").unlink()
        self.assertIn("shard differs", self.run_study(file, "shards", code=2).stderr)
        (self.folder / "shards/shard-1-of-2.json").unlink()
        rows = (self.folder / "shards/shard-1-of-4.csv").read_text()
        (self.folder / "shards/rows.part.csv").write_text(rows)
        twice = "shard-1-of-4.csv: has run 0, which .*rows.part.csv has too"
        self.assertRegex(self.run_study(file, "shards", code=2).stderr, twice)


class RowsTest(StudyTest):
    layout = studies.Layout(["index", "n", "x", "failure"], 2)
    header = "index,n,x,failure\n"

    def read(self, text):
        file = self.folder / "rows.csv"
        file.write_bytes(text.encode())
        return studies.read_rows(file, self.layout, studies.Range(0, 100))

    def test_a_file_ends_with_its_last_complete_run(self):
        whole = self.header + "4,1,0.5,\n4,2,0.5,\n5,0,nan,too fast\n2,1,0,\n2,2,0,\n"
        for cut in ("", "3,1,0.25,\n", "3,1,0.25,\n3,2,0.", "3", "3,1,0.25,\n3,2,0.5,"):
            first, second = self.read(whole + cut)
            self.assertEqual(second.end, len(whole), cut)
            self.assertEqual((first.failures, second.failures), (1, 0))
            self.assertEqual((first.runs, second.runs), ((4, 6), (2, 3)))
        for nothing in ("", self.header[:5], self.header, self.header + "1,1,0,\n"):
            self.assertEqual(self.read(nothing), [])

    def test_rows_of_another_study_are_refused_with_their_line(self):
        for text, line in (
            ("index,n,y,failure\n", ":1: has another header"),
            (self.header + "100,1,0,\n", ":2: has index 100"),
            (self.header + "1,2,0,\n", ":2: does not follow"),
            (self.header + "1,1,0,\n2,1,0,\n", ":3: does not follow"),
            (self.header + "1,1,0\n", ":2: is no row"),
            (self.header + "one,1,0,\n", ":2: is no row"),
            (self.header + "1,0,0,\n", ":2: is no row"),
            (self.header + "1,1,0,\r\n1,2,0,\r\n", ":2: "),
        ):
            with self.subTest(text), self.assertRaisesRegex(sprag.InputError, line):
                self.read(text)

    def test_missing_ranges(self):
        missing = studies.missing_ranges
        self.assertEqual(missing(studies.Range(0, 10), []), [(0, 10)])
        done = [studies.Range(7, 9), studies.Range(0, 2), studies.Range(2, 4)]
        self.assertEqual(missing(studies.Range(0, 10), done), [(4, 7), (9, 10)])
        self.assertEqual(missing(studies.Range(3, 5), [studies.Range(3, 5)]), [])

    def test_a_file_belongs_to_one_process(self):
        file = self.folder / "rows.part.csv"
        rows = studies.RowFile(file)
        with self.assertRaisesRegex(sprag.Error, "another process"):
            studies.RowFile(file)
        rows.close()

    def test_a_failed_run_has_a_row(self):
        # Each axis alone is outside the support, but both together are inside.
        file = self.folder / "inside.toml"
        file.write_text(
            f'scene = "{SOURCE}/scenes/lab_rig.toml"\nduration = 1.0\nrecord = ["impacts"]\n'
            "[vary]\ncontact.1.clearance = [0.01, 0.002]\nmaster.q.2 = [0.0, -0.005]\n"
        )
        report = self.folder / "report.json"
        done = self.run_study(file, "inside", "--report", report)
        self.assertIn("4 of 4 runs", done.stderr)
        self.assertIn("1 failed", done.stderr)
        study = sprag.read_study(self.folder / "inside")
        self.assertIn("starts inside the support of contact 1", study["failure"][3])
        self.assertTrue(np.isnan(study["impacts"][3]))
        self.assertEqual(json.loads(report.read_text())["failed"], 1)

    def test_a_section_has_a_row_for_each_point(self):
        # Its orbit has the period of the force, in closed form.
        file = self.folder / "orbit.toml"
        file.write_text(
            f'scene = "{SOURCE}/scenes/impact_oscillator.toml"\n'
            'record = ["poincare", "attractor", "impacts_per_period", "lyapunov"]\n'
            '[machine]\ntransient = 20\nperiods = 40\ncoordinates = ["u1"]\n'
            "[vary]\nforce.1.frequency = [34.0, 26.0, 20.0]\n"
        )
        self.run_study(file, "orbit", "--chunk", "1")
        study = sprag.read_study(self.folder / "orbit")
        first = study["index"] == 0
        self.assertEqual(study["n"][first].tolist(), list(range(1, 41)))
        np.testing.assert_allclose(study["u1"][first], 0.1855338168983542, atol=1e-9)
        self.assertEqual(set(study["attractor.period"][first]), {1.0})
        self.assertEqual(set(study["impacts_per_period"][first]), {1.0})
        self.assertTrue((study["lyapunov"][first] < -0.01).all())
        whole = self.rows("orbit")  # interrupted within the rows of a run
        (self.folder / "orbit/rows.part.csv").write_text(whole[: len(whole) // 2])
        (self.folder / "orbit/rows.csv").unlink()
        self.run_study(file, "orbit")
        self.assertEqual(self.rows("orbit"), whole)

    def test_a_recorded_input_of_the_observer_varies(self):
        scene = self.folder / "beam.toml"
        text = (SOURCE / "scenes/swept_beam.toml").read_text()
        record = f'"{SOURCE}/scenes/records/swept_base.csv"'
        text = text.replace('"records/swept_base.csv"', record)
        spline = 'interpolation = "spline"'
        scene.write_text(text.replace(spline, f'{spline}\noutside = "hold"'))
        file = self.folder / "study.toml"
        file.write_text(
            'scene = "beam.toml"\nduration = 5.0\nsamples = 200\nestimators = ["both"]\n'
            'record = ["V_floor", "nees"]\n[vary]\n'
            "observer.excitation.gain = [0.9, 1.0]\nevents.jitter = [1e-6]\n"
        )
        floors = sprag.run_study(file)["both.V_floor"]
        self.assertGreater(floors[0], 1e3 * floors[1])
        scene.write_text(text)  # no values outside of the record
        file.write_text(file.read_text().replace("5.0", "7.0"))
        refused = self.run_study(file, "more", code=2)
        self.assertIn("the recorded input ends at t = 6", refused.stderr)


class RefusalsTest(StudyTest):
    def test_the_folder_of_another_study(self):
        file = self.study(1)
        self.run_study(file, "folder")
        before = self.rows("folder")
        changed = self.folder / "changed.toml"
        changed.write_text(file.read_text() + "# changed\n")
        for other in (changed, self.study(2, "other")):
            refused = self.run_study(other, "folder", code=2)
            self.assertIn("belongs to another study", refused.stderr)
        (self.folder / "folder/manifest.json").unlink()
        self.run_study(file, "folder", code=2)
        self.assertEqual(self.rows("folder"), before)

    def test_a_name_that_is_a_path(self):
        text = self.study(1).read_text()
        for name in ("../out", "/tmp/out", ".", "..", "", "a/b", "a\\nb", "\\u001b[31m"):
            file = self.folder / "named.toml"
            file.write_text(f'name = "{name}"\n{text}')
            refused = self.run_main(studies.main, file, code=2)
            self.assertIn("use --output FOLDER", refused.stderr)
            self.assertNotIn("\x1b", refused.stderr)

    def test_bad_usage(self):
        file = self.study(1)
        copy = self.folder / "negative.toml"
        copy.write_text(file.read_text().replace("samples = 50", "samples = -1"))
        cases = [
            (file, ["--shard", of], "must be i/n") for of in ("0/4", "5/4", "1/", "a/b", "1/2/3")
        ]
        whole = "must be a whole number from 1 to 1024"
        cases += [
            (file, ["--jobs", of], whole) for of in ("1025", "0", "-1", "99999999999999999999")
        ]
        cases += [("none.toml", [], "none.toml"), (copy, [], "negative.toml:4:11: samples")]
        for given, options, expected in cases:
            with self.subTest(expected):
                refused = self.run_study(given, "folder", *options, code=2)
                self.assertIn(expected, refused.stderr)
        self.assertFalse((self.folder / "folder").exists())

    def test_a_result_that_would_overwrite_an_input(self):
        file = self.study(1)
        (self.folder / "own").mkdir()
        own = file.rename(self.folder / "own/rows.csv")
        text = own.read_text()
        self.assertIn("would overwrite", self.run_study(own, "own", code=2).stderr)
        self.assertEqual(own.read_text(), text)


class ResultsTest(StudyTest):
    @unittest.skipUnless(has("xarray"), "python3-xarray is missing")
    def test_a_table_and_a_dataset_with_a_dimension_for_each_axis(self):
        file = self.study(2)
        study = sprag.run_study(file)
        if has("pandas"):
            table = study.table()
            self.assertEqual(list(table.columns), study.names)
            np.testing.assert_array_equal(table["both.V_floor"], study["both.V_floor"])
        data = study.dataset()
        V = data["both.V_floor"]
        self.assertEqual(V.dims, ("events.jitter", "observer.impact.restitution", "run"))
        self.assertEqual(V.shape, (4, 3, 2))
        np.testing.assert_array_equal(V.values.ravel(), study["both.V_floor"])
        np.testing.assert_allclose(data["observer.impact.restitution"], [-0.1, 0.0, 0.1])
        self.assertIn("disturbance.lost", data.data_vars)
        self.run_study(file, "part", "--shard", "2/2")
        part = sprag.read_study(self.folder / "part/shard-2-of-2.csv").dataset()
        self.assertEqual(part["both.V_floor"].shape, (4, 3, 2))
        self.assertEqual(int(part["impacts"].isnull().sum()), 12)
