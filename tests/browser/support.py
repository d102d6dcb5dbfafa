"""Common parts of the tests of `view`: programs on a port of the test's own, contents of a
recording, and Debian's chromium driven by Debian's python3-selenium."""

import csv
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

import sprag
from sprag._core import _open_recording
from sprag.view.messages import decoded, records

SOURCE = Path(os.environ["SPRAG_SOURCE_DIR"])
PATIENCE = 60.0  # s, for an event that must occur, also on a busy machine


def scene(name="paper_beam"):
    return str(SOURCE / "scenes" / f"{name}.toml")


def free_url():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("", 0))
        return f"udpm://239.255.76.67:{probe.getsockname()[1]}?ttl=0"


def wait_for(what, condition, patience=PATIENCE):
    """The first value of condition() that is true."""
    end = time.monotonic() + patience
    while True:
        value = condition()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError(f"{what}: not within {patience:g} s")
        time.sleep(0.02)


def what_is_missing():
    """The reason why no browser can be driven here; empty if there is none."""
    missing = [name for name in ("chromium", "chromedriver") if not shutil.which(name)]
    try:
        import selenium  # noqa: F401
    except ImportError:
        missing.append("selenium")
    if not missing:
        return ""
    return f"no {', '.join(missing)}: scripts/install_packages --browser"


