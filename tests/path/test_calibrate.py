"""calibrate on pictures made here: a wall with a shadow and a highlight, seen by a camera whose map is known."""
import json
import struct
import zlib

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


def hash_of(number):
    """Of pattern number's codes, each 0 or 255."""
    axis, within = divmod(number, 12)
    at = np.arange(PANEL[axis])
    row = ((at ^ at >> 1) >> (5 - within // 2) & 1) ^ within % 2
    codes = 255 * (np.broadcast_to(row, PANEL[::-1]) if axis == 0 else np.broadcast_to(row[:, None], PANEL[::-1]))
    word, whole = 0, 2 ** 64 - 1
    for code in codes.reshape(-1).tolist():
        word = (word + code + 1) & whole
        word = ((word ^ word >> 30) * 0xbf58476d1ce4e5b9) & whole
        word = ((word ^ word >> 27) * 0x94d049bb133111eb) & whole
        word ^= word >> 31
    return word


def write_png16(path, samples):
    rows = b"".join(b"\0" + row.astype(">u2").tobytes() for row in samples)

    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", samples.shape[1], samples.shape[0], 16, 0, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) +
                     chunk(b"IEND", b""))


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

    def record(self, frames):
        """A recording by its description alone: 12 bit, linear, black level 100, two frames a pattern, the first too dark."""
        folder, random, sequence = self.folder / "recording", np.random.default_rng(6), 0
        folder.mkdir()
        lines = ["counterlight-recording 1", "panel 64 48 1 8 0.0166",
                 "camera 96 72 1 12 0.0333 0.0001 0.1 100 1 10000 4 1"]
        for n, light in enumerate(frames):
            shown = 10 ** 9 * (n + 1)
            for part in (0.5, 1):
                samples = 100 + 3995 * np.minimum(part * light, 1) + random.normal(0, 3, light.shape)
                write_png16(folder / f"{sequence}.png", np.clip(np.round(samples), 0, 4095))
                lines.append(f"frame {sequence} {n + 1} {hash_of(n):016x} {shown} {shown + 10 ** 7 + sequence} "
                             f"{0.02 * part} {sequence}.png")
                sequence += 1
        (folder / "index.txt").write_text("\n".join(lines) + "\n")
        return folder

    def test_recording_is_replayed(self):
        folder, out = self.record(pictures()), self.folder / "out"
        answer = answer_of("calibrate", "--replay", folder, "-o", out)
        x, y, _ = np.load(out / "map.npy")
        true_x, true_y = places()
        decoded = np.isfinite(x)
        self.assertGreater(decoded.sum(), 6200)
        self.assertLess(np.median(np.hypot(x - true_x, y - true_y)[decoded]), 0.05)
        self.assertEqual([f for f in answer["findings"] if f["serious"]], [])
        answer_of("calibrate", "--replay", folder, "-o", out, "--exposure-ms", 10)
        index = (folder / "index.txt").read_text()
        (folder / "index.txt").write_text(index.replace(f"{hash_of(5):016x}", f"{hash_of(7):016x}"))
        self.refused("calibrate", "--replay", folder, "-o", self.folder / "new", names="recorded for another pattern")

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
