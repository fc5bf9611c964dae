"""simulate through a camera with pixels of its own: a photograph pixel by pixel, and the true map of the pixels."""
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy as np

PROGRAM = sys.argv[1]
SCENE = """
grid = { width = 8; height = 6; channels = 1; };
projector = { response = "linear"; bits = 16; tangent = [0.4, 0.3]; };
camera = { %s };
materials = ( { name = "white"; albedo = 0.6; } );
surfaces = ( { corner = [-2, 0, -2]; u = [4, 0, 0]; v = [0, 0, 4]; material = "white"; } );
"""


class OwnCamera(unittest.TestCase):
    def setUp(self):
        self.place = tempfile.TemporaryDirectory()
        self.addCleanup(self.place.cleanup)
        self.folder = pathlib.Path(self.place.name)
        self.scene, self.out, self.map = (str(self.folder / name) for name in ("scene.cfg", "out.npy", "map.npy"))
        self.write("pixels = [31, 20]; tangent = [0.48, 0.33]; full_well = 1e6;")
        self.drive = str(self.folder / "drive.npy")
        np.save(self.drive, np.linspace(0.2, 1.0, 48, dtype="f4").reshape(1, 6, 8))

    def write(self, camera):
        pathlib.Path(self.scene).write_text(SCENE % camera)

    def run_it(self, *arguments):
        return subprocess.run([PROGRAM, *arguments], text=True, capture_output=True, timeout=100)

    def refused(self, *arguments, names):
        answer = self.run_it(*arguments)
        self.assertEqual((answer.returncode, answer.stdout), (2, ""), answer)
        self.assertIn(names, answer.stderr)

    def test_photograph_and_map(self):
        answer = self.run_it("simulate", self.scene, "--drive", self.drive, "-o", self.out, "--map", self.map, "--json")
        self.assertEqual((answer.returncode, answer.stderr), (0, ""))
        self.assertEqual(json.loads(answer.stdout)["pixels"], {"width": 31, "height": 20})
        exact = self.folder / "exact.npy"
        self.run_it("simulate", self.scene, "--drive", self.drive, "-o", str(exact), "--exact")
        seen, (x, y, fate), light = np.load(self.out)[0], np.load(self.map), np.load(exact)[0]
        columns, rows = (np.arange(31) + 0.5) / 31 * 2 - 1, 1 - (np.arange(20) + 0.5) / 20 * 2
        wanted_x = np.broadcast_to(4 * (1 + columns * 0.48 / 0.4), (20, 31))
        wanted_y = np.broadcast_to(3 * (1 - rows * 0.33 / 0.3)[:, None], (20, 31))
        lit = (wanted_x > 0) & (wanted_x < 8) & (wanted_y > 0) & (wanted_y < 6)
        self.assertTrue(np.array_equal(fate, np.where(lit, 1, 3)))
        self.assertTrue(np.array_equal(np.isnan(x), ~lit) and np.array_equal(np.isnan(y), ~lit))
        self.assertLess(np.abs(x - wanted_x)[lit].max(), 1e-5)
        self.assertLess(np.abs(y - wanted_y)[lit].max(), 1e-5)
        # Pixels that lie wholly in a cell (one is 0.31 x 0.33 cells) show it, but for the noise of 10^6 electrons.
        inside = lit & (np.abs(wanted_x % 1 - 0.5) < 0.3) & (np.abs(wanted_y % 1 - 0.5) < 0.3)
        cells = light[wanted_y[inside].astype(int), wanted_x[inside].astype(int)]
        self.assertGreater(inside.sum(), 80)
        self.assertLess(np.abs(seen[inside] / cells - 1).max(), 0.02)

    def test_explain(self):
        answer = self.run_it("scene", "explain", self.scene, "--json")
        pixels = json.loads(answer.stdout)["pixels"]
        self.assertAlmostEqual(pixels["lit"], 0.4 * 0.3 / (0.48 * 0.33), delta=0.01)
        self.assertAlmostEqual(pixels["lit"] + pixels["outside"], 1.0, delta=1e-9)
        self.assertIn("own pixels", self.run_it("scene", "explain", self.scene).stdout)

    def test_refusals(self):
        self.refused("acquire", "--scene", self.scene, "-o", str(self.folder / "T.h5"), "--calibration",
                     str(self.folder / "none.h5"), names="none.h5")
        self.refused("simulate", self.scene, "--drive", self.drive, "-o", self.out, "--map", "map.png", names=".npy")
        self.write("cell_pixels = 2;")
        self.refused("simulate", self.scene, "--drive", self.drive, "-o", self.out, "--map", self.map,
                     names="pixels = [width, height]")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1], verbosity=0)
