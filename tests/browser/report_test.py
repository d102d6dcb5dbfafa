"""The page of `report` in a real browser: on a desktop, on a phone and in print."""

import base64
import os
import re
import subprocess

from support import BrowserCase, Page, main, scene

WIDE = "Math.max(document.documentElement.scrollWidth, document.body.scrollWidth)"
# Texts of a picture, in pixels of the screen: the title of an axis and a number must not overlap.
TEXTS = """[...document.querySelectorAll('figure')].map((figure) =>
    [...figure.querySelectorAll('svg text')].map((text) => {
  const box = text.getBoundingClientRect();
  return [text.textContent.trim(), box.left, box.top, box.right, box.bottom];
}).filter((text) => text[0] !== ''))"""
LOADED = "performance.getEntriesByType('resource').map((entry) => entry.name)"


class ReportTest(BrowserCase):
    def setUp(self):
        super().setUp()
        rig = scene("two_stops_beam")
        files = "events.csv machine.csv states.csv impacts.csv V.csv observer.json identify.json"
        free = "contact.1.restitution,beam.damping,contact.2.clearance"
        for program, arguments in (
            (
                "MASTER_SIM",
                f"{rig} --duration 3 --speed max --no-lcm --events events.csv --states machine.csv",
            ),
            (
                "OBSERVER",
                f"{rig} --duration 3 --replay events.csv --states states.csv --impacts impacts.csv "
                "--report observer.json",
            ),
            ("SYNC_LOGGER", f"{rig} --truth machine.csv --estimate states.csv --csv V.csv"),
            ("IDENTIFY", f"events.csv {rig} --free {free} --report identify.json"),
            ("REPORT", f"{rig} --output report.html {files}"),
        ):
            command = [os.environ[program], *arguments.split()]
            ended = subprocess.run(command, capture_output=True, text=True, cwd=self.folder)
            self.assertEqual(ended.returncode, 0, ended.stderr)

    def shown(self, width, height):
        page = Page(width, height)
        self.addCleanup(page.close)
        page.cdp(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=1,
            mobile=width < 600,
        )
        page.driver.get("file://" + self.file("report.html"))
        return page

    def check(self, page, width):
        self.assertEqual(page.complaints(), [])
        self.assertEqual(page.js(LOADED), [])
        self.assertLessEqual(page.js(WIDE), width, "only tables and pictures scroll, not the page")
        self.assertEqual(page.js("document.querySelectorAll('.verdict').length"), 2)
        boxes = page.js(
            """[...document.querySelectorAll('figure svg')].map((svg) => {
            const box = svg.getBoundingClientRect(); return [box.width, box.height]; })"""
        )
        self.assertGreaterEqual(len(boxes), 5)
        for across, high in boxes:
            self.assertGreaterEqual(across, 0.85 * min(width, 600))
            self.assertLessEqual(across, width)
            self.assertGreaterEqual(high, 90)

    def test_desktop(self):
        page = self.shown(1280, 900)
        self.check(page, 1280)
        # Numbers, titles of axes and legends do not overlap.
        for texts in page.js(TEXTS):
            for i, (text, left, top, right, bottom) in enumerate(texts):
                for other, left2, top2, right2, bottom2 in texts[:i]:
                    across = min(right, right2) - max(left, left2)
                    down = min(bottom, bottom2) - max(top, top2)
                    self.assertFalse(across > 2 and down > 4, f"{text!r} overlaps {other!r}")

    def test_phone(self):
        page = self.shown(390, 800)
        self.check(page, 390)
        font = float(page.js("getComputedStyle(document.body).fontSize").removesuffix("px"))
        self.assertGreaterEqual(font, 14)
        # Pictures fit, with legible texts; tables scroll, and a shadow at their side shows that
        # they do.
        self.assertEqual(
            page.js(
                """[...document.querySelectorAll('figure')].filter(
            (figure) => figure.scrollWidth > figure.clientWidth).length"""
            ),
            0,
        )
        heights = [bottom - top for texts in page.js(TEXTS) for _, _, top, _, bottom in texts]
        self.assertGreater(min(heights), 6.0)
        # Captions are whole, and short texts of cells on one line.
        captions = "[...document.querySelectorAll('.caption')]"
        right = f"Math.max(...{captions}.map((part) => part.getBoundingClientRect().right))"
        self.assertLessEqual(page.js(right), 390)
        cells = "[...document.querySelectorAll('td:not(.wide)')]"
        short = page.js(
            f"{cells}.map((cell) => [cell.textContent, cell.firstChild ? (() => {{"
            " const range = document.createRange(); range.selectNodeContents(cell);"
            " return range.getClientRects().length; })() : 0])"
        )
        self.assertEqual([text for text, rows in short if rows > 1], [])
        scrolling = page.js(
            """[...document.querySelectorAll('.scroll')].filter(
            (part) => part.scrollWidth > part.clientWidth).map(
            (part) => getComputedStyle(part).backgroundImage)"""
        )
        self.assertGreater(len(scrolling), 0)
        for image in scrolling:
            self.assertEqual(image.count("linear-gradient"), 4)

    def test_print(self):
        page = self.shown(1280, 900)
        pdf = base64.b64decode(page.cdp("Page.printToPDF", preferCSSPageSize=True)["data"])
        pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
        self.assertGreaterEqual(pages, 2)
        self.assertLessEqual(pages, 12)
        page.cdp("Emulation.setEmulatedMedia", media="print")
        page.cdp(
            "Emulation.setDeviceMetricsOverride",
            width=680,
            height=960,
            deviceScaleFactor=1,
            mobile=False,
        )
        self.assertLessEqual(page.js(WIDE), 680, "nothing is cut off in print")
        sizes = [
            float(page.js(f"getComputedStyle(document.querySelector('{part}')).fontSize")[:-2])
            for part in ("figcaption", "strong")
        ]
        self.assertLess(*sizes, "a caption is smaller than the text")
        # A page break cuts no picture, no verdict, no short table, and no row of a long one.
        for kind in ("figure", ".verdict", ".short", "tr"):
            parts = page.js(
                f"""[...document.querySelectorAll('{kind}')].map((part) => [
                getComputedStyle(part).breakInside, part.getBoundingClientRect().height])"""
            )
            self.assertGreater(len(parts), 0)
            for inside, high in parts:
                self.assertEqual(inside, "avoid", kind)
                self.assertLess(high, 960, f"{kind} is higher than a page")


if __name__ == "__main__":
    main()
