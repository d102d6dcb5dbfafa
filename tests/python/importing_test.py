"""Files of devices, spreadsheets and loggers: each is read right, or refused with the reason."""

from __future__ import annotations

import importlib.util
import io
import os
import random
import tempfile
import unittest
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from sprag import InputError
from sprag.importing import import_events
from sprag.importing.events import Columns, import_table
from sprag.importing.formats import read_file
from sprag.importing.hints import find_batches, hints_at_bounces
from sprag.importing.moments import moment, unit_in_name
from sprag.importing.tables import read_table
from sprag.importing.times import Options

COMPILED = importlib.util.find_spec("sprag._core") is not None
OPTIONAL = {"scipy", "openpyxl"}
MISSING = {name for name in OPTIONAL if importlib.util.find_spec(name) is None}


def impact_times() -> np.ndarray:
    """Impacts [s] of a ball that falls 1 m, restitution 0.9."""
    g, times = 9.81, [np.sqrt(2 / 9.81)]
    speed = np.sqrt(2 * g)
    for _ in range(11):
        speed *= 0.9
        times.append(times[-1] + 2 * speed / g)
    return np.array(times)


TIMES = impact_times()
FEW = TIMES[:4]
EDGES = sorted([(t, 1) for t in TIMES] + [(t + 0.001, 0) for t in TIMES])
SAMPLES = np.arange(int(2.7 * 5000)) / 5000  # with the first four impacts
VOLTS = np.full(len(SAMPLES), 0.02)
for _t in TIMES:
    VOLTS[(SAMPLES >= _t) & (SAMPLES < _t + 0.001)] = 4.9
DIGITAL = (VOLTS > 2).astype(int)
GRID = SAMPLES[np.flatnonzero(np.diff(DIGITAL, prepend=0) == 1)]

PULSES: dict[str, Any] = {"pulse_shorter_than": 0.003}
CHANNEL = {"level": {1: "Channel 0"}, **PULSES}
SCOPE = {"threshold": 2.5, **PULSES}


def rows(form: str, head: str, *columns: Any) -> str:
    """A line for each entry of the columns."""
    return head + "".join(form.format(*row) + "\n" for row in zip(*columns))


def edge_rows(form: str, head: str, high: Any = 1, low: Any = 0) -> str:
    """A line for each edge: its time and its level."""
    return head + "".join(form.format(t, high if on else low) + "\n" for t, on in EDGES)


class Refused(str):
    """Part of the message with which a file is refused."""


class FileTest(unittest.TestCase):
    """A file, and the times that are wanted of it."""

    def read(self, content: str | bytes, contacts: int, how: dict[str, Any]) -> tuple[Any, str]:
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "file"
            file.write_bytes(content if isinstance(content, bytes) else content.encode())
            table = read_file(
                file,
                how.pop("columns", None),
                how.pop("separator", None),
                how.pop("skip_lines", 0),
            )
        by = {role: how.pop(role, {}) for role in ("impacts", "on", "off", "level")}
        imported = import_table(table, contacts, Columns(**by), Options(**how))
        said = " | ".join(table.remarks + table.doubts + [str(p) for p in table.problems])
        return imported.events["t"], said

    def check(
        self,
        name: str,
        content: str | bytes,
        want: Any,
        tolerance: float = 1e-9,
        *,
        contacts: int = 1,
        said: str = "",
        **how: Any,
    ) -> None:
        """`want`: the events' times [s], or Refused with a part of the message."""
        if not COMPILED and {"level", "on"} & how.keys():
            return
        with self.subTest(name):
            if isinstance(want, Refused):
                with self.assertRaises((InputError, ValueError)) as raised:
                    self.read(content, contacts, how)
                self.assertIn(want, str(raised.exception))
                self.assertIn(said, str(raised.exception))
                return
            times, words = self.read(content, contacts, how)
            self.assertEqual(len(times), len(want), words)
            np.testing.assert_allclose(times, want, rtol=0, atol=tolerance)
            self.assertIn(said, words)