class BrowserCase(unittest.TestCase):
    """A browser, and programs on an LCM port of the test's own, in its own folder."""

    def setUp(self):
        if missing := what_is_missing():
            self.skipTest(missing)
        self.url = free_url()
        self.folder = Path(tempfile.mkdtemp(prefix="sprag_browser_"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.programs = 0

    def open_page(self, address, **size):
        page = Page(**size)
        self.addCleanup(page.close)
        page.open(address)
        page.wait("the stream", "window.sprag && sprag.connected && sprag.frame && sprag.health")
        return page

    def file(self, name):
        return str(self.folder / name)

    def start(self, program, *arguments, bus=True):
        """A process of the build tree; `said()` is its stderr so far."""
        self.programs += 1
        log = self.folder / f"{self.programs}_{program.lower()}.err"
        command = [os.environ[program], *arguments, *(["--url", self.url] if bus else [])]
        with log.open("wb") as stderr:
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr)
        process.said = lambda: log.read_text(errors="replace")
        self.addCleanup(self.end, process)
        return process

    def end(self, process, number=signal.SIGTERM):
        """Ends it if it still runs; returns its exit code."""
        if process.poll() is None:
            process.send_signal(number)
        try:
            return process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            raise

    def start_listening(self, program, *arguments):
        """An observer or a logger, returned as soon as it listens."""
        port = f":{int(self.url.split(':')[2].split('?')[0]):04X}"
        before = listeners(port)
        process = self.start(program, *arguments)
        since = time.monotonic()
        # During its probe of multicast it listens on the port, too.
        while time.monotonic() < since + 0.3:
            self.assertIsNone(process.poll(), process.said())
            if listeners(port) <= before:
                since = time.monotonic()
            time.sleep(0.01)
        return process

    def start_view(self, *arguments, http="127.0.0.1:0", name="paper_beam", bus=True):
        """The process; its `address` is (host, port)."""
        view = self.start("VIEW", scene(name), "--http", http, *arguments, bus=bus)

        def address():
            self.assertIsNone(view.poll(), view.said())
            return re.search(r"http://([\d.]+):(\d+)/", view.said())

        found = wait_for("the page's address", address)
        view.address = (found[1], int(found[2]))
        return view

    def start_run(
        self,
        *,
        duration=None,
        speed="1",
        tick="0.005",
        name="paper_beam",
        record=False,
        estimator="both",
        key=(),
    ):
        """Observer and, if it is recorded, logger, then a master."""
        until = ["--duration", duration] if duration else []
        common = [scene(name), *until, "--tick", tick, *key]
        if record:
            self.logger = self.start_listening(
                "SYNC_LOGGER",
                scene(name),
                *key,
                "--csv",
                self.file("V.csv"),
                "--record",
                self.file("run.lcmlog"),
            )
        self.observer = self.start_listening("OBSERVER", *common, "--estimator", estimator)
        self.master = self.start("MASTER_SIM", *common, "--speed", speed)

    def end_run(self):
        """Waits for the end of a run with an end; then the recording is complete."""
        for process in (self.master, self.observer):
            self.assertEqual(process.wait(PATIENCE), 0, process.said())
        time.sleep(0.3)  # their last messages may be under way
        self.assertEqual(self.end(self.logger), 0, self.logger.said())


def listeners(port):
    table = Path("/proc/net/udp").read_text().splitlines()[1:]
    return sum(row.split()[1].endswith(port) for row in table)


# ---- recordings ----


def read_log(file, wanted):
    """The messages of a channel in an LCM log."""
    for name, message, _, _ in _open_recording(file, sprag.read_scene(scene()), None, 0.0):
        if name == wanted:
            yield message


def estimates(file, channel):
    """Tick -> [(t, q), ...] of SPRAG_SETTLED or SPRAG_ESTIMATE, where a tick may come again."""
    found = {}
    for message in read_log(file, channel):
        for of in next(records([message], True)):
            found.setdefault(int(of["tick"]), []).append((float(of["t"]), of["q"].tolist()))
    return found


def last_health(file):
    """The counts of the last SPRAG_HEALTH, and the refused messages."""
    *_, message = read_log(file, "SPRAG_HEALTH")
    health = decoded("SPRAG_HEALTH", message)
    names = (
        "sessions ticks deadlines missed_deadlines real_time_losses events late_events lost_events "
        "gaps skipped_events rollbacks inconsistencies messages lost_messages doubled_messages "
        "reordered_messages other_masters stale overflowed unsent"
    )
    counts = {name: getattr(health, name) for name in names.split()}
    return counts, dict(zip(health.cause, health.refused))


def rows(file):
    with open(file, newline="") as table:
        return list(csv.DictReader(table))


# ---- the browser ----


class Page:
    """Chromium with a page of `view` open."""

    def __init__(self, width=1280, height=1000):
        from selenium import webdriver
        from selenium.webdriver.chrome.options import Options
        from selenium.webdriver.chrome.service import Service

        options = Options()
        options.binary_location = shutil.which("chromium")
        for argument in (
            "--headless=new",
            "--disable-gpu",
            "--disable-dev-shm-usage",
            "--no-first-run",
            "--disable-extensions",
            "--hide-scrollbars",
            f"--window-size={width},{height}",
        ):
            options.add_argument(argument)
        if os.geteuid() == 0:
            options.add_argument("--no-sandbox")
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(
            service=Service(shutil.which("chromedriver")), options=options
        )
        self.driver.set_script_timeout(PATIENCE)
        self.said = []

    def open(self, address):
        self.driver.get("http://{}:{}/".format(*address))

    def close(self):
        self.driver.quit()

    def js(self, expression, *arguments):
        return self.driver.execute_script(f"return ({expression});", *arguments)

    def wait(self, what, expression, *arguments):
        """The first true value of a JavaScript expression, whose objects may not exist yet."""
        from selenium.common.exceptions import JavascriptException

        def value():
            try:
                return self.js(expression, *arguments)
            except JavascriptException:
                return None

        return wait_for(what, value)

    def cdp(self, command, **arguments):
        return self.driver.execute_cdp_cmd(command, arguments)

    def click(self, name):
        self.driver.find_element("id", name).click()

    def choose(self, name, value):
        """An option of a <select>, by its value."""
        from selenium.webdriver.support.select import Select

        Select(self.driver.find_element("id", name)).select_by_value(value)

    def complaints(self):
        """Messages of the browser's console, except routine ones."""
        self.said += self.driver.get_log("browser")
        return [entry["message"] for entry in self.said if entry["level"] in ("SEVERE", "WARNING")]


def main():
    """Runs the named tests; exit code 77, with the reason in GoogleTest's format, if they were
    skipped."""
    result = unittest.main(exit=False, verbosity=2).result
    if result.wasSuccessful() and result.skipped:
        print(f"{sys.argv[0]}:1: Skipped\n{result.skipped[0][1]}")
        sys.exit(77)
    sys.exit(0 if result.wasSuccessful() else 1)
