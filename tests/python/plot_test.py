"""plot: figures show the data of files and results; names are text; damage and failures are named.

Without the compiled part of the package.
"""

import importlib
import json
import math
import os
import resource
import sys
import unittest
import unittest.mock
import xml.etree.ElementTree
from pathlib import Path

try:
    import matplotlib
    import matplotlib.colors
    import matplotlib.text
    import pandas  # noqa: F401
    import numpy as np
except ImportError as missing:
    print(f"no {missing.name}")
    sys.exit(77)

from sprag import _drawing, plot, plot_study, tables  # noqa: E402
from sprag._command import UsageError  # noqa: E402
from sprag._errors import InputError  # noqa: E402
from sprag._machine import Machine  # noqa: E402
from support import SOURCE, FolderTest  # noqa: E402

STATES = "k,t,q1,u1\n0,0,1,2\n1,8,3,4\n"
nan = float("nan")


def lines(axes):
    """The named lines of axes."""
    return {line.get_label(): line for line in axes.lines if line.get_label()[0] != "_"}


def panel(figure, title):
    return next(axes for axes in figure.axes if axes.get_title(loc="left") == title)


def titles(figure):
    return [axes.get_title(loc="left") for axes in figure.axes]


def texts(figure):
    return [text.get_text() for text in figure.findobj(matplotlib.text.Text) if text.get_text()]


def machine(f=1, m=1, units=None, rate=None, name="a machine"):
    def gaps(t, q):
        return np.column_stack([q @ np.ones(f) + i for i in range(m)])

    return Machine(name, f, m, units or {}, rate, gaps)


class Files(FolderTest):
    def table(self, text, label="run"):
        return tables.read_table(self.file("table.csv", text), label)

    def figure(self, *runs, of=None, show=(), zoom=None):
        panels = plot.Panels(runs, of)
        return plot.figure_of(panels.chosen(show), panels.span, zoom=zoom)

    def plot(self, *arguments, code=0):
        return self.run_main(plot.main, *arguments, code=code)


class DrawingTest(unittest.TestCase):
    def test_every_pixel_keeps_its_range(self):
        random = np.random.default_rng(7)
        t = np.cumsum(random.uniform(0.0, 2e-4, 100000))
        y = random.normal(size=len(t))
        x, v = _drawing.thin(t, y, pixels=300)
        self.assertLess(len(x), 5 * 301)
        self.assertTrue((np.diff(x) > 0).all())
        self.assertEqual((x[0], x[-1]), (t[0], t[-1]))
        step = len(t) // 300 + 1
        kept = dict(zip(x, v))
        for i in range(0, len(t), step):
            block = slice(i, i + step)
            shown = [kept[at] for at in t[block] if at in kept]
            self.assertEqual((min(shown), max(shown)), (y[block].min(), y[block].max()))

    def test_breaks_stay(self):
        t = np.arange(10000.0)
        y = np.sin(t)
        y[500:503] = nan
        x, v = _drawing.thin(t, y, pixels=50)
        broken = x[np.isnan(v)]
        self.assertTrue(len(broken) and broken.min() >= 500 and broken.max() <= 502)
        self.assertEqual(x[np.flatnonzero(np.isnan(v))[0] - 1], 499.0)

    def test_units_are_readable(self):
        for largest, unit, expected in [
            (0.2, "m", (1.0, "m")), (0.02, "m", (1e3, "mm")), (2e-4, "m/s", (1e3, "mm/s")),
            (2e-5, "m", (1e6, "µm")), (2e-8, "m", (1e9, "nm")), (2e-15, "m", (1e12, "pm")),
            (0.0, "m", (1.0, "m")), (math.inf, "m", (1.0, "m")), (1e-5, "N s", (1.0, "N s")),
            (1e-5, "mm", (1.0, "mm")), (1e-5, "", (1.0, "")),
        ]:  # fmt: skip
            self.assertEqual(_drawing.readable_unit(largest, unit), expected)