class TroubleTest(FileTest):
    def test_an_odd_first_row(self):
        for cell in ("NaN", "OL", "-", "n/a"):
            text = f"Impact [ms]\n{cell}\n500.5\n1200.25\n1300.5\n"
            said = f"2: column Impact [ms]: {cell} is neither"
            self.check(cell, text, [0.5005, 1.20025, 1.3005], said=said)
        states = "Time,D0\n0,unavailable\n0.5,on\n0.501,off\n1.2,on\n1.201,off\n"
        level = {"level": {1: "D0"}, **PULSES}
        said = "2: column D0: unavailable is no level"
        self.check("word", states, [0.5, 1.2], said=said, **level)

    def test_time_that_goes_back(self):
        text = "Impact [s]\n0.451523641\n4.691626739\n5.80358983\n5.430218003\n5.745091120\n"
        back = Refused("5: column Impact [s]: time goes back from 5.80358983 to 5.430218003")
        self.check("nanoseconds without zeros", text, back, said="leading zeros")
        wraps = "Impact [us]\n4292418820\n4293231562\n246545\n812494\n"
        self.check("counter too small", wraps, Refused("of 16 bits"), counter_bits=16)
        text = "0.4,1,1\n0.401,1,0\n1.2,1,1\n1.201,1,0\n0.1,1,0\n0.5,1,1\n0.501,1,0\n"
        how = {"columns": ["time", "contact", "level"], "level": {1: "level"}, "said": "restart"}
        self.check("restart", text, Refused("5: column time: time goes back"), **how)
        text, said = "t [s]\n2\n1\n3\n", "in line 3; sorted"
        self.check("--any-order", text, [1, 2, 3], any_order=True, said=said)
        levels = "Time [s],D0\n2,1\n1,0\n3,1\n"
        how = {"level": {1: "D0"}, "any_order": True}
        self.check("levels in any order", levels, Refused("time goes back"), **how)


class LogicAnalyserTest(FileTest):
    def test_files(self):
        check = self.check
        check("saleae", edge_rows("{:.9f},{}", "Time [s],Channel 0\n-0.1,0\n"), TIMES, **CHANNEL)

        def iso(t: float) -> str:
            nanoseconds = round(t % 1 * 1e9)
            return f"2024-05-03T12:34:{56 + int(t):02d}.{nanoseconds:09d}+01:00"

        dates = rows("{},1\n{},0", "Time [s],Channel 0\n", map(iso, FEW), map(iso, FEW + 0.001))
        check("ISO", dates, FEW, 1.1e-9, offset="2024-05-03T11:34:56Z", **CHANNEL)
        check("ISO, no offset", dates, Refused("give --offset"), **CHANNEL)
        commas = "; DSView\nTime(s),0,1\n" + "".join(
            f"{t:.7f}".replace(".", ",") + f",{on},0\n" for t, on in EDGES
        )
        check("commas", commas, Refused("has 4 fields; the header has 3"), level={1: "0"}, **PULSES)
        in_cells = "Channel 0,Time\n" + "".join(f"{on},{t * 1e6:.6f} us\n" for t, on in EDGES)
        check("units in cells", in_cells, TIMES, **CHANNEL)
        sigrok = (
            "; CSV generated by libsigrok 0.5.2\n; Channels (1/1): D0\n; Samplerate: 5 kHz\nlogic\n"
        ) + "".join(f"{level}\n" for level in DIGITAL)
        level = {"level": {1: "logic"}, **PULSES}
        check("no times", sigrok, Refused("--sample-rate 5000"), **level)
        check("--sample-rate", sigrok, GRID, sample_rate=5000.0, **level)
        text = rows("{:.0f},{}", "Time,D0\n", SAMPLES * 1e6, DIGITAL)
        check("no unit", text, Refused("no unit is stated"), level={1: "D0"}, **PULSES)

    def test_words(self):
        check = self.check
        gpiomon = "".join(
            f"{2000 + t:.9f}\t{'rising' if on else 'falling'}\tgpiochip0 17\n" for t, on in EDGES
        )
        how = {"columns": ["time", "level", "chip", "line"], **PULSES}
        check("gpiomon", gpiomon, TIMES, 1.1e-9, offset="2000", level={1: "level"}, **how)
        both = sorted([(t, on, 17) for t, on in EDGES] + [(t + 1e-4, on, 27) for t, on in EDGES])
        two = "".join(
            f"{t:.9f}\t{'rising' if on else 'falling'}\tgpiochip0 {line}\n" for t, on, line in both
        )
        times = np.sort(np.concatenate([TIMES, TIMES + 1e-4]))
        levels = {1: "level@line=17", 2: "level@line=27"}
        check("two lines in one column", two, times, contacts=2, level=levels, **how)
        check("no such line", two, Refused("no row has '18'"), level={1: "level@line=18"}, **how)
        for high, low in [
            ("on", "off"), ("true", "false"), ("True", "False"), ("HIGH", "LOW"), ("closed", "open")
        ]:  # fmt: skip
            text = edge_rows("{:.9f},{}", "Time [s],state\n", high, low)
            check(f"{high}/{low}", text, TIMES, level={1: "state"}, **PULSES, said="is high")
        unknown = "Time,D0\n0,off\n0.5,on\n0.501,off\n1.2,maybe\n1.3,on\n1.301,off\n"
        check("unknown word", unknown, [0.5, 1.3], level={1: "D0"}, **PULSES,
              said="5: column D0: maybe is no level")  # fmt: skip
        check("no word", "Time,D0\n0,a\n1,b\n", Refused("'a' is none"), level={1: "D0"})
        text = edge_rows("{:.9f},{}", "Time [s],state\n-1,on\n", "off", "on")
        check("inverted", text, TIMES, level={1: "state"}, inverted=True, **PULSES)
        old = "".join(
            f"event: {'RISING' if on else 'FALLING'} EDGE offset: 16 timestamp: [ {t:.9f}]\n"
            for t, on in EDGES
        )
        check("gpiomon 1", old, Refused("are no table"), level={1: "level"})


