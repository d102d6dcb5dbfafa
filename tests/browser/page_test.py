"""The page of `view` in a browser."""

import json
import os
import signal
import subprocess
import time

from support import BrowserCase, estimates, free_url, last_health, main, rows, scene, wait_for

# Number of pixels in the curves' chart with the transparency of the band of 2 sigma.
BAND = """[...document.querySelectorAll('#curve-chart canvas')].reduce((sum, canvas) => {
  const pixels = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  return sum + pixels.filter((value, i) => i % 4 === 3 && Math.abs(value - 64) < 3).length;
}, 0)"""
# Number of pixels that are drawn in a chart.
INK = """((id) => {
  const canvas = document.querySelector(`#${id} canvas:not([style*="z-index"])`) ||
    document.querySelector(`#${id} canvas`);
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let inked = 0;
  for (let i = 3; i < data.length; i += 4) if (data[i] > 128) inked += 1;
  return inked;
})(arguments[0])"""
SHOWN = "({tick: '', vTick: '', ...document.getElementById('sprag').dataset, now: sprag.frame.now})"


class PageTest(BrowserCase):
    def expect_quiet(self, page):
        self.assertEqual(page.complaints(), [])

    def simulate(self, scene_file, duration, events):
        command = [os.environ["MASTER_SIM"], scene_file, "--no-lcm", "--speed", "max"]
        command += ["--duration", duration, "--events", events]
        subprocess.run(command, check=True, capture_output=True)

    def check(self, shown, settled, now, energies):
        """The page shows the values of the recording, to the last digit."""
        if shown["tick"]:
            t, q = settled[int(shown["tick"])][-1]
            self.assertEqual(float(shown["t"]), t)
            self.assertEqual(json.loads(shown["q"]), q)
        if shown["now"]:
            said = (shown["now"]["t"], shown["now"]["q"])
            self.assertIn(said, now[shown["now"]["tick"]] + settled.get(shown["now"]["tick"], []))
        if shown["vTick"]:
            self.assertEqual(float(shown["v"]), energies[int(shown["vTick"])])

    def test_values_match_the_recording(self):
        view = self.start_view()
        page = self.open_page(view.address)
        self.assertEqual(page.js("sprag.frame.badge"), "waiting")
        self.start_run(duration="6", speed="1.5", record=True)
        samples = []
        wait_for(
            "the last tick", lambda: samples.append(page.js(SHOWN)) or samples[-1]["tick"] == "1200"
        )
        wait_for("the last V", lambda: page.js(SHOWN)["vTick"] == "1200")
        self.end_run()
        page.wait("the observer's last word", "sprag.health.observer && sprag.health.observer.last")
        samples.append(page.js(SHOWN))

        settled = estimates(self.file("run.lcmlog"), "SPRAG_SETTLED")
        now = estimates(self.file("run.lcmlog"), "SPRAG_ESTIMATE")
        energies = {int(row["k"]): float(row["V"]) for row in rows(self.file("V.csv"))}
        self.assertEqual(len(energies), 1201)
        for shown in samples:
            self.check(shown, settled, now, energies)
        self.assertGreater(len({shown["tick"] for shown in samples}), 10)
        self.assertGreater(len({shown["vTick"] for shown in samples}), 10)
        # The curves are thinned: the remaining values of V occur in the recording, and the extremes
        # are among them.
        by_time = {float(row["t"]): float(row["V"]) for row in rows(self.file("V.csv"))}

        def extremes_are_shown():
            V = [value for value in page.js("sprag.curves.energy.V") if value is not None]
            inside = [value for t, value in by_time.items() if t >= page.js("sprag.curves.from")]
            return all(
                any(abs(v - value) <= 1e-5 * value for v in V)
                for value in (min(inside), max(inside))
            )

        # Curves are sent less often than values: the last ones may be under way.
        wait_for("the extremes of V", extremes_are_shown)
        self.assertGreater(len(page.js("sprag.curves.energy.t")), 100)
        self.assertFalse(page.js("document.getElementById('energy-part').hidden"))
        self.assertTrue(page.js("document.getElementById('innovation-part').hidden"), "V is known")
        # Health.
        counts, refused = last_health(self.file("run.lcmlog"))
        shown = page.js("sprag.health.observer")
        for name, count in counts.items():
            self.assertEqual(shown[name], count, name)
        self.assertEqual(shown["refused"], refused)
        self.assertEqual(counts["ticks"], 1201)
        texts = page.js(
            """Object.fromEntries([...document.querySelectorAll('#health dd')]
            .map((e) => [e.id, e.dataset.value]))"""
        )
        for name in (
            "events",
            "late_events",
            "lost_events",
            "rollbacks",
            "inconsistencies",
            "messages",
        ):
            self.assertEqual(texts["health-" + name.replace("_", "-")], str(counts[name]))
        self.expect_quiet(page)

    def test_recording_is_shown(self):
        self.start_run(duration="8", speed="4", record=True)
        self.end_run()
        settled = estimates(self.file("run.lcmlog"), "SPRAG_SETTLED")
        now = estimates(self.file("run.lcmlog"), "SPRAG_ESTIMATE")
        energies = {int(row["k"]): float(row["V"]) for row in rows(self.file("V.csv"))}
        view = self.start_view("--replay", self.file("run.lcmlog"), "--speed", "8", bus=False)
        page = self.open_page(view.address)
        samples = []
        wait_for("the end", lambda: samples.append(page.js(SHOWN)) or page.js("sprag.over"))
        samples.append(page.js(SHOWN))
        for shown in samples:
            self.check(shown, settled, now, energies)
        self.assertEqual(samples[-1]["tick"], "1600")
        self.assertEqual(samples[-1]["vTick"], "1600")
        page.choose("window", "10")
        page.wait("the shorter window", "sprag.curves.to - sprag.curves.from === 10")
        self.assertGreater(page.js(BAND), 1000)
        self.expect_quiet(page)
        self.assertIsNone(view.poll())

    def test_window_follows_the_period(self):
        # 30 periods at 4.5 Hz are 6.7 s; the nearest choice is 5 s, not the 20 s of a machine
        # without a period.
        view = self.start_view(name="lab_rig")
        page = self.open_page(view.address)
        self.start_run(name="lab_rig", speed="1")
        page.wait("an estimate", "sprag.frame.settled")
        self.assertAlmostEqual(page.js("sprag.scene.period"), 1 / 4.5)
        page.wait(
            "the window",
            "sprag.view.window === 5 && sprag.curves "
            "&& sprag.curves.to - sprag.curves.from <= 5.001",
        )
        page.choose("window", "50")
        page.wait("the chosen window", "sprag.curves.to - sprag.curves.from > 49")
        self.expect_quiet(page)

    def test_window_of_a_recording_follows_the_period(self):
        # 30 periods at 4.5 Hz are 6.7 s, also at a speed at which 2 s of wall time are 16 s of the
        # machine.
        events = self.file("events.csv")
        self.simulate(scene("lab_rig"), "20", events)
        for speed in ("8", "max"):
            view = self.start_view("--replay", events, "--speed", speed, name="lab_rig", bus=False)
            page = self.open_page(view.address)
            page.wait(
                "the window",
                "sprag.over && sprag.curves && sprag.curves.to - sprag.curves.from <= 5.001",
            )
            self.assertEqual(page.js("sprag.view.window"), 5)
            self.end(view)

    def test_guaranteed_and_calibrated_bands_are_shown(self):
        tolerant = self.file("tolerant.toml")
        with open(scene()) as nominal, open(tolerant, "w") as own:
            own.write(nominal.read() + "\n[tolerance]\ntime = 1e-4\n")
        events = self.file("events.csv")
        self.simulate(tolerant, "8", events)
        view = self.start_view(
            "--replay", events, "--speed", "8", name=tolerant.removesuffix(".toml"), bus=False
        )
        page = self.open_page(view.address)
        hidden = "document.getElementById('guaranteed-legend').hidden"
        page.wait(
            "the band",
            f"sprag.over && !{hidden} && sprag.curves.guaranteed.low.some((y) => y !== null)",
        )
        shown = page.js("sprag.curves.guaranteed")
        self.assertTrue(
            all(low <= high for low, high in zip(shown["low"], shown["high"]) if low is not None)
        )
        self.expect_quiet(page)

    def test_innovations_are_shown_in_place_of_an_unknown_V(self):
        # An events file has no true states, like a real machine.
        events, states = self.file("events.csv"), self.file("states.csv")
        self.simulate(scene("lab_rig"), "20", events)
        subprocess.run(
            [os.environ["OBSERVER"], scene("lab_rig"), "--replay", events, "--states", states],
            check=True,
            capture_output=True,
        )
        wanted = {
            float(row["closing_t"]): float(row["filter_gap"]) / float(row["sigma_filter_gap"])
            for row in rows(states)
            if float(row["sigma_filter_gap"]) > 0.0
        }
        page = self.open_page(
            self.start_view("--replay", events, "--speed", "max", name="lab_rig", bus=False).address
        )
        page.choose("window", "50")
        page.wait(
            "all of the recording",
            "sprag.over && sprag.curves && sprag.curves.to - sprag.curves.from === 50",
        )
        shown = page.js("sprag.curves.innovation")
        self.assertEqual(shown["t"], list(wanted))
        for ratio, value in zip(shown["ratio"], wanted.values()):
            self.assertAlmostEqual(ratio, value, delta=1e-5 * abs(value))
        self.assertEqual(page.js("sprag.frame.innovation.ratio"), list(wanted.values())[-1])
        hidden = (
            "['energy-part', 'V-row', 'innovation-part', 'innovation-row']"
            ".map((id) => document.getElementById(id).hidden)"
        )
        self.assertEqual(page.js(hidden), [True, True, False, False])
        self.assertGreater(page.js(INK, "innovation-chart"), 500)
        self.expect_quiet(page)

    def shaken(self, stream):
        """The name of a scene with the shaker's record, which an observer takes from the bus if
        `stream`."""
        with open(scene("swept_beam")) as file:
            text = file.read()
        text = text.replace('"records/', f'"{os.path.dirname(scene())}/records/')
        if stream:
            text = text.replace(
                'interpolation = "spline"',
                'interpolation = "linear"\noutside = "hold"\nstream = true',
            )
        name = self.file("shaken.toml")
        with open(name, "w") as file:
            file.write(text)
        return name.removesuffix(".toml")

    def expect_input_drawn(self, page):
        self.assertEqual(
            page.js("document.getElementById('input-title').textContent"),
            "excitation acceleration [m/s^2]",
        )
        self.assertGreater(page.js(INK, "input-chart"), 500)

    def test_recorded_input_is_shown(self):
        name = self.shaken(stream=False)
        events = self.file("events.csv")
        self.simulate(scene(name), "5", events)
        page = self.open_page(
            self.start_view("--replay", events, "--speed", "8", name=name, bus=False).address
        )
        page.wait("the input", "sprag.over && sprag.curves.input.t.length > 200")
        self.expect_input_drawn(page)
        largest = max(abs(a) for a in page.js("sprag.curves.input.value"))
        self.assertGreater(largest, 0.1)
        self.expect_quiet(page)

    def test_streamed_input_is_shown_and_its_end_named(self):
        name = self.shaken(stream=True)
        page = self.open_page(self.start_view(name=name).address)
        page.wait("the page", "sprag.scene")
        self.start_listening("OBSERVER", scene(name), "--tick", "0.005")
        self.start(
            "MASTER_SIM", scene(name), "--tick", "0.005", "--duration", "4", "--publish-input"
        )
        page.wait("samples", "sprag.curves && sprag.curves.input.t.length > 500")
        page.wait("health", "sprag.health.observer && sprag.health.observer.input === 'heard'")
        self.expect_input_drawn(page)
        # Another run, of which the samples do not arrive.
        self.start("MASTER_SIM", scene(name), "--tick", "0.005", "--duration", "20")
        page.wait(
            "its end in words",
            "document.getElementById('health-words').textContent"
            ".includes('No samples of the excitation arrive')",
        )
        page.wait("the mark", "document.getElementById('health-input').dataset.value === 'silent'")
        self.expect_quiet(page)

    def test_refused_messages_are_shown_by_cause(self):
        secret, other = self.file("key"), self.file("other")
        for file, digit in ((secret, "a"), (other, "b")):
            with open(file, "w") as key:
                key.write(64 * digit)
        view = self.start_view("--key", secret)
        page = self.open_page(view.address)
        observer = self.start_listening("OBSERVER", scene(), "--key", secret)
        page.wait(
            "health without a master",
            "sprag.health.observer && sprag.health.observer.master === 'awaited'",
        )
        self.start("MASTER_SIM", scene(), "--key", other)
        page.wait("the refused messages", "sprag.health.observer.refused.unauthenticated > 20")
        page.wait(
            "their cause in words",
            "document.getElementById('health-refused').textContent.includes('unauthenticated')",
        )
        self.assertEqual(page.js("sprag.frame.badge"), "waiting")
        self.assertIsNone(observer.poll())
        self.start("MASTER_SIM", scene(), "--key", secret)
        page.wait(
            "the right master",
            "sprag.health.observer.master === 'heard' && sprag.frame.badge !== 'waiting'",
        )
        self.expect_quiet(page)

    def test_page_reconnects_after_restart(self):
        view = self.start_view()
        page = self.open_page(view.address)
        self.start_run()
        page.wait("an estimate", "sprag.frame.settled && sprag.frame.settled.tick > 100")
        self.end(view, signal.SIGKILL)
        page.wait(
            "the loss on the page", "document.getElementById('connection').dataset.state === 'lost'"
        )
        before = page.js("sprag.frame.settled.tick")
        self.assertFalse(page.js("sprag.connected"))
        time.sleep(0.7)  # a failed attempt to reconnect
        self.start_view(http="127.0.0.1:{}".format(view.address[1]))
        page.wait("the connection", "sprag.connected")
        page.wait(
            "later estimates",
            "sprag.frame.settled && sprag.frame.settled.tick > arguments[0] + 200",
            before,
        )
        page.wait(
            "the curves",
            "sprag.curves.to > sprag.curves.from && sprag.curves.estimate.t.length > 20",
        )
        self.assertEqual(
            page.js("document.getElementById('connection').dataset.state"), "connected"
        )
        # The observer ends, and starts again.
        page.wait("its health, once a second", "sprag.health && sprag.health.observer")
        self.end(self.observer, signal.SIGKILL)
        page.wait("the observer's silence", "sprag.health.observer.age > 1.5")
        self.start("OBSERVER", scene(), "--tick", "0.005")
        page.wait(
            "its return", "sprag.health.observer.age < 1.2 && sprag.health.observer.ticks > 50"
        )
        for said in page.complaints():
            self.assertIn("WebSocket connection to", said)

    def test_zoom_and_pan_during_streaming(self):
        view = self.start_view()
        page = self.open_page(view.address)
        self.start_run(speed="3")
        page.wait(
            "some curves",
            "sprag.curves && sprag.curves.estimate.t.length > 50 && sprag.curves.last > 3",
        )

        def streams():
            tick = page.js("sprag.frame.now.tick")
            page.wait("later frames", "sprag.frame.now.tick > arguments[0] + 100", tick)

        page.choose("window", "5")
        page.wait("a window of 5 s", "Math.abs(sprag.curves.to - sprag.curves.from - 5) < 1e-9")
        page.wait(
            "that follows",
            "sprag.curves.to > 6 && Math.abs(sprag.curves.to - sprag.curves.last) < 1e-9",
        )

        # After zooming by the button and by the mouse the window stays, and the stream continues.
        page.click("zoom-in")
        page.wait("half of it", "Math.abs(sprag.curves.to - sprag.curves.from - 2.5) < 1e-9")
        self.assertEqual(
            page.js("document.getElementById('follow').getAttribute('aria-pressed')"), "false"
        )
        held = page.js("[sprag.curves.from, sprag.curves.to]")
        streams()
        self.assertEqual(page.js("[sprag.curves.from, sprag.curves.to]"), held)
        from selenium.webdriver import ActionChains

        chart = page.driver.find_element("id", "curve-chart")
        for shift in range(3):
            ActionChains(page.driver, duration=50).move_to_element_with_offset(
                chart, -100 + 20 * shift, 0
            ).click_and_hold().move_by_offset(150, 0).release().perform()
            page.wait(
                "a smaller window",
                "sprag.curves.to - sprag.curves.from < arguments[0] && !sprag.view.follow",
                0.6 * (held[1] - held[0]),
            )
            inner = page.js("[sprag.curves.from, sprag.curves.to]")
            self.assertGreaterEqual(inner[0], held[0])
            self.assertLessEqual(inner[1], held[1])
            held = inner
            streams()
            self.assertEqual(page.js("[sprag.curves.from, sprag.curves.to]"), held)
        page.click("zoom-out")
        page.wait(
            "twice that",
            "Math.abs((sprag.curves.to - sprag.curves.from) / arguments[0] - 2) < 1e-6",
            held[1] - held[0],
        )

        page.click("follow")
        page.wait(
            "the newest again",
            "sprag.view.follow && Math.abs(sprag.curves.to - sprag.curves.last) < 1e-9",
        )
        self.assertAlmostEqual(page.js("sprag.curves.to - sprag.curves.from"), 5.0)

        page.click("pause")
        page.wait("a pause", "sprag.paused")
        # Curves of a later window that were under way at the click may still come.
        stopped = page.js(
            "[document.getElementById('t').textContent, sprag.view.from, sprag.view.to]"
        )
        streams()
        self.assertEqual(
            page.js(
                "[document.getElementById('t').textContent, sprag.curves.from, sprag.curves.to]"
            ),
            stopped,
        )
        page.click("pause")
        page.wait(
            "going on",
            """!sprag.paused && sprag.view.follow
            && document.getElementById('t').textContent !== arguments[0]""",
            stopped[0],
        )

        names = page.js("sprag.scene.quantities.map(q => q.name)")
        self.assertGreater(len(names), 1)
        page.choose("series", names[-1])
        page.wait("another quantity", "sprag.curves.quantity === arguments[0]", names[-1])
        self.expect_quiet(page)

    def watch_stops(self, page):
        # At every picture: the state of the list item, and the number of pixels of the machine in
        # the colour of a contact.
        page.driver.execute_script(
            """
            const offscreen = document.createElement('canvas');
            const copy = offscreen.getContext('2d', {willReadFrequently: true});
            window.seen = [];
            const look = () => {
              const canvas = document.getElementById('machine');
              copy.canvas.width = canvas.width;
              copy.canvas.height = canvas.height;
              copy.drawImage(canvas, 0, 0);
              const data = copy.getImageData(0, 0, canvas.width, canvas.height).data;
              let lit = 0;
              for (let i = 0; i < data.length; i += 4) {
                if (data[i] === 0xf0 && data[i + 1] === 0xe4 && data[i + 2] === 0x42) ++lit;
              }
              const item = document.querySelector('#contacts li');
              const closed = sprag.frame.contacts[0].closed;
              if (item) seen.push([item.dataset.lit === 'true', lit, closed]);
              setTimeout(() => requestAnimationFrame(look), 60);
            };
            look();"""
        )

    def test_closed_stops_are_highlighted(self):
        # A beam with pulses only, and a ball that comes to rest.
        view = self.start_view()
        page = self.open_page(view.address)
        self.watch_stops(page)
        self.start_run(speed="2")
        page.wait("impacts", "sprag.frame.contacts[0].events > 8")
        seen = page.js("seen")
        lit = [area for on, area, _ in seen if on]
        dark = [area for on, area, _ in seen if not on]
        self.assertGreater(len(lit), 2)
        self.assertGreater(len(dark), 2)
        self.assertGreater(min(lit), 50)
        self.assertEqual(max(dark), 0)
        self.assertEqual([], [closed for _, _, closed in seen if closed])
        self.assertGreater(page.js("sprag.curves.raster[0].length"), 4)

        self.url = free_url()
        page.open(self.start_view(name="bouncing_ball").address)
        page.wait("the stream", "window.sprag && sprag.connected && sprag.frame && sprag.health")
        self.watch_stops(page)
        self.start_run(speed="2", name="bouncing_ball")
        page.wait("rest", "seen.filter(([, , closed]) => closed).length > 5")
        for on, area, closed in page.js("seen"):
            if closed:
                self.assertTrue(on)
                self.assertGreater(area, 50)
        self.assertFalse(page.js("seen[0]")[0])
        self.expect_quiet(page)

    def test_small_screen_and_dark_mode(self):
        view = self.start_view()
        page = self.open_page(view.address)
        self.start_run(speed="2")
        page.wait("some curves", "sprag.curves && sprag.curves.estimate.t.length > 50")
        page.wait("health", "sprag.health.observer && sprag.health.observer.master === 'heard'")
        colours = """(() => {
          const luminance = (colour) => {
            const [r, g, b] = colour.match(/[\\d.]+/g).map((x) => x / 255)
              .map((x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4));
            return 0.2126 * r + 0.7152 * g + 0.0722 * b;
          };
          const ground = (e) => {
            const clear = 'rgba(0, 0, 0, 0)';
            while (e && getComputedStyle(e).backgroundColor === clear) e = e.parentElement;
            return luminance(getComputedStyle(e || document.documentElement).backgroundColor);
          };
          const kinds = 'h1, h1 span, h2, h3, p, dt, dd, li, button, select, .dygraph-axis-label';
          const texts = [...document.querySelectorAll(kinds)]
            .filter((e) => e.textContent.trim() && e.getClientRects().length);
          const ratios = texts.map((e) => {
            const a = luminance(getComputedStyle(e).color), b = ground(e);
            const ratio = (Math.max(a, b) + 0.05) / (Math.min(a, b) + 0.05);
            return [ratio, e.id || e.className || e.tagName];
          });
          return {ground: ground(document.body), worst: ratios.sort((a, b) => a[0] - b[0])[0]};
        })()"""
        for scheme, dark in (("dark", True), ("light", False), ("dark", True)):
            page.cdp(
                "Emulation.setEmulatedMedia",
                features=[{"name": "prefers-color-scheme", "value": scheme}],
            )
            page.wait(
                scheme, "matchMedia('(prefers-color-scheme: dark)').matches === arguments[0]", dark
            )
            found = page.js(colours)
            with self.subTest(scheme=scheme):
                self.assertEqual(found["ground"] < 0.2, dark)
                self.assertGreater(found["worst"][0], 4.5, found["worst"][1])
        for width, height in ((390, 844), (844, 390), (320, 568)):
            page.cdp(
                "Emulation.setDeviceMetricsOverride",
                width=width,
                height=height,
                deviceScaleFactor=3,
                mobile=True,
            )
            page.wait(
                "the width",
                "innerWidth === arguments[0] || document.body.scrollWidth > arguments[0]",
                width,
            )
            tick = page.js("sprag.frame.now.tick")
            page.wait("frames", "sprag.frame.now.tick > arguments[0] + 50", tick)
            with self.subTest(width=width):
                self.assertLessEqual(page.js("document.documentElement.scrollWidth"), width)
                wide = page.js(
                    """[...document.querySelectorAll('body *')]
                    .filter((e) => e.getClientRects().length && !e.closest('.chart'))
                    .filter((e) => e.getBoundingClientRect().right > innerWidth + 0.5)
                    .map((e) => e.tagName + '#' + e.id)"""
                )
                self.assertEqual(wide, [])
                self.assertGreater(
                    page.js("document.getElementById('machine').clientWidth"), 0.8 * width - 40
                )
        self.expect_quiet(page)


if __name__ == "__main__":
    main()
