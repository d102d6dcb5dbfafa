"""What the page of `view` is sent: the content of the messages, by session, and who is answered."""

import asyncio
import contextlib
import io
import json
import math
import os
import struct
import unittest
import warnings
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import sprag
from multidict import CIMultiDict
from sprag._command import UsageError
from sprag._core import _open_recording
from sprag.view.history import Window
from sprag.view.machine import DrawnMachine, longest_period
from sprag.view.messages import encoded
from sprag.view.replay import Player
from sprag.view.server import Client, Stage, endpoint_of, is_loopback, refusal, text_of
from sprag.view.watch import Watch

from support import FolderTest, write_events

SCENES = Path(os.environ["SPRAG_SOURCE_DIR"]) / "scenes"
# Two carriages, the second between springs and a stop.
CARRIAGES = """
name = "two_carriages"
[system]
M = [[2.0, 0.0], [0.0, 1.0]]
C = [[0.4, -0.1], [-0.1, 0.2]]
K = [[9.0, -3.0], [-3.0, 5.0]]
[[force]]
direction = [1.0, 0.0]
amplitude = 2.0
frequency = 2.7
[impact]
restitution = 0.5
[[contact]]
direction = [0.0, 1.0]
clearance = 0.1
[master]
q = [0.3, 0.4]
[replica]
q = [0.1, 0.2]
uncertainty = [0.1, 0.1]
"""


def estimate(tick, q, sigma, /, session=5, **more):
    members = {"session": session, "tick": tick, "t": 0.01 * tick, "f": 2}
    members |= {"q": [-q, q], "u": [0.0, 0.0], "estimators": 3, "from_filter": 1}
    members |= {"bound": math.inf, "deviations": 2, "gaps": 1, "sigma_g": [sigma]}
    members |= {"sigma_q": [sigma] * 2, "sigma_u": [sigma] * 2, "closing": -1.0, "suspect_t": -1.0}
    return encoded("estimate_t", **(members | more))


def contacts(horizon, sequence, session=5, speed=1.0, times=(), kinds=()):
    rest = [0] * (120 - len(times))
    return encoded(
        "contacts_t",
        **{"session": session, "sequence": sequence, "speed": speed, "horizon": horizon},
        **{"contacts": 1, "records_total": len(times), "records": len(times)},
        **{"t": [*times, *rest], "contact": [1] * len(times) + rest, "kind": [*kinds, *rest]},
    )


