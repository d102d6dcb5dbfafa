"""Tables are read by their headers, up to their damage, exactly."""

import json
from pathlib import Path

import numpy as np

from sprag import tables
from sprag._errors import InputError
from support import FolderTest


class TablesTest(FolderTest):
    def read(self, text: str | bytes, label: str = "") -> tables.Table:
        return tables.read_table(self.file("a.csv", text), label)

    def test_kinds_are_told_apart_by_their_headers(self) -> None:
        for kind, header in [
            ("states", "k,t,q1,u1"),
            ("energy", "k,t,V,V1"),
            ("events", "t,contact,closed"),
            ("impacts", "t,contact,kind,impulse"),
            ("predictions", "made_at,certain_until,t,contact,kind,sigma_t"),
            ("study", "index,point,run,rate"),
        ]:
            table = self.read(header + "\n")
            self.assertEqual((table.kind, len(table.data), table.damage), (kind, 0, ""))
        for foreign in (
            "",
            "time,value\n0,1\n",
            "t,contact\n",
            '{"a": 1}',
            b"\xff\xfe\x00\x01\x00",
        ):
            with self.assertRaisesRegex(InputError, r"a\.csv:1: the header is none of"):
                self.read(foreign)
        with self.assertRaisesRegex(InputError, r"none\.csv: cannot be read: No such file"):
            tables.read_table(self.folder / "none.csv")

    def test_numbers_read_back_exactly(self) -> None:
        values = [0.1, 1 / 3, 1e-300, 123456789.12345678, -0.0, 5e-324, np.inf, -np.inf]
        rows = "".join(f"{k},{k},{value!r}\n" for k, value in enumerate(values))
        table = self.read("k,t,q1\n" + rows)
        self.assertEqual(table.column("q1").tobytes(), np.array(values).tobytes())
        self.assertEqual(table.label, "a")
        self.assertEqual(self.read("k,t,q1\n", "run").label, "run")

    def test_forms_of_lines(self) -> None:
        for text in ("k,t,q1\n0,1,2\n", "k,t,q1\r\n0,1,2\r\n", "\ufeffk,t,q1\n0,1,2\n"):
            self.assertEqual(self.read(text).data.to_numpy().tolist(), [[0.0, 1.0, 2.0]])

    def test_a_cell_that_is_no_number_is_nan(self) -> None:
        table = self.read('k,t,q1\n0,0,\n1,1,word\n2,2,nan\n3,3,"4"\n4,4,5\n')
        self.assertEqual(np.isnan(table.column("q1")).tolist(), [True] * 4 + [False])

    def test_reading_ends_at_damage(self) -> None:
        for rows, kept, damage in [
            ("0,0,1\n1,1\n2,2,1\n", 1, ":3: 2 fields; the header has 3"),
            ("0,0,1\n1,1,1,1\n", 1, ":3: 4 fields; the header has 3"),
            ("0,0,1\n\n2,2,1\n", 1, ":3: 1 fields; the header has 3"),
            ("0,0,1\n1,1,1", 1, ":3: truncated line (no end of line)"),
            ("x\n", 0, ":2: 1 fields; the header has 3"),
        ]:
            table = self.read("k,t,q1\n" + rows)
            self.assertEqual(len(table.data), kept, rows)
            self.assertEqual(table.damage, f"{table.file}{damage}")

    def test_impossible_contacts_are_damage(self) -> None:
        for contact in ("0", "61", "1e9", "1.5", "nan", "-1", ""):
            table = self.read(f"t,contact,closed\n1,1,1\n2,{contact},1\n3,1,1\n")
            self.assertEqual(len(table.data), 1, contact)
            words = f":3: contact {contact}; must be a whole number in 1 to 60"
            self.assertEqual(table.damage, f"{table.file}{words}")
        header = "made_at,certain_until,t,contact,kind,sigma_t\n"
        self.assertEqual(self.read(header + "1,2,,,,\n1,2,1.5,1,impact,0.1\n").damage, "")

    def test_names_of_columns_may_be_anything(self) -> None:
        table = self.read(b"k,t,q1,\xff\x1b,q1,,\n0,0,1,2,3,4,5\n")
        self.assertEqual(list(table.data), ["k", "t", "q1", "\udcff\x1b", ""])
        self.assertEqual(table.column("q1")[0], 1.0)
        self.assertEqual(table.coordinates, 1)

    def test_estimates_have_columns_about_their_error(self) -> None:
        for column in ("B", "sigma_q1", "bound_g1"):
            self.assertTrue(self.read(f"k,t,q1,u1,{column}\n").is_estimate)
        self.assertFalse(self.read("k,t,q1,u1,tip\n").is_estimate)
        self.assertFalse(self.read("k,t,V,B\n").is_estimate)

    def test_pulses_are_one_event(self) -> None:
        events = self.read("t,contact,closed\n1,1,1\n1,1,0\n2,2,1\n2,1,1\n2,1,0\n3,2,0\n")
        found = tables.contact_events(events.data)
        self.assertEqual(found["kind"].tolist(), ["impact", "closes", "impact", "opens"])
        self.assertEqual(found["contact"].tolist(), [1, 2, 1, 2])
        for text in ("t,contact,closed\n", "t,contact,kind\n"):
            self.assertEqual(len(tables.contact_events(self.read(text).data)), 0)

    def test_closures(self) -> None:
        events = self.read(
            "t,contact,closed\n1,1,1\n1,1,0\n2,2,1\n3,1,1\n3,1,0\n4,2,0\n4.5,1,0\n5,1,1\n"
        )
        found = tables.closures(tables.contact_events(events.data), 8.0)
        self.assertEqual(found[1].impacts, [1.0, 3.0])
        self.assertEqual(found[1].stretches, [(5.0, 8.0)])
        self.assertEqual(found[1].begins, [1.0, 3.0, 5.0])
        self.assertEqual(found[2], tables.Closures([], [(2.0, 4.0)]))

    def test_shards_of_a_study(self) -> None:
        axes = [{"path": "x", "group": 0}, {"path": "y", "group": 0}, {"path": "z"}]
        self.file("manifest.json", json.dumps({"name": "jitter", "axes": axes}))
        header = "index,point,run,x,y,z,rate,failure\n"
        first = self.file("rows.csv", header + "0,0,0,1,2,3,4,a word; another\n")
        second = self.file("rows.2.csv", header + "1,0,0,1,2,3,5,\n2,0")
        study = tables.read_study_rows([first, second])
        self.assertEqual((study.name, study.axes), ("jitter", ["x", "z"]))
        self.assertEqual(study.rows["rate"].tolist(), [4.0, 5.0])
        self.assertEqual(study.damage, [f"{second}:3: truncated line (no end of line)"])
        self.assertTrue(tables.is_study(first))
        self.assertFalse(tables.is_study(self.folder / "manifest.json"))
        self.assertEqual(tables.manifest_of("a/shard3.csv"), Path("a/shard3.json"))
        other = self.file("rows.3.csv", "index,point,run,x\n")
        with self.assertRaisesRegex(InputError, "not that of the first file"):
            tables.read_study_rows([first, other])
        self.file("manifest.json", "[1]")
        with self.assertRaisesRegex(InputError, "no manifest of a study"):
            tables.read_study_rows([first])
