"""Study files: how they are read, the values and the scenes of each run, and their errors."""


import numpy as np

import sprag
from sprag._figures import figures
from sprag._study_file import StudyRuns, read_study_file
from support import SOURCE, FolderTest

RIG = f"{SOURCE}/scenes/lab_rig.toml"
BOTH = 'estimators = ["replica", "both"]\n'


class StudyFileTest(FolderTest):
    def write(self, text, scene="lab_rig"):
        return self.file("study.toml", f'scene = "{SOURCE}/scenes/{scene}.toml"\n{text}')

    def read(self, text, scene="lab_rig"):
        return read_study_file(self.write(text, scene))

    def test_a_grid_is_a_product_in_the_order_of_the_file(self):
        study = self.read(
            """
runs = 3
[vary]
impact.restitution = [0.5, 0.6]
events.jitter = { log = [1e-6, 1e-2], points = 3 }
disturbance.lost = { linear = [0.0, 0.2], points = 3, zip = "trouble" }
contact.1.clearance = { relative = [-0.5, 0.5, 1.0], zip = "trouble" }
"""
        )
        axes = ["impact.restitution", "events.jitter", "disturbance.lost", "contact.1.clearance"]
        self.assertEqual(study.columns, ["index", "point", "run", *axes, "failure"])
        self.assertEqual((study.points, study.runs), (18, 3))
        for index in range(54):
            point = index // 3
            expected = [0.5 if point < 9 else 0.6, 10.0 ** (-6 + 2 * (point // 3 % 3))]
            expected += [0.1 * (point % 3), (0.001, 0.003, 0.004)[point % 3]]
            np.testing.assert_allclose(study.values_at(index), expected, rtol=1e-15)
        setting = study.setting_of(study.values_at(53))
        (contact,) = setting.machine.model.contacts
        self.assertEqual((contact.restitution, contact.clearance), (0.6, 0.004))
        self.assertEqual(setting.observer.jitter, 1e-2)
        self.assertEqual(setting.knobs, {"disturbance.jitter": 1e-2, "disturbance.lost": 0.2})

    def test_random_axes_are_drawn_for_each_run(self):
        text = """
runs = 200
[vary]
impact.restitution = { linear = [0.2, 0.6], random = true }
contact.1.clearance = { log = [1e-4, 1e-2], random = true }
events.jitter = [1e-5, 1e-4]
"""
        study, common = self.read(text), self.read(f'draws = "common"\n{text}')
        values = np.array([study.values_at(index) for index in range(400)])
        shared = np.array([common.values_at(index) for index in range(400)])
        self.assertTrue(((values[:, 0] >= 0.2) & (values[:, 0] < 0.6)).all())
        self.assertTrue(((values[:, 1] >= 1e-4) & (values[:, 1] < 1e-2)).all())
        self.assertEqual(len(set(values[:, 0])), 400)
        self.assertEqual(len(set(shared[:, 0])), 200)
        np.testing.assert_array_equal(shared[:200, :2], shared[200:, :2])
        # Half of them, within five standard deviations.
        self.assertAlmostEqual(int((values[:, 1] < 1e-3).sum()), 200, delta=5 * 10)

    def test_a_key_of_the_observer_does_not_change_the_machine(self):
        study = self.read(
            """
[vary]
impact.restitution = [0.5, 0.7]
observer.impact.restitution = { relative = [-0.1, 0.0] }
observer.system.K.1.1 = [1810.0]
system.K.1.2 = [-610.0]
"""
        )
        values = study.values_at(2)
        self.assertAlmostEqual(values[1], 0.63, 15, "relative to the machine's varied value")
        setting = study.setting_of(values)
        self.assertEqual(setting.machine.model.contacts[0].restitution, 0.7)
        self.assertAlmostEqual(setting.observer.model.contacts[0].restitution, 0.63, 15)
        for scene, first in ((setting.machine, 1800.0), (setting.observer, 1810.0)):
            self.assertEqual(scene.model.K[0].tolist(), [first, -610.0])
            self.assertEqual(scene.model.K[1, 0], -610.0)

    def error(self, text, scene="lab_rig"):
        """The error without the name of the file."""
        with self.assertRaises(sprag.SceneError, msg=text) as caught:
            self.read(text, scene)
        place = f"{self.path('study.toml')}:"
        self.assertTrue(str(caught.exception).startswith(place))
        return str(caught.exception).removeprefix(place)

    def test_errors_name_position_and_allowed_values(self):
        lasting = "duration = 1.0"
        for text, expected in (
            ("runs = 0", "2:8: runs is 0; must be in 1..1000000000"),
            ("runs = 1.5", "2:8: runs is a float; must be an integer"),
            ("rnus = 1", "2:1: unknown key rnus; did you mean runs?"),
            ('draws = "other"', '2:9: draws is "other"; must be "independent" or "common"'),
            ("duration = inf", "2:12: duration is inf; must be finite"),
            (
                'estimators = ["replika"]',
                '2:15: estimators[1] is "replika"; did you mean "replica"?',
            ),
            (
                'record = ["impacts", "impacts"]',
                '2:22: record[2] is "impacts" again; must be another one',
            ),
            ('record = ["impacts"]', "1:1: missing key duration"),
            (
                f'record = ["V_floor"]\n{lasting}',
                "2:10: record has quantities of an estimator; must go with estimators = [...]",
            ),
            (
                f'estimators = ["replica"]\nrecord = ["nees"]\n{lasting}',
                "3:10: record has nees, beyond_3_sigma or trusted, which a replica does not tell; "
                "must go with the estimator timing, both or adaptive",
            ),
            (
                f'estimators = ["both"]\nrecord = ["worse"]\n{lasting}',
                "3:10: record has worse, which is against the replica; must go with the estimators "
                "replica and timing, both or adaptive",
            ),
            (
                f'estimators = ["adaptive"]\nrecord = ["V_floor"]\n{lasting}\n[vary]\n'
                "observer.modes = [1]",
                "2:14: estimators has adaptive, which seeks keys of the scene; must be without it "
                "where observer.modes varies",
            ),
            (
                '[machine]\ncoordinates = ["q3"]',
                '3:16: machine.coordinates[1] is "q3"; must be one of q1, q2, u1, u2',
            ),
            ("[disturbance]\nlost = 1.5", "3:8: disturbance.lost is 1.5; must be in [0, 1]"),
            ("start = 3", "2:9: start is an integer; must be a table"),
            (
                "[vary]\nimpact.restituton = [0.5]",
                f"3:21: vary.impact.restituton = 0.5: {RIG}: unknown key impact.restituton; did "
                "you mean restitution?",
            ),
            (
                "[vary]\nimpact.restitution = [0.5, 1.5]",
                f"3:22: vary.impact.restitution = 1.5: {RIG}: impact.restitution is 1.5; must be "
                "in [0, 1]",
            ),
            (
                "[vary]\nimpact.restitution = { linaer = [0, 1], points = 3 }",
                "3:24: unknown key vary.impact.restitution.linaer; did you mean linear?",
            ),
            (
                "[vary]\nimpact.restitution = { linear = [0, 1] }",
                "3:33: vary.impact.restitution.linear is a range; must go with points = n or "
                "random = true",
            ),
            (
                "[vary]\nimpact.restitution = { linear = [0, 1, 2], points = 3 }",
                "3:33: vary.impact.restitution.linear has 3 numbers; must be a range of two, with "
                "points",
            ),
            (
                "[vary]\nimpact.restitution = { log = [0, 1], points = 3 }",
                "3:30: vary.impact.restitution.log has 0; must be > 0",
            ),
            (
                '[vary]\nimpact.restitution = "high"',
                "3:22: vary.impact.restitution has an entry that is no finite number; must be a "
                "number, an array of numbers, or a table such as { linear = [0, 1], points = 5 }",
            ),
            (
                "[vary]\nevents.jitter = { relative = [-0.1, 0.1] }",
                f"3:17: vary.events.jitter is relative; must be a number that {RIG} gives",
            ),
            (
                "[vary]\ndisturbance.jiter = [0.1]",
                "3:21: vary.disturbance.jiter is not known; did you mean disturbance.jitter?",
            ),
            (
                "[vary]\ncontact.2.clearance = [0.1]",
                f"3:23: vary.contact.2.clearance = 0.1: {RIG}: has no contact.2.clearance",
            ),
            (
                "[vary]\nobserver.modes = [1, 3]",
                "3:18: vary.observer.modes has 3; must be whole numbers in 1..2",
            ),
            (
                '[vary]\nduration = { linear = [1, 2], points = 2, zip = "a" }\n'
                'tick = { linear = [0.1, 0.2], points = 3, zip = "a" }',
                '4:8: vary.tick has 3 points; must have 2, as others of zip "a"',
            ),
            ("runs = [", "2:9: "),
        ):
            with self.subTest(text=text):
                self.assertTrue(self.error(text).startswith(expected), self.error(text))
        self.assertEqual(
            self.error("[vary]\nobserver.beam.modes = [5]", "paper_beam"),
            "3:23: vary.observer.beam.modes = 5: the observer has more coordinates than the "
            "machine; must be as many at most",
        )

    def test_a_scene_that_is_not_there(self):
        file = self.file("study.toml", 'scene = "none"\n')
        with self.assertRaisesRegex(sprag.SceneError, r':1:9: scene is "none"; must be a scene'):
            read_study_file(file)
        with self.assertRaisesRegex(sprag.InputError, "did you mean lab_rig_jitter"):
            read_study_file("lab_rig_jiter")
        self.assertEqual(read_study_file("lab_rig_jitter").points, 45)

    def columns(self, text, scene="lab_rig"):
        return sprag.run_study(self.write(text, scene))

    def test_figures_are_those_of_an_observer(self):
        names = ["replica", "timing", "both"]
        record = ["V_floor", "V_max", "nees", "beyond_3_sigma", "trusted", "worse"]
        study = self.columns(
            f"duration = 20.0\ntick = 0.025\nsamples = 160\nestimators = {names}\n"
            f"record = {record}\n[vary]\nobserver.events.jitter = 1e-4\n"
        )
        rig = sprag.read_scene(RIG)
        run = sprag.simulate(rig, 20.0, tick=0.025)
        of_samples, settled = slice(None, None, 5), slice(81, None)
        V = {}
        for name in names:
            given = rig.replace(jitter=1e-4)
            seen = sprag.observe(given, run.events, 20.0, tick=0.025, estimator=name)
            V[name] = sprag.energies(rig, run.q, run.u, seen.q, seen.u).V[of_samples]
            expected = {"V_floor": np.median(V[name][settled]), "V_max": V[name][settled].max()}
            if name != "replica":
                errors = np.hstack([seen.q - run.q, seen.u - run.u])
                z = (errors / np.hstack([seen.sigma_q, seen.sigma_u]))[of_samples][settled]
                worse = V[name] > np.maximum(10.0 * V["replica"], 1e-20 * V["replica"][0])
                expected |= {
                    "nees": np.mean(z**2),
                    "beyond_3_sigma": np.mean(np.abs(z) > 3.0),
                    "trusted": seen.from_filter[of_samples][1:].mean(),
                    "worse": worse[settled].mean(),
                }
            for record, value in expected.items():
                found = study[f"{name}.{record}"][0]
                self.assertAlmostEqual(found, value, delta=1e-9 * value, msg=f"{name}.{record}")

    def test_figures_of_V(self):
        V = np.array([1.0, 5.0, 5.0, 5.0, 1.1e-5, 0.9e-5, 1e-20, 1.1e-20])
        replica = np.array([1.0, 1e-6, 1e-6, 1e-6, 1e-6, 1e-6, 0.0, 0.0])
        of = figures(V, replica, 0.5, 0.0)
        self.assertEqual((of.V_floor, of.V_max, of.worse), (0.5 * (0.9e-5 + 1.1e-20), 1.1e-5, 0.5))
        self.assertEqual((of.time_below, of.rate), (2.0, np.log(1.0 / 1.1e-5) / 2.0))
        never = figures(V, None, 0.5, 1e-21)
        self.assertEqual(never.time_below, np.inf)
        self.assertTrue(np.isnan(never.worse), "there is no replica")

    # Statement of docs/measurements/robustness.md on the paper's beam: if the filter alone
    # diverges, both is not much worse than the replica.
    def test_both_is_never_much_worse_than_the_replica(self):
        for trouble in (
            "disturbance.lost = [0.05]",
            "disturbance.spurious = [0.1]",
            "observer.beam.bending_stiffness = [1.03]",
            "observer.contact.1.clearance = [0.01]",
        ):
            study = self.columns(
                f'{BOTH}duration = 120.0\nruns = 6\nrecord = ["V_floor", "worse"]\n'
                f"[start]\nmachine = 5e-3\n[vary]\nevents.jitter = [1e-4]\n{trouble}\n",
                "paper_beam",
            )
            V, replica = (np.sort(study[f"{name}.V_floor"])[3] for name in ("both", "replica"))
            self.assertLessEqual(V, 10.0 * replica, trouble)
            self.assertLessEqual(study["both.worse"].mean(), 0.05, trouble)

    def test_all_modes_give_the_machine(self):
        common = 'duration = 20.0\nestimators = ["replica"]\nrecord = ["V_floor", "rate"]\n'
        common += "samples = 200\n[start]\nreplica = 0.1\n[vary]\nevents.jitter = 1e-4\n"
        (whole,) = self.columns(common)["replica.V_floor"]
        one, both = self.columns(f"draws = 'common'\n{common}observer.modes = [1, 2]\n")[
            "replica.V_floor"
        ]
        self.assertAlmostEqual(both, whole, delta=0.5 * whole)
        self.assertGreater(one, 100.0 * whole)

    def test_runs_that_are_not_there(self):
        runs = StudyRuns(self.write("runs = 3"))
        self.assertEqual(runs.rows(1, 3), ("1,0,1,\n2,0,2,\n", 2, 0))
        for first, end in ((-1, 1), (2, 1), (0, 4)):
            with self.assertRaises(ValueError):
                runs.rows(first, end)
