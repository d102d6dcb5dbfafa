"""A machine in Python, the observer as a process and a listener in Python, over real LCM."""

import math
import os
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
import unittest
from pathlib import Path

import numpy as np
import sprag

from support import SOURCE, free_url, multicast_works, readme_examples, scene


def receivers(port: int) -> int:
    """Sockets that listen on the port."""
    table = Path("/proc/net/udp").read_text().splitlines()[1:]
    return sum(row.split()[1].endswith(f":{port:04X}") for row in table)


@unittest.skipUnless(multicast_works(), "multicast does not work on this host")
class LiveTest(unittest.TestCase):
    def start_observer(self, url: str, *options: str) -> None:
        scene_file = str(SOURCE / "scenes" / "paper_beam.toml")
        command = [os.environ["OBSERVER"], scene_file, "--url", url, "--tick", "0.01", *options]
        port = int(url.split(":")[2].split("?")[0])
        listening = receivers(port)
        observer = subprocess.Popen(command, stderr=subprocess.DEVNULL)
        self.addCleanup(observer.wait)
        self.addCleanup(observer.send_signal, signal.SIGINT)
        # During its probe of multicast it listens on the port, too.
        since = time.monotonic()
        while time.monotonic() < since + 0.5:
            self.assertIsNone(observer.poll())
            if receivers(port) == listening:
                since = time.monotonic()
            time.sleep(0.01)

    def observe_live(self, duration: float, **publisher_options):
        """Publishes the paper's beam to an observer; returns its settled estimates up to the
        end."""
        beam = scene()
        events = sprag.simulate(beam, duration, tick=0.0).events
        url = free_url()
        key = publisher_options.get("key")
        settled = sprag.EstimateListener(settled=True, url=url, key=key)
        self.start_observer(url, *(["--key", str(key)] if key else []))
        now = sprag.EstimateListener(url=url, key=key)
        received = []
        with sprag.EventPublisher(1, url=url, **publisher_options) as publisher:
            publisher.set_horizon(0.0)
            self.assertIsNotNone(now.next(30.0))  # the observer runs
            for t, contact, kind in events[::-1].tolist():
                self.assertTrue(publisher.take(t, contact, kind))
            # On one core messages may arrive faster than a process handles them.
            for part in np.linspace(0.0, duration, 21)[1:]:
                publisher.set_horizon(part)
                while not received or received[-1].t < part - 0.02:
                    estimate = settled.next(30.0)
                    self.assertIsNotNone(estimate)
                    received.append(estimate)
            self.assertEqual(publisher.unsent, 0)
        self.assertGreater(publisher.sent, 40)
        self.assertFalse(publisher.take(duration + 1.0))
        self.assertTrue(all(estimate.session == publisher.session for estimate in received))
        self.assertEqual(settled.refused, 0)
        return sprag.observe(beam, events, duration), received

    def expect_same(self, offline, received):
        ticks = [estimate.tick for estimate in received]
        self.assertEqual(ticks, sorted(set(ticks)))
        np.testing.assert_array_equal([e.t for e in received], offline.t[ticks])
        np.testing.assert_array_equal([e.q for e in received], offline.q[ticks])
        np.testing.assert_array_equal([e.u for e in received], offline.u[ticks])
        np.testing.assert_array_equal([e.sigma_q for e in received], offline.sigma_q[ticks])
        np.testing.assert_array_equal([e.sigma_gap for e in received], offline.sigma_gap[ticks])
        np.testing.assert_array_equal([e.from_filter for e in received], offline.from_filter[ticks])
        np.testing.assert_array_equal([e.bound for e in received], offline.bound[ticks])
        self.assertFalse(received[0].q.flags.writeable)
        self.assertEqual(received[-1].closed, ())

    def test_settled_live_estimates_equal_offline_ones(self):
        self.expect_same(*self.observe_live(4.0, speed=math.inf))

    def test_readme_example(self):
        (example,) = [block for block in readme_examples() if "EventPublisher" in block]
        url = free_url()
        self.start_observer(url)
        for option in ("settled=True", "speed=math.inf"):
            self.assertIn(option, example)
            example = example.replace(option, f"{option}, url={url!r}")
        done = subprocess.run(
            [sys.executable, "-c", example], cwd=SOURCE, capture_output=True, text=True
        )
        self.assertEqual(done.returncode, 0, done.stderr)
        times = [line.split()[0] for line in done.stdout.splitlines()]
        self.assertEqual((times[0], times[-1]), ("0.0", "5.0"))

    def test_with_a_key(self):
        with tempfile.TemporaryDirectory() as folder:
            key = Path(folder) / "key"
            key.write_text(secrets.token_hex(32))
            self.expect_same(*self.observe_live(2.0, speed=math.inf, key=key))

    def test_listener_has_a_timeout_and_is_interruptible(self):
        listener = sprag.EstimateListener(url=free_url())
        self.assertIsNone(listener.next(0.0))
        self.assertIsNone(listener.next(0.05))
        threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT)).start()
        with self.assertRaises(KeyboardInterrupt):
            listener.next()

    def test_other_threads_run_while_it_waits(self):
        listener = sprag.EstimateListener(url=free_url())
        thread = threading.Thread(target=listener.next, args=(0.5,))
        started = time.monotonic()
        thread.start()
        self.assertLess(time.monotonic() - started, 0.4)
        thread.join()

    def test_wrong_arguments(self):
        url = free_url()
        wrong = {
            "contacts": lambda: sprag.EventPublisher(0, url=url),
            "speed": lambda: sprag.EventPublisher(1, url=url, speed=-1.0),
            "address": lambda: sprag.EventPublisher(1, url="carrier pigeon"),
            "contact": lambda: sprag.EventPublisher(1, url=url).take(1.0, 2),
            "time": lambda: sprag.EventPublisher(1, url=url).take(-1.0),
            "horizon": lambda: sprag.EventPublisher(1, url=url).set_horizon(math.nan),
            "timeout": lambda: sprag.EstimateListener(url=url).next(-1.0),
        }
        for name, call in wrong.items():
            with self.subTest(name), self.assertRaises(ValueError):
                call()
        with self.assertRaises(sprag.InputError):
            sprag.EstimateListener(url=url, key="/nowhere/key")