class OscilloscopeTest(FileTest):
    def test_files(self):
        check, t, v = self.check, SAMPLES, VOLTS
        preamble = (
            "Record Length,Analog:31142\nSample Rate,5000.0\nVertical Scale,CH1: 1.00\n"
            "Vertical Offset,CH1: 0.0\nHorizontal Scale, 0.5\nSecond,Volt\n"
        )
        waveforms = "#Digilent WaveForms\n#Sample rate: 5000Hz\n\nTime (s),Channel 1 (V)\n"
        for name, head, channel in [
            ("keysight", "x-axis,1\nsecond,Volt\n", "1"),
            ("digilent", waveforms, "Channel 1 (V)"), ("rohde", "in s,CH1 in V\n", "CH1 in V"),
        ]:  # fmt: skip
            text = rows("{:.5f},{:.3f}", head, t, v)
            check(name, text, GRID, 1e-5, level={1: channel}, **SCOPE)
        how = {"level": {1: "Volt"}, **SCOPE}
        text = rows("{:.5f},{:.3f}", preamble, t, v)
        check("lines before", text, GRID, 1e-5, **how, said="5 lines before the header left out")
        check("--skip-lines of all", preamble, Refused("no header"), skip_lines=40, **how)
        plain = rows("{:.5f},{:.3f}", "", t, v)
        how = {"columns": ["t", "v"], "time": "t", "level": {1: "v"}, **SCOPE}
        check("no header", plain, GRID, 1e-5, **how)
        keys = ["Record Length,31000", "Sample Interval,2e-4", "Trigger Point,0"]
        keys += [","] * (len(t) - 3)
        beside = rows("{},{:.5f},{:.3f}", "", keys, t, v)
        how = {"time": "column 3", "level": {1: "column 4"}, **SCOPE}
        check("keys beside the data", beside, GRID, 1e-5, **how)
        pico = rows("{:.4f},{:.3f}", "Time,Channel A\n(ms),(V)\n\n", t * 1e3, v)
        level = {"level": {1: "Channel A"}}
        check("picoscope", pico, GRID, 1e-7, **level, **SCOPE, said="Time in ms")
        rigol = rows(
            "{},{:.2f},", "X,CH1,Start,Increment,\nSequence,VOLT,-0.5,2e-4,\n", range(9), v
        )
        check("rigol", rigol, Refused("X is the number of the sample"), level={1: "CH1"}, **SCOPE)
        lvm = (
            "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\n"
            "Decimal_Separator\t.\nMulti_Headings\tYes\nX_Columns\tOne\nTime_Pref\tRelative\n"
            "Operator\tx\nDate\t2022/01/02\nTime\t12:01:02.123\n***End_of_Header***\t\n\t\n"
            "Channels\t2\t\nSamples\t31000\t31000\nDate\t2022/01/02\t2022/01/02\n"
            "X_Dimension\tTime\tTime\nX0\t0\t0\nDelta_X\t0.0002\t0.0002\n***End_of_Header***\t\t\n"
            "X_Value\tAcceleration_0\tAcceleration_1\tComment\n"
        )
        level = {"level": {1: "Acceleration_0"}, "said": "fewer cells"}
        check("LVM", rows("{:.6f}\t{:.4f}\t0.1", lvm, t, v), GRID, 1e-6, **level, **SCOPE)


