"""Every method on a transport that an independent path tracer rendered, against numpy and scipy."""
import re
import sys

import h5py
import numpy as np
from scipy.optimize import lsq_linear

from support import SHARED, PathTest, answer_of, main, relative_error, run

RENDERED = SHARED / "data" / "cycles-dihedral.h5"


class Cycles(PathTest):
    def setUp(self):
        super().setUp()
        with h5py.File(RENDERED) as file:
            self.shape = (1, int(file.attrs["height"]), int(file.attrs["width"]))
            self.transport = file["dense"][0].astype(float)
            self.black = file["black"][0].astype(float)
        self.first = np.diag(self.transport)

    def target(self, name, radiance):
        """Writes a radiance as a target; returns what of it is asked of T, as the file holds it."""
        path = self.folder / name
        np.save(path, radiance.reshape(self.shape).astype("f4"))
        return path, np.load(path).ravel().astype(float) - self.black

    def compensate(self, target, method, tolerance):
        out = self.folder / f"{method}.npy"
        answer = answer_of("compensate", RENDERED, "--target", target, "-o", out, "--white", 1, "--method", method,
                           "--tolerance", tolerance)
        return answer, np.load(out).ravel().astype(float)

    def methods(self, target):
        refusal = self.refused("compensate", RENDERED, "--target", target, "-o", self.folder / "x.npy", "--method", "none")
        names = re.search(r"use one of: (.*)", refusal).group(1).strip().split(", ")
        self.assertGreaterEqual(len(names), 20)
        return names

    def test_every_method_has_the_answer_of_numpy(self):
        wanted_drive = np.random.default_rng(2).uniform(0.2, 0.8, self.black.size)
        target, wanted = self.target("target.npy", self.transport @ wanted_drive + self.black)
        solved = np.linalg.solve(self.transport, wanted)
        self.assertTrue(0 < solved.min() and solved.max() < 1)
        condition = np.linalg.cond(self.transport / self.first)
        for method in self.methods(target):
            answer, drive = self.compensate(target, method, 1e-6)
            self.assertIn(answer["method"], ("pcg", "gmres", "jacobi", "damped", "chebyshev") if method == "auto" else (method,))
            # a float32 drive is rounded to 6e-8; bounded's tolerance is that of its gradient, S' r
            limit = 1e-6 * condition ** (2 if method == "bounded" else 1) + 2e-7
            self.assertLessEqual(relative_error(self.first * drive, self.first * solved), limit, method)

    def test_bounded_has_the_optimum_of_scipy(self):
        y, x = np.mgrid[0:self.shape[1], 0:self.shape[2]]
        pictures = {"checker": (x // 2 + y // 2) % 2 * 1.4 * np.median(self.first),
                    "half": (x < self.shape[2] // 2) * 1.1 * np.median(self.first)}
        for name, picture in pictures.items():
            target, wanted = self.target(name + ".npy", picture.astype(float))
            best = lsq_linear(self.transport, wanted, (0, 1), method="trf", tol=1e-13, max_iter=200)
            limit = np.sqrt(2 * best.cost)
            for method in ("bounded", "auto"):
                answer, drive = self.compensate(target, method, 1e-7)
                self.assertEqual(answer["method"], "bounded")
                off = np.linalg.norm(self.transport @ drive - wanted)
                self.assertAlmostEqual(off / limit, 1, delta=1e-6)
                self.assertLess(relative_error(self.first * drive, self.first * best.x), 1e-4)

    def test_a_tolerance_or_target_that_is_none_is_refused(self):
        target, _ = self.target("target.npy", self.transport @ np.full(self.black.size, 0.5))
        for tolerance in ("-1e-3", "nan", "inf", "none"):
            done = run("compensate", RENDERED, "--target", target, "-o", self.folder / "x.npy", "--tolerance", tolerance)
            self.assertEqual((done.returncode, done.stderr.count("\n")), (2, 1), done.stderr)
            self.assertIn("tolerance", done.stderr)
        for value in (np.nan, np.inf, -np.inf):
            bad = np.load(target)
            bad[0, 3, 4] = value
            np.save(self.folder / "bad.npy", bad)
            self.refused("compensate", RENDERED, "--target", self.folder / "bad.npy", "-o", self.folder / "x.npy")
        self.refused("compensate", RENDERED, "--target", target, "-o", self.folder / "x.npy", "--deadline-ms", 0,
                     names="--deadline-ms")
        answer = answer_of("compensate", RENDERED, "--target", target, "-o", self.folder / "late.npy", "--white", 1,
                           "--deadline-ms", 0.01)
        drive = np.load(self.folder / "late.npy")
        self.assertTrue(np.isfinite(drive).all() and drive.min() >= 0 and drive.max() <= 1)
        self.assertTrue(np.isfinite(answer["error_after"]))


if __name__ == "__main__":
    if not RENDERED.exists():
        print(f"skipped: {RENDERED} is not there (CLT_SHARED names the folder of shared)")
        sys.exit(77)
    main()