class WatchTest(unittest.TestCase):
    def setUp(self):
        self.watch = Watch(sprag.parse_scene(CARRIAGES, "two_carriages.toml"))

    def take(self, channel, data, now=0.0):
        self.watch.take(f"SPRAG_{channel}", data, now)
        self.watch.settle()

    def frame(self, now=0.0):
        return json.loads(self.watch.frame(now))

    def curves(self, name="g1", end=1.0, pixels=100):
        return json.loads(self.watch.curves(name, Window(0.0, end, pixels)))

    def test_last_estimate_of_a_tick_is_shown(self):
        self.take("CONTACTS", contacts(0.0, 1))
        self.take("SETTLED", estimate(1, 0.1, 0.01))
        for tick, q in ((2, 0.2), (3, 0.3), (3, 0.5)):
            self.take("ESTIMATE", estimate(tick, q, 0.01))
        self.assertEqual(self.frame()["now"]["q"][1], 0.5)
        self.assertEqual(self.frame()["settled"]["q"][1], 0.1)
        # c = 0.1: the gap, and two sigma on both sides.
        shown = self.curves()["estimate"]
        self.assertEqual(shown["t"], [0.01, 0.02, 0.03])
        for name, value in (("low", 0.58), ("mean", 0.6), ("high", 0.62)):
            self.assertAlmostEqual(shown[name][2], value, delta=1e-6)
        # A settled estimate replaces the provisional one, and stays.
        self.take("SETTLED", estimate(2, 0.7, 0.01))
        self.take("ESTIMATE", estimate(2, 9.0, 0.01))
        self.take("SETTLED", estimate(2, 9.0, 0.01))
        self.assertAlmostEqual(self.curves()["estimate"]["mean"][1], 0.8, delta=1e-6)
        self.assertEqual(self.frame()["settled"]["q"][1], 0.7)

    def bounds(self, tick, half_width, session=5, names=("q1", "q2", "g1")):
        of = {"session": session, "tick": tick, "t": 0.01 * tick, "n": len(names)}
        self.take("BOUNDS", encoded("bounds_t", **of, name=list(names), half_width=half_width))

    def test_guaranteed_band_is_around_the_settled_estimate_of_its_tick(self):
        self.take("CONTACTS", contacts(0.0, 1))
        self.bounds(1, [0.1, 0.2, 0.3])
        self.assertEqual(self.curves()["guaranteed"]["t"], [], "no estimate of this tick")
        self.take("SETTLED", estimate(1, 0.4, 0.01))
        self.bounds(1, [0.1, 0.2, 0.3])
        self.take("SETTLED", estimate(2, 0.6, 0.01))
        self.bounds(2, [0.1, math.inf, 0.3])
        gap, q1, q2 = (self.curves(name)["guaranteed"] for name in ("g1", "q1", "q2"))
        self.assertEqual(gap["t"], [0.01, 0.02])
        for shown, low, high in ((gap, 0.2, 0.8), (q1, -0.5, -0.3), (q2, 0.2, 0.6)):
            self.assertAlmostEqual(shown["low"][0], low, delta=1e-6)
            self.assertAlmostEqual(shown["high"][0], high, delta=1e-6)
        self.assertIsNone(q2["low"][1], "nothing is guaranteed")
        self.bounds(2, [0.1, 0.2, 0.3], session=6)
        self.assertEqual(self.watch.of_others, 1)
        self.bounds(2, [], names=())
        self.bounds(2, [0.1] * 4, names=("q1", "q2", "q3", "g1"))
        self.assertEqual(self.watch.misfits, 2)

    def test_a_replica_has_no_deviations(self):
        self.take("SETTLED", estimate(1, 0.1, 0.01, from_filter=0))
        frame = self.frame()
        self.assertEqual(frame["badge"], "replica")
        self.assertIsNone(frame["machine"]["sigma"])
        self.assertIsNone(frame["contacts"][0]["sigma"])
        self.assertEqual(self.curves()["estimate"]["low"], [None])

    def test_innovations_are_kept_once_per_closing(self):
        closings = [(-1.0, 0.0, 0.0), (0.015, 1e-3, 0.0), (0.025, 1e-3, math.inf)]
        closings += [(0.035, -3e-3, 2e-3)] * 2 + [(0.055, 1e-3, 4e-3)]
        self.assertIsNone(self.frame()["innovation"])
        for tick, (t, gap, sigma) in enumerate(closings, 1):
            of = {"closing": t, "closing_contact": 1 if t > 0.0 else 0}
            of |= {"filter_gap": gap, "sigma_filter_gap": sigma}
            self.take("SETTLED", estimate(tick, 0.1, 0.01, **of))
        shown = self.curves(pixels=1000)["innovation"]
        self.assertEqual(shown, {"t": [0.035, 0.055], "ratio": [-1.5, 0.25]})
        self.assertEqual(self.frame()["innovation"], {"t": 0.055, "contact": 1, "ratio": 0.25})

    def test_an_estimate_inside_a_support_is_marked(self):
        self.take("CONTACTS", contacts(0.0, 1))
        for k, q in enumerate((0.1, -0.05, -0.3, -0.2, 0.1, 0.2, -0.4), 1):
            self.take("SETTLED", estimate(k, q, math.inf, from_filter=0))
            self.assertAlmostEqual(self.frame()["penetration"], max(-0.1 - q, 0.0), delta=1e-15)
        self.assertEqual(self.curves(pixels=1000)["penetrating"], [0.03, 0.05, 0.07, None])
        for i in range(1, 5):
            self.take("CONTACTS", contacts(0.0, i, session=9), 2.0 + 1e-9 * i)
        self.assertEqual(self.curves(pixels=1000)["penetrating"], [], "of the session before")

    def test_badge_names_the_source_of_the_estimate(self):
        self.assertEqual(self.frame()["badge"], "waiting")
        self.take("CONTACTS", contacts(0.0, 1))
        self.take("ESTIMATE", estimate(1, 0.1, 0.01))
        self.assertEqual(self.frame(0.1)["badge"], "filter")
        self.assertEqual(self.frame(0.7)["badge"], "free", "no contact messages arrive")
        self.assertEqual(self.frame(3.0)["badge"], "waiting", "no estimates either")
        self.take("CONTACTS", contacts(4.0, 2), 4.0)
        self.take("ESTIMATE", estimate(400, 0.1, 0.01), 4.0)
        for session, badge in ((6, "filter"), (5, "free")):
            self.take("HEALTH", encoded("health_t", session=session, master=2), 4.0)
            self.assertEqual(self.frame(4.0)["badge"], badge)

    def test_another_master_resets_and_strangers_are_ignored(self):
        self.take("CONTACTS", contacts(0.0, 1))
        self.take("SETTLED", estimate(1, 0.1, 0.01))
        stranger = estimate(2, 0.9, 0.01, session=6)
        self.take("SETTLED", stranger)
        self.assertEqual(self.watch.of_others, 1)
        self.assertEqual(self.frame()["settled"]["tick"], 1)
        for i in range(5):
            self.take("CONTACTS", contacts(0.0, i, session=6), 1.0 + 1e-9 * i)
        self.assertIsNone(self.frame(1.1)["settled"])
        self.take("SETTLED", stranger, 1.1)
        self.assertEqual((self.frame(1.1)["session"], self.watch.settled["tick"]), ("6", 2))
        of_three = {"session": 6, "f": 3, "q": [0.0] * 3, "u": [0.0] * 3}
        self.take("TRUTH", encoded("state_t", **of_three), 1.1)
        self.assertEqual(self.watch.misfits, 1)

    def test_states_before_the_first_contact_message_are_kept(self):
        state = {"session": 5, "f": 2, "q": [0.1, 0.2], "u": [0.0, 0.0]}
        self.watch.take("SPRAG_TRUTH", encoded("state_t", **state), 0.0)
        self.watch.take("SPRAG_CONTACTS", contacts(0.0, 1), 0.0)
        self.take("SETTLED", estimate(0, 0.2, 0.01))
        self.assertEqual(self.frame()["energy"]["k"], 0)

    def test_unsettled_estimates_are_bounded_and_shown(self):
        for i in range(1, 20_000):
            self.watch.take("SPRAG_ESTIMATE", estimate(i, 0.1, 0.01), 0.0)
            if i % 10 == 0:
                self.watch.settle()
        self.watch.settle()
        t = self.curves(end=600.0, pixels=4000)["estimate"]["t"]
        self.assertLessEqual(len(t), 4097)
        self.assertLess(t[0], 1.0)
        self.assertEqual(t[-1], 199.99)
        self.assertLess(np.diff(t).max(), 1.0, "all of the time is there, only coarser")

    def test_energies_equal_those_of_the_library(self):
        scene = self.watch.scene
        run = sprag.simulate(scene, 5.0, tick=0.01)
        seen = sprag.observe(scene, run.events, 5.0, tick=0.01)
        for k, t in enumerate(run.t.tolist()):
            of = {"session": 5, "tick": k, "t": t, "f": 2}
            state = {"q": run.q[k].tolist(), "u": run.u[k].tolist()}
            self.watch.take("SPRAG_TRUTH", encoded("state_t", **of, **state), 0.0)
            state = {"q": seen.q[k].tolist(), "u": seen.u[k].tolist()}
            self.watch.take("SPRAG_SETTLED", estimate(k, 0.0, 0.01, t=t, **state), 0.0)
            if k % 7 == 0:
                self.watch.settle()
        self.watch.settle()
        V = sprag.energies(scene, run.q, run.u, seen.q, seen.u).V
        self.assertEqual(self.frame()["energy"], {"k": 500, "t": run.t[-1], "V": V[-1]})
        shown = self.curves(end=5.0, pixels=1000)["energy"]["V"]
        self.assertEqual(len(shown), 501)
        np.testing.assert_allclose(shown, V, rtol=1e-6)

    def test_states_of_a_fast_recording_are_paired(self):
        state = {"session": 5, "f": 2, "q": [0.1, 0.2], "u": [0.0, 0.0]}
        for k in range(9000):
            data = encoded("state_t", **state, tick=k, t=0.001 * k)
            self.watch.take("SPRAG_TRUTH", data, 0.0)
        for k in range(180):
            self.watch.take("SPRAG_SETTLED", estimate(k, 0.2, 0.01, t=0.05 * k), 0.0)
        self.watch.settle()
        self.assertEqual(len(self.curves(end=10.0, pixels=1000)["energy"]["t"]), 180)

    def test_events_are_taken_once_and_suspects_are_kept(self):
        for i in range(1, 6):
            times = [0.1 * k for k in range(1, i + 1)]
            for _ in range(2):
                self.take("CONTACTS", contacts(0.1 * i, i, times=times, kinds=[3] * i), 0.01 * i)
        contact = self.frame()["contacts"][0]
        self.assertEqual((contact["events"], contact["last"]), (5, 0.5))
        self.assertIsNone(self.frame()["suspect"])
        of = {"inconsistencies": 1, "suspect_t": 0.4, "suspect_contact": 1, "suspicion": 2}
        self.take("SETTLED", estimate(60, 0.1, 0.01, **of))
        suspect = {"t": 0.4, "contact": 1, "suspicion": "spurious event"}
        self.assertEqual(self.frame()["suspect"], suspect)
        self.assertEqual(self.curves()["suspects"], [suspect])
        self.assertEqual(len(self.curves()["raster"][0]), 10)

    def test_events_have_the_machines_time(self):
        text = CARRIAGES + "[clock]\noffset = 3.0\nrate = 2.0\n"
        for machine_time, t in ((False, 0.5), (True, 4.0)):
            watch = Watch(sprag.parse_scene(text), machine_time=machine_time)
            watch.take("SPRAG_CONTACTS", contacts(4.0, 1, times=[4.0], kinds=[3]), 0.0)
            self.assertEqual(watch.closures[0].last, t)