class SpreadsheetTest(FileTest):
    def test_times(self):
        check = self.check
        for bits in (32, 30):
            start = 2**bits - 3_000_000
            counts = [(round(t * 1e6) + start) % 2**bits for t in TIMES]
            text = rows("{}", "Impact [us]\n", counts)
            how = {"offset": str(start), "said": "column Impact [us]"}
            check(f"wraps at {bits}", text, Refused(f"--counter-bits {bits}"), **how)
            check(f"{bits} bits", text, TIMES, 1e-6, offset=str(start), counter_bits=bits)
        days = rows("{:.14f}", "Impact\n", 45415.5 + TIMES / 86400)
        check("days", days, TIMES, 1e-5, unit="86400", offset="45415.5")
        ms = [int(t % 1 * 1000) for t in FEW]
        seconds = [56 + int(t) for t in FEW]
        wanted = np.floor(FEW * 1000) / 1000
        german = rows("12:34:{:02d},{:03d}", "Zeit\n", seconds, ms)
        check("time of day", german, wanted, offset="12:34:56")
        dates = rows("03.05.2024 12:34:{:02d},{:03d}", "Stoss\n", seconds, ms)
        check("date", dates, wanted, offset="2024-05-03 12:34:56")
        midnight = "Time\n23:59:59.5\n00:00:00.25\n00:00:01\n"
        check("past midnight", midnight, [0.5, 1.25, 2], offset="23:59:59")
        check("past midnight first", "Time\n00:00:01\n", [2], offset="23:59:59")
        american = rows("5/3/2024 12:34:{}.{:03d} PM", "Stamp\n", seconds, ms)
        check("US date", american, wanted, offset="2024-05-03T12:34:56Z")
        ambiguous = "Stamp\n5/3/2024 12:34:56.451\n"
        check("day or month", ambiguous, Refused("is the day or the month first"))
        check("--month-first", ambiguous, [0.451], offset="2024-05-03 12:34:56", day_first=False)
        check("--day-first", ambiguous, [0.451], offset="2024-03-05 12:34:56", day_first=True)
        check("minutes", "Impact\n34:56.5\n34:57.5\n", [0.5, 1.5], offset="34:56")
        check("minutes, maybe", "Impact\n12:34\n12:35\n", [754, 755],
              said="column Impact: 12:34 is read as minutes:seconds")  # fmt: skip
        check("hours", "Impact\n12:34:56\n12:34:57\n", Refused("12:34:00"), offset="12:34")
        check("AM", "Time\n8:30:00 AM\n8:30:01 AM\n", [0, 1], offset="8:30:00")
        check("kinds", "t\n1.5\n2.5\n12:34:56\n", Refused("different kinds"))

    def test_tables(self):
        check = self.check
        for name, mark, comma in [
            ("comma", ",", False), ("tab", "\t", False), ("semicolon", ";", False),
            ("tab, decimal comma", "\t", True), ("semicolon, decimal comma", ";", True),
        ]:  # fmt: skip
            text = f'"Time (s)"{mark}"Distance (m)"\n'
            for t in TIMES:
                text += f"{t:.9E}".replace(".", "," if comma else ".") + f"{mark}1.000E0\n".replace(
                    ".", "," if comma else "."
                )
            check(f"phyphox {name}", text, TIMES, 1e-8, impacts={1: "Time (s)"})
        one = rows("{}", "Time (s)\n", [f"{t:.9E}".replace(".", ",") for t in TIMES])
        check("one column, commas", one, TIMES, 1e-8, said="decimal commas")
        latin = "Aufschläge [s];Höhe\n".encode("latin-1")
        latin += rows("{:.9f};1", "", TIMES).encode()
        check("latin-1", latin, TIMES, impacts={1: "Aufschläge [s]"}, said="Latin-1")
        check("UTF-16", rows("{:.9f}", "Impact [s]\n", TIMES).encode("utf-16"), TIMES)
        micro = [round(t * 1e6) for t in TIMES]
        thousands = rows("{:,}", "Impact [us]\n", micro)
        check("thousands", thousands, Refused("thousands commas"))
        text, said = "Impact [us]\n451,524\n", "separates thousands"
        check("may be thousands", text, [451.524e-6], said=said)
        text = 'a [us];b\n"1,264,381";1\n'
        check("quoted thousands", text, Refused("between thousands"), impacts={1: "a [us]"})
        spectral = "".join(
            f"{t:.6f}\t{t + 0.001:.6f}\t{'hit' if i % 3 else ''}\n\\\t100.0\t2000.0\n"
            for i, t in enumerate(TIMES)
        )
        pair = {"columns": ["start", "end", "label"], "on": {1: "start"}, "off": {1: "end"}}
        check("audacity", spectral, TIMES, 1e-6, **pair, **PULSES)
        savetxt = rows("{:.9e} {:.9e}", "# time(s), acceleration(g)\n", SAMPLES, VOLTS)
        check("savetxt", savetxt, GRID, columns=["t", "a"], time="t", level={1: "a"}, **SCOPE)


