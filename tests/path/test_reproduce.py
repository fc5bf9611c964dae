"""`counterlight reproduce`: its integers against numpy's polynomials, its curves against the theory's closed forms."""
import csv
import pathlib
import shutil
import tempfile
from collections import defaultdict

import numpy as np

from support import PathTest, answer_of, main

POWERS = 8


def lines_of(path):
    lines = defaultdict(list)
    with open(path) as table:
        for row in csv.DictReader(table):
            lines[row["line"]].append((float(row["x"]), float(row["y"])))
    return {name: np.array(points) for name, points in lines.items()}


class Reproduce(PathTest):
    @classmethod
    def setUpClass(cls):
        cls.place = tempfile.TemporaryDirectory()
        cls.out = pathlib.Path(cls.place.name) / "reproduced"
        cls.answer = answer_of("reproduce", "-o", cls.out, "--largest", "320")

    @classmethod
    def tearDownClass(cls):
        cls.place.cleanup()

    def test_every_claim_has_a_verdict_that_holds(self):
        rows = self.answer["rows"]
        self.assertGreaterEqual(len(rows), 20)
        for row in rows:
            self.assertEqual(set(row), {"name", "report", "ours", "pass"})
            # what Fig. 10 says of times is that of the machine and of what else runs on it
            self.assertTrue(row["pass"] or row["name"].startswith("Fig. 10"), row)
        self.assertEqual(self.answer["passed"], sum(row["pass"] for row in rows))

    def test_the_coefficients_are_those_of_the_expanded_series(self):
        light = np.ones(POWERS, dtype=int)
        reflected = light.copy()
        reflected[0] = 0
        total, power = np.zeros(POWERS, dtype=int), np.eye(1, POWERS, dtype=int)[0]
        inverse, product = lines_of(self.out / "fig5.csv"), lines_of(self.out / "fig6.csv")
        for n in range(13):
            total = total + (-1) ** n * power
            power = np.convolve(power, reflected)[:POWERS]
            shown = np.convolve(total, light)[:POWERS]
            for m in range(POWERS):
                self.assertEqual(inverse[f"A^{m}"][n, 1], total[m], (n, m))
                self.assertEqual(product[f"A^{m}"][n, 1], shown[m], (n, m))

    def test_the_errors_follow_theory(self):
        curves = lines_of(self.out / "fig8b.csv")
        for m in (0.3, 0.4, 0.45):
            n = np.arange(21)
            np.testing.assert_allclose(curves[f"albedo {m:g}"][:, 1], m ** (n + 1) / (1 - m) ** n, rtol=1e-6)
        closed = lines_of(self.out / "fig8c.csv")
        for m in (0.4, 0.45, 0.49, 0.51):
            curve = closed[f"albedo {m:g}"][:, 1]
            self.assertAlmostEqual(curve[20] / curve[19], m / (1 - m), delta=2e-3)

    def test_variance_falls_as_samples(self):
        curves = lines_of(self.out / "fig11.csv")
        for name in ("inverse", "forward", "inverse, gathered", "forward, gathered"):
            samples, variance = np.log(curves[name].T)
            self.assertAlmostEqual(np.polyfit(samples, variance, 1)[0], -1, delta=0.1, msg=name)
        for way in ("inverse", "forward"):
            self.assertLess((curves[f"{way}, gathered"][:, 1] / curves[way][:, 1]).max(), 0.2)

    def test_bounces_keep_their_digits_where_eq_51_loses_them(self):
        curves = lines_of(self.out / "fig12-eq51.csv")
        here, sums = curves["A times the last, here"][:, 1], curves["eq. 51"][:, 1]
        self.assertEqual(len(here), 8)
        self.assertLess(here.max(), 4e-3)
        self.assertGreater(sums[7], 1)
        self.assertGreater(np.diff(np.log(sums)).min(), 0)

    def test_the_page_holds_all_it_shows(self):
        page = (self.out / "reproduce.html").read_text()
        self.assertNotIn('src="http', page)
        self.assertIn("data:image/png;base64,", page)
        self.assertEqual(page.count("data:image/svg+xml;base64,") > 0, shutil.which("gnuplot") is not None)
        for row in self.answer["rows"]:
            self.assertIn(row["name"].replace("<", "&lt;"), page)

    def test_bad_words_are_refused(self):
        for words in (("--largest", "7"), ("--largest", "100"), ("--quick", "7"), ("--largest", "x"), ("-o", "/proc/nothing/there")):
            self.refused("reproduce", *words)


if __name__ == "__main__":
    main()