class InputTest(FolderTest):
    def input_watch(self, text, t, value):
        rows = "".join(f"{t_k:.6f},{value_k:.17g}\n" for t_k, value_k in zip(t, value))
        self.file("force.csv", "t,f\n" + rows)
        return Watch(sprag.read_scene(self.file("scene.toml", text)))

    def input_of(self, watch, start, end):
        return json.loads(watch.curves("g1", Window(start, end, 100)))["input"]

    def test_a_recorded_input_has_a_curve_that_keeps_its_peaks(self):
        t = 0.001 * np.arange(5001)
        value = np.sin(10.0 * t) + 5.0 * np.exp(-(((t - 1.234) / 0.02) ** 2))
        force = '[[force]]\ndirection = [1.0, 0.0]\nfile = "force.csv"\ngain = 2.0\n'
        watch = self.input_watch(CARRIAGES + force, t, value)
        self.assertEqual(
            json.loads(watch.description(None))["input"], "force.2 [unit of the force]"
        )
        everything = self.input_of(watch, 0.0, 10.0)
        self.assertLessEqual(len(everything["t"]), 204)
        self.assertEqual(everything["t"], sorted(everything["t"]))
        self.assertAlmostEqual(max(everything["value"]), 2.0 * value.max(), delta=1e-6)
        few = self.input_of(watch, 1.2, 1.25)
        self.assertGreaterEqual(len(few["t"]), 50)
        self.assertLessEqual(few["t"][0], 1.2)
        self.assertEqual(self.input_of(watch, -3.0, -1.0)["t"], [])
        self.assertIsNone(
            json.loads(Watch(sprag.parse_scene(CARRIAGES)).description(None))["input"]
        )

    def test_a_streamed_input_is_drawn_as_its_samples_arrive(self):
        watch = Watch(streamed_beam())
        gain = watch.machine.drawing["gain"]
        watch.take("SPRAG_CONTACTS", contacts(0.0, 1), 0.0)
        of = {"t0": 0.5, "dt": 0.001, "n": 3, "channels": 1, "value": [1.0, 2.0, 3.0] + [0.0] * 147}
        for session, total in ((5, 3), (5, 5), (5, 4), (7, 6)):  # the third one is late
            watch.take("SPRAG_INPUT", encoded("input_t", session=session, total=total, **of), 0.0)
        watch.settle()
        shown = self.input_of(watch, 0.49, 0.51)
        self.assertEqual(shown["value"], [gain * k for k in (1.0, 2.0, 3.0, 2.0, 3.0)])
        self.assertAlmostEqual(shown["t"][-1], 0.504)
        self.assertEqual(watch.of_others, 1)