class BinaryTest(FileTest):
    def made(self, write: Callable[[io.BytesIO], Any]) -> bytes:
        file = io.BytesIO()
        write(file)
        return file.getvalue()

    @unittest.skipIf("openpyxl" in MISSING, "no openpyxl")
    def test_excel(self):
        import openpyxl

        def write(file: io.BytesIO) -> None:
            book = openpyxl.Workbook()
            book.active.append(["Impact [s]", "note"])
            for t in TIMES:
                book.active.append([float(t), "hit"])
            book.create_sheet("second")
            book.save(file)

        book = self.made(write)
        said = "only the first of 2 sheets"
        self.check("xlsx", book, TIMES, 1e-15, impacts={1: "Impact [s]"}, said=said)
        how = {"skip_lines": 2, "columns": ["t [s]", "note"], "impacts": {1: "t [s]"}}
        said = "times in s, as column 't [s]' says"
        self.check("--columns of .xlsx", book, TIMES[1:], 1e-15, **how, said=said)

    @unittest.skipIf("scipy" in MISSING, "no scipy")
    def test_matlab_and_sound(self):
        import scipy.io
        import scipy.io.wavfile

        vectors = self.made(lambda f: scipy.io.savemat(f, {"t": SAMPLES, "y": VOLTS}))
        self.check("mat", vectors, GRID, 1e-12, time="t", level={1: "y"}, **SCOPE)
        of_pico = {"Tstart": 0.0, "Tinterval": 2e-4, "A": VOLTS}
        pico = self.made(lambda f: scipy.io.savemat(f, of_pico))
        self.check("picoscope", pico, GRID, 1e-12, level={1: "A"}, **SCOPE)
        stamps = np.array([1714739696000000001, 1714739696000000003])
        whole = self.made(lambda f: scipy.io.savemat(f, {"ns": stamps}))
        how = {"impacts": {1: "ns"}, "unit": "ns", "offset": "1714739696000000000"}
        self.check("integers", whole, [1e-9, 3e-9], 0, **how)
        n = np.arange(int(6.5 * 44100))
        sound = np.random.default_rng(1).normal(0, 0.001, len(n))
        for t in TIMES:
            k = np.maximum(n - t * 44100, 0)
            sound += np.where(k > 0, np.exp(-k / 130.0) * np.sin(k * 0.5), 0)
        samples = (sound / abs(sound).max() * 30000).astype(np.int16)
        wav = self.made(lambda f: scipy.io.wavfile.write(f, 44100, samples))
        self.check("wav", wav, TIMES, 1e-4, said="12 onsets")
        silent = self.made(lambda f: scipy.io.wavfile.write(f, 44100, samples * 0))
        self.check("silence", silent, Refused("is silent"))

    def test_numpy_and_vcd(self):
        two = self.made(lambda f: np.save(f, np.array([TIMES, TIMES]).T))
        self.check("named", two, TIMES, 0, columns=["a", "t [s]"], impacts={1: "t [s]"},
                   said="times in s, as column 't [s]' says")  # fmt: skip
        self.check("too few names", two, Refused("--columns names 1 column"), columns=["a"],
                   impacts={1: "a"})  # fmt: skip
        objects = self.made(lambda f: np.save(f, np.array([{}, 1], object)))
        self.check("objects", objects, Refused("cannot be read"))
        vcd = (
            "$date x $end\n$timescale 100 ns $end\n$scope module top $end\n"
            '$var wire 1 ! D0 $end\n$var wire 1 " D1 $end\n$upscope $end\n$enddefinitions $end\n'
            '#0\n0!\n0"\n'
        ) + "".join(f"#{round(t * 1e7)}\n{on}!\n" for t, on in EDGES)
        self.check("vcd", vcd, TIMES, 1e-7, level={1: "D0"}, **PULSES)

    def test_foreign_files_are_named(self):
        for what, data in [
            ("TDMS", b"TDSm\0\0\0"), ("ROS bag", b"#ROSBAG V2.0\n"), ("-v7", b"\x89HDF\r\n\x1a\n"),
            ("JSON", b'{"t": [1, 2]}'), ("zip", b"PK\x03\x04 metadata"), ("PDF", b"%PDF-1.7\n"),
            ("unknown kind", bytes(range(256)) * 20), ("LCM log", b"\xed\xa1\xda\x01" * 9),
            ("no header", b""),
        ]:  # fmt: skip
            self.check(what, data, Refused(what))


