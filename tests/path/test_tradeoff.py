"""tradeoff on transports that h5py wrote: times aside, every number of its table is numpy's, and so are front, choice and
sentence."""
import csv
import re
import xml.etree.ElementTree as xml

import h5py
import numpy as np
from scipy.optimize import lsq_linear

from support import PathTest, answer_of, appearance, main, relative_error, room, run, write_transport

WIDTH, HEIGHT = 10, 8


def soft_picture(channels, seed=5):
    random = np.random.default_rng(seed)
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH] / HEIGHT
    return np.stack([0.5 + 0.25 * np.sin(3 * x + random.uniform(0, 6)) * np.cos(2 * y) for _ in range(channels)])


def checker(channels):
    y, x = np.mgrid[0:HEIGHT, 0:WIDTH]
    return np.repeat(((x + y) % 2)[None].astype(float), channels, axis=0)


class Tradeoff(PathTest):
    def given(self, channels, radius, picture, seed=1, sigma=None):
        """Writes a room and a .npy target; the radiance wanted is with white = 1."""
        self.dense = room(WIDTH, HEIGHT, channels, radius, seed).astype("f4")
        self.black = np.random.default_rng(seed).uniform(0.001, 0.01, self.dense.shape[:2]).astype("f4")
        self.transport, self.picture = self.folder / "T.h5", self.folder / "picture.npy"
        write_transport(self.transport, self.dense, WIDTH, HEIGHT, self.black)
        self.sigma = None
        if sigma is not None:
            self.sigma = (sigma * np.random.default_rng(seed).uniform(0.5, 1.5, self.dense.shape[:2])).astype("f4")
            with h5py.File(self.transport, "a") as file:
                file["sigma"] = self.sigma
        np.save(self.picture, picture.astype("f4"))
        self.wanted = picture.astype("f4").reshape(channels, -1).astype(float)

    def measure(self, *options, out="out"):
        self.out = self.folder / out
        answer = answer_of("tradeoff", self.transport, "--target", self.picture, "-o", self.out, "--white", 1,
                           "--seconds", 5, *options)
        with open(self.out / "tradeoff.csv") as file:
            self.rows = [{k: v if k in ("method", "storage") else float(v) if v else None for k, v in row.items()}
                         for row in csv.DictReader(file)]
        return answer

    def size(self, vector):
        return np.linalg.norm(vector) / np.linalg.norm(self.wanted)

    def best(self):
        """T x* of the bounded optimum by scipy, channel by channel."""
        seen = []
        for c in range(len(self.dense)):
            t = self.dense[c].astype(float)
            found = lsq_linear(t, (self.wanted - self.black)[c], (0, 1), method="bvls", tol=1e-12)
            seen.append(t @ found.x)
        return np.stack(seen)

    def drive_of(self, row):
        return np.load(self.out / f"drive-{int(row['number'])}.npy").astype(float).reshape(len(self.dense), -1)

    def seen(self, x):
        return np.einsum("cij,cj->ci", self.dense.astype(float), x)

    def check_row(self, row, best):
        """Every part of a row from its drive, in double."""
        x, b = self.drive_of(row), self.wanted - self.black
        shown, keeps = np.clip(x, 0, 1), row["method"] in ("auto", "bounded")
        self.assertAlmostEqual(self.size(self.seen(shown) - b), row["error"], delta=1e-6 + 1e-4 * row["error"])
        parts = row["solver_error"], row["storage_error"], row["clipping_error"]
        self.assertLessEqual(row["error"], sum(parts) * (1 + 1e-6) + 1e-9)
        self.assertGreaterEqual(row["error"], (2 * max(parts) - sum(parts)) * (1 - 1e-7) - 1e-9)
        cut = self.size(best - b) if keeps else self.size(self.seen(shown - x))
        self.assertAlmostEqual(row["clipping_error"], cut, delta=2e-6 + 1e-3 * cut)
        if row["storage"] in ("dense", "dense64"):
            rest = self.size(self.seen(x) - (best if keeps else b))
            self.assertAlmostEqual(row["solver_error"], rest, delta=(3e-4 if keeps else 1e-6) + 1e-4 * rest)
            self.assertLess(row["storage_error"], 1e-12)
        else:
            self.assertLess(row["storage_error"], {"dense16": 1e-3, "dense8": 5e-3}[row["storage"]])
            self.assertGreater(row["storage_error"], 1e-9)
        if self.sigma is None:
            self.assertIsNone(row["noise_error"])
        else:
            variance = (self.sigma.astype(float) ** 2).sum(1) * (shown ** 2).sum(1)
            noise = np.sqrt(variance.sum()) / np.linalg.norm(self.wanted)
            self.assertAlmostEqual(row["noise_error"], noise, delta=1e-4 * noise)
            self.assertAlmostEqual(row["expected_error"], np.hypot(row["error"], noise), delta=1e-5)

    def front(self):
        """No other row is both at least as fast and at least as near."""
        rows = sorted(self.rows, key=lambda row: (row["time_ms"], row["error"]))
        least, front = np.inf, []
        for row in rows:
            if row["error"] < least:
                front.append(row)
                least = row["error"]
        return front

    def check_front(self, answer):
        front = self.front()
        self.assertEqual([r["number"] for r in self.rows if r["front"]], sorted(r["number"] for r in front))
        self.assertEqual([p["method"] for p in answer["front"]], [r["method"] for r in front])
        (chosen,) = [r for r in self.rows if r["chosen"]]
        self.assertTrue(chosen["front"])
        self.assertEqual((answer["chosen"]["method"], answer["chosen"]["storage"]),
                         (chosen["method"], chosen["storage"]))
        return front, chosen

    def check_sentence(self, answer, front):
        told = re.findall(r"([\d.e+-]+) % costs ([\d.e+-]+) (ms|s)", answer["sentence"])
        self.assertTrue(told, answer["sentence"])
        for level, time, unit in told:
            row = next(r for r in front if r["error"] <= float(level) / 100 * 1.06)
            self.assertAlmostEqual(float(time) * (1000 if unit == "s" else 1), row["time_ms"],
                                   delta=0.06 * row["time_ms"])
        levels = [float(level) for level, *_ in told]
        self.assertEqual(levels, sorted(levels, reverse=True))

    def test_every_row_is_recomputed(self):
        for channels, radius, picture, sigma in ((1, 0.3, soft_picture(1), 1e-4), (3, 0.8, checker(3), None)):
            self.given(channels, radius, picture, sigma=sigma)
            answer = self.measure("--drives", out=f"out{channels}")
            best = self.best()
            self.assertAlmostEqual(answer["limit"], self.size(best - (self.wanted - self.black)), delta=1e-5)
            self.assertEqual(len(self.rows), answer["solves"])
            for row in self.rows:
                self.check_row(row, best)
            front, _ = self.check_front(answer)
            self.check_sentence(answer, front)
            methods = {row["method"] for row in self.rows}
            self.assertLessEqual({"auto", "pcg", "gmres", "damped", "bounded", "direct", "wavelet"}, methods)
            self.assertLessEqual({"dense", "dense64", "dense16", "dense8"}, {row["storage"] for row in self.rows})
            missing = {"jacobi", "series", "montecarlo", "hybrid", "matrix"} - methods
            self.assertLessEqual(missing, {gap["method"] for gap in answer["gaps"]})

    def test_finer_tolerances_come_nearer(self):
        self.given(1, 0.4, soft_picture(1))
        self.measure()
        for method in ("pcg", "jacobi", "damped", "gmres", "chebyshev"):
            rows = [r for r in self.rows if (r["method"], r["storage"]) == (method, "dense")]
            self.assertGreater(len(rows), 4)
            self.assertEqual([r["tolerance"] for r in rows], sorted((r["tolerance"] for r in rows), reverse=True))
            for before, after in zip(rows, rows[1:]):
                self.assertLessEqual(after["solver_error"], before["solver_error"] * (1 + 1e-9))
                self.assertGreaterEqual(after["iterations"], before["iterations"])
            for row in rows:
                self.assertLessEqual(row["solver_error"], row["tolerance"])

    def test_compensate_does_what_a_row_says(self):
        self.given(1, 0.4, soft_picture(1))
        self.measure()
        rows = [r for r in self.rows if r["storage"] == "dense" and r["method"] in ("pcg", "jacobi", "direct", "auto")]
        for row in rows[::3]:
            answer = answer_of("compensate", self.transport, "--target", self.picture, "-o", self.folder / "d.npy",
                               "--white", 1, "--method", row["method"], "--tolerance", row["tolerance"])
            self.assertEqual(answer["iterations"], row["iterations"])
            seen = appearance(self.dense, self.black, np.load(self.folder / "d.npy"))
            self.assertAlmostEqual(relative_error(seen, self.wanted), row["error"], delta=1e-6)

    def test_chooses_as_asked(self):
        self.given(1, 0.4, soft_picture(1))
        for tolerance in (0.05, 1e-3, 1e-15):
            front, chosen = self.check_front(self.measure("--tolerance", max(tolerance, 1e-12)))
            within = [r for r in front if r["error"] <= tolerance]
            self.assertEqual(chosen["number"], (within or front[-1:])[0]["number"])
        times = [r["time_ms"] for r in front]
        for deadline in (times[0] * 0.1, np.sqrt(times[0] * times[-1]), 10 * times[-1]):
            front, chosen = self.check_front(self.measure("--deadline-ms", max(deadline, 0.01)))
            within = [r for r in front if r["time_ms"] <= max(deadline, 0.01)]
            self.assertEqual(chosen["number"], (within[-1:] or front[:1])[0]["number"])
        # else: the fastest of those nearer than which nobody sees, with the noise counted
        self.given(1, 0.4, soft_picture(1), sigma=3e-3)
        front, chosen = self.check_front(self.measure())
        enough = max(1.05 * min(r["expected_error"] for r in front), 1e-3)
        self.assertEqual(chosen["number"], next(r for r in front if r["expected_error"] <= enough)["number"])

    def test_drawing_is_whole_and_its_labels_are_apart(self):
        self.given(3, 0.8, checker(3), sigma=1e-4)
        answer = self.measure()
        text = (self.out / "tradeoff.svg").read_text()
        self.assertNotRegex(text, r"\bnan\b|\binf\b")
        page = (self.out / "tradeoff.html").read_text()
        self.assertNotRegex(page, r"\bnan\b|\binf\b")
        self.assertIn(answer["sentence"].replace("'", "'"), page)
        tree = xml.fromstring(text)
        space = "{http://www.w3.org/2000/svg}"
        dots = [p for p in tree.iter(space + "path") if p.find(space + "title") is not None]
        self.assertGreaterEqual(len(dots), len(self.rows))
        labels = [t for t in tree.iter(space + "text") if "halo" in t.get("class", "")]
        self.assertTrue(any("name" in t.get("class") for t in labels))
        boxes = []
        for label in labels:
            wide, x, y = 6.2 * len(label.text), float(label.get("x")), float(label.get("y"))
            left = x - wide if label.get("text-anchor") == "end" else x
            self.assertTrue(0 <= left and left + wide <= 1000 and 0 <= y <= 600, label.text)
            boxes.append((left, y - 10, left + wide, y + 2))
        for i, a in enumerate(boxes):
            for b in boxes[:i]:
                self.assertFalse(a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3], (a, b))

    def test_odd_transports_have_a_sensible_page(self):
        for name, dense, width, height, picture in (
                ("one", np.full((1, 1, 1), 0.7), 1, 1, np.full((1, 1, 1), 0.5)),
                ("black", room(4, 3, 1, 0.4), 4, 3, np.zeros((1, 3, 4))),
                ("dim", room(4, 3, 1, 0.4), 4, 3, np.full((1, 3, 4), 5.0))):
            self.transport, self.picture, self.out = (self.folder / f"{name}{e}" for e in (".h5", ".npy", ""))
            write_transport(self.transport, dense, width, height)
            np.save(self.picture, picture.astype("f4"))
            answer = answer_of("tradeoff", self.transport, "--target", self.picture, "-o", self.out, "--seconds", 3)
            self.assertTrue(answer["front"] and answer["sentence"])
            for file in self.out.iterdir():
                self.assertNotRegex(file.read_text(), r"\bnan\b|\binf\b", file)

    def test_bad_input_is_refused(self):
        self.given(1, 0.3, soft_picture(1))
        words = ("tradeoff", self.transport, "--target", self.picture, "-o", self.folder / "out")
        self.refused(*words, "--tolerance", 0, names="tolerance")
        self.refused(*words, "--deadline-ms", 0, names="deadline")
        self.refused(*words, "--seconds", -1, names="seconds")
        self.refused(*words, "--white", "nan", names="white")
        bad = soft_picture(1)
        for value in (np.nan, np.inf, -1):
            bad[0, 2, 3] = value
            np.save(self.folder / "bad.npy", bad.astype("f4"))
            self.refused("tradeoff", self.transport, "--target", self.folder / "bad.npy", "-o", self.folder / "out")
        write_transport(self.folder / "dark.h5", np.zeros((1, 80, 80)), WIDTH, HEIGHT)
        self.refused("tradeoff", self.folder / "dark.h5", "--target", self.picture, "-o", self.folder / "out",
                     names="lit")
        write_transport(self.folder / "tall.h5", np.ones((1, 100, 80)), WIDTH, HEIGHT)
        self.refused("tradeoff", self.folder / "tall.h5", "--target", self.picture, "-o", self.folder / "out")

    def test_inspect_foretells_what_compensate_takes(self):
        self.given(1, 0.6, np.random.default_rng(2).uniform(0, 1, (1, HEIGHT, WIDTH)))
        for tolerance in (1e-2, 1e-5):
            answer = answer_of("inspect", self.transport, "--tolerance", tolerance)
            foretold = {f["method"]: f for f in answer["forecasts"]}
            self.assertFalse(foretold["jacobi"]["possible"])
            self.assertIn("diverges", foretold["jacobi"]["why_not"])
            self.assertIsNone(foretold["jacobi"]["iterations"])
            for method in ("damped", "chebyshev", "pcg", "gmres", "sor"):
                real = answer_of("compensate", self.transport, "--target", self.picture, "-o", self.folder / "d.npy",
                                 "--method", method, "--tolerance", tolerance)
                self.assertLessEqual(foretold[method]["residual"], tolerance)
                self.assertLessEqual(abs(foretold[method]["iterations"] - real["iterations"]),
                                     max(2, 0.5 * real["iterations"]), method)
            short = answer_of("inspect", self.transport, "--tolerance", tolerance, "--deadline-ms", 0.01)
            slow = {f["method"]: f for f in short["forecasts"]}["damped"]
            self.assertTrue(slow["residual"] > tolerance and slow["iterations"] < foretold["damped"]["iterations"])
            self.assertIn("iterations", answer["auto"]["reason"])

    def test_says_it_in_words_or_not_at_all(self):
        self.given(1, 0.3, soft_picture(1))
        words = ("tradeoff", self.transport, "--target", self.picture, "-o", self.folder / "out", "--seconds", 2)
        quiet, plain = run(*words, "-q"), run(*words)
        self.assertEqual((quiet.returncode, quiet.stdout, quiet.stderr), (0, "", ""))
        self.assertEqual((plain.returncode, plain.stderr), (0, ""))
        self.assertIn("costs", plain.stdout)
        self.assertIn("chosen: ", plain.stdout)


if __name__ == "__main__":
    main()