def streamed_beam():
    """The swept beam with a streamed excitation."""
    text = (SCENES / "swept_beam.toml").read_text().replace('"records/', f'"{SCENES}/records/')
    streamed = 'interpolation = "linear"\noutside = "hold"\nstream = true'
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return sprag.parse_scene(text.replace('interpolation = "spline"', streamed))


def log_of(messages):
    """An LCM log of (channel, data, arrival [us]), in the format of lcm-logger."""
    log = b""
    for number, (channel, data, utime) in enumerate(messages):
        head = struct.pack(">IqqII", 0xEDA1DA01, number, utime, len(channel), len(data))
        log += head + channel.encode() + data
    return log


class ReplayTest(FolderTest):
    def setUp(self):
        super().setUp()
        self.scene = sprag.parse_scene(CARRIAGES, "two_carriages.toml")
        self.said = io.StringIO()

    def events(self, duration=20.0):
        return sprag.simulate(self.scene, duration, tick=0.0).events

    def play(self, name, scene=None, key=None):
        """The watch after a replay without pauses, its verdict and its report."""
        scene, report, stage = scene or self.scene, {}, Stage(speed=math.inf)
        options = SimpleNamespace(replay=str(self.folder / name), key=key, speed=math.inf)
        options.tick = 0.01
        player = Player(scene, options)
        watch = Watch(scene, machine_time=not player.is_log)

        def receive(channel, data, now, utime, appended):
            watch.take(channel, data, now, utime, appended)

        with contextlib.redirect_stderr(self.said):
            whole = asyncio.run(player.play(watch, receive, stage, report))
        watch.settle()
        return watch, whole, report

    def messages(self, events):
        """Contact messages of a master that has these events."""
        write_events(self.folder / "events.csv", events)
        opened = _open_recording(self.folder / "events.csv", self.scene, None, 0.0)
        return [(channel, data, utime) for channel, data, utime, _ in opened]

    def test_events_and_logs_without_estimates_are_observed(self):
        events = self.events()
        (self.folder / "run.lcmlog").write_bytes(log_of(self.messages(events)))
        end = float(events["t"][-1])
        seen = sprag.observe(self.scene, events, end, tick=0.01)
        for name in ("events.csv", "run.lcmlog"):
            watch, whole, report = self.play(name)
            self.assertTrue(whole)
            self.assertTrue(report["observed_here"])
            self.assertEqual(watch.settled["tick"], len(seen.t) - 1)
            np.testing.assert_array_equal(watch.settled["q"], seen.q[-1])
            np.testing.assert_array_equal(watch.settled["sigma_g"], seen.sigma_gap[-1])
            self.assertEqual(watch.closures[0].events, len(events))
            np.testing.assert_allclose(watch.closures[0].last, end)
        self.assertEqual(self.said.getvalue(), "")

    def test_a_log_with_estimates_is_not_observed(self):
        messages = [*self.messages(self.events()), ("SPRAG_SETTLED", estimate(9, 0.1, 0.01), 0)]
        (self.folder / "run.lcmlog").write_bytes(log_of(messages))
        watch, _, report = self.play("run.lcmlog")
        self.assertFalse(report["observed_here"])
        self.assertIsNone(watch.settled, "of another session")

    def test_a_streamed_excitation_is_that_of_the_log(self):
        self.scene = streamed_beam()
        messages = self.messages(np.array([(0.1, 1, 3)], sprag.event_dtype))
        (self.folder / "run.lcmlog").write_bytes(log_of(messages))
        self.assertIsNone(self.play("run.lcmlog")[0].settled, "waits for samples")
        of = {"session": 1, "t0": 0.0, "dt": 0.002, "channels": 1, "n": 75, "total": 75}
        sample = encoded("input_t", **of, value=[0.1] * 75 + [0.0] * 75)
        messages += [("SPRAG_INPUT", sample, 100_000)]
        (self.folder / "run.lcmlog").write_bytes(log_of(messages))
        self.assertEqual(self.play("run.lcmlog")[0].settled["t"], 0.1)
        self.assertEqual(self.play("events.csv")[0].settled["t"], 0.1, "of the scene's record")

    def test_damage_is_reported_and_the_rest_is_used(self):
        events = self.events()
        log = log_of(self.messages(events))
        (self.folder / "run.lcmlog").write_bytes(log[:5000] + bytes(900) + log[5900:])
        watch, whole, report = self.play("run.lcmlog")
        self.assertFalse(whole)
        self.assertGreater(watch.settled["t"], events["t"][-2])
        self.assertEqual(len(report["damage"]), 1)
        self.assertIn("run.lcmlog: from byte ", self.said.getvalue())
        (self.folder / "events.csv").write_text("t,contact,closed\n1,1,1\n1,1,0\n2,1,x\n3,1,1\n")
        watch, whole, report = self.play("events.csv")
        self.assertFalse(whole)
        self.assertEqual(watch.closures[0].events, 1)
        self.assertEqual(report["damage"][0]["from"], 4)
        self.assertIn("events.csv:4: ", self.said.getvalue())
        (self.folder / "events.csv").write_text("t,contact,closed\n1,1,1\n1,1,1\n2,1,0\n")
        _, whole, report = self.play("events.csv")
        self.assertTrue(whole)
        self.assertEqual(report["skipped_rows"], 1)
        self.assertIn("events.csv:3: skipped: ", self.said.getvalue())

    def test_a_key_admits_signed_messages_only(self):
        key = self.folder / "key"
        key.write_text(32 * "5a" + "\n")
        key.chmod(0o600)
        (self.folder / "run.lcmlog").write_bytes(log_of(self.messages(self.events())))
        watch, _, report = self.play("run.lcmlog", key=key)
        self.assertIsNone(watch.session)
        self.assertGreater(report["unauthenticated"], 900)


