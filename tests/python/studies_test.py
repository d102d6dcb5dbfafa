"""Rows of a study become arrays, in the order of its axes."""

import json

import numpy as np
import sprag
from support import FolderTest


class StudiesTest(FolderTest):
    def write(self, lines, axes=("x", "y"), name="rows", manifest="manifest"):
        (self.folder / f"{name}.csv").write_text("\n".join(lines) + "\n")
        axes = [{"path": path, "group": path} for path in axes]
        (self.folder / f"{manifest}.json").write_text(json.dumps({"name": "s", "axes": axes}))

    def rows(self):
        lines = ["index,point,run,x,y,both.rate,failure"]
        for i in range(12):
            x, y, run = (1e-6, 1e-5)[i // 6], i // 2 % 3 - 1.0, i % 2
            failed = i == 7
            value = "nan" if failed else "inf" if i == 3 else repr(100 * x + 10 * y + run)
            failure = "t = 0.5: lost; all of it" if failed else ""
            lines.append(f"{i},{i // 2},{run},{x!r},{y!r},{value},{failure}")
        return lines

    def test_columns_are_arrays(self):
        self.write(self.rows())
        for path in (self.folder, str(self.folder / "rows.csv")):
            study = sprag.read_study(path)
            self.assertEqual(study.rows, 12)
            self.assertEqual(study.axes, ["x", "y"])
            self.assertEqual(study.manifest["name"], "s")
            self.assertEqual(study.names[:4], ["index", "point", "run", "x"])
            self.assertEqual(study["point"].dtype, np.int64)
            self.assertEqual(study["both.rate"].dtype, np.float64)
            self.assertEqual(study["both.rate"][3], np.inf)
            self.assertTrue(np.isnan(study["both.rate"][7]))
            self.assertEqual(study["failure"][7], "t = 0.5: lost; all of it")
            self.assertEqual(study["x"][11], 1e-5)
            with self.assertRaises(KeyError):
                study["V"]

    def test_a_grid_has_a_dimension_for_each_axis(self):
        lines = self.rows()
        self.write(lines[:1] + lines[:0:-1])  # the order of rows does not matter, except for runs
        study = sprag.read_study(self.folder)
        grid = study.grid("both.rate")
        self.assertEqual(grid.shape, (2, 3, 2))
        for i, x in enumerate((1e-6, 1e-5)):
            for k, y in enumerate((-1.0, 0.0, 1.0)):
                if (i, k) in ((0, 1), (1, 0)):
                    continue
                np.testing.assert_allclose(np.sort(grid[i, k]), 100 * x + 10 * y + np.arange(2))
        self.write(lines[:-1])
        with self.assertRaisesRegex(ValueError, "grid"):
            sprag.read_study(self.folder).grid("x")

    def test_a_shard_and_a_file_without_manifest(self):
        self.write(self.rows(), name="shard-2-of-4", manifest="shard-2-of-4")
        study = sprag.read_study(self.folder / "shard-2-of-4.csv")
        self.assertEqual(study.axes, ["x", "y"])
        (self.folder / "shard-2-of-4.json").unlink()
        study = sprag.read_study(self.folder / "shard-2-of-4.csv")
        self.assertEqual((study.axes, study.manifest), ([], {}))
        self.write(self.rows()[:1])
        self.assertEqual(sprag.read_study(self.folder).rows, 0)

    def test_damage_is_an_error_with_its_line(self):
        for lines, what in (
            (self.rows() + ["12,6"], "rows.csv:14: 2 fields; the header has 7"),
            (["t,x", "0,1"], "rows.csv:1: the header"),
            (self.rows() + ["12,6,0,a,0,0,"], "column x"),
        ):
            self.write(lines)
            with self.assertRaisesRegex(sprag.InputError, what):
                sprag.read_study(self.folder)
        self.write(self.rows())
        (self.folder / "manifest.json").write_text("{")
        with self.assertRaisesRegex(sprag.InputError, "manifest"):
            sprag.read_study(self.folder)
        with self.assertRaises(sprag.InputError):
            sprag.read_study(self.folder / "none")