class RunsTest(Files):
    def test_gaps_with_bands_of_two_sigma_and_guaranteed_widths(self):
        states = self.table(
            "k,t,q1,u1,sigma_g1,bound_q1\n0,0,0.01,2,0.001,0.5\n1,1,0.03,4,inf,0.25\n"
            "2,2,0.02,4,0.002,0.25\n"
        )
        figure = self.figure(states, of=machine())
        axes = panel(figure, "Gap g [mm]")
        np.testing.assert_allclose(lines(axes)["run ± 2σ"].get_ydata(), [10, 30, 20])
        heights = np.concatenate([p.vertices[:, 1] for p in axes.collections[0].get_paths()])
        np.testing.assert_allclose([heights.min(), heights.max()], [8, 24])
        self.assertNotIn(30, heights.round(9))
        two = self.figure(states, of=machine(m=2))
        self.assertEqual(titles(two), ["Gap g1 [mm]", "Gap g2 [m]"])
        bounded = lines(self.figure(states).axes[0])["guaranteed"]
        np.testing.assert_allclose(bounded.get_ydata(), [0.51, 0.28, 0.27])

    def test_inside_a_support_dashed_replica_dotted(self):
        states = self.table(
            "k,t,q1,u1,sigma_q1,from_filter,penetrating\n0,0,1,2,inf,0,1\n1,1,2,2,inf,0,0\n"
            "2,2,3,2,inf,0,0\n3,3,4,2,1,1,0\n4,4,5,2,1,1,0\n"
        )
        drawn = lines(panel(self.figure(states), "q1"))
        self.assertEqual(set(drawn), {"run ± 2σ", "inside a support", "replica shown"})
        known = {name: (~np.isnan(line.get_ydata())).tolist() for name, line in drawn.items()}
        self.assertEqual(known["run ± 2σ"], [False, False, False, True, True])
        # The parts reach the points beside them.
        self.assertEqual(known["inside a support"], [True, True, False, False, False])
        self.assertEqual(known["replica shown"], [True, True, True, True, False])
        self.assertEqual(len({line.get_linestyle() for line in drawn.values()}), 2)
        self.assertEqual(len({line.get_color() for line in drawn.values()}), 1)

    def test_a_run_has_one_colour_in_all_panels(self):
        estimate = "k,t,q1,u1,B\n0,0,1,2,1\n1,1,1,2,1\n"
        energy = self.table("k,t,V\n0,0,1\n1,1,0.5\n", "b")
        runs = [
            self.table(STATES, "machine"),
            energy,
            self.table(estimate, "a"),
            self.table(estimate, "b"),
        ]
        figure = self.figure(*runs)
        q, V = lines(panel(figure, "q1")), lines(panel(figure, "Error energy [J]"))
        self.assertEqual(q["machine"].get_color(), "black")
        self.assertEqual(V["V"].get_color(), q["b"].get_color())
        self.assertEqual(V["B ≥ V, guaranteed, b"].get_color(), q["b"].get_color())
        self.assertNotEqual(q["a"].get_color(), q["b"].get_color())
        self.assertEqual(panel(figure, "Error energy [J]").get_yscale(), "log")

    def test_energies_of_several_runs_and_damping(self):
        text = "k,t,V,V1,V2\n0,0,1,0.75,0.25\n1,1,0.5,0.3,0.2\n2,2,0,0,0\n"
        one = lines(self.figure(self.table(text), of=machine(rate=2.0)).axes[0])
        self.assertEqual(set(one), {"V", "V₁, V₂", "by damping alone"})
        of_one_mode = self.table("k,t,V,V1\n0,0,1,1\n1,1,0.5,0.5\n")
        self.assertEqual(set(lines(self.figure(of_one_mode).axes[0])), {"V"})
        self.assertEqual(one["V"].get_ydata().tolist(), [1.0, 0.5])
        np.testing.assert_allclose(one["by damping alone"].get_ydata(), [1.0, math.exp(-4.0)])
        two = lines(self.figure(self.table(text, "a"), self.table(text, "b")).axes[0])
        self.assertEqual(set(two), {"V, a", "V, b", "V₁, V₂"})

    def test_an_energy_of_zero_is_not_drawn(self):
        nothing = self.table("k,t,V\n0,0,0\n1,1,0\n")
        figure = self.figure(self.table(STATES), nothing, of=machine(rate=2.0))
        self.assertEqual(titles(figure), ["Gap g [m]"])
        late = self.table("k,t,V\n0,0,0\n1,1,2\n2,2,1\n")
        figure = self.figure(late, of=machine(rate=2.0))
        self.assertEqual(set(lines(figure.axes[0])), {"V"}, "no damping from 0 on")
        panels = plot.Panels([late])
        plot.figure_of(panels.chosen([]), (0.0, 0.5))  # nothing within the span

    def test_the_rounding_of_a_contact_at_rest_is_no_motion(self):
        rows = "".join(f"{k},{k},3,{-3 + 1e-15 * (-1) ** k},0,0\n" for k in range(1000))
        panels = plot.Panels([self.table("k,t,q1,q2,u1,u2\n" + rows)], machine(f=2))
        self.assertIsNone(panels.zoom(panels.chosen([]), panels.span))
        figure = plot.figure_of(panels.chosen([]), panels.span)
        self.assertEqual(titles(figure), ["Gap g [m]"])

    def test_noise_is_median_and_range(self):
        n = 20000
        random = np.random.default_rng(3)
        V = np.exp(random.normal(size=n))
        rows = "".join(f"{k},{k},{v!r}\n" for k, v in enumerate(V))
        axes = self.figure(self.table("k,t,V\n" + rows)).axes[0]
        line = lines(axes)["V"]
        self.assertLess(len(line.get_xdata()), 500)
        heights = axes.collections[0].get_paths()[0].vertices[:, 1]
        self.assertEqual((heights.min(), heights.max()), (V.min(), V.max()))

    def test_outputs_and_parameters_have_panels(self):
        estimate = self.table(
            "k,t,q1,u1,B,sigma_q1,filter_gap,sigma_filter_gap,accepted,impact.restitution,"
            "sigma_impact.restitution,tip,sigma_tip\n"
            "0,0,1,2,1,1,3,4,1,0.7,0.25,0.005,0.0005\n1,1,1,2,1,1,3,4,1,0.7,0.125,0.0065,inf\n"
        )
        of = machine(units={"tip": "m"})
        figure = self.figure(estimate, of=of)
        self.assertEqual(
            titles(figure), ["tip [mm]", "impact.restitution", "Gap g [m]", "Error energy [J]"]
        )
        np.testing.assert_allclose(lines(figure.axes[0])["run ± 2σ"].get_ydata(), [5.0, 6.5])
        self.assertEqual(titles(self.figure(estimate, of=of, show=["u1", "q1"])), ["u1", "q1"])
        # An output with the name of another panel does not replace it.
        both = self.table("k,t,q1,u1,B,V,sigma_V\n0,0,1,2,1,3,1\n1,1,1,2,1,4,1\n")
        self.assertEqual(titles(self.figure(both, show=["V"])), ["V", "Error energy [J]"])

    def test_contacts_are_pulses_and_stretches(self):
        events = self.table("t,contact,closed\n1,1,1\n1,1,0\n2,2,1\n3,1,1\n3,1,0\n4,2,0\n5,1,1\n")
        figure = self.figure(events, self.table(STATES))
        axes = panel(figure, "Reported contacts")
        pulses, bars, _, stretches = axes.collections
        self.assertEqual([s[0][0] for s in pulses.get_segments()], [1.0, 3.0])
        ends = [p.vertices[:, 0].max() for p in bars.get_paths()]
        self.assertEqual(ends, [8.0], "still closed at the end")
        corners = stretches.get_paths()[0].vertices[:, 0]
        self.assertEqual((corners.min(), corners.max()), (2.0, 4.0))
        self.assertEqual([t.get_text() for t in axes.get_yticklabels()], ["1", "2"])

    def test_impacts_are_dots_of_each_contact(self):
        impacts = self.table(
            "t,contact,kind,impulse,sigma_impulse,velocity_before,sigma_velocity_before\n"
            "1,2,impact,3,0.5,-0.02,0\n2,1,impact,4,inf,-0.01,0\n3,1,opens,,,,\n"
        )
        axes = panel(self.figure(impacts), "Impulse ± 2σ [N s]")
        words = [text.get_text() for text in axes.get_legend().get_texts()]
        self.assertEqual(words, ["contact 1", "contact 2"])
        one, two = axes.containers
        self.assertEqual(one.lines[0].get_ydata().tolist(), [4.0])
        bar = two.lines[2][0].get_segments()[0][:, 1]
        self.assertEqual(bar.tolist(), [2.0, 4.0])
        self.assertNotEqual(one.lines[0].get_marker(), two.lines[0].get_marker())
        figure = self.figure(impacts, show=["velocity_before"])
        self.assertEqual(titles(figure), ["Gap velocity before ± 2σ [mm/s]"])
        panels = plot.Panels([impacts])
        (part,) = plot.figure_of(panels.chosen([]), (1.5, 2.5)).axes
        self.assertEqual(len(part.containers), 1, "only impacts within the span")
        self.assertIsNone(part.get_legend(), "of one contact")
        wide = self.table(
            "t,contact,kind,impulse,sigma_impulse\n1,1,impact,3,90\n2,1,impact,4,0.1\n"
        )
        low, high = self.figure(wide).axes[0].get_ylim()
        self.assertTrue(2.0 < low and high < 5.0, "bars may leave the range")

    def test_a_constant_curve_is_centred(self):
        table = self.table("k,t,q1,u1,still,zero\n0,0,1,0,-0.7,0\n1,3,2,0,-0.7,0\n")
        figure = self.figure(table, show=["still", "zero"])
        for axes, middle in zip(figure.axes, (-0.7, 0.0)):
            low, high = axes.get_ylim()
            self.assertAlmostEqual((low + high) / 2, middle)
            self.assertGreater(high, low)

    def test_zooms_where_a_motion_would_be_a_block(self):
        def oscillation(periods):
            t = np.linspace(0.0, 100.0, 20 * periods)
            rows = enumerate(zip(t, np.sin(2 * np.pi * periods * t / 100.0)))
            return self.table("k,t,q1\n" + "".join(f"{k},{x},{y}\n" for k, (x, y) in rows))

        late = oscillation(400)
        late.data["t"] += 0.2345
        panels = plot.Panels([late])
        self.assertEqual(panels.zoom(panels.chosen([]), panels.span), (0.0, 5.0))

        for periods, zoomed in ((50, False), (400, True)):
            panels = plot.Panels([oscillation(periods)])
            zoom = panels.zoom(panels.chosen([]), panels.span)
            self.assertEqual(zoom is not None, zoomed)
        self.assertEqual(zoom, (0.0, 5.0), "20 periods of 0.25 s")
        self.assertEqual(plot.draw([oscillation(400)]).axes[0].get_xlim(), (0.0, 5.0))
        whole = plot.draw([oscillation(400)], end=100.0).axes[0].get_xlim()
        self.assertEqual(whole, (0.0, 100.0))
        t = np.linspace(0.0, 100.0, 5000)
        rows = zip(t, np.sin(0.3 * t) + 0.05 * np.sin(40.0 * t))
        text = "".join(f"{k},{x},{y}\n" for k, (x, y) in enumerate(rows))
        panels = plot.Panels([self.table("k,t,q1\n" + text)])
        self.assertIsNone(panels.zoom(panels.chosen([]), panels.span), "ripples are no motion")

    def test_zoom_shows_V_of_the_whole_run_beside(self):
        energy = self.table("k,t,V\n0,0,1\n1,8,0.5\n")
        figure = self.figure(self.table(STATES), energy, zoom=(1.0, 2.0))
        self.assertEqual(panel(figure, "q1").get_xlim(), (1.0, 2.0))
        self.assertEqual(panel(figure, "Error energy [J]").get_xlim(), (0.0, 8.0))