# Two beam elements with deflections and rotations.
ELEMENTS = """
[system]
M = [[1, 0, 0, 0], [0, 0.1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 0.1]]
C = [[0.1, 0, 0, 0], [0, 0.1, 0, 0], [0, 0, 0.1, 0], [0, 0, 0, 0.1]]
K = [[4, 0, -1, 0], [0, 2, 0, 0.5], [-1, 0, 3, 0], [0, 0.5, 0, 1]]
[impact]
restitution = 0.5
[[contact]]
direction = [0, 0, -2, 0]
clearance = 0.3
[[contact]]
direction = [0.5, 0.1, 0.5, -0.1]
clearance = 0.2
[[output]]
name = "middle"
direction = [1, 0, 0, 0]
[[output]]
name = "rate"
direction = [0, 0, 1, 0]
quantity = "velocity"
"""


class MachineTest(unittest.TestCase):
    def test_a_finite_element_model_is_drawn_by_its_nodes(self):
        self.assertEqual(DrawnMachine(sprag.parse_scene(ELEMENTS)).kind, "chain")
        tip = '[[output]]\nname = "tip"\ndirection = [0, 0, 1, 0]\n'
        scene = sprag.parse_scene(ELEMENTS + tip)
        machine = DrawnMachine(scene)
        self.assertEqual(machine.names, ["middle", "tip", "contact 2"])
        self.assertEqual(machine.stops[0]["side"], 1, "above the tip")
        q = np.array([0.1, 7.0, 0.02, -5.0])
        shape = machine.shape(q, 0.0)
        np.testing.assert_allclose(shape[:2], [0.1, 0.02])
        for i, weight in enumerate((2.0, 1.0)):
            stop = machine.stops[i]
            height = shape[int(stop["across"]) - 1] - machine.stop(i, 0.0)
            gap = scene.gaps([0.0], [q])[0, i]
            self.assertAlmostEqual(weight * height * -stop["side"], gap, delta=1e-12)

    def coupled(self, coupling):
        """A model of 14 coordinates with stiffness between neighbours, and one contact."""
        K = 4.0 * np.eye(14) + coupling * (np.eye(14, k=1) + np.eye(14, k=-1))
        contact = sprag.Contact(np.eye(14)[12], 0.5, 0.1)
        return sprag.Scene(sprag.Model(np.eye(14), np.zeros((14, 14)), K, [contact]))

    def test_metres_and_radians_share_no_axis(self):
        self.assertEqual(len(DrawnMachine(self.coupled(-1.0)).names), 14, "masses and springs")
        self.assertEqual(DrawnMachine(self.coupled(1.0)).names, ["contact 1"])

    def test_a_shaken_frame_is_drawn_by_its_displacements(self):
        K = 4.0 * np.eye(6) + np.eye(6, k=1) + np.eye(6, k=-1)
        text = f"""
[system]
M = {np.eye(6).tolist()}
C = {np.zeros((6, 6)).tolist()}
K = {K.tolist()}
[excitation]
amplitude = 0.1
frequency = 3.0
influence = [1, 0, 1, 0, 0, 0]
[impact]
restitution = 0.5
[[contact]]
direction = [0, 0, 0, 0, 1, 0]
clearance = 0.1
"""
        machine = DrawnMachine(sprag.parse_scene(text))
        self.assertEqual((machine.kind, machine.names), ("chain", ["q1", "q3", "q5"]))
        self.assertEqual(machine.stops[0]["across"], machine.places[2])
        self.assertEqual(machine.shape(np.arange(1.0, 7.0), 0.0), [1.0, 3.0, 5.0])

    def test_a_beam_touches_its_stop_at_zero_gap(self):
        random = np.random.default_rng(3)
        for name in ("two_stops_beam", "steel_ruler"):
            scene = sprag.read_scene(SCENES / f"{name}.toml")
            machine, t = DrawnMachine(scene), 0.37
            q = 0.1 * random.normal(size=scene.f)
            heights = machine.shape(q, t)
            self.assertAlmostEqual(heights[0], machine.base(t), delta=1e-12, msg="clamped")
            for i, (x, stop) in enumerate(zip(scene.positions, machine.stops)):
                w = sprag.beam_contact(scene.beam, x, 0.5).w
                distance = (w @ q + machine.base(t) - machine.stop(i, t)) * -stop["side"]
                gap = scene.gaps([t], [q])[0, i]
                self.assertAlmostEqual(distance, gap, delta=1e-12)

    def test_period_is_that_of_the_excitation_else_of_the_vibration(self):
        scene = sprag.parse_scene(CARRIAGES)
        self.assertAlmostEqual(longest_period(scene.model), 2.0 * math.pi / 2.7)
        model = SimpleNamespace(M=scene.model.M, K=scene.model.K, forces=[], contacts=[])
        # omega^2 of K - omega^2 M: 2 x^2 - 19 x + 36 = 0.
        square = (19.0 - math.sqrt(19.0**2 - 4.0 * 2.0 * 36.0)) / 4.0
        self.assertAlmostEqual(longest_period(model), 2.0 * math.pi / math.sqrt(square))
        model.K = 0.0 * model.K
        self.assertIsNone(longest_period(model), "nothing vibrates")