class DamageTest(unittest.TestCase):
    def test_random_damage_gives_events_or_a_reason(self):
        generator = random.Random(7)
        files = [
            ("t [ms];u\n" + "".join(f"{k},5;{k % 2}\n" for k in range(1, 40)),
             {"impacts": "t [ms]"}),
            (rows("{:.6f}", "Impact [s]\n", TIMES), {}),
            ("Time,V\n(ms),(V)\n" + "".join(f"{k}.25,{k % 3}.5\n" for k in range(40)),
             {"impacts": "Time"}),
            ("Stamp\n" + "".join(f"2024-05-03T12:34:{k:02d}.5Z\n" for k in range(40)),
             {"offset": "2024-05-03T12:34:00Z"}),
        ]  # fmt: skip
        outcomes = {"read": 0, "refused": 0}
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "damaged.csv"
            for _ in range(1200 if "SPRAG_THOROUGH" in os.environ else 300):
                text, how = generator.choice(files)
                data = bytearray(text.encode())
                for _ in range(generator.randint(1, 3)):
                    at = generator.randrange(len(data))
                    kind = generator.randrange(4)
                    if kind == 0:
                        data[at] = generator.randrange(256)
                    elif kind == 1:
                        del data[at : at + generator.randint(1, 20)]
                    elif kind == 2:
                        data[at:at] = bytes(generator.choices(b'0123456789.,;:"\n\t eE+-', k=3))
                    else:
                        del data[max(1, at) :]
                file.write_bytes(data)
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    try:
                        t = import_events(file, 1, **how)["t"]
                    except (InputError, ValueError):
                        outcomes["refused"] += 1
                        continue
                self.assertTrue(np.isfinite(t).all() and (np.diff(t) >= 0).all(), bytes(data))
                self.assertTrue((t >= 0).all(), bytes(data))
                outcomes["read"] += 1
        self.assertGreater(min(outcomes.values()), 25, outcomes)


class MomentTest(unittest.TestCase):
    def test_times_are_exact(self):
        def seconds(text: str) -> float | None:
            read = moment(text)
            return None if read is None else float(read[0])

        for text, value in [
            ("12.5", 12.5), ("1970-01-02T00:00:00Z", 86400.0), ("12:34:56.789", 45296.789),
            ("2000-03-01 12:34:56.789", 951914096.789), ("0:00:01", 1.0), ("12.5 ms", 0.0125),
            ("2000-03-01T14:34:56,789+02:00", 951914096.789), ("34:56.5", 2096.5),
            ("2000/03/01 07:04:56.789 -0530", 951914096.789), ("1e-300", 1e-300),
        ]:  # fmt: skip
            self.assertEqual(seconds(text), value, text)
        for wrong in [
            "2001-02-29T00:00:00", "2000-03-01", "25:00:00", "12:60:00", "12:34:61", "12:34:56x",
            "2000-03-01T12:34:56+2", "", "12:34:", "1e400", "1" * 5000, "nan", "inf", "0x10", "1 2",
            "1_0", "١", "1e99999999999", "0000-01-01 00:00:00",
        ]:  # fmt: skip
            self.assertIsNone(moment(wrong), wrong)

    def test_large_stamps_keep_every_digit(self):
        for cell, offset, unit, wanted in [
            ("1732190400123456789", "1732190400000000000", "ns", 0.123456789),
            ("1732190400123456789", "1732190400123456788", "ns", 1e-9),
            ("1732190400.123456789", "1732190400", "s", 0.123456789),
            ("1732190400123.456789", "1.7321904e12", "ms", 0.123456789),
        ]:
            table = read_table(f"t\n{cell}\n")
            imported = import_table(table, 1, Columns(), Options(unit, offset))
            self.assertEqual(imported.events["t"].tolist(), [wanted])

    def test_units_of_names(self):
        for name, unit in [
            ("Impact [ms]", "ms"), ("impact [ s ]", "s"), ("[us] off", "us"), ("t in ms", "ms"),
            ("t / ns", "ns"), ("on_ms", "ms"), ("t [µs]", "µs"), ("t [rig 2] [ms]", "ms"),
            ("t (seconds)", "seconds"), ("t [min]", "min"), ("Second", "Second"),
        ]:  # fmt: skip
            self.assertEqual(unit_in_name(name), unit, name)
        for name in ["", *"t;s;impacts;hits;t [rig A];t [m];off (2);in;a_b;[".split(";")]:
            self.assertIsNone(unit_in_name(name), name)