class NamesTest(Files):
    def test_names_cover_neither_each_other_nor_leave_the_axes(self):
        t = np.linspace(0.0, 10.0, 500)
        runs = []
        for i in range(9):
            y = np.sin(t + 0.3 * i) * (1.0 + 0.2 * i)
            rows = "".join(f"{k},{x},{v},0,{0.1}\n" for k, (x, v) in enumerate(zip(t, y)))
            runs.append(self.table("k,t,q1,u1,sigma_q1\n" + rows, f"estimate number {i + 1}"))
        for n in (3, 9):
            figure = self.figure(*runs[:n])
            figure.canvas.draw()
            axes = figure.axes[0]
            legend = axes.get_legend()
            shown = list(axes.texts) + (legend.get_texts() if legend else [])
            self.assertEqual(len(shown), n)
            boxes = [text.get_window_extent() for text in shown]
            frame = axes.get_window_extent()
            for i, box in enumerate(boxes):
                self.assertTrue(frame.x0 <= box.x0 and box.x1 <= frame.x1, n)
                self.assertTrue(frame.y0 <= box.y0 and box.y1 <= frame.y1, n)
                for other in boxes[i + 1 :]:
                    self.assertFalse(box.overlaps(other), n)

    def test_names_are_beside_their_own_curve(self):
        flat = "k,t,q1,u1,B\n0,0,{0},0,1\n1,9,{0},0,1\n"
        figure = self.figure(
            *(self.table(flat.format(y), f"at {y}") for y in (1, 2, 3)), show=["q1"]
        )
        axes = figure.axes[0]
        for text in axes.texts:
            height = axes.transData.inverted().transform(text.get_window_extent().get_points())[
                :, 1
            ]
            own = float(text.get_text().split()[1])
            distance = {y: abs(height.mean() - y) for y in (1.0, 2.0, 3.0)}
            self.assertEqual(min(distance, key=distance.get), own)

    def test_a_name_covers_no_mark(self):
        with _drawing.style():
            axes = _drawing.new_figure(4.0, 2.0).add_subplot()
            axes.plot(range(99), [0] * 99, marker="o", ms=6, label="name")
            axes.figure.canvas.draw()
            _drawing.name_lines(axes)
        box = axes.texts[0].get_window_extent()
        for point in axes.transData.transform(axes.lines[0].get_xydata()):
            self.assertFalse(box.padded(9).contains(*point))

    def test_a_leader_crosses_few_lines(self):
        with _drawing.style():
            axes = _drawing.new_figure(4.0, 3.0).add_subplot()
            axes.plot([0, 1], [9.6, 9.6], label="name")
            for y in (9.9, 10.5, *np.linspace(9.5, 9.0, 6)):
                axes.plot([0, 1], [y, y], label="_other")
            axes.set_ylim(0, 12)
            axes.figure.canvas.draw()
            _drawing.name_lines(axes)
        self.assertGreater(axes.texts[0].get_position()[1], 10 / 12)

    def test_names_in_a_legend_may_begin_with_an_underscore(self):
        impacts = "t,contact,kind,impulse\n1,1,impact,3\n2,1,impact,4\n"
        figure = plot.draw([self.table(impacts, name) for name in ("_a", "b")])
        words = [text.get_text().strip() for text in figure.axes[0].get_legend().get_texts()]
        self.assertEqual(words, ["_a, contact 1", "b, contact 1"])

    def test_text_never_leaves_the_picture(self):
        long = "n" * 100000
        figure = plot.draw([self.table(STATES, long)], title=long)
        figure.canvas.draw()
        for text in figure.findobj(matplotlib.text.Text):
            if text.get_text() and text.get_visible():
                box = text.get_window_extent()
                self.assertGreaterEqual(figure.bbox.x1 + 1, box.x1, text.get_text()[:20])

    def test_names_are_text(self):
        names = ["".join(f"{c}run{c}" for c in "\x01\x07\t\n\r\x1b\x7f'\"")]
        names += ["$x$ $\\frac{1}{2}$ \\$", "$$", "_a __ ^{a}_b %s %d %{x} 日本語 🔔 \udcff\udcfe"]
        names += [
            "Ω ∂g/∂t a\\b &amp; <script> ]]> --> -- \x9b[31m \u202e \x1b]0;title\x07 $(run)`run`"
        ]
        runs = [self.table(STATES, name) for name in names]
        for name in names:
            runs[0].data[name] = 1.0
        figure = plot.draw(runs, title="of " + names[1], show=["q1", *names])
        for name in ("of " + names[1], *names):
            self.assertIn(_drawing.legible(name), texts(figure))
        plot.save(figure, self.path("a.svg"))
        xml.etree.ElementTree.parse(self.path("a.svg"))