class ClientTest(unittest.TestCase):
    def test_gets_the_newest_data_limited_by_its_acknowledgement(self):
        watch, client = Watch(sprag.parse_scene(CARRIAGES)), Client()
        watch.take("SPRAG_SETTLED", estimate(1, 0.1, 0.01), 0.0)
        watch.settle()

        def following():
            return json.loads(client.next(watch, Stage(), {}))

        first = following()
        self.assertEqual((first["n"], first["scene"]["name"]), (1, "two_carriages"))
        self.assertEqual(first["frame"]["settled"]["q"][1], 0.1)
        self.assertEqual(first["frame"]["session"], "5")
        self.assertIsNone(first["frame"]["bound"], "infinite")
        self.assertIn("curves", first)
        self.assertNotIn("scene", following())
        following()
        self.assertFalse(client.wants(), "it has seen none of three")
        for nonsense in ("", "{", "[1]", "7", '{"seen": "x"}', '{"seen": -1}', '{"seen": 1e99}'):
            client.receive(nonsense)
        for view in ('3, "window": -1', '{"from": 2, "to": 1}', '{"pixels": 0, "to": null}'):
            client.receive(f'{{"view": {view}}}')
        client.receive("[" * 3000)
        self.assertFalse(client.wants())
        client.receive('{"seen": 3, "view": {"from": 0.005, "to": 0.02, "pixels": 1e9}}')
        client.receive('{"view": {"quantity": "q2"}}')
        self.assertTrue(client.wants())
        zoomed = following()["curves"]
        self.assertEqual((zoomed["from"], zoomed["to"]), (0.005, 0.02))
        self.assertEqual(zoomed["quantity"], "q2")
        self.assertAlmostEqual(zoomed["estimate"]["mean"][0], 0.1, delta=1e-6)
        client.receive('{"view": {"window": 2}}')
        self.assertEqual(following()["curves"]["to"], 0.01 + 2.0, "it fills from the left")
        client.receive('{"view": {"window": 1e308, "pixels": 1e308, "quantity": "nothing"}}')
        self.assertEqual(following()["curves"]["quantity"], "g1")


