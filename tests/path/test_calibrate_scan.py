"""calibrate on a real Gray code scan with its owner's calibration: distances recomputed by numpy from map.npy alone."""
import json
import re
import subprocess
import sys

import numpy as np

from support import PROGRAM, SHARED, PathTest, answer_of, main

SCAN = SHARED / "data" / "sltk-scan"
REFERENCE = SCAN / "procam_2016_12_09.yaml"


def matrix(name):
    found = re.search(rf"^{name}: !!opencv-matrix\s+rows: (\d+)\s+cols: (\d+)\s+dt: \w\s+data: \[([^\]]*)\]",
                      REFERENCE.read_text(), re.M)
    return np.array([float(v) for v in found[3].split(",")]).reshape(int(found[1]), int(found[2]))


def undistort(x, y, lens, distortion):
    """Brown's model inverted by fixed-point iteration."""
    k1, k2, p1, p2, k3 = distortion.ravel()
    u, v = (x - lens[0, 2]) / lens[0, 0], (y - lens[1, 2]) / lens[1, 1]
    a, b = u.copy(), v.copy()
    for _ in range(40):
        r = a * a + b * b
        s = 1 + r * (k1 + r * (k2 + r * k3))
        a, b = ((u - 2 * p1 * a * b - p2 * (r + 2 * a * a)) / s, (v - p1 * (r + 2 * b * b) - 2 * p2 * a * b) / s)
    return np.stack([a, b, np.ones_like(a)])


def distances(x, y, panel_x, panel_y):
    """Of camera pixels from the epipolar lines of their panel coordinates, camera pixels."""
    lens, t = matrix("cam_K"), matrix("T").ravel()
    camera = undistort(x, y, lens, matrix("cam_kc"))
    panel = undistort(panel_x - 0.5, panel_y - 0.5, matrix("pro_K"), matrix("pro_kc"))
    cross = np.array([[0, -t[2], t[1]], [t[2], 0, -t[0]], [-t[1], t[0], 0]])
    line = (cross @ matrix("R")).T @ panel
    return np.abs((line * camera).sum(0)) / np.hypot(line[0] / lens[0, 0], line[1] / lens[1, 1])


def sanitized():
    return b"libasan" in subprocess.run(["ldd", PROGRAM], capture_output=True).stdout


class RealScan(PathTest):
    def test_real_scan(self):
        out = self.folder / "out"
        answer = answer_of("calibrate", "--replay", SCAN, "--panel", "1280x720", "--reference", REFERENCE, "-o", out)
        x, y, confidence = np.load(out / "map.npy").astype(float)
        row, column = np.nonzero(np.isfinite(x))
        decoded = (row, column)
        self.assertTrue(np.isnan(y[np.isnan(x)]).all() and (confidence[np.isnan(x)] == 0).all())
        self.assertTrue((0 <= x[decoded]).all() and (x[decoded] < 1280).all())
        self.assertTrue((0 <= y[decoded]).all() and (y[decoded] < 720).all())
        off = distances(column.astype(float), row.astype(float), x[decoded], y[decoded])
        # The bounds, over everything that was decoded ...
        self.assertGreaterEqual(len(off), 580_000)
        self.assertLessEqual(np.median(off), 0.77)
        self.assertLessEqual(np.percentile(off, 90), 3.0)
        # ... and at as many pixels as the independent decoder had.
        sure = off[np.argsort(-confidence[decoded])[:490_000]]
        self.assertLessEqual(np.median(sure), 0.65)
        self.assertLessEqual(np.percentile(sure, 90), 2.6)
        told = answer["epipolar"]
        self.assertEqual((told["pixels"], told["fitted"]), (len(off), False))
        self.assertAlmostEqual(told["median"], np.median(off), delta=0.005)
        self.assertAlmostEqual(told["p90"], np.percentile(off, 90), delta=0.02)
        self.check_causes(answer, len(off))
        self.check_steadiness(answer)
        self.assertEqual(json.loads((out / "summary.json").read_text()), answer)

    def check_causes(self, answer, decoded):
        fates = answer["fates"]
        self.assertEqual(sum(fates.values()), 2592 * 1944)
        self.assertEqual(fates["decoded"], decoded)
        for region in answer["regions"]:
            self.assertIn(f"{region['fate']}: ", region["why"])
            self.assertGreater(fates[region["fate"]], 0)
        self.assertEqual(answer["regions"][0]["fate"], "unlit")
        self.assertGreaterEqual({r["fate"] for r in answer["regions"]}, {"unlit", "double"})

    def check_steadiness(self, answer):
        """pattern + inverse drift, and it is said with how much."""
        serious = [f["text"] for f in answer["findings"] if f["serious"] and "pattern + inverse" in f["text"]]
        self.assertTrue(serious, answer["findings"])
        moved = float(re.search(r"by ([0-9.]+) %", serious[0])[1])
        self.assertGreater(moved, 5)
        self.assertAlmostEqual(moved, 100 * max(c["wide"] for c in answer["drift"]), delta=0.06)

    def test_bad_input(self):
        new = ("-o", self.folder / "new")
        self.refused("calibrate", *new, names="--replay")
        self.refused("calibrate", "--replay", self.folder / "none", *new, names="none")
        self.refused("calibrate", "--replay", SCAN, "--panel", "12by9", *new, names="12by9")
        self.refused("calibrate", "--replay", SCAN, "--panel", "4096x2160", *new, names="44 pictures")
        self.refused("calibrate", "--replay", SCAN, "--reference", SCAN / "list.yaml", *new, names="cam_K")


if __name__ == "__main__":
    if not REFERENCE.exists():
        print(f"skipped: {SCAN} is not there (CLT_SHARED names the folder)")
        sys.exit(77)
    if sanitized():
        print("skipped: 44 photographs of 5 megapixels take too long under the address sanitizer")
        sys.exit(77)
    main()
