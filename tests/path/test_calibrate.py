"""calibrate on pictures made here: a wall with a shadow and a highlight, seen by a camera whose map is known."""
import json

import numpy as np

from support import PathTest, answer_of, encode_srgb, main, read_png, run, write_png

PANEL, CAMERA = (64, 48), (96, 72)
SHADOW, HIGHLIGHT = np.s_[10:30, 20:40], np.s_[50:60, 70:85]


def places():
    """Panel coordinates [2, height, width] of the camera's pixels: turned, stretched, all within the panel."""
    v, u = np.mgrid[:CAMERA[1], :CAMERA[0]].astype(float)
    return np.stack([0.62 * u + 0.03 * v + 1.7, 0.6 * v - 0.02 * u + 3.1])


def profile(codes, at, blur=0.5):
    """Light of a row of panel pixels at a coordinate, blurred by a Gaussian (summed over 64 points of it)."""
    offsets = (np.arange(64) + 0.5) / 64 * 8 - 4
    weights = np.exp(-offsets ** 2 / 2)
    index = np.floor(at[..., None] + blur * offsets).astype(int)
    lit = np.where((index >= 0) & (index < len(codes)), codes[np.clip(index, 0, len(codes) - 1)], 0)
    return (lit * weights).sum(-1) / weights.sum()


def pictures(growth=0.0):
    """The frames' linear light, in the order of the patterns."""
    place, frames = places(), []
    for axis, bits in ((0, 6), (1, 6)):
        k = np.arange(PANEL[axis])
        gray = k ^ k >> 1
        for bit in reversed(range(bits)):
            for inverse in (0, 1):
                light = 0.02 + 0.5 * profile((gray >> bit & 1) ^ inverse, place[axis])
                light[SHADOW] = 0.02
                light[HIGHLIGHT] *= 4
                frames.append(light * (1 + growth * len(frames) / 24))
    return frames


class Calibrate(PathTest):
    def scan(self, name, frames):
        """A folder of sRGB pictures with a little noise."""
        folder, random = self.folder / name, np.random.default_rng(5)
        folder.mkdir()
        for n, light in enumerate(frames):
            codes = encode_srgb(light) + random.normal(0, 0.004, light.shape)
            write_png(folder / f"{n:03}.png", codes[None])
        return folder

    def test_map_is_that_of_the_camera(self):
        out = self.folder / "out"
        words = ("calibrate", "--replay", self.scan("scan", pictures()), "--panel", "64x48", "-o", out)
        answer = answer_of(*words)
        x, y, confidence = np.load(out / "map.npy")
        true_x, true_y = places()
        masked = np.zeros(x.shape, bool)
        for part in (SHADOW, HIGHLIGHT):
            masked[part] = True
        self.assertTrue(np.isnan(x[masked]).all() and np.isnan(y[masked]).all() and (confidence[masked] == 0).all())
        decoded = np.isfinite(x)
        self.assertGreater(decoded.sum(), 0.97 * (~masked).sum())
        off = np.hypot(x - true_x, y - true_y)[decoded]
        self.assertLess(np.median(off), 0.05)
        self.assertLess(off.max(), 0.7)
        self.assertAlmostEqual(answer["pitch"], 0.61, delta=0.02)
        self.assertEqual(answer["fates"]["decoded"], decoded.sum())
        self.assertGreaterEqual(answer["fates"]["unlit"], 400)
        self.assertEqual(answer["fates"]["saturated"], 150)
        causes = {r["fate"]: r for r in answer["regions"]}
        self.assertEqual(causes["saturated"]["box"], [70, 50, 85, 60])
        self.assertEqual([f for f in answer["findings"] if f["serious"]], [])
        self.assertEqual(json.loads((out / "summary.json").read_text()), answer)
        colours = read_png(out / "coverage.png")
        self.assertTrue((colours[:, SHADOW[0], SHADOW[1]][:, 3:-3, 3:-3] == 0).all())
        self.assertTrue((colours[:, HIGHLIGHT[0], HIGHLIGHT[1]] == 1).all())
        printed = run(*words).stdout
        for text in ("saturated: ", "unlit: ", f"{decoded.sum()} of 6912"):
            self.assertIn(text, printed)
        self.assertNotIn("WRONG", printed)

    def test_exposure_that_moves_is_told(self):
        words = ("--panel", "64x48", "-o", self.folder / "out")
        answer = answer_of("calibrate", "--replay", self.scan("scan", pictures(0.1)), *words)
        serious = [f["text"] for f in answer["findings"] if f["serious"]]
        self.assertEqual(len(serious), 1)
        self.assertIn("exposure", serious[0])
        self.assertAlmostEqual(max(c["all"] for c in answer["drift"]), 0.1 * 22 / 24 / 1.05, delta=0.02)

    def test_a_scan_that_is_cut_off_is_refused(self):
        folder = self.scan("scan", pictures()[:-1])
        self.refused("calibrate", "--replay", folder, "--panel", "64x48", "-o", self.folder / "out", names="23 pictures")
        (folder / "023.png").write_bytes((folder / "000.png").read_bytes()[:200])
        self.refused("calibrate", "--replay", folder, "--panel", "64x48", "-o", self.folder / "out", names="023.png")
        (folder / "index.txt").write_text("counterlight-recording 1\npanel 64 48\n")
        self.refused("calibrate", "--replay", folder, "-o", self.folder / "out", names="index.txt:2")


if __name__ == "__main__":
    main()