class RulesTest(unittest.TestCase):
    def status(self, method, target, host, origin=None, upgrade=False):
        headers = CIMultiDict([("Host", host)] if host is not None else [])
        headers.extend([("Origin", origin)] if origin is not None else [])
        headers.extend([("Upgrade", "websocket")] if upgrade else [])
        message = SimpleNamespace(path=target)
        request = SimpleNamespace(method=method, headers=headers, _message=message)
        refused = refusal(request, ("127.0.0.1", 8080))
        return refused[0] if refused else 200

    def test_only_the_page_is_served(self):
        here = "127.0.0.1:8080"
        self.assertEqual(self.status("GET", "/", here), 200)
        self.assertEqual(self.status("HEAD", "/index.html", "localhost:8080"), 200)
        # A foreign name that resolves to this host, or a name with only the right beginning.
        foreign = ["evil.example:8080", "127.0.0.1", "127.0.0.1:80", f"{here}.evil", f"{here} "]
        foreign += ["127.0.0.1.evil.example:8080", f"user@{here}", "127.0.0.2:8080"]
        for host in (*foreign, "localhost", "localhost:80800", "", None):
            self.assertEqual(self.status("GET", "/", host), 403, host)
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "CONNECT", "get"):
            self.assertEqual(self.status(method, "/", here), 405, method)
        foreign = ["/%2e%2e/etc/passwd", "/page.js/", "/index.html~", f"http://{here}/"]
        for target in ("/x", "//", "/../etc/passwd", "/index.html?x", "", *foreign):
            self.assertEqual(self.status("GET", target, here), 404, target)

    def test_the_stream_requires_the_page_of_the_same_host(self):
        here = "127.0.0.1:8080"
        self.assertEqual(self.status("GET", "/stream", here, f"http://{here}", True), 200)
        self.assertEqual(self.status("GET", "/stream", here, f"http://{here}"), 426)
        foreign = ["http://evil.example", "http://127.0.0.1:8081", f"https://{here}"]
        foreign += ["http://127.0.0.1", f"http://{here}.evil.example"]
        for origin in (*foreign, "null", "http://localhost:8080", f"http://{here}/"):
            self.assertEqual(self.status("GET", "/stream", here, origin, True), 403, origin)
        self.assertEqual(self.status("GET", "/stream", here, None, True), 403)
        self.assertEqual(self.status("POST", "/stream", here, f"http://{here}", True), 405)

    def test_addresses_are_read_in_common_forms(self):
        for text, read in (
            ("127.0.0.1:8080", "127.0.0.1:8080"),
            ("localhost:0", "127.0.0.1:0"),
            ("9000", "127.0.0.1:9000"),
            (":9000", "127.0.0.1:9000"),
            ("[::1]:80", "[::1]:80"),
        ):
            self.assertEqual(text_of(*endpoint_of(text)), read)
        for text in ("", *"127.0.0.1 127.0.0.1: 127.0.0.1:65536 127.0.0.1:-1 ::1:80 x".split()):
            with self.assertRaises(UsageError, msg=text):
                endpoint_of(text)
        self.assertTrue(is_loopback("127.0.0.1"))
        self.assertFalse(is_loopback("0.0.0.0"))