class StudyTest(Files):
    def study(self, axes, columns, rows, name="study"):
        folder = self.folder / name
        folder.mkdir(exist_ok=True)
        manifest = {"name": name, "axes": [{"path": a, "group": i} for i, a in enumerate(axes)]}
        (folder / "manifest.json").write_text(json.dumps(manifest))
        text = ",".join(["index", "point", "run", *axes, *columns, "failure"]) + "\n"
        for i, row in enumerate(rows):
            cells = ",".join(repr(float(value)) for value in row)
            text += f"{i},0,0,{cells},{'t = 1: a word; another' if i % 2 else ''}\n"
        (folder / "rows.csv").write_text(text)
        return folder / "rows.csv"

    def draw(self, file, **options):
        return plot_study.draw(tables.read_study_rows([file]), **options)

    def test_median_and_band_of_each_estimator(self):
        jitters = (1e-6, 1e-5, 1e-4, 1e-3)
        rows = [(j, j * (r + 1), 5.0, nan) for j in jitters for r in range(21)]
        columns = ["replica.V_floor", "both.V_floor", "both.rate"]
        figure = self.draw(self.study(["events.jitter"], columns, rows))
        self.assertEqual(titles(figure), ["V_floor [J]"], "rate is nowhere known")
        axes = figure.axes[0]
        self.assertEqual(axes.get_xlabel(), "events.jitter [s]")
        self.assertEqual((axes.get_xscale(), axes.get_yscale()), ("log", "log"))
        drawn = lines(axes)
        np.testing.assert_allclose(drawn["replica"].get_ydata(), 11 * np.array(jitters))
        self.assertEqual(drawn["both"].get_ydata().tolist(), [5.0] * 4)
        self.assertNotEqual(drawn["both"].get_color(), drawn["replica"].get_color())
        corners = axes.collections[0].get_paths()[0].vertices
        at = corners[np.isclose(corners[:, 0], 1e-4), 1]
        np.testing.assert_allclose([at.min(), at.max()], [2e-4, 20e-4])

    def test_ticks_of_a_logarithmic_axis_do_not_overlap(self):
        for low, high in [(0.3, 4.0), (1e-5, 9e-5), (0.2, 0.21), (12.0, 95.0), (1e-9, 1.0)]:
            with self.subTest(low=low, high=high), _drawing.style():
                figure = _drawing.new_figure(2.0, 1.5)
                axes = figure.add_subplot()
                axes.set(xscale="log", xlim=(low, high))
                _drawing.logarithmic_ticks(axes.xaxis, low, high)
                axes.set_xlim(low, high)
                figure.canvas.draw()
                labels = [
                    text.get_window_extent()
                    for which in ("major", "minor")
                    for text in axes.get_xticklabels(which=which)
                    if text.get_text() and low <= text.get_position()[0] <= high
                ]
                self.assertGreater(len(labels), 1)
                labels.sort(key=lambda box: box.x0)
                for left, right in zip(labels, labels[1:]):
                    self.assertLess(left.x1, right.x0)

    def test_numbers_of_modes_have_whole_ticks(self):
        figure = self.draw(self.study(["modes"], ["rate"], [(n, 1.0) for n in (1, 2, 3)]))
        self.assertTrue((figure.axes[0].get_xticks() % 1 == 0).all())

    def test_points_of_the_stroboscope(self):
        rows = [(2.0 + k, n, -k, 0.1 * n, 7.0) for k in range(3) for n in range(1, 5)]
        columns = ["n", "lyapunov", "q1", "u1"]
        figure = self.draw(self.study(["force.1.frequency"], columns, rows))
        self.assertEqual(titles(figure), ["q1", "lyapunov [1/s]"])
        points, medians = (axes.lines[0] for axes in figure.axes)
        self.assertEqual(len(points.get_ydata()), 12)
        self.assertEqual(medians.get_ydata().tolist(), [0.0, -1.0, -2.0])
        self.assertEqual(len(figure.axes[1].collections), 0, "one value for all points of a run")

    def test_two_keys_give_a_map_of_the_median(self):
        rows = [
            (x, y, x * y + r, 100.0 * x)
            for x in (1.0, 2.0, 4.0)
            for y in (-1.0, 1.0)
            for r in range(3)
        ]
        file = self.study(["x", "y"], ["replica.rate", "both.rate"], rows)
        figure = self.draw(file)
        self.assertEqual(titles(figure)[:2], ["replica.rate [1/s]", "both.rate [1/s]"])
        mesh = figure.axes[0].collections[0]
        self.assertEqual(mesh.get_array().reshape(2, 3).tolist(), [[0, -1, -3], [2, 3, 5]])
        limits = [axes.collections[0].get_clim() for axes in figure.axes[:2]]
        self.assertEqual(limits, [(-3.0, 400.0)] * 2, "colours mean the same in both")
        one = self.draw(file, where={"y": 0.8})
        self.assertEqual(lines(one.axes[0])["replica"].get_ydata().tolist(), [2.0, 3.0, 5.0])
        for options in ({"over": ["z"]}, {"where": {"z": 1.0}}, {"show": ["ra"]}):
            with self.assertRaises(UsageError):
                self.draw(file, **options)

    def test_starts_are_coloured_by_attractor(self):
        random = np.random.default_rng(3)
        rows, expected = [], np.zeros((20, 30))
        for i in range(30):
            for k in range(20):
                left = i + k < 20
                near = 1.0 + random.uniform(-1e-6, 1e-6)
                rows.append(
                    (0.1 * i, k, 1 if left else 2, 0.3 if left else -0.2, near if left else 4)
                )
                expected[k, i] = 1 if left else 2
                if i == k:
                    rows[-1] = (0.1 * i, k, 0, nan, nan)
                    expected[k, i] = 0
        columns = ["attractor.period", "attractor.q1", "attractor.u1"]
        figure = self.draw(self.study(["master.q.1", "master.u.1"], columns, rows))
        mesh = figure.axes[0].collections[0]
        np.testing.assert_array_equal(mesh.get_array().reshape(20, 30), expected)
        words = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
        self.assertEqual(
            [word.rpartition(",")[0] for word in words],
            ["none found", "1: period 1", "2: period 2"],
        )

    def test_attractors_are_numbered_by_period_and_place(self):
        periods = np.array([2, 1, 0, 1, 1, 2])
        q = np.array([[1.0], [2.0], [0.0], [-2.0], [2.0005], [1.0]])
        labels = plot_study.attractors(periods, q, np.zeros((6, 1)))
        self.assertEqual(labels.tolist(), [3, 2, 0, 1, 2, 3])

    def test_cells_on_logarithmic_axes(self):
        np.testing.assert_allclose(
            plot_study._edges(np.array([1.0, 10.0, 100.0])), 10 ** np.array([-0.5, 0.5, 1.5, 2.5])
        )
        self.assertEqual(plot_study._edges(np.array([1.0, 2.0])).tolist(), [0.5, 1.5, 2.5])

    def test_a_key_is_a_quantity_too(self):
        figure = self.draw(self.study(["x"], ["V"], [(1, 2), (3, 4)]), show=["x"])
        self.assertEqual(figure.axes[0].lines[0].get_ydata().tolist(), [1.0, 3.0])

    def test_sparse_data_is_drawn(self):
        rows = [(1, 1, 1, 4, -math.inf, 2), (1, 2, 2, 3, -math.inf, math.inf)]
        columns = ["attractor.period", "attractor.q1", "rate", "V"]
        file = self.study(["x", "y"], columns, rows)
        self.draw(file, over=["x", "y"], show=["attractor", "V"])
        self.draw(file, over=["y"], show=["V", "rate"])
        with self.assertRaisesRegex(InputError, "nothing to show"):
            self.draw(file, over=["y"], show=["rate"])

    def test_scattered_starts_are_dots(self):
        random = np.random.default_rng(4)
        rows = [(*random.uniform(size=2), i) for i in range(20)]
        figure = self.draw(self.study(["x", "y"], ["rate"], rows))
        self.assertEqual(len(figure.axes[0].collections[0].get_offsets()), 20)

    def test_program_draws_shards_and_reports_damage(self):
        file = self.study(["x"], ["rate"], [(1.0, 2.0), (2.0, 3.0)])
        shard = file.with_name("rows.2.csv")
        shard.write_text(file.read_text() + "2,0\n")
        damaged = self.plot(file, shard, "--output", "a.png", code=1)
        self.assertIn(f"{shard}:4: 2 fields; the header has 6; the picture shows", damaged.stderr)
        for arguments in (
            ("--over", "none"),
            ("--show", "V"),
            ("--where", "x"),
            ("--report", file.with_name("manifest.json")),
            (SOURCE / "scenes" / "lab_rig.toml",),
        ):
            refused = self.plot(file, "--output", "a.png", *arguments, code=2)
            self.assertEqual(refused.stdout, "")
            self.assertIn("plot: ", refused.stderr)
        file.with_name("manifest.json").unlink()
        refused = self.plot(file, "--output", "a.png", code=2)
        self.assertIn("the varied keys of the study are unknown", refused.stderr)
        self.plot(file, "--over", "x", "--output", "a.png")