class HintTest(unittest.TestCase):
    def closings(self, generator: np.random.Generator, contacts: int, impact: bool) -> np.ndarray:
        made = np.zeros(300, [("t", "f8"), ("contact", "i4"), ("kind", "i1")])
        made["t"] = np.cumsum(generator.exponential(0.02, 300))
        made["contact"] = generator.integers(1, contacts + 1, 300)
        made["kind"] = 3 if impact else 1
        return made

    def test_batches(self):
        for seed in range(1, 11):
            impact = seed % 2 == 0
            closings = self.closings(np.random.default_rng(seed), 1 if impact else 2, impact)
            self.assertIsNone(find_batches(closings), seed)
            for period in (0.01, 0.04):
                for apart in (0.0, 1e-5):
                    polled = closings.copy()
                    read = period * np.ceil(polled["t"] / period)
                    order = np.arange(300) - np.searchsorted(read, read)
                    polled["t"] = read + apart * order
                    batches = find_batches(polled)
                    self.assertIsNotNone(batches, (seed, period, apart))
                    self.assertAlmostEqual(batches.period, period, delta=0.01 * period)
                    self.assertGreater(batches.events, 50)
                    self.assertIn("time stamps come in batches", batches.text(300))

    def test_bounces_and_periodic_motions_are_no_batches(self):
        bounces = np.zeros(600, [("t", "f8"), ("contact", "i4"), ("kind", "i1")])
        bounces["t"] = np.repeat(0.05 * np.arange(200), 3) + np.tile([0, 1e-4, 2e-4], 200)
        bounces["contact"] = bounces["kind"] = 1
        self.assertIsNone(find_batches(bounces))
        periodic = bounces[:400].copy()
        periodic["t"] = np.repeat(0.05 * np.arange(200), 2) + np.tile([0, 0.02], 200)
        periodic["contact"] = np.tile([1, 2], 200)
        self.assertIsNone(find_batches(periodic))
        self.assertIsNone(find_batches(bounces[:0]))

    @unittest.skipUnless(COMPILED, "no _core")
    def test_short_sustained_contacts(self):
        def hints(text: str) -> list[str]:
            table = read_table("on;off\n" + text)
            of = import_table(table, 1, Columns(on={1: "on"}, off={1: "off"}), Options())
            return hints_at_bounces(of.events, of.figures)

        brief = hints("".join(f"{0.1 * k:.4f};{0.1 * k + 1e-4:.4f}\n" for k in range(20)))
        self.assertEqual(len(brief), 1)
        self.assertIn("contact 1: 20 of 20 sustained contacts last less than 0.001 s", brief[0])
        self.assertIn("--pulse-shorter-than", brief[0])
        slow = ""
        for k in range(20):
            for bounce in (0.0, 8e-3):
                slow += f"{100.0 * k + bounce:.4f};{100.0 * k + bounce + 5e-3:.4f}\n"
        found = hints(slow + "2000.0;2001.0\n2100.0;\n")
        self.assertIn("contact 1: 40 of 41 sustained contacts last less than 0.1 s", found[0])
        self.assertIn("20 closings follow an opening as closely", found[0])


@unittest.skipUnless(COMPILED, "no _core")
class ContactTest(FileTest):
    """Closings and openings, by the rules of the compiled library."""

    def test_contradictions_are_named_by_line(self):
        table = read_table("on,off\n,0.5\n1,2\n1.5,4\n3,5\n1,\n")
        columns = Columns(on={1: "on"}, off={1: "off"})
        of = import_table(table, 1, columns, Options(unit="s", any_order=True))
        self.assertEqual(of.events.tolist(), [(1.0, 1, 1), (2.0, 1, 2), (3.0, 1, 1), (4.0, 1, 2)])
        self.assertEqual(
            [str(problem) for problem in table.problems],
            [
                "2: column off: opens at t = 0.5, but is open already",
                "4: column on: closes at t = 1.5, but is closed already since t = 1",
                "5: column off: opens at t = 5, but is open already",
                "6: column on: closes at t = 1, but is closed already since t = 1",
            ],
        )

    def test_impacts(self):
        self.check("debounce", "a [ms]\n10\n13\n17\n22\n26\n", [0.01, 0.022], debounce=0.005,
                   impacts={1: "a [ms]"})  # fmt: skip
        text = "t;Time [s];V\n9;0;0,1\n9;1;3\n9;2;2,9\n9;3;0,2\n9;4;;\n9;5;3,3\n"
        for edge, wanted in [("rising", [1, 5]), ("falling", [3]), ("both", [1, 3, 5])]:
            self.check(edge, text, wanted, level={1: "V"}, threshold=1.5, impacts_at=edge)
        self.check("threshold", "Time,V\n0,0.5\n1,2\n", Refused("--threshold"), level={1: "V"})