class ProgramTest(Files):
    """The program within this process; Program.plot starts it as a user does."""

    def setUp(self):
        super().setUp()
        self.states = self.file("s.csv", STATES)

    def test_draws_all_kinds_of_pictures(self):
        for name, begin in (("a.png", b"\x89PNG"), ("a.svg", b"<?xml"), ("a.pdf", b"%PDF-")):
            done = self.plot(f"a={self.states}", "--output", name)
            self.assertEqual((done.stdout, done.stderr), ("", ""))
            first = (self.folder / name).read_bytes()
            self.assertEqual(first[: len(begin)], begin)
            self.plot(f"a={self.states}", "--output", name)
            self.assertEqual(
                (self.folder / name).read_bytes(), first, "equal files, equal pictures"
            )

    def test_says_what_it_chooses(self):
        rows = "".join(f"{k},{0.1 * k},{k % 2},1,1,1,1\n" for k in range(1000))
        states = self.file("s.csv", "k,t,q1,q2,q3,q4,q5\n" + rows)
        done = self.plot(states, "--output", "a.png", "--report", "r.json")
        self.assertIn("the motion is shown from 0 to 4 s", done.stderr)
        self.assertIn("not shown: q5; --show NAME,... chooses", done.stderr)
        report = json.loads((self.folder / "r.json").read_text())
        self.assertEqual(report["panels"], ["q1", "q2", "q3", "q4"])
        whole = self.plot(states, "--output", "a.png", "--from", 0, "--show", "q1")
        self.assertEqual(whole.stderr, "")

    def test_bad_usage_exits_with_2_and_overwrites_nothing(self):
        states = self.states
        foreign = self.file("b.csv", "time,value\n0,1\n")
        predictions = self.file("p.csv", "made_at,certain_until,t,contact,kind,sigma_t\n1,2,,,,\n")
        scene = SOURCE / "scenes" / "two_stops_beam.toml"
        (self.folder / "lab_rig").mkdir()  # does not hide the scene of this name
        out = ("--output", "a.png")
        for words, arguments in [
            ("must end in .png, .svg or .pdf", (states, "--output", "a.jpg")),
            ("two numbers that rise", (states, *out, "--zoom", "3:1")),
            ("choose q1 or u1", (states, *out, "--show", "g1")),
            ("nothing to show in this time", (states, *out, "--from", "9")),
            ("No such file", ("none.csv", *out)),
            ("n: cannot be read", ("n" * 100000, *out)),
            ("header is none of", (foreign, *out)),
            ("holds predictions", (predictions, *out)),
            ("a second scene", (scene, f"a={scene}", states, *out)),
            ("has 1 coordinates; the scene has 2", ("lab_rig", states, *out)),
        ]:
            self.assertIn(words, self.plot(*arguments, code=2).stderr)
        self.assertEqual(Path(states).read_text(), STATES)
        self.assertFalse((self.folder / "a.png").exists())

    def test_a_damaged_file_is_shown_up_to_the_damage(self):
        states = self.file("s.csv", STATES + "2,9\n")
        done = self.plot(states, "--output", "a.png", code=1)
        words = f"{states}:4: 2 fields; the header has 4; the picture shows everything before it\n"
        self.assertEqual(done.stderr, words)
        self.assertTrue((self.folder / "a.png").exists())

    def test_an_existing_picture_stays_when_drawing_fails(self):
        picture = self.file("a.svg", "old")
        import_module = importlib.import_module

        def without(name, *package):
            if name.startswith("matplotlib"):
                raise ModuleNotFoundError(name="matplotlib")
            return import_module(name, *package)

        with unittest.mock.patch("importlib.import_module", without):
            done = self.plot(self.states, "--output", picture, code=1)
        self.assertIn("install it: apt install python3-matplotlib", done.stderr)
        limits = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (512, limits[1]))
        try:
            done = self.plot(self.states, "--output", picture, code=1)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        self.assertIn("File too large", done.stderr)
        self.assertEqual(Path(picture).read_text(), "old")
        self.assertEqual(sorted(p.name for p in self.folder.glob(".a*")), [])

    @unittest.skipUnless(os.path.exists("/dev/full"), "no /dev/full here")
    def test_a_full_disk_is_a_failure(self):
        os.symlink("/dev/full", self.path("a.svg"))
        done = self.plot(self.states, "--output", "a.svg", code=1)
        self.assertIn("a.svg: No space left on device", done.stderr)
        nowhere = self.plot(self.states, "--output", "nowhere/a.svg", code=1)
        self.assertIn("nowhere/a.svg", nowhere.stderr)

    def test_settings_of_the_user_change_nothing(self):
        self.plot(self.states, "--output", "a.svg")
        user = {"text.usetex": True, "figure.facecolor": "red", "lines.linewidth": 9}
        with matplotlib.rc_context(user):
            self.plot(self.states, "--output", "b.svg")
        a, b = ((self.folder / name).read_bytes() for name in ("a.svg", "b.svg"))
        self.assertEqual(a, b)