class PlainTest(FileTest):
    """Without the compiled library."""

    def test_bad_cells_are_left_out_with_their_line(self):
        self.check("bad cell", "t\n0.5\nx\n0.7\n", [0.5, 0.7], said="3: column t: x is neither")
        self.check("long row", "t,u\n" + "1,0\n" * 1 + "2,0\n3,0\n4,0\n5,0\n6,0\n7,0\n8,0\n9,0\n"
                   "9.5,0\n10,0,5\n11,0\n", [1, 2, 3, 4, 5, 6, 7, 8, 9, 9.5, 11], impacts={1: "t"},
                   said="12: has 3 fields; the header has 2")  # fmt: skip
        self.check("open quote", 't,u\n1,0\n2,0\n"3,0\n4,0\n', [1, 2, 4], impacts={1: "t"},
                   said="4: a quote is not closed")  # fmt: skip
        self.check("twice", "t\n1\n2\n2\n", [1, 2], said="impact at t = 2, where there is one")
        self.check("all bad", "t,u\nx,1\ny,2\n", Refused("'x' is none. Times are numbers"),
                   impacts={1: "t"})  # fmt: skip

    def test_lines(self):
        self.check("CR", "# a Mac\rt,u\r1,2\r\r5,6\r", [1, 5], impacts={1: "t"})
        self.check("BOM", "\ufeffleft;right\r\n\"1,5\"; 2 \r\n# half\r\n4;\r\n \r\n;\r\n5;6",
                   [1.5, 4, 5], impacts={1: "left"})  # fmt: skip

    def test_names(self):
        for text, names in [
            ("a;b, c\n1.5;2\n", ["a", "b, c"]), ("a\tb;c\n1.5\t2\n", ["a", "b;c"]),
            ('"a;x",b\n1.5,2\n', ["a;x", "b"]),
            ('  a  , "b ""q""" \n 1.5\t, 2 \n', ["a", 'b "q"']),
        ]:  # fmt: skip
            table = read_table(text)
            self.assertEqual((table.names, table.rows), (names, [["1.5", "2"]]), text)
        for text, names in [
            ("# a Mac\n1.5,2\n3.5,4\n", ["column 1", "column 2"]),
            ("# t a\n1 2\n3 4\n", ["t", "a"]),
            ("# time(s), a (g)\n1 2\n3 4\n", ["time(s)", "a (g)"]),
            ("# t,u\n# a logger\n1.5,2\n3.5,4\n", ["column 1", "column 2"]),
        ]:  # fmt: skip
            self.assertEqual(read_table(text).names, names, text)
        table = read_table("impact,rise,fall,rise\n1,2,3,4\n")
        with self.assertRaisesRegex(InputError, "did you mean 'impact'"):
            table.column("impcat")
        with self.assertRaisesRegex(InputError, "more than one column 'rise'"):
            table.column("rise")
        with self.assertRaisesRegex(InputError, "1: has 2 fields; --columns names 1 column"):
            read_table("0.5,1\n", ["time"], "comma")

    def test_units(self):
        text = "a [ms],b [ms],c [us],d,e [min]\n1,2,3,4,5\n"
        for columns, wanted in [
            ({1: "a [ms]", 2: "b [ms]"}, None), ({1: "a [ms]", 2: "c [us]"}, "not say the same"),
            ({1: "a [ms]", 2: "d"}, "not say the same"), ({1: "e [min]", 2: "a [ms]"}, "is in min"),
        ]:  # fmt: skip
            table = read_table(text)
            arguments = (table, 2, Columns(impacts=columns), Options())
            if wanted is None:
                self.assertEqual(import_table(*arguments).events["t"].tolist(), [1e-3, 2e-3])
                self.assertIn("times in ms, as column 'a [ms]' says", table.remarks)
            else:
                with self.assertRaisesRegex(
                    InputError, f"{wanted}.*--unit s, ms, us, ns or a number"
                ):
                    import_table(*arguments)
        self.check("contradiction", "a [ms]\n500.5\n", [500.5], unit="s",
                   said="says ms; --unit says something else")  # fmt: skip

    def test_choices_that_contradict(self):
        table = "a,b,c\n1,2,3\n"
        for columns, wanted in [
            ({"impacts": {4: "a"}}, "--impacts a is for contact 4; the scene has 3 contacts"),
            ({"on": {1: "a"}}, "contact 1 has --on without --off"),
            ({"off": {2: "a"}}, "contact 2 has --off without --on"),
            ({"impacts": {1: "a"}, "on": {1: "b"}, "off": {1: "c"}}, "must be either"),
            ({}, "name the columns with --impacts"),
        ]:  # fmt: skip
            with self.assertRaisesRegex(ValueError, wanted):
                self.read(table, 3, dict(columns))
        with self.assertRaisesRegex(ValueError, "are for --level"):
            self.read("t\n1\n2\n", 1, {"threshold": 0.5})
